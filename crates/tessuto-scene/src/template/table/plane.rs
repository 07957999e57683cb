//! The plane that a fabric lies on, in the camera's frame of the first frame.

use glam::{DVec2, DVec3};

use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Result};

/// A plane seen along itself by less than this [sine of the angle between ray and plane] has no outline worth its
/// name: a pixel across is ten pixels along.
const STEEPEST: f64 = 0.1;

/// A plane: camera frame of the first frame (x right, y down, z forward).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// One of its points `[m]`.
    pub point: DVec3,
    /// Of length 1, on the side from which the camera looks.
    pub normal: DVec3,
}

/// A plane, and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoundPlane {
    /// The plane.
    pub plane: Plane,
    /// Root mean square of what does not fit; `None` where nothing was fitted.
    pub residual: Option<Residual>,
    /// Standard deviation of the normal's direction `[rad]`, where it was estimated.
    pub tilt_deviation: Option<f64>,
    /// Standard deviation of the distance in the middle of the fabric, as a fraction of it and so of all lengths.
    pub length_deviation: Option<f64>,
    /// Angle to another plane that fits nearly as well `[rad]`, where there is one.
    pub rival: Option<f64>,
}

/// What does not fit, root mean square.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Residual {
    /// Corners of a sheet of paper in the image `[px]`.
    Pixels(f64),
    /// Measured depths `[m]`.
    Metres(f64),
}

impl Plane {
    /// The plane through `point` `[m]`, perpendicular to `normal` of any length and sign.
    ///
    /// # Errors
    /// [`Error::Usage`] of numbers that are not finite, a normal without a direction, or a plane through the camera.
    pub fn new(point: DVec3, normal: DVec3) -> Result<Self> {
        let direction = normal.try_normalize().filter(|n| n.is_finite() && point.is_finite());
        let Some(n) = direction else {
            let hint = "give three finite numbers each, and a normal that is not 0 0 0";
            return Err(Error::usage(format!("the plane through {point} with the normal {normal}"), hint));
        };
        let height = n.dot(point);
        // A plane whose points are all in the direction of the camera's centre is seen as a line.
        if height.abs() <= 1e-9 * point.length().max(1e-9) {
            let hint = "give a point of the table and its normal, both in the camera's frame (x right, y down, z \
                        forward)";
            return Err(Error::usage(
                format!("the plane through {point} with the normal {normal} contains the camera"),
                hint,
            ));
        }
        Ok(Self { point, normal: if height < 0.0 { n } else { -n } })
    }

    /// Where a ray from the camera in `direction` meets it `[m]`; `None` if it does not, or at its horizon.
    pub fn meet(&self, direction: DVec3) -> Option<DVec3> {
        let sine = self.normal.dot(direction) / direction.length();
        let along = self.normal.dot(self.point) / self.normal.dot(direction);
        (sine < -1e-6 && along > 0.0).then(|| direction * along)
    }

    /// The same plane in another unit of length: `factor` of them make one of before.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self { point: self.point * factor, ..*self }
    }

    /// Directions of length 1 within it: that of the image's rows, as nearly as it can be, and downwards.
    pub fn axes(&self) -> [DVec3; 2] {
        let n = self.normal;
        let along = |axis: DVec3| axis - n * n.dot(axis);
        let rows = if n.x.abs() < 0.95 { along(DVec3::X) } else { along(DVec3::Z) }.normalize();
        [rows, rows.cross(n)]
    }

    /// Refuses a plane that the camera sees along itself at `p_pixel`, the middle of the fabric.
    ///
    /// # Errors
    /// [`Error::Input`].
    pub(super) fn check_seen(&self, camera: &Camera, p_pixel: DVec2) -> Result<()> {
        let sine = -self.normal.dot(camera.ray(p_pixel).normalize());
        if sine >= STEEPEST {
            return Ok(());
        }
        let problem = format!(
            "the camera sees it edge-on: {:.1}° from the plane itself at the fabric's middle, pixel {:.0},{:.0}; \
             {:.1}° at least",
            sine.asin().to_degrees(),
            p_pixel.x,
            p_pixel.y,
            STEEPEST.asin().to_degrees()
        );
        let hint = "film from above, or see whether the plane is the table's: its normal and point are in the camera's \
                    frame";
        Err(Error::input("the plane of the table", problem, hint))
    }

    /// Its distance in the direction of `p_pixel`, along the ray with z = 1 `[m]`.
    pub(super) fn depth(&self, camera: &Camera, p_pixel: DVec2) -> Option<f64> {
        self.meet(camera.ray(p_pixel)).map(|p| p.z)
    }
}

impl FoundPlane {
    /// A plane that was given.
    pub fn given(plane: Plane) -> Self {
        Self { plane, residual: None, tilt_deviation: None, length_deviation: None, rival: None }
    }

    /// In words; `p_pixel` is the middle of the fabric as `camera` sees it.
    pub fn sentence(&self, camera: &Camera, p_pixel: DVec2) -> String {
        let ray = camera.ray(p_pixel);
        let away = self.plane.meet(ray).map_or(f64::NAN, DVec3::length);
        let angle = self.plane.normal.angle_between(-ray).to_degrees();
        let mut text = format!("table: {away:.3} m away, seen {angle:.1}° from its normal");
        match self.residual {
            Some(Residual::Pixels(off)) => text += &format!("; the paper's corners are off by {off:.2} px"),
            Some(Residual::Metres(off)) => {
                text += &format!("; measured depths are off by {:.1} mm", 1e3 * off);
            }
            None => {}
        }
        if let Some(tilt) = self.tilt_deviation {
            text += &format!("; tilt ± {:.2}°", tilt.to_degrees());
        }
        if let Some(part) = self.length_deviation {
            text += &format!("; lengths ± {:.2} %", 100.0 * part);
        }
        text
    }
}

