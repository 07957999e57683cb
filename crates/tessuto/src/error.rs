//! The one error type of the library. Every message names the place, the value found and the way out.

use std::path::PathBuf;

/// Error kinds, by who must act.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Wrong option or value, found before any file is read.
    #[error("{problem}\n  hint: {hint}")]
    Usage {
        /// What is wrong, with the value found.
        problem: String,
        /// What to do about it.
        hint: String,
    },
    /// A file of the scene or result cannot be used.
    #[error("{place}: {problem}\n  hint: {hint}")]
    Input {
        /// File, and frame, line or key where it applies.
        place: String,
        /// What is wrong, with the values found and expected.
        problem: String,
        /// What to do about it.
        hint: String,
    },
    /// The computation left the finite numbers or cannot go on.
    #[error("numerical failure in {place}: {problem}\n  hint: {hint}")]
    Numerical {
        /// Stage, epoch and frame.
        place: String,
        /// Cause, with the first offending value.
        problem: String,
        /// What to do about it.
        hint: String,
    },
    /// A file cannot be written.
    #[error(
        "cannot write {path}: {source}\n  hint: check free space and permissions, or choose another folder with --out"
    )]
    Output {
        /// File or folder.
        path: PathBuf,
        /// What the system answered.
        source: std::io::Error,
    },
    /// The user asked to stop.
    #[error("interrupted: {0}")]
    Interrupted(String),
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
    pub fn input(place: impl Into<String>, problem: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Input { place: place.into(), problem: clipped(problem.into()), hint: hint.into() }
    }

    /// Wrong option or value.
    pub fn usage(problem: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Usage { problem: problem.into(), hint: hint.into() }
    }

    /// Numerical failure at `place` (stage, epoch, frame).
    pub fn numerical(place: impl Into<String>, problem: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Numerical { place: place.into(), problem: problem.into(), hint: hint.into() }
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
