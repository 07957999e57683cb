//! The plane of a table from measured depths of the fabric on it.

use glam::{DMat3, DVec2, DVec3};

use super::plane::{FoundPlane, Plane, Residual};
use crate::io::depth::DepthMap;
use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Result};
use tessuto_core::image::Image;
use tessuto_core::math::median::median;

/// Rounds of weighting: the first ones by the absolute error, which bears nearly half of the pixels astray.
const ROUNDS: [usize; 2] = [12, 12];
/// Tukey's constant: errors beyond this many standard deviations do not count.
const TUKEY: f64 = 4.685;
/// Least noise, as a fraction of the distance: maps without any are made ones.
const NOISE: f64 = 1e-6;
/// Fewest measurements.
const FEWEST: usize = 50;
/// A standard deviation from the plane of more than this part of the distance is no flat fabric: phones measure 1 %.
const FLAT: f64 = 0.03;
/// Measurements this near to the mask's border `[px of the map]` see past it.
const BORDER: f64 = 1.5;

/// The plane through what `map`, seen by `sensor`, measured where the `mask` of `camera` at the same place is fabric;
/// `at` `[px of the mask]` is the middle of the fabric.
///
/// # Errors
/// [`Error::Input`] if there are too few measurements, or they are far from any plane.
pub fn from_depth(
    camera: &Camera,
    mask: &Image,
    (map, sensor): (&DepthMap, &Camera),
    at: DVec2,
) -> Result<FoundPlane> {
    let fabric = |p: DVec2| {
        let q = camera.project(sensor.ray(p)).round();
        let within = q.min_element() >= 0.0 && (q.x as usize) < mask.width && (q.y as usize) < mask.height;
        within && mask.pixel(q.x as usize, q.y as usize)[0] >= 0.5
    };
    let around = [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y];
    let measured: Vec<(DVec3, f64)> = (0..map.z.len())
        .filter(|k| !map.z[*k].is_nan())
        .map(|k| (DVec2::new((k % map.width) as f64, (k / map.width) as f64), map.z[k]))
        .filter(|(p, _)| around.iter().all(|d| fabric(*p + *d * BORDER)))
        .map(|(p, z)| (sensor.ray(p), z))
        .collect();
    if measured.len() < FEWEST {
        let problem = format!("measures {} pixels of the fabric, {FEWEST} at least", measured.len());
        let hint = "see whether the depth map is of the first frame, turned as it is, and of the same camera";
        return Err(Error::input("the depth map", problem, hint));
    }
    // A plane is 1/z = a·ray: linear in a, and errors of z are z times as large as those of z (a·ray) − 1.
    let off = |a: DVec3, (ray, z): &(DVec3, f64)| z * a.dot(*ray) - 1.0;
    let mut a = solve(&measured, |_| 1.0).0;
    for _ in 0..ROUNDS[0] {
        a = solve(&measured, |m| 1.0 / off(a, m).abs().max(NOISE)).0;
    }
    let (mut inverse, mut spread) = (DMat3::ZERO, NOISE);
    for _ in 0..ROUNDS[1] {
        let middle = median(measured.iter().map(|m| off(a, m).abs()).collect()).unwrap_or(0.0);
        spread = (1.4826 * middle).max(NOISE);
        let weight = |m: &(DVec3, f64)| (1.0 - (off(a, m) / (TUKEY * spread)).powi(2)).max(0.0).powi(2);
        (a, inverse) = solve(&measured, weight);
    }
    let on: Vec<f64> =
        measured.iter().filter(|m| off(a, m).abs() < TUKEY * spread).map(|m| m.1 * off(a, m)).collect();
    let rms = (on.iter().map(|e| e * e).sum::<f64>() / on.len().max(1) as f64).sqrt();
    let plane =
        (a.is_finite() && a.length() > 0.0).then(|| Plane::new(a / a.length_squared(), a)).transpose()?;
    let Some(plane) = plane.filter(|_| spread <= FLAT) else {
        let problem = format!(
            "the fabric is {:.1} % of its distance off the best plane (standard deviation), {:.0} % at most",
            100.0 * spread,
            100.0 * FLAT
        );
        let hint = "lay the garment flat, or make the template from the depth map itself, which may bend";
        return Err(Error::input("the depth map", problem, hint));
    };
    // Of independent pixels; sensors' errors are not, so this is the least that it can be.
    let covariance = inverse * (spread * spread);
    let ray = camera.ray(at);
    let length = (ray.dot(covariance * ray)).max(0.0).sqrt() * plane.depth(camera, at).unwrap_or(1.0);
    let n = plane.normal;
    let across = DMat3::from_cols(DVec3::X - n * n.x, DVec3::Y - n * n.y, DVec3::Z - n * n.z);
    let turned = across * covariance * across;
    let tilt = (turned.x_axis.x + turned.y_axis.y + turned.z_axis.z).max(0.0).sqrt() / a.length();
    Ok(FoundPlane {
        residual: Some(Residual::Metres(rms)),
        tilt_deviation: Some(tilt),
        length_deviation: Some(length),
        ..FoundPlane::given(plane)
    })
}

