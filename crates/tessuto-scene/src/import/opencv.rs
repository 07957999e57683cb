//! Calibrations that OpenCV's FileStorage, its samples and ROS write: camera matrix and distortion, YAML or JSON.

use serde_json::{Map, Value};
use yaml_rust2::parser::{Event, Parser};
use yaml_rust2::{ScanError, Yaml, YamlLoader};

use super::calibration::{Calibration, Focal, Reader};
use super::lens::Distortion;
use super::matrix;
use tessuto_core::error::{Error, Hint, Remedy, Result};

const MATRIX: [&str; 10] = [
    "camera_matrix",
    "Camera_Matrix",
    "cameraMatrix",
    "CameraMatrix",
    "K",
    "mtx",
    "intrinsic_matrix",
    "intrinsics",
    "intrinsicMatrix",
    "cameraIntrinsics",
];
/// Models after Brown and Conrady, or without distortion.
const BROWN: [&str; 9] = [
    "plumb_bob",
    "opencv",
    "pinhole",
    "radtan",
    "radial-tangential",
    "rational_polynomial",
    "brown",
    "none",
    "perspective",
];
/// Models after Kannala and Brandt.
const FISHEYE: [&str; 7] = [
    "fisheye",
    "opencv_fisheye",
    "equidistant",
    "equi",
    "kannala_brandt",
    "kannala_brandt4",
    "kannalabrandt4",
];
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

/// The kind of file.
pub(super) const READER: Reader = Reader {
    about: ".yml, .yaml or .json (OpenCV)",
    endings: &["yml", "yaml", "json"],
    knows: |_| true,
    read: |file| match file.json {
        Some(json) => parse_json(json, file.place),
        None => parse_yaml(file.text, file.place),
    },
};

fn parse_yaml(text: &str, place: &str) -> Result<Calibration> {
    parse_json(&yaml(text, place)?, place)
}

/// What a YAML text holds; the header `%YAML:1.0` of OpenCV is not YAML and skipped.
pub(super) fn yaml(text: &str, place: &str) -> Result<Value> {
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
    Ok(documents.first().map_or(Value::Null, to_json))
}

/// Deepest nesting of lists and maps; the loader calls itself at every level.
const MAX_DEPTH: usize = 32;

/// Why loading `text` could take memory or stack without bound, if it could: a few aliases of aliases stand for
/// millions of values.
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

/// The camera in a JSON value; of Kalibr's chains the first one.
pub(super) fn parse_json(file: &Value, place: &str) -> Result<Calibration> {
    if file["cam0"].is_object() {
        let mut found = parse_json(&file["cam0"], place)?;
        if file["cam1"].is_object() {
            found.notes.push("holds several cameras; the first one, cam0, is taken".to_owned());
        }
        return Ok(found);
    }
    if file["intrinsic"].is_object() {
        return parse_json(&file["intrinsic"], place);
    }
    let found = |keys: &[&str]| keys.iter().map(|k| &file[*k]).find(|v| !v.is_null());
    let [fx, fy, cx, cy] = pinhole(file, place)?;
    let k = found(&COEFFICIENTS).map(numbers).unwrap_or_default();
    if k.iter().any(|v| !v.is_finite()) {
        return Err(Error::input(
            place,
            "its distortion coefficients are not all numbers",
            "give k1 k2 p1 p2 k3, of a fisheye lens k1 k2 k3 k4",
        ));
    }
    let distortion = match is_fisheye(file, place)? {
        true => {
            let k = <[f64; 4]>::try_from(k).map_err(|k| {
                let problem = format!("is of a fisheye lens, but has {} distortion coefficients", k.len());
                Error::input(place, problem, "give k1 k2 k3 k4, as cv2.fisheye.calibrate finds them")
            })?;
            Distortion::of_fisheye(k)
        }
        false => brown(&k, place)?,
    };
    let side = |keys: &[&str]| found(keys).and_then(Value::as_u64).map(|v| v as usize);
    let size = side(&["image_width", "image_Width", "imageWidth", "width", "w"]).zip(side(&[
        "image_height",
        "image_Height",
        "imageHeight",
        "height",
        "h",
    ]));
    let lists = ["image_size", "img_size", "DIM", "resolution", "imageResolution", "image_resolution"];
    let listed = found(&lists).map(numbers).filter(|s| s.len() == 2);
    Ok(Calibration {
        centre: Some([cx, cy]),
        size: size.map(|(w, h)| [w, h]).or(listed.map(|s| [s[0] as usize, s[1] as usize])),
        distortion,
        ..Calibration::new(place, Focal::Pixels([fx, fy]))
    })
}

