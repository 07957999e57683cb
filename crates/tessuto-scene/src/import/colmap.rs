//! COLMAP's cameras.txt: `CAMERA_ID MODEL WIDTH HEIGHT PARAMS…`, one camera a line.

use super::calibration::{Calibration, Focal, Reader};
use super::lens::Distortion;
use tessuto_core::error::{Error, Hint, Remedy, Result};

/// Cameras that a message names at most.
const LISTED: usize = 5;

/// The kind of file.
pub(super) const READER: Reader = Reader {
    about: "cameras.txt (COLMAP)",
    endings: &["txt"],
    knows: |_| true,
    read: |file| parse(file.text, file.place, file.camera_id),
};

/// The camera in `text`; the only one, or the one of `camera_id`.
fn parse(text: &str, place: &str, camera_id: Option<u32>) -> Result<Calibration> {
    let lines = text.lines().enumerate().map(|(k, l)| (k + 1, l.trim()));
    let cameras: Vec<(usize, Vec<&str>)> = lines
        .filter(|(_, l)| !l.is_empty() && !l.starts_with('#'))
        .map(|(k, l)| (k, l.split_whitespace().collect()))
        .collect();
    let mut ids: Vec<&str> = cameras.iter().take(LISTED).map(|(_, words)| words[0]).collect();
    if cameras.len() > LISTED {
        ids.push("…");
    }
    let chosen = match camera_id {
        Some(id) => cameras.iter().find(|(_, words)| words[0].parse() == Ok(id)),
        None if cameras.len() > 1 => {
            return Err(Error::input(
                place,
                format!("holds {} cameras: {}", cameras.len(), ids.join(", ")),
                Hint::from("COLMAP shares one camera with --ImageReader.single_camera 1; else choose the video's one")
                    .with(Remedy::CameraId),
            ));
        }
        None => cameras.first(),
    };
    let Some((line, words)) = chosen else {
        let problem = match camera_id {
            Some(id) => format!("has no camera {id}; there are: {}", ids.join(", ")),
            None => "holds no camera".to_owned(),
        };
        return Err(Error::input(
            place,
            problem,
            "each camera is a line: CAMERA_ID MODEL WIDTH HEIGHT PARAMS",
        ));
    };
    camera(words, &format!("{place}:{line}"))
}

fn camera(words: &[&str], place: &str) -> Result<Calibration> {
    let bad = |problem: String| {
        Error::input(place, problem, "each camera is a line: CAMERA_ID MODEL WIDTH HEIGHT PARAMS")
    };
    let number = |word: &&str| {
        word.parse::<f64>()
            .ok()
            .filter(|v| v.is_finite())
            .ok_or_else(|| bad(format!("\"{word}\" is not a number")))
    };
    if words.len() < 4 {
        return Err(bad(format!("has {} words", words.len())));
    }
    let side =
        |word: &str| word.parse::<usize>().map_err(|_| bad(format!("\"{word}\" is not a width or height")));
    let size = [side(words[2])?, side(words[3])?];
    let p: Vec<f64> = words[4..].iter().map(number).collect::<Result<_>>()?;
    let expected = match words[1] {
        "SIMPLE_PINHOLE" => 3,
        "PINHOLE" | "SIMPLE_RADIAL" => 4,
        "RADIAL" => 5,
        "OPENCV" | "OPENCV_FISHEYE" => 8,
        "SIMPLE_RADIAL_FISHEYE" => 4,
        "RADIAL_FISHEYE" => 5,
        other => {
            return Err(Error::input(
                place,
                format!("the camera model {other} is not read"),
                "SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV and the fisheye models of the last \
                 three are; run COLMAP with --ImageReader.camera_model OPENCV, or undistort the frames with \
                 colmap image_undistorter",
            ));
        }
    };
    if p.len() != expected {
        return Err(bad(format!("{} has {} parameters, {expected} expected", words[1], p.len())));
    }
    let none = Distortion::default();
    let (focal, centre, distortion) = match words[1] {
        "SIMPLE_PINHOLE" => ([p[0], p[0]], [p[1], p[2]], none),
        "PINHOLE" => ([p[0], p[1]], [p[2], p[3]], none),
        "SIMPLE_RADIAL" => ([p[0], p[0]], [p[1], p[2]], Distortion { k1: p[3], ..none }),
        "RADIAL" => ([p[0], p[0]], [p[1], p[2]], Distortion { k1: p[3], k2: p[4], ..none }),
        "SIMPLE_RADIAL_FISHEYE" => {
            ([p[0], p[0]], [p[1], p[2]], Distortion::of_fisheye([p[3], 0.0, 0.0, 0.0]))
        }
        "RADIAL_FISHEYE" => ([p[0], p[0]], [p[1], p[2]], Distortion::of_fisheye([p[3], p[4], 0.0, 0.0])),
        "OPENCV_FISHEYE" => ([p[0], p[1]], [p[2], p[3]], Distortion::of_fisheye([p[4], p[5], p[6], p[7]])),
        _ => ([p[0], p[1]], [p[2], p[3]], Distortion::from_opencv(&p[4..])),
    };
    Ok(Calibration {
        // COLMAP's origin is the corner of the first pixel, here it is its centre.
        centre: Some(centre.map(|c| c - 0.5)),
        size: Some(size),
        distortion,
        ..Calibration::new(place, Focal::Pixels(focal))
    })
}
