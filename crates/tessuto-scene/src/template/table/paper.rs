//! The plane of a table from a sheet of paper on it: four corners and the sheet's size.

use glam::{DVec2, DVec3};

use super::plane::{FoundPlane, Plane, Residual};
use crate::template::outline::from_upper_left;
use crate::template::rectangle::fit;
use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Result};

/// A sheet of paper is flat and its size exact. Corners farther from those of the best rectangle than this [fraction of
/// its mean side, and px at least] are not its own, or the camera is another.
const MISFIT: f64 = 0.02;
const LEAST_MISFIT: f64 = 3.0;
/// Planes this near to each other `[rad]` are the same.
const SAME: f64 = 0.05;

/// The plane that a sheet of paper of `size` `[m]`, in either order, lies on; its corners are seen at `corners`
/// `[px]`, in any order, each known to `click` `[px]` in either direction. `at` `[px]` is the middle of the fabric,
/// where the uncertainty of lengths counts.
///
/// # Errors
/// [`Error::Usage`] if the four points are no convex quadrilateral; [`Error::Input`] if no sheet of this size can look
/// like this.
pub fn from_paper(
    camera: &Camera,
    size: DVec2,
    corners: [DVec2; 4],
    click: f64,
    at: DVec2,
) -> Result<(FoundPlane, bool)> {
    let (corners, reordered) = in_order(corners)?;
    let side = (0..4).map(|k| corners[k].distance(corners[(k + 1) % 4])).sum::<f64>() / 4.0;
    // Which side is the longer one is not asked: one of both ways fits.
    let mut found: Vec<(Plane, f64)> = Vec::new();
    for size in [size, size.yx()] {
        for (pose, error) in fit(camera, size, corners) {
            let (point, normal) = pose.plane();
            found.extend(Plane::new(point, normal).ok().map(|plane| (plane, error)));
        }
    }
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    let limit = LEAST_MISFIT.max(MISFIT * side);
    let Some(&(plane, error)) = found.first().filter(|(_, error)| *error <= limit) else {
        let off = found.first().map_or(f64::INFINITY, |(_, error)| *error);
        let problem = format!(
            "no sheet of {:.0}×{:.0} mm looks like this: the best one is off by {off:.1} px, {limit:.1} px at most",
            1e3 * size.x,
            1e3 * size.y
        );
        let hint = "see whether the corners are the paper's own in the first frame, its size is right, it lies flat, \
                    and the camera is right";
        return Err(Error::input("the paper", problem, hint));
    };
    // Eight numbers were seen, six are found: two remain to judge a click by.
    let sigma = click.max(error * 2f64.sqrt());
    let depth = plane.depth(camera, at);
    let (mut tilt, mut length) = (0.0, 0.0);
    for k in 0..8 {
        let mut moved = corners;
        moved[k / 2][k % 2] += sigma;
        let near = nearest(camera, size, moved, plane);
        tilt += near.normal.angle_between(plane.normal).powi(2);
        length += match (depth, near.depth(camera, at)) {
            (Some(before), Some(after)) => (after / before - 1.0).powi(2),
            _ => 1.0,
        };
    }
    let rival = found.iter().skip(1).filter(|(_, other)| *other < 1.5 * error + 0.2);
    let rival = rival.map(|(other, _)| other.normal.angle_between(plane.normal)).find(|angle| *angle > SAME);
    let found = FoundPlane {
        plane,
        residual: Some(Residual::Pixels(error)),
        tilt_deviation: Some(tilt.sqrt()),
        length_deviation: Some(length.sqrt()),
        rival,
    };
    Ok((found, reordered))
}

/// Of the planes that fit the corners, the one with the normal nearest to that of `plane`.
fn nearest(camera: &Camera, size: DVec2, corners: [DVec2; 4], plane: Plane) -> Plane {
    let poses = [size, size.yx()].into_iter().flat_map(|size| fit(camera, size, corners));
    let mut planes: Vec<(Plane, f64)> = poses
        .filter_map(|(pose, error)| {
            let (point, normal) = pose.plane();
            Some((Plane::new(point, normal).ok()?, error))
        })
        .collect();
    // The way round that fits is the better half.
    planes.sort_by(|a, b| a.1.total_cmp(&b.1));
    planes.truncate(2);
    let angle = |p: &Plane| p.normal.angle_between(plane.normal);
    let best = planes.into_iter().map(|(p, _)| p).min_by(|a, b| angle(a).total_cmp(&angle(b)));
    best.unwrap_or(Plane { normal: DVec3::NEG_Z, ..plane })
}

