//! How a camera in the hand moves about a sheet.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec3};

use super::settings::Settings;
use tessuto_core::camera::Pose;
use tessuto_core::math::rng::Rng;

/// Random stream of the path.
const STREAM: u64 = 700;
/// Waves that a hand's shaking is made of, and their frequencies, from and to [1/s]: a hand sways and trembles.
const WAVES: usize = 4;
const FREQUENCIES: [f64; 2] = [0.4, 4.0];
/// Rotation of a hand that shakes, over the way that it does [rad/m]: 1° and 1 cm.
const TURN: f64 = 1.745;

/// Where the camera is in every frame; `None` if it stands still. It goes around `centre` `[m]`, which it keeps in the
/// same place of its image, by `settings.orbit`, and shakes by `settings.shake`, the root mean square of its way from
/// where it would be.
pub fn poses(settings: &Settings, centre: DVec3) -> Option<Vec<Pose>> {
    if settings.orbit == 0.0 && settings.shake == 0.0 {
        return None;
    }
    let mut rng = Rng::new(settings.seed, STREAM);
    // Ways along and turns about three axes: phases of waves.
    let [low, high] = FREQUENCIES;
    let shakes: Vec<[(f64, f64); WAVES]> = (0..6)
        .map(|_| {
            std::array::from_fn(|k| {
                let at = (k as f64 + rng.uniform()) / WAVES as f64;
                (low * (high / low).powf(at), rng.uniform())
            })
        })
        .collect();
    // Slow waves are the larger ones, as a walk's are.
    let weight = |frequency: f64| 1.0 / frequency;
    let shake = |of: &[(f64, f64); WAVES], t: f64| {
        let total: f64 = of.iter().map(|(f, _)| weight(*f).powi(2)).sum::<f64>().sqrt();
        let wave = |(f, phase): &(f64, f64)| weight(*f) * (TAU * (f * t + phase)).sin();
        // Three axes of sines together: the root mean square of their way is √(3/2).
        of.iter().map(wave).sum::<f64>() / total * (2.0 / 3.0f64).sqrt()
    };
    let pose = |n: usize| {
        let (t, part) = (n as f64 / settings.fps, n as f64 / (settings.frames - 1) as f64);
        // Around the sheet, slow at both ends.
        let angle = settings.orbit.to_radians() * part * part * (3.0 - 2.0 * part);
        let turn = DMat3::from_rotation_y(angle);
        let orbit = Pose { rotation: turn, translation: centre - turn * centre };
        let [x, y, z, a, b, c] =
            [0, 1, 2, 3, 4, 5].map(|k| settings.shake * (shake(&shakes[k], t) - shake(&shakes[k], 0.0)));
        let rotation = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(a, b, c) * TURN));
        Pose { rotation, translation: DVec3::new(x, y, z) }.after(&orbit)
    };
    Some((0..settings.frames).map(pose).collect())
}

/// Where camera `v` stands, 0 the first: as far from `centre` `[m]` as that, `settings.apart` farther around it than
/// the one before.
pub fn beside(settings: &Settings, v: usize, centre: DVec3) -> Pose {
    let turn = DMat3::from_rotation_y((v as f64 * settings.apart).to_radians());
    Pose { rotation: turn, translation: centre - turn * centre }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_around_the_sheet_and_shakes_as_far_as_it_should() {
        let centre = DVec3::new(0.1, 0.0, 1.2);
        assert!(poses(&Settings::default(), centre).is_none());
        let orbit = poses(&Settings { orbit: 25.0, ..Settings::default() }, centre).unwrap();
        assert_eq!(orbit[0], Pose::IDENTITY);
        let last = orbit.last().unwrap();
        assert!((last.apart(&orbit[0])[0].to_degrees() - 25.0).abs() < 1e-6);
        for pose in &orbit {
            assert!((pose.rotation * centre + pose.translation - centre).length() < 1e-12);
        }
        let long = Settings { shake: 0.01, frames: 4000, ..Settings::default() };
        let shaken = poses(&long, centre).unwrap();
        let ways = shaken.iter().map(|pose| pose.translation);
        let mean = ways.clone().sum::<DVec3>() / 4000.0;
        let spread = (ways.map(|way| way.distance_squared(mean)).sum::<f64>() / 4000.0).sqrt();
        println!("shakes by {spread} m");
        assert!((spread / 0.01 - 1.0).abs() < 0.15);
        assert_eq!(shaken[0], Pose::IDENTITY);
        assert_eq!(shaken, poses(&long, centre).unwrap());
    }
}
