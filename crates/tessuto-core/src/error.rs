//! The one error type of the library. Every message names the place, the value found and the way out.

mod hint;

use std::fmt;
use std::path::PathBuf;

pub use hint::{Hint, Remedy, Repair, Warning};

/// Error kinds, by who must act.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// Wrong option or value, found before any file is read.
    Usage {
        /// What is wrong, with the value found.
        problem: String,
        /// What to do about it.
        hint: Hint,
    },
    /// A file of the scene or result cannot be used.
    Input {
        /// File, and frame, line or key where it applies.
        place: String,
        /// What is wrong, with the values found and expected.
        problem: String,
        /// What to do about it.
        hint: Hint,
    },
    /// The computation left the finite numbers or cannot go on.
    Numerical {
        /// Stage, epoch and frame.
        place: String,
        /// Cause, with the first offending value.
        problem: String,
        /// What to do about it.
        hint: Hint,
    },
    /// A file cannot be written.
    Output {
        /// File or folder.
        path: PathBuf,
        /// What the system answered.
        source: std::io::Error,
    },
    /// The user asked to stop.
    Interrupted(String),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usage { problem, hint } => write!(f, "{problem}\n  hint: {hint}"),
            Self::Input { place, problem, hint } => write!(f, "{place}: {problem}\n  hint: {hint}"),
            Self::Numerical { place, problem, hint } => {
                write!(f, "numerical failure in {place}: {problem}\n  hint: {hint}")
            }
            Self::Output { path, source } => {
                write!(f, "cannot write {}: {source}\n  hint: ", path.display())?;
                f.write_str("check free space and permissions, or choose another folder")
            }
            Self::Interrupted(place) => write!(f, "interrupted: {place}"),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Output { source, .. } => Some(source),
            _ => None,
        }
    }
}

/// `Result` with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Most bytes of what was found in a file that a message repeats.
const LONGEST: usize = 2000;

/// A word of a damaged file may be as long as the file.
fn clipped(mut text: String) -> String {
    if text.len() > LONGEST {
        let end = (0..=LONGEST).rev().find(|i| text.is_char_boundary(*i)).unwrap_or(0);
        text.truncate(end);
        text.push('…');
    }
    text
}

impl Error {
    /// Input error at `place` (file, frame, line or key).
    pub fn input(place: impl Into<String>, problem: impl Into<String>, hint: impl Into<Hint>) -> Self {
        Self::Input { place: place.into(), problem: clipped(problem.into()), hint: hint.into() }
    }

    /// Wrong option or value.
    pub fn usage(problem: impl Into<String>, hint: impl Into<Hint>) -> Self {
        Self::Usage { problem: problem.into(), hint: hint.into() }
    }

    /// `asked` needs the cargo feature `feature`, which this build was made without.
    pub fn left_out(asked: impl fmt::Display, feature: &str) -> Self {
        Self::usage(
            format!("{asked}: this build was made without the feature `{feature}`"),
            Hint::from("build with all that is asked for").with(Remedy::Feature(feature.to_owned())),
        )
    }

    /// Numerical failure at `place` (stage, epoch, frame).
    pub fn numerical(place: impl Into<String>, problem: impl Into<String>, hint: impl Into<Hint>) -> Self {
        Self::Numerical { place: place.into(), problem: problem.into(), hint: hint.into() }
    }

    /// The same, its place one within `outer`.
    #[must_use]
    pub fn within(self, outer: &str) -> Self {
        match self {
            Self::Input { place, problem, hint } => {
                Self::Input { place: format!("{outer}, {place}"), problem, hint }
            }
            Self::Numerical { place, problem, hint } => {
                Self::Numerical { place: format!("{outer}, {place}"), problem, hint }
            }
            other => other,
        }
    }

    /// Exit status of a program that ends with this error: 2 usage, 3 bad input, 4 numerical
    /// failure, 5 disk, 75 interrupted.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage { .. } => 2,
            Self::Input { .. } => 3,
            Self::Numerical { .. } => 4,
            Self::Output { .. } => 5,
            Self::Interrupted(_) => 75,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_file_holds_is_repeated_in_part_only() {
        let message =
            |word: String| Error::input("a.txt", format!("{word} is not a number"), "correct it").to_string();
        assert_eq!(message("é".into()), "a.txt: é is not a number\n  hint: correct it");
        for word in ["é", "x", "漢"] {
            let text = message(word.repeat(5000));
            assert!(text.len() < 2100 && text.ends_with("…\n  hint: correct it"), "{}", text.len());
        }
    }
}
