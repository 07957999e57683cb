//! The focal length of a camera from the four corners of a flat sheet of known size.
//!
//! Square pixels and a principal point in the middle of the image leave seven unknowns, pose and focal length, to
//! eight measured numbers. For every focal length the best pose is found; the interval is that of the focal
//! lengths that explain the corners nearly as well as the best one, by the error of a click. It is wide where the
//! sheet is parallel to the image: then a longer lens farther away sees the same.

use glam::DVec2;

use super::rectangle::{check_order, fit};
use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Result};

/// Focal lengths tried, in diagonals of the image: fields of view of 153° to 6° along it.
const TRIED: [f64; 2] = [0.12, 10.0];
/// How many, evenly spaced in their logarithm: 4 % apart.
const COUNT: usize = 112;
/// An interval whose half is more than this fraction of the focal length determines none.
const WIDEST: f64 = 0.15;
/// A sheet whose corners are farther [fraction of its mean side] from those of the best plane rectangle is not
/// flat enough.
const BENT: f64 = 0.02;

/// A focal length that was estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimated {
    /// Along either axis `[px]`.
    pub focal: f64,
    /// Shortest and longest that explain the corners, at one standard deviation of a click `[px]`.
    pub interval: [f64; 2],
    /// Root mean square distance of the plane rectangle's corners from those seen `[px]`.
    pub residual: f64,
}

impl Estimated {
    /// Half of the interval, as a fraction of the focal length.
    pub fn uncertainty(&self) -> f64 {
        (self.interval[1] - self.interval[0]) / (2.0 * self.focal)
    }
}

/// The camera of images of `image` (width, height) `[px]` that see the corners of a flat rectangle of `size`
/// (width along the upper side, height) `[m]` at `corners` `[px]`, upper left, upper right, lower right, lower
/// left, each known to `precision` `[px]` in either direction.
///
/// # Errors
/// [`Error::Usage`] if the four points are no convex quadrilateral in this order; [`Error::Input`] if they do not
/// determine the focal length.
pub fn estimate(
    size: DVec2,
    corners: [DVec2; 4],
    image: [usize; 2],
    precision: f64,
) -> Result<(Camera, Estimated)> {
    check_order(corners)?;
    let diagonal = (image[0] as f64).hypot(image[1] as f64);
    let camera = |focal: f64| Camera {
        fx: focal,
        fy: focal,
        cx: (image[0] as f64 - 1.0) / 2.0,
        cy: (image[1] as f64 - 1.0) / 2.0,
        width: image[0],
        height: image[1],
    };
    // Sum of squared distances; there are four corners.
    let cost = |log: f64| {
        let error = fit(&camera(log.exp()), size, corners)[0].1;
        4.0 * error * error
    };
    let [low, high] = TRIED.map(|f| (f * diagonal).ln());
    let step = (high - low) / (COUNT - 1) as f64;
    let costs: Vec<f64> = (0..COUNT).map(|k| cost(low + step * k as f64)).collect();
    let best = (0..COUNT).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).expect("there are several");
    let at = low + step * best as f64;
    let log = golden([at - step, at + step], &cost);
    let least = cost(log).min(costs[best]);
    let residual = (least / 4.0).sqrt();
    let side = (0..4).map(|k| corners[k].distance(corners[(k + 1) % 4])).sum::<f64>() / 4.0;
    if residual > BENT * side {
        return Err(refusal(
            format!("no plane rectangle has these corners with any lens: off by {residual:.1} px at best"),
            "the sheet is bent in this frame, or its size or corners are wrong",
        ));
    }
    // One number more than unknowns: the residual shows the clicks' error, too, if it is more than was said.
    let limit = least + (precision * precision).max(least);
    let end = |side: f64, last: f64| {
        // Outwards from the best, until it is too bad; then back to where that began.
        let mut near = log;
        loop {
            let far = near + side * step;
            if (far - last) * side > 0.0 {
                return None;
            }
            if cost(far) > limit {
                return Some(crossing([near, far], limit, &cost).exp());
            }
            near = far;
        }
    };
    let interval = [end(-1.0, low), end(1.0, high)];
    let estimated = match interval {
        [Some(a), Some(b)] => Some(Estimated { focal: log.exp(), interval: [a, b], residual }),
        _ => None,
    };
    match estimated {
        Some(found) if found.uncertainty() <= WIDEST => Ok((camera(found.focal), found)),
        found => {
            let known = found.map_or_else(
                || "any lens explains them".to_owned(),
                |f| format!("{:.0} to {:.0} px explain them", f.interval[0], f.interval[1]),
            );
            Err(refusal(
                format!("the corners do not determine the focal length: {known} within {precision} px"),
                "the sheet is seen too much from the front: use a frame in which it is tilted by 30° or more \
                 and near the camera",
            ))
        }
    }
}

