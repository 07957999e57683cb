//! Planes that the fabric lies on, as scene.json lists them.

use glam::DVec3;
use serde::Deserialize;

use tessuto_core::error::{Error, Result};
use tessuto_core::scene::Plane;

/// One of `planes`: a point of it in the scene's unit and its normal, in the frame of the camera in frame 0.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ListedPlane {
    point: [f64; 3],
    normal: [f64; 3],
}

/// The planes, lengths in metres, with normals towards the camera: it sees what lies on them. `scale` are the metres in
/// one unit, `place` is where they are from.
///
/// # Errors
/// [`Error::Input`] for numbers that make no plane, and a plane that the camera is in.
pub(super) fn read(listed: &[ListedPlane], scale: f64, place: &str) -> Result<Vec<Plane>> {
    let of = |plane: &ListedPlane| [DVec3::from_array(plane.point) * scale, DVec3::from_array(plane.normal)];
    through(&listed.iter().map(of).collect::<Vec<_>>(), place)
}

/// The planes through these points `[m]` across these directions.
///
/// # Errors
/// As [`read`].
pub(super) fn through(planes: &[[DVec3; 2]], place: &str) -> Result<Vec<Plane>> {
    let of = |(k, [point, across]): (usize, &[DVec3; 2])| {
        let place = format!("{place}, plane {k}");
        let normal = across.try_normalize().filter(|_| point.is_finite()).ok_or_else(|| {
            let problem = format!("its point is {point} m, its normal {across}");
            Error::input(&place, problem, "give a point of the plane, and the direction across it")
        })?;
        let height = normal.dot(*point);
        if height == 0.0 {
            let hint = "give a point of it in the camera's frame: x right, y down, z ahead";
            return Err(Error::input(&place, "the camera is in it", hint));
        }
        // The camera is at the origin.
        Ok(if height > 0.0 { Plane { normal: -normal, height: -height } } else { Plane { normal, height } })
    };
    planes.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_turn_to_the_camera_and_what_is_no_plane_is_refused() {
        let listed = |point, normal| [ListedPlane { point, normal }];
        for sign in [1.0, -1.0] {
            let found = read(&listed([0.0, 10.0, 50.0], [0.0, 0.0, 2.0 * sign]), 0.01, "scene.json").unwrap();
            assert_eq!(found, [Plane { normal: -DVec3::Z, height: -0.5 }]);
        }
        for (point, normal) in [([0.0; 3], [0.0, 1.0, 0.0]), ([0.0, 0.0, 1.0], [0.0; 3])] {
            let message = read(&listed(point, normal), 1.0, "scene.json").unwrap_err().to_string();
            assert!(message.contains("plane 0"), "{message}");
        }
    }
}
