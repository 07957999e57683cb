//! Reads the calibration files of other programs.

use std::path::Path;

use super::calibration::{Calibration, Contents, Reader};
use super::{colmap, nerfstudio, opencv};
use crate::io::read_text;
use tessuto_core::error::{Error, Result};

/// The kinds of camera files; of a file that several of them have a name for, the first that knows it reads it.
const READERS: [&Reader; 3] = [&nerfstudio::READER, &colmap::READER, &opencv::READER];

/// The camera files that are read, in words.
pub fn camera_files() -> String {
    READERS.map(|reader| reader.about).join(", ")
}

/// Reads nerfstudio's transforms.json, COLMAP's cameras.txt (or the folder that holds it) or a calibration of
/// OpenCV in YAML or JSON, distinguished by their names and contents. `camera_id` chooses one of several COLMAP
/// cameras.
///
/// # Errors
/// [`Error::Input`] naming the file, and an unknown camera model by its name.
pub fn read_calibration(path: &Path, camera_id: Option<u32>) -> Result<Calibration> {
    let inside = path.join("cameras.txt");
    let path = if path.is_dir() && inside.is_file() { inside.as_path() } else { path };
    let place = path.display().to_string();
    if path.file_name().is_some_and(|n| n == "cameras.bin") || path.is_dir() {
        return Err(Error::input(
            place,
            "is not a camera file that can be read",
            "name cameras.txt; COLMAP makes it: colmap model_converter --input_path IN --output_path OUT \
             --output_type TXT",
        ));
    }
    let text = &read_text(path)?;
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let json: Option<serde_json::Value> = match ending.as_str() {
        "json" => Some(serde_json::from_str(text).map_err(|e| {
            let line = format!("{place}:{}", e.line());
            Error::input(line, format!("is not valid JSON: {e}"), "correct this line")
        })?),
        _ => None,
    };
    let contents = Contents { text, json: json.as_ref(), place: &place, camera_id };
    let mut named = READERS.iter().filter(|reader| reader.endings.contains(&ending.as_str()));
    match named.find(|reader| (reader.knows)(&contents)) {
        Some(reader) => (reader.read)(&contents),
        None => Err(Error::input(
            place,
            format!("has the ending \"{ending}\""),
            format!("camera files are {}", camera_files()),
        )),
    }
}