fn refusal(problem: String, hint: &str) -> Error {
    let other = "; or give the camera: a focal length, a field of view or a calibration";
    Error::input("the camera", problem, format!("{hint}{other}"))
}

/// Where `cost` is least in an interval in which it has one minimum.
fn golden([mut a, mut b]: [f64; 2], cost: &dyn Fn(f64) -> f64) -> f64 {
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut c, mut d) = (b - ratio * (b - a), a + ratio * (b - a));
    let (mut at_c, mut at_d) = (cost(c), cost(d));
    for _ in 0..40 {
        if at_c < at_d {
            (b, d, at_d) = (d, c, at_c);
            c = b - ratio * (b - a);
            at_c = cost(c);
        } else {
            (a, c, at_c) = (c, d, at_d);
            d = a + ratio * (b - a);
            at_d = cost(d);
        }
    }
    0.5 * (a + b)
}

/// Where `cost` exceeds `limit`, between `near`, where it does not, and `far`, where it does.
fn crossing([mut near, mut far]: [f64; 2], limit: f64, cost: &dyn Fn(f64) -> f64) -> f64 {
    for _ in 0..30 {
        let middle = 0.5 * (near + far);
        *(if cost(middle) > limit { &mut far } else { &mut near }) = middle;
    }
    0.5 * (near + far)
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3, EulerRot};

    use super::*;
    use tessuto_core::math::rng::Rng;

    const IMAGE: [usize; 2] = [1280, 720];
    const SIZE: DVec2 = DVec2::new(0.7, 0.5);
    const FOCAL: f64 = 950.0;

    /// Corners of a sheet turned by these angles `[rad]`, at this distance `[m]`.
    fn seen([x, y]: [f64; 2], distance: f64) -> [DVec2; 4] {
        let camera = Camera { fx: FOCAL, fy: FOCAL, cx: 639.5, cy: 359.5, width: IMAGE[0], height: IMAGE[1] };
        let turn = DMat3::from_euler(EulerRot::XYZ, x, y, 0.1);
        [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|c| {
            camera
                .project(turn * (DVec2::from_array(c) * SIZE).extend(0.0) + DVec3::new(0.05, -0.03, distance))
        })
    }

    #[test]
    fn a_tilted_sheet_tells_the_focal_length() {
        let (camera, found) = estimate(SIZE, seen([0.5, -0.6], 1.0), IMAGE, 1.0).unwrap();
        assert!((found.focal - FOCAL).abs() < 1e-3 * FOCAL, "{found:?}");
        assert!(found.residual < 0.01 && camera.fx == found.focal && camera.cy == 359.5);
        assert!(found.interval[0] < FOCAL && FOCAL < found.interval[1]);
        // A click twice as rough leaves twice the doubt.
        let (_, rough) = estimate(SIZE, seen([0.5, -0.6], 1.0), IMAGE, 2.0).unwrap();
        assert!((rough.uncertainty() / found.uncertainty() - 2.0).abs() < 0.3);
    }

    #[test]
    fn the_interval_holds_the_truth_as_often_as_it_says() {
        let mut rng = Rng::new(7, 0);
        let (mut inside, mut errors) = (0, Vec::new());
        for _ in 0..60 {
            let corners = seen([0.5, -0.6], 1.0).map(|p| p + DVec2::new(rng.normal(), rng.normal()));
            let (_, found) = estimate(SIZE, corners, IMAGE, 1.0).unwrap();
            inside += usize::from(found.interval[0] <= FOCAL && FOCAL <= found.interval[1]);
            errors.push((found.focal / FOCAL - 1.0).abs() / found.uncertainty());
        }
        // 68 % of 60 are 41 ± 4; doubt is added where the corners disagree.
        assert!((36..=57).contains(&inside), "{inside} of 60");
        let mean = errors.iter().sum::<f64>() / 60.0;
        assert!((0.35..1.1).contains(&mean), "{mean} of the uncertainty");
    }

    #[test]
    fn a_sheet_seen_from_the_front_is_refused() {
        for tilt in [0.0, 0.03] {
            let told = estimate(SIZE, seen([tilt, 0.0], 1.5), IMAGE, 1.0).unwrap_err().to_string();
            assert!(told.contains("do not determine the focal length") && told.contains("tilted"), "{told}");
        }
        let mut bent = seen([0.5, -0.6], 1.0);
        bent[2] += DVec2::new(90.0, -70.0);
        let told = estimate(SIZE, bent, IMAGE, 1.0).unwrap_err().to_string();
        assert!(told.contains("no plane rectangle"), "{told}");
        let [a, b, c, d] = seen([0.5, -0.6], 1.0);
        assert!(estimate(SIZE, [a, c, b, d], IMAGE, 1.0).is_err());
    }
}
