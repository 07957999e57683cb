//! A row of the table of formats.

use super::Clip;
use tessuto_core::error::Result;

/// What a format is, and how it is written.
pub(super) struct Row {
    /// What it is called: lower-case letters and digits.
    pub key: &'static str,
    /// The programs that it is for, or what it is, in a few words.
    pub programs: &'static str,
    /// What it holds, in one line.
    pub content: &'static str,
    /// What it leaves: ends of names, and what each file or folder is for.
    pub files: &'static [(&'static str, &'static str)],
    /// The cargo feature that it needs, if any, and whether this build has it.
    pub feature: Option<(&'static str, bool)>,
    /// Whether the script for Blender, the preset of its cloth and the light go with it.
    pub for_blender: bool,
    /// The files of a clip.
    pub outputs: fn(&Clip) -> Result<Vec<Output>>,
}

/// What one format leaves in the target folder: a file, or a folder of files. Appears whole or not at all.
pub(super) enum Output {
    File(String, Vec<u8>),
    Folder(String, Vec<(String, Vec<u8>)>),
}

impl Output {
    pub(super) fn name(&self) -> &str {
        match self {
            Self::File(name, _) | Self::Folder(name, _) => name,
        }
    }
}
