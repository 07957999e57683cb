//! Reads the calibration files of other programs.

use std::path::Path;

use super::calibration::Calibration;
use super::{colmap, nerfstudio, opencv};
use crate::io::read_text;
use tessuto_core::error::{Error, Result};

/// Reads nerfstudio's transforms.json, COLMAP's cameras.txt (or the folder that holds it) or a calibration of
/// OpenCV in YAML or JSON, told apart by their content. `camera_id` chooses one of several COLMAP cameras.
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
            "name cameras.txt; COLMAP makes it: colmap model_converter --input_path IN --output_path OUT --output_type TXT",
        ));
    }
    let text = &read_text(path)?;
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    match ending.as_str() {
        "txt" => colmap::parse(text, &place, camera_id),
        "yml" | "yaml" => opencv::parse_yaml(text, &place),
        "json" => {
            let value: serde_json::Value = serde_json::from_str(text).map_err(|e| {
                Error::input(
                    format!("{place}:{}", e.line()),
                    format!("is not valid JSON: {e}"),
                    "correct this line",
                )
            })?;
            let nerfstudio = ["frames", "fl_x", "camera_angle_x"].iter().any(|key| value.get(key).is_some());
            if nerfstudio { nerfstudio::parse(&value, &place) } else { opencv::parse_json(&value, &place) }
        }
        _ => Err(Error::input(
            place,
            format!("has the ending \"{ending}\""),
            "camera files are transforms.json (nerfstudio), cameras.txt (COLMAP), .yml, .yaml or .json (OpenCV)",
        )),
    }
}
