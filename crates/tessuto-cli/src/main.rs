//! The program `tessuto`.

#[cfg(all(target_arch = "x86_64", target_feature = "avx2"))]
mod processor;

#[cfg(all(target_arch = "x86_64", target_feature = "avx2"))]
use std::io::Write as _;
use std::process::ExitCode;

fn main() -> ExitCode {
    // Nothing before this may need what it looks for.
    #[cfg(all(target_arch = "x86_64", target_feature = "avx2"))]
    if let Some(told) = processor::complaint() {
        let _ = writeln!(std::io::stderr(), "{told}");
        return ExitCode::from(101);
    }
    ExitCode::from(tessuto_cli::run(std::env::args_os()))
}