/// The corners clockwise from the upper left, and whether they were given in an order that goes around neither way.
fn in_order(given: [DVec2; 4]) -> Result<([DVec2; 4], bool)> {
    let middle = given.iter().sum::<DVec2>() / 4.0;
    let mut around = given;
    around.sort_by(|a, b| (*a - middle).to_angle().total_cmp(&(*b - middle).to_angle()));
    let turn = |p: &[DVec2; 4], k: usize| (p[(k + 1) % 4] - p[k]).perp_dot(p[(k + 2) % 4] - p[(k + 1) % 4]);
    // As for the corners of fabric: a tenth of a square pixel is a line, not a corner.
    if !given.iter().all(|p| p.is_finite()) || !(0..4).all(|k| turn(&around, k) > 0.1) {
        let text = given.map(|p| format!("{:.0},{:.0}", p.x, p.y)).join(" ");
        let hint =
            "give the four corners of the sheet as seen in the first frame; their order does not matter";
        return Err(Error::usage(format!("the paper's corners {text} are no quadrilateral"), hint));
    }
    let goes_around = (0..4).all(|k| turn(&given, k) > 0.0) || (0..4).all(|k| turn(&given, k) < 0.0);
    Ok((from_upper_left(around), !goes_around))
}

trait Swapped {
    fn yx(self) -> Self;
}

impl Swapped for DVec2 {
    fn yx(self) -> Self {
        Self::new(self.y, self.x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    const CAMERA: Camera = Camera { fx: 900.0, fy: 880.0, cx: 630.0, cy: 365.0, width: 1280, height: 720 };
    const A4: DVec2 = DVec2::new(0.297, 0.21);

    /// An A4 sheet on a tilted table: its corners as seen, and the plane.
    fn seen() -> ([DVec2; 4], Plane) {
        let rotation = DMat3::from_euler(glam::EulerRot::XYZ, -0.7, 0.15, 0.3);
        let place =
            |c: [f64; 2]| rotation * (DVec2::from_array(c) * A4).extend(0.0) + DVec3::new(-0.2, 0.1, 1.1);
        let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|c| CAMERA.project(place(c)));
        (corners, Plane::new(place([0.0, 0.0]), rotation.z_axis).unwrap())
    }

    #[test]
    fn the_plane_is_found_whatever_the_order_and_the_way_round() {
        let (corners, truth) = seen();
        let at = DVec2::new(700.0, 400.0);
        let orders =
            [([0, 1, 2, 3], false), ([2, 1, 0, 3], false), ([0, 2, 1, 3], true), ([3, 1, 0, 2], true)];
        for (order, expected) in orders {
            for size in [A4, A4.yx()] {
                let (found, reordered) =
                    from_paper(&CAMERA, size, order.map(|k: usize| corners[k]), 1.0, at).unwrap();
                assert_eq!(reordered, expected, "{order:?}");
                assert!(found.plane.normal.angle_between(truth.normal) < 1e-6);
                let depths = [found.plane, truth].map(|p| p.depth(&CAMERA, at).unwrap());
                assert!((depths[0] - depths[1]).abs() < 1e-6, "{depths:?}");
                assert!(matches!(found.residual, Some(Residual::Pixels(off)) if off < 1e-4));
            }
        }
    }

    #[test]
    fn the_uncertainty_is_that_of_clicks() {
        let (corners, truth) = seen();
        let at = DVec2::new(700.0, 400.0);
        let (found, _) = from_paper(&CAMERA, A4, corners, 1.0, at).unwrap();
        let (tilt, length) = (found.tilt_deviation.unwrap(), found.length_deviation.unwrap());
        // Corners off at random by one pixel, many times.
        let mut rng = tessuto_core::math::rng::Rng::new(7, 0);
        let (mut tilts, mut lengths) = (0.0, 0.0);
        let count = 200;
        for _ in 0..count {
            let moved = corners.map(|c| c + DVec2::new(rng.normal(), rng.normal()));
            let plane = nearest(&CAMERA, A4, moved, truth);
            tilts += plane.normal.angle_between(truth.normal).powi(2) / f64::from(count);
            let ratio = plane.depth(&CAMERA, at).unwrap() / truth.depth(&CAMERA, at).unwrap();
            lengths += (ratio - 1.0).powi(2) / f64::from(count);
        }
        let (tilts, lengths) = (tilts.sqrt(), lengths.sqrt());
        assert!((tilt / tilts - 1.0).abs() < 0.25, "{tilt} {tilts}");
        assert!((length / lengths - 1.0).abs() < 0.25, "{length} {lengths}");
    }

    #[test]
    fn corners_of_something_else_are_refused() {
        let (corners, _) = seen();
        let refused = |corners: [DVec2; 4], size: DVec2| {
            from_paper(&CAMERA, size, corners, 1.0, DVec2::new(700.0, 400.0)).unwrap_err().to_string()
        };
        let mut wrong = corners;
        wrong[1] += DVec2::new(45.0, -30.0);
        let text = refused(wrong, A4);
        assert!(
            text.contains("297×210 mm") && text.contains("off by") && text.contains("px at most"),
            "{text}"
        );
        let text = refused(corners, DVec2::new(0.4, 0.1));
        assert!(text.contains("no sheet of 400×100 mm"), "{text}");
        let inside = [corners[0], corners[1], corners[2], (corners[0] + corners[1] + corners[2]) / 3.0];
        assert!(refused(inside, A4).contains("no quadrilateral"));
        assert!(refused([corners[0]; 4], A4).contains("no quadrilateral"));
    }
}
