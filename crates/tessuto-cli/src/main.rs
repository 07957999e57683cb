//! The program `tessuto`.

use std::io::Write as _;
use std::process::ExitCode;

/// Nothing but the check and the program: the compiler may use what the processor lacks anywhere else.
fn main() -> ExitCode {
    if let Err(message) = tessuto::processor::check() {
        refuse(message);
    }
    program()
}

/// Ends with status 6. Without formatting: see [`tessuto::processor`].
#[inline(never)]
fn refuse(message: &'static str) -> ! {
    for part in ["error: ", message, "\n"] {
        // There is nobody else to report to.
        std::io::stderr().write_all(part.as_bytes()).unwrap_or(());
    }
    std::process::exit(6)
}

#[inline(never)]
fn program() -> ExitCode {
    ExitCode::from(tessuto_cli::run(std::env::args_os()))
}
