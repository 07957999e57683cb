//! Why a file is not read.

use std::fmt;

/// Why a file, or a frame of it, is not read. The text names what was found, not the file: who opened it knows its
/// name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refused {
    /// Sound as far as it was read, but not of a kind that is decoded here; another program may read it.
    NotHandled(String),
    /// Contradicts itself or ends early; another program would guess.
    Damaged(String),
    /// Its frames have another pixel format from one on; both are named.
    Changed(String),
    /// Its frames are turned otherwise from one on; both angles are named.
    Turned(String),
    /// Takes more than the [`Limits`](crate::native::Limits) allow.
    TooLarge(String),
    /// The system does not give its bytes.
    Unreadable(String),
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Refused::NotHandled(what) => write!(f, "is not decoded here: {what}"),
            Refused::Damaged(what) => write!(f, "is damaged: {what}"),
            Refused::Changed(what) => write!(f, "changes its pixel format: {what}"),
            Refused::Turned(what) => write!(f, "changes its rotation: {what}"),
            Refused::TooLarge(what) => write!(f, "is too large: {what}"),
            Refused::Unreadable(what) => write!(f, "cannot be read: {what}"),
        }
    }
}

impl std::error::Error for Refused {}

impl From<std::io::Error> for Refused {
    fn from(error: std::io::Error) -> Refused {
        Refused::Unreadable(error.to_string())
    }
}

/// Shorter at the many places that refuse.
pub(crate) fn damaged<T>(what: impl Into<String>) -> Result<T, Refused> {
    Err(Refused::Damaged(what.into()))
}

pub(crate) fn not_handled<T>(what: impl Into<String>) -> Result<T, Refused> {
    Err(Refused::NotHandled(what.into()))
}
