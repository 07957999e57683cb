//! nerfstudio's transforms.json: one camera for all frames, or the same in every frame.

use serde_json::Value;

use super::calibration::{Calibration, Focal, Reader};
use super::lens::Distortion;
use tessuto_core::error::{Error, Result};

const KEYS: [&str; 11] = ["fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "k3", "p1", "p2"];

/// The kind of file.
pub(super) const READER: Reader = Reader {
    about: "transforms.json (nerfstudio)",
    endings: &["json"],
    knows: |file| {
        ["frames", "fl_x", "camera_angle_x"].iter().any(|key| file.json.is_some_and(|f| f.get(key).is_some()))
    },
    read: |file| parse(file.json.unwrap_or(&Value::Null), file.place),
};

/// The camera in `file`.
fn parse(file: &Value, place: &str) -> Result<Calibration> {
    let frames = file["frames"].as_array().map_or(&[][..], Vec::as_slice);
    let model = text(file, frames, "camera_model");
    let said = |v: &Value| v["is_fisheye"].as_bool().unwrap_or(v["is_fisheye"].as_i64() == Some(1));
    let fisheye = model == Some("OPENCV_FISHEYE") || std::iter::once(file).chain(frames).any(said);
    if let Some(model) = model.filter(|m| {
        !matches!(*m, "OPENCV" | "OPENCV_FISHEYE" | "PINHOLE" | "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL")
    }) {
        return Err(Error::input(
            place,
            format!("the camera model {model} is not read"),
            "OPENCV, OPENCV_FISHEYE, PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL and RADIAL are; undistort the frames first",
        ));
    }
    // Coefficients that the lens's formula has not.
    let none = if fisheye { ["p1", "p2", "k5"] } else { ["k4", "k5", "k6"] };
    for key in none {
        if number(file, frames, key, place)?.is_some_and(|v| v != 0.0) {
            let read = if fisheye { "of a fisheye lens as k1 k2 k3 k4" } else { "as k1 k2 p1 p2 k3" };
            let problem = format!("\"{key}\" is not 0; distortion is read {read}");
            return Err(Error::input(
                place,
                problem,
                "undistort the frames first, or calibrate with the model OPENCV",
            ));
        }
    }
    let [fl_x, fl_y, cx, cy, w, h, k1, k2, k3, p1, p2] = {
        let mut values = [None; KEYS.len()];
        for (value, key) in values.iter_mut().zip(KEYS) {
            *value = number(file, frames, key, place)?;
        }
        values
    };
    let angle = number(file, frames, "camera_angle_x", place)?;
    let focal = match (fl_x.or(fl_y), angle) {
        (Some(f), _) => Focal::Pixels([fl_x.unwrap_or(f), fl_y.unwrap_or(f)]),
        (None, Some(angle)) => Focal::Angle(angle),
        (None, None) => {
            return Err(Error::input(
                place,
                "has neither \"fl_x\" nor \"camera_angle_x\"",
                "add the focal length [px] as \"fl_x\"",
            ));
        }
    };
    let mut notes = Vec::new();
    if moves(frames) {
        notes.push(
            "the camera moves between frames; unless its poses are given, too, it is taken to stand still"
                .to_owned(),
        );
    }
    let or_zero = |v: Option<f64>| v.unwrap_or(0.0);
    Ok(Calibration {
        // The origin is the corner of the first pixel (rays go through +0.5), here it is its centre.
        centre: cx.zip(cy).map(|(x, y)| [x - 0.5, y - 0.5]),
        size: w.zip(h).map(|(w, h)| [w as usize, h as usize]),
        distortion: if fisheye {
            let k4 = number(file, frames, "k4", place)?;
            Distortion::of_fisheye([k1, k2, k3, k4].map(or_zero))
        } else {
            Distortion {
                k1: or_zero(k1),
                k2: or_zero(k2),
                k3: or_zero(k3),
                p1: or_zero(p1),
                p2: or_zero(p2),
                fisheye: None,
            }
        },
        notes,
        ..Calibration::new(place, focal)
    })
}

/// A number of the file, or the one that all frames agree on.
fn number(file: &Value, frames: &[Value], key: &str, place: &str) -> Result<Option<f64>> {
    let all = std::iter::once(file).chain(frames);
    let mut values = all.map(|v| &v[key]).filter(|v| !v.is_null());
    let Some(first) = values.next() else { return Ok(None) };
    let Some(found) = first.as_f64() else {
        return Err(Error::input(place, format!("\"{key}\" is {first}, not a number"), "correct this key"));
    };
    // The file's own value counts; without one the frames must share theirs.
    if file[key].is_null()
        && values.any(|v| v.as_f64().is_none_or(|v| (v - found).abs() > 1e-6 * found.abs().max(1.0)))
    {
        let problem = format!("\"{key}\" differs between frames");
        return Err(Error::input(place, problem, "a zoom is not supported: give one camera for all frames"));
    }
    Ok(Some(found))
}

fn text<'a>(file: &'a Value, frames: &'a [Value], key: &str) -> Option<&'a str> {
    std::iter::once(file).chain(frames).find_map(|v| v[key].as_str())
}

/// Whether the poses of the frames differ by more than what a solver's noise explains: 1° of rotation.
fn moves(frames: &[Value]) -> bool {
    let rotation = |frame: &Value| -> Option<Vec<f64>> {
        let rows = frame["transform_matrix"].as_array()?;
        rows.iter().take(3).flat_map(|row| (0..3).map(move |k| row[k].as_f64())).collect()
    };
    let Some(first) = frames.first().and_then(rotation) else { return false };
    // ‖R − R0‖ = 2√2 sin(angle / 2).
    let far = 2.0 * 2f64.sqrt() * (0.5_f64.to_radians()).sin();
    frames
        .iter()
        .filter_map(rotation)
        .any(|r| r.iter().zip(&first).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt() > far)
}
