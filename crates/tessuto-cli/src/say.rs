//! What the program says: results on standard output, news and complaints on standard error.
//!
//! Saying something never ends a command: its files are worth more than its last line. A reader that has gone
//! (`tessuto … | head`) is not a fault. Any other failure of standard output, such as a full disk behind it, is
//! kept and becomes the program's error at its [`end`].

use std::fmt::Arguments;
use std::io::{self, ErrorKind, IsTerminal as _, Write as _};
use std::sync::{Mutex, PoisonError};

/// The first failure of standard output; nothing more is written after it.
static FAILURE: Mutex<Option<io::Error>> = Mutex::new(None);

/// A line on standard output, with the arguments of `format!`.
macro_rules! say {
    ($($text:tt)*) => { $crate::say::output(format_args!("{}\n", format_args!($($text)*))) };
}

/// A line on standard error, with the arguments of `format!`.
macro_rules! aside {
    ($($text:tt)*) => { $crate::say::error(format_args!("{}\n", format_args!($($text)*))) };
}

pub(crate) use {aside, say};

/// Writes `text` to standard output.
pub fn output(text: Arguments) {
    keep(|| io::stdout().lock().write_fmt(text));
}

/// Writes `text` to standard error. There is no place to complain if that fails.
pub fn error(text: Arguments) {
    let _ = io::stderr().lock().write_fmt(text);
}

/// Whether standard output may be coloured: a terminal whose user has not set NO_COLOR.
pub fn coloured() -> bool {
    io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}

/// Columns of the terminal behind standard output; `None` if it is none.
pub fn width() -> Option<usize> {
    let (columns, _) = terminal_size::terminal_size_of(io::stdout())?;
    Some(usize::from(columns.0))
}

/// Everything is said.
///
/// # Errors
/// [`tessuto::Error::Output`] if some of it could not be written, though somebody was there to read it.
pub fn end() -> tessuto::Result<()> {
    keep(|| io::stdout().lock().flush());
    match failure().take() {
        Some(source) if source.kind() != ErrorKind::BrokenPipe => {
            Err(tessuto::Error::Output { path: "standard output".into(), source })
        }
        _ => Ok(()),
    }
}

fn failure() -> std::sync::MutexGuard<'static, Option<io::Error>> {
    FAILURE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Writes unless that has failed before.
fn keep(write: impl FnOnce() -> io::Result<()>) {
    let mut failure = failure();
    if failure.is_none() {
        *failure = write().err();
    }
}