/// The solution a of least weighted squares of z (a·ray) − 1, and the inverse of its matrix.
fn solve(measured: &[(DVec3, f64)], weight: impl Fn(&(DVec3, f64)) -> f64) -> (DVec3, DMat3) {
    let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for m in measured {
        let (row, w) = (m.0 * m.1, weight(m));
        matrix += DMat3::from_cols(row * row.x, row * row.y, row * row.z) * w;
        right += row * w;
    }
    let inverse = matrix.inverse();
    (inverse * right, inverse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::depth_unit::Unit;
    use tessuto_core::math::rng::Rng;

    const CAMERA: Camera = Camera { fx: 300.0, fy: 300.0, cx: 159.5, cy: 119.5, width: 320, height: 240 };

    /// A map at half the size, with noise, a part astray and pixels without a measurement.
    fn measured(truth: &Plane, noise: f64, astray: f64) -> (DepthMap, Camera) {
        let sensor = CAMERA.resized([160, 120]);
        let mut rng = Rng::new(11, 0);
        let z = (0..160 * 120).map(|k| {
            let ray = sensor.ray(DVec2::new(f64::from(k % 160), f64::from(k / 160)));
            let there = truth.meet(ray).unwrap().z + noise * rng.normal();
            match rng.uniform() {
                u if u < 0.1 => f64::NAN,
                u if u < 0.1 + astray => there - 0.2 * rng.uniform(),
                _ => there,
            }
        });
        (
            DepthMap {
                width: 160,
                height: 120,
                z: z.collect(),
                unit: Unit { metres: 1.0, told: true },
                channel: None,
            },
            sensor,
        )
    }

    fn mask() -> Image {
        let mut mask = Image::new(320, 240, 1);
        (60..180).for_each(|y| (80..240).for_each(|x| mask.pixel_mut(x, y)[0] = 1.0));
        mask
    }

    #[test]
    fn the_plane_is_found_though_a_third_is_astray() {
        let truth = Plane::new(DVec3::new(0.0, 0.05, 0.8), DVec3::new(0.1, -0.8, -1.0)).unwrap();
        let (map, sensor) = measured(&truth, 2e-3, 0.3);
        let at = DVec2::new(160.0, 120.0);
        let found = from_depth(&CAMERA, &mask(), (&map, &sensor), at).unwrap();
        let angle = found.plane.normal.angle_between(truth.normal);
        let [there, expected] = [found.plane, truth].map(|p| p.depth(&CAMERA, at).unwrap());
        assert!(angle < 3.5 * found.tilt_deviation.unwrap() && angle < 2e-3, "{angle} {found:?}");
        assert!((there / expected - 1.0).abs() < 4.0 * found.length_deviation.unwrap(), "{there} {expected}");
        assert!(
            matches!(found.residual, Some(Residual::Metres(rms)) if rms > 1e-3 && rms < 6e-3),
            "{found:?}"
        );
    }

    #[test]
    fn what_is_no_plane_or_hardly_measured_is_refused() {
        let truth = Plane::new(DVec3::new(0.0, 0.05, 0.8), DVec3::new(0.1, -0.8, -1.0)).unwrap();
        let (mut map, sensor) = measured(&truth, 1e-3, 0.0);
        let bent = map.clone();
        let at = DVec2::new(160.0, 120.0);
        map.z.iter_mut().step_by(2).for_each(|z| *z = f64::NAN);
        map.z[3000..].fill(f64::NAN);
        let text = from_depth(&CAMERA, &mask(), (&map, &sensor), at).unwrap_err().to_string();
        assert!(text.contains("pixels of the fabric, 50 at least"), "{text}");
        let mut rng = Rng::new(2, 0);
        let scattered = DepthMap { z: bent.z.iter().map(|z| z + 0.3 * rng.uniform()).collect(), ..bent };
        let text = from_depth(&CAMERA, &mask(), (&scattered, &sensor), at).unwrap_err().to_string();
        assert!(text.contains("off the best plane") && text.contains("3 % at most"), "{text}");
    }
}