/// The plane with the `normal` on which the points seen at `between` `[px]` are `length` `[m]` apart. `at` `[px]` is
/// the middle of the fabric; a click is off by `click` `[px]`.
///
/// # Errors
/// [`Error::Usage`] if a ray does not meet such a plane, or the two points are one.
pub fn from_distance(
    camera: &Camera,
    normal: DVec3,
    between: [DVec2; 2],
    length: f64,
    click: f64,
) -> Result<FoundPlane> {
    let unit = |n: DVec3| Plane::new(-n, n);
    let direction = normal.try_normalize().filter(|n| n.is_finite()).unwrap_or(DVec3::ZERO);
    let middle = camera.ray((between[0] + between[1]) / 2.0);
    // The camera looks at the upper side: the other sign of a normal means the same plane.
    let n = if direction.dot(middle) > 0.0 { -direction } else { direction };
    let one = unit(n)?;
    let apart = |p: [DVec2; 2]| Some(one.meet(camera.ray(p[0]))?.distance(one.meet(camera.ray(p[1]))?));
    let Some(found) = apart(between).filter(|d| *d > 1e-6) else {
        let text = between.map(|p| format!("{:.0},{:.0}", p.x, p.y)).join(" and ");
        let hint = "give two points on the table that are far from each other, and a tilt with which both are seen \
                    from above";
        return Err(Error::usage(format!("the points {text} have no distance on such a plane"), hint));
    };
    if !(length > 0.0 && length.is_finite()) {
        return Err(Error::usage(format!("a distance of {length} m"), "give a length above 0"));
    }
    let mut square = 0.0;
    for k in 0..4 {
        let mut moved = between;
        moved[k / 2][k % 2] += click;
        square += apart(moved).map_or(1.0, |d| (d / found - 1.0).powi(2));
    }
    let plane = one.scaled(length / found);
    Ok(FoundPlane { length_deviation: Some(square.sqrt()), ..FoundPlane::given(plane) })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera { fx: 600.0, fy: 610.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };

    #[test]
    fn rays_meet_the_plane_and_the_normal_looks_at_the_camera() {
        let plane = Plane::new(DVec3::new(0.0, 0.1, 1.0), DVec3::new(0.0, 0.4, 2.0)).unwrap();
        assert!(plane.normal.z < 0.0 && (plane.normal.length() - 1.0).abs() < 1e-15);
        let p = plane.meet(CAMERA.ray(DVec2::new(100.0, 400.0))).unwrap();
        assert!(plane.normal.dot(p - plane.point).abs() < 1e-12);
        assert!(plane.meet(DVec3::NEG_Z).is_none());
        let [x, y] = plane.axes();
        assert!(x.dot(plane.normal).abs() < 1e-15 && y.dot(plane.normal).abs() < 1e-15 && y.y > 0.9);
        assert!((x.cross(y) + plane.normal).length() < 1e-12);
        assert!(Plane::new(DVec3::Z, DVec3::ZERO).is_err() && Plane::new(DVec3::Z, DVec3::X).is_err());
        assert!(Plane::new(DVec3::new(f64::NAN, 0.0, 1.0), DVec3::Z).is_err());
        assert!((plane.scaled(1e3).point / 1e3 - plane.point).length() < 1e-12);
    }

    #[test]
    fn a_plane_seen_along_itself_is_refused() {
        let plane = Plane::new(DVec3::new(0.0, 0.05, 1.0), DVec3::new(0.0, -1.0, 0.01)).unwrap();
        let text = plane.check_seen(&CAMERA, DVec2::new(319.5, 270.0)).unwrap_err().to_string();
        assert!(text.contains("edge-on") && text.contains("5.7° at least"), "{text}");
        assert!(plane.check_seen(&CAMERA, DVec2::new(319.5, 420.0)).is_ok());
    }

    #[test]
    fn one_distance_and_the_tilt_give_the_plane() {
        let truth = Plane::new(DVec3::new(0.1, 0.0, 0.9), DVec3::new(0.1, -0.6, -1.0)).unwrap();
        let seen = [DVec2::new(150.0, 120.0), DVec2::new(500.0, 300.0)];
        let [a, b] = seen.map(|p| truth.meet(CAMERA.ray(p)).unwrap());
        for normal in [truth.normal, truth.normal * -3.0] {
            let found = from_distance(&CAMERA, normal, seen, a.distance(b), 1.0).unwrap();
            assert!((found.plane.normal - truth.normal).length() < 1e-12);
            assert!(found.plane.normal.dot(found.plane.point - truth.point).abs() < 1e-12);
            let part = found.length_deviation.unwrap();
            assert!(part > 1e-3 && part < 1e-2, "{part}");
        }
        assert!(from_distance(&CAMERA, truth.normal, [seen[0]; 2], 0.4, 1.0).is_err());
        assert!(from_distance(&CAMERA, truth.normal, seen, -0.4, 1.0).is_err());
        assert!(from_distance(&CAMERA, DVec3::ZERO, seen, 0.4, 1.0).is_err());
    }
}
