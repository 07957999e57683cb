//! Calibrations that OpenCV's FileStorage, its samples and ROS write: camera matrix and distortion, YAML or JSON.

use serde_json::{Map, Value};
use yaml_rust2::parser::{Event, Parser};
use yaml_rust2::{ScanError, Yaml, YamlLoader};

use super::calibration::{Calibration, Focal};
use super::lens::Distortion;
use crate::error::{Error, Hint, Remedy, Result};

const MATRIX: [&str; 7] =
    ["camera_matrix", "Camera_Matrix", "cameraMatrix", "CameraMatrix", "K", "mtx", "intrinsic_matrix"];
const COEFFICIENTS: [&str; 10] = [
    "distortion_coefficients",
    "Distortion_Coefficients",
    "distCoeffs",
    "DistCoeffs",
    "dist_coeffs",
    "distortion_coeffs",
    "dist_coeff",
    "D",
    "dist",
    "distortion",
];

/// The camera in a YAML text; the header `%YAML:1.0` of OpenCV is not YAML and skipped.
pub(super) fn parse_yaml(text: &str, place: &str) -> Result<Calibration> {
    let body: String = text
        .lines()
        .map(|l| if l.starts_with("%YAML") { "\n".to_owned() } else { format!("{l}\n") })
        .collect();
    let invalid = |e: ScanError| {
        Error::input(
            format!("{place}:{}", e.marker().line()),
            format!("is not valid YAML: {e}"),
            "correct this line",
        )
    };
    if let Some(problem) = unbounded(&body).map_err(invalid)? {
        return Err(Error::input(place, problem, "give the file as OpenCV writes it"));
    }
    let documents = YamlLoader::load_from_str(&body).map_err(invalid)?;
    parse_json(&documents.first().map_or(Value::Null, to_json), place)
}

/// Deepest nesting of lists and maps; the loader calls itself at every level.
const MAX_DEPTH: usize = 32;

/// Why loading `text` could take memory or stack without bound, if it could: a few aliases of aliases stand for millions
/// of values.
fn unbounded(text: &str) -> std::result::Result<Option<String>, ScanError> {
    let mut parser = Parser::new_from_str(text);
    let mut depth = 0;
    loop {
        match parser.next_token()?.0 {
            Event::SequenceStart(..) | Event::MappingStart(..) => depth += 1,
            Event::SequenceEnd | Event::MappingEnd => depth -= 1,
            Event::Alias(_) => return Ok(Some("uses aliases (*name)".to_owned())),
            Event::StreamEnd => return Ok(None),
            _ => {}
        }
        if depth > MAX_DEPTH {
            return Ok(Some(format!("nests lists deeper than {MAX_DEPTH}")));
        }
    }
}

fn to_json(yaml: &Yaml) -> Value {
    match yaml {
        Yaml::Real(_) => yaml.as_f64().map_or(Value::Null, Value::from),
        Yaml::Integer(v) => Value::from(*v),
        Yaml::String(s) => Value::from(s.as_str()),
        Yaml::Boolean(b) => Value::from(*b),
        Yaml::Array(list) => list.iter().map(to_json).collect(),
        Yaml::Hash(map) => {
            let pairs = map.iter().filter_map(|(k, v)| Some((k.as_str()?.to_owned(), to_json(v))));
            Value::Object(pairs.collect::<Map<String, Value>>())
        }
        _ => Value::Null,
    }
}

/// The camera in a JSON value.
pub(super) fn parse_json(file: &Value, place: &str) -> Result<Calibration> {
    let found = |keys: &[&str]| keys.iter().map(|k| &file[*k]).find(|v| !v.is_null());
    let Some(matrix) = found(&MATRIX) else {
        return Err(Error::input(
            place,
            "has no camera matrix",
            Hint::from("give it as \"camera_matrix\" (3×3, as OpenCV writes it), or its numbers")
                .with(Remedy::Intrinsics),
        ));
    };
    let m = numbers(matrix);
    if m.len() != 9 || m.iter().any(|v| !v.is_finite()) {
        let problem = format!("its camera matrix holds {} numbers, 9 expected", m.len());
        return Err(Error::input(place, problem, "give fx 0 cx, 0 fy cy, 0 0 1, row by row"));
    }
    if m[1].abs() > 1e-3 * m[0].abs() {
        return Err(Error::input(
            place,
            format!("its camera matrix has a skew of {}", m[1]),
            "a skew is not supported: calibrate without",
        ));
    }
    for key in ["distortion_model", "camera_model", "model"] {
        if let Some(model) = file[key].as_str().filter(|m| {
            !["plumb_bob", "opencv", "pinhole", "radtan", "brown"].contains(&m.to_lowercase().as_str())
        }) {
            return Err(Error::input(
                place,
                format!("the camera model {model} is not read"),
                "plumb_bob (k1 k2 p1 p2 k3) is; undistort fisheye images first, e.g. with cv2.fisheye.undistortImage",
            ));
        }
    }
    if file["fisheye_model"].as_i64().or(file["fisheye"].as_i64()).is_some_and(|v| v != 0) {
        return Err(Error::input(
            place,
            "the camera model fisheye is not read",
            "undistort the images first, e.g. with cv2.fisheye.undistortImage",
        ));
    }
    let k = found(&COEFFICIENTS).map(numbers).unwrap_or_default();
    if k.iter().any(|v| !v.is_finite()) {
        return Err(Error::input(
            place,
            "its distortion coefficients are not all numbers",
            "give k1 k2 p1 p2 k3",
        ));
    }
    if let Some(j) = (5..k.len()).find(|j| k[*j] != 0.0) {
        return Err(Error::input(
            place,
            format!("distortion coefficient {} of {} is {}; k1 k2 p1 p2 k3 are read", j + 1, k.len(), k[j]),
            "calibrate without CALIB_RATIONAL_MODEL, CALIB_THIN_PRISM_MODEL and CALIB_TILTED_MODEL, or undistort the frames first",
        ));
    }
    let side = |keys: &[&str]| found(keys).and_then(Value::as_u64).map(|v| v as usize);
    let size =
        side(&["image_width", "image_Width", "width"]).zip(side(&["image_height", "image_Height", "height"]));
    let listed = found(&["image_size", "img_size"]).map(numbers).filter(|s| s.len() == 2);
    Ok(Calibration {
        centre: Some([m[2], m[5]]),
        size: size.map(|(w, h)| [w, h]).or(listed.map(|s| [s[0] as usize, s[1] as usize])),
        distortion: Distortion::from_opencv(&k),
        ..Calibration::new(place, Focal::Pixels([m[0], m[4]]))
    })
}

/// The numbers of a list, of lists in a list, or of a matrix with its numbers under "data"; NaN for anything else.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(list) => list.iter().flat_map(numbers).collect(),
        Value::Object(map) => map.get("data").map(numbers).unwrap_or_default(),
        other => vec![other.as_f64().unwrap_or(f64::NAN)],
    }
}
