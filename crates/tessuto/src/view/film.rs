//! The images of a film: which frame each shows, from where, under which turn of the light.

use std::f64::consts::TAU;
use std::ops::Range;

use tessuto_core::camera::Viewpoint;
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::Positions;
use tessuto_render::pbr::EnvironmentMap;

/// Where it is seen from.
#[derive(Debug, Clone, PartialEq)]
pub enum View {
    /// From the recording camera.
    Original,
    /// From the further camera of this name.
    Camera(String),
    /// Degrees to the left and upwards around the centre of the fabric, at the distance where it fills the image.
    About(f64, f64),
}

/// What goes once around the fabric in the course of a film.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// The camera, to the left: a turntable.
    Camera,
    /// The light, about the camera's vertical, from the left over the camera's side to the right.
    Light,
}

/// One image.
pub(super) struct Shot {
    /// Its number.
    pub number: usize,
    /// The frame of the motion that it shows.
    pub frame: usize,
    pub viewpoint: Viewpoint,
    /// Angle by which the light is turned `[rad]`.
    pub light: f64,
}

/// The images of `frames` of `motion`; `originals` are the views of the recording camera, or of the further one that is
/// asked for, one of each frame of the motion.
/// Without `pictures` there is one per frame, which has its number; else this many, from 0, over which the frames are
/// spread.
///
/// # Errors
/// [`Error::Usage`] for a view straight from above or below, and for a turntable from the recording camera.
pub(super) fn shots(
    motion: &[Positions],
    frames: Range<usize>,
    originals: &[Viewpoint],
    (view, turn, pictures): (&View, Option<Turn>, Option<usize>),
) -> Result<Vec<Shot>> {
    let count = pictures.unwrap_or(frames.len());
    let fraction = |k: usize| k as f64 / count.max(1) as f64;
    let frame_of =
        |k: usize| frames.start + (k * frames.len() / count.max(1)).min(frames.len().saturating_sub(1));
    let camera = originals[0].camera;
    let viewpoints = match (view, turn) {
        (View::Original | View::Camera(_), Some(Turn::Camera)) => {
            return Err(Error::usage(
                "a turntable from the recording camera",
                "it goes around the middle of the fabric: give degrees to start from, such as 0",
            ));
        }
        (View::Original | View::Camera(_), _) => (0..count).map(|k| originals[frame_of(k)]).collect(),
        (View::About(left, up), Some(Turn::Camera)) => {
            // As near as what is shown fits.
            let shown = &motion[frames.clone()];
            let at = |k: usize| {
                Viewpoint::about(shown, camera, left.to_radians() + TAU * fraction(k), up.to_radians())
            };
            Viewpoint::at_one_distance((0..count).map(at).collect::<Result<_>>()?, shown)
        }
        (View::About(left, up), _) => {
            vec![Viewpoint::about(motion, camera, left.to_radians(), up.to_radians())?; count]
        }
    };
    let shot = |(k, viewpoint): (usize, Viewpoint)| Shot {
        number: if pictures.is_some() { k } else { frames.start + k },
        frame: frame_of(k),
        viewpoint,
        light: if turn == Some(Turn::Light) { TAU * fraction(k) } else { 0.0 },
    };
    Ok(viewpoints.into_iter().enumerate().map(shot).collect())
}

/// `light`, turned about the vertical by `angle` `[rad]`, to the nearest column: what was where the camera looks
/// comes to its right.
pub(super) fn turned(light: &EnvironmentMap, angle: f64) -> EnvironmentMap {
    let columns = (angle / TAU * light.width as f64).round() as usize % light.width.max(1);
    let mut texels = light.texels.clone();
    texels.chunks_exact_mut(light.width.max(1)).for_each(|row| row.rotate_right(columns));
    EnvironmentMap { texels, ..*light }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use tessuto_core::camera::{Camera, Pose};

    const CAMERA: Camera = Camera { fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };

    fn motion() -> Vec<Positions> {
        let at = |n: usize| vec![DVec3::new(-0.3, -0.2, 1.0), DVec3::new(0.3, 0.2, 1.0 + 0.1 * n as f64)];
        (0..4).map(at).collect()
    }

    /// A camera that moves to the right, by 0.1 m a frame.
    fn originals() -> Vec<Viewpoint> {
        let pose = |n: usize| Pose { translation: DVec3::X * (-0.1 * n as f64), ..Pose::IDENTITY };
        (0..4).map(|n| Viewpoint { camera: CAMERA, camera_from_world: Some(pose(n)) }).collect()
    }

    #[test]
    fn a_turntable_goes_once_around_at_one_distance() {
        let motion = motion();
        let about = &View::About(0.0, 10.0);
        let film = shots(&motion, 1..3, &originals(), (about, Some(Turn::Camera), Some(8))).unwrap();
        let frames: Vec<usize> = film.iter().map(|s| s.frame).collect();
        assert_eq!(frames, [1, 1, 1, 1, 2, 2, 2, 2]);
        assert_eq!(film.iter().map(|s| s.number).collect::<Vec<_>>(), (0..8).collect::<Vec<_>>());
        let middle = DVec3::new(0.0, 0.0, 1.1);
        let seen: Vec<DVec3> = film.iter().map(|s| s.viewpoint.in_camera(middle)).collect();
        assert!(seen.iter().all(|p| (*p - seen[0]).length() < 1e-9), "{seen:?}");
        let back = film[4].viewpoint.camera_from_world.unwrap().rotation * DVec3::Z;
        assert!(back.z < -0.9, "half of the way around it looks from behind: {back}");
        let inside = film.iter().flat_map(|s| motion[1..3].iter().flatten().map(|x| s.viewpoint.project(*x)));
        assert!(inside.into_iter().all(|p| (0.0..640.0).contains(&p.x) && (0.0..480.0).contains(&p.y)));
        assert!(shots(&motion, 0..4, &originals(), (&View::Original, Some(Turn::Camera), None)).is_err());
    }

    #[test]
    fn the_light_goes_once_around_and_the_frames_keep_their_numbers() {
        let film = shots(&motion(), 1..3, &originals(), (&View::Original, Some(Turn::Light), None)).unwrap();
        let told: Vec<(usize, usize, f64)> = film.iter().map(|s| (s.number, s.frame, s.light)).collect();
        assert_eq!(told, [(1, 1, 0.0), (2, 2, TAU / 2.0)]);
        let eyes: Vec<f64> = film.iter().map(|s| s.viewpoint.eye().x).collect();
        assert_eq!(eyes, [0.1, 0.2], "from where each frame was filmed");
        let mut light = EnvironmentMap::uniform(8, 4, [0.0; 3]);
        let ahead = light.texel_of(DVec3::new(0.1, 0.1, 1.0).normalize());
        light.texels[ahead] = [1.0; 3];
        let quarter = turned(&light, TAU / 4.0);
        assert_eq!(quarter.texels[quarter.texel_of(DVec3::new(1.0, 0.1, -0.1).normalize())], [1.0; 3]);
        assert_eq!(turned(&light, 0.0).texels, light.texels);
    }
}