/// fx, fy, cx, cy: a matrix, four numbers, or each by its name.
fn pinhole(file: &Value, place: &str) -> Result<[f64; 4]> {
    if let Some(found) = MATRIX.iter().map(|k| &file[*k]).find(|v| !v.is_null()) {
        let m = numbers(found);
        return match m[..] {
            [fx, fy, cx, cy] if m.iter().all(|v| v.is_finite()) => Ok([fx, fy, cx, cy]),
            _ => matrix::intrinsics(&m, place),
        };
    }
    let named = |keys: [&str; 2]| keys.iter().find_map(|key| file[*key].as_f64());
    let all = [["fx", "f"], ["fy", "fx"], ["cx", "ppx"], ["cy", "ppy"]].map(named);
    if let [Some(fx), Some(fy), Some(cx), Some(cy)] = all {
        return Ok([fx, fy, cx, cy]);
    }
    Err(Error::input(
        place,
        "has no camera matrix",
        Hint::from("give it as \"camera_matrix\" (3×3, as OpenCV writes it), or its numbers")
            .with(Remedy::Intrinsics),
    ))
}

/// Whether the file is of a fisheye lens: it says so, or has the names that OpenCV's samples for these have (K, D,
/// DIM).
fn is_fisheye(file: &Value, place: &str) -> Result<bool> {
    let mut fisheye = ["fisheye_model", "fisheye", "is_fisheye"].iter().any(|key| {
        let value = &file[*key];
        value.as_bool().unwrap_or(value.as_i64().is_some_and(|v| v != 0))
    });
    fisheye |= !file["DIM"].is_null();
    for key in ["distortion_model", "camera_model", "model"] {
        let Some(model) = file[key].as_str() else { continue };
        let name = model.to_lowercase();
        fisheye |= FISHEYE.contains(&name.as_str());
        if !FISHEYE.contains(&name.as_str()) && !BROWN.contains(&name.as_str()) {
            return Err(Error::input(
                place,
                format!("the camera model {model} is not read"),
                "plumb_bob (k1 k2 p1 p2 k3) and equidistant fisheye lenses (k1 k2 k3 k4) are; undistort other \
                 images first",
            ));
        }
    }
    Ok(fisheye)
}

/// Distortion in OpenCV's order.
fn brown(k: &[f64], place: &str) -> Result<Distortion> {
    if let Some(j) = (5..k.len()).find(|j| k[*j] != 0.0) {
        return Err(Error::input(
            place,
            format!("distortion coefficient {} of {} is {}; k1 k2 p1 p2 k3 are read", j + 1, k.len(), k[j]),
            "calibrate without CALIB_RATIONAL_MODEL, CALIB_THIN_PRISM_MODEL and CALIB_TILTED_MODEL, or \
             undistort the frames first",
        ));
    }
    Ok(Distortion::from_opencv(k))
}

/// The numbers of a list, of lists in a list, or of a matrix with its numbers under "data"; NaN for anything else.
pub(super) fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(list) => list.iter().flat_map(numbers).collect(),
        Value::Object(map) => map.get("data").map(numbers).unwrap_or_default(),
        other => vec![other.as_f64().unwrap_or(f64::NAN)],
    }
}
