//! A scene whose camera's poses have no unit, beside a result, which has found how long one is.

use std::borrow::Cow;
use std::path::Path;

use super::read_run;
use tessuto_core::camera::Pose;
use tessuto_core::error::{Error, Result};
use tessuto_core::scene::{PoseUnit, Scene};
use tessuto_estimate::io::scene::read_poses;

/// `scene` with the poses of the result in `folder`, where its own have no unit; as it is where they have.
///
/// # Errors
/// [`Error::Input`] if they have none and no result of these frames says how long one is.
pub(crate) fn in_metres<'a>(scene: Cow<'a, Scene>, folder: &Path) -> Result<Cow<'a, Scene>> {
    if scene.pose_unit != PoseUnit::Unknown {
        return Ok(scene);
    }
    let refused = || {
        let problem = "the poses of its camera have no unit, and no result says how long one is";
        let hint = "name the folder of a result of these frames, whose poses.json is in metres";
        Error::input(scene.folder.display().to_string(), problem, hint)
    };
    let run = read_run(folder)?.ok_or_else(refused)?;
    let found = read_poses(folder, run.frames[1] - run.frames[0])?.ok_or_else(refused)?;
    let first = scene.first_frame.checked_sub(run.frames[0]).ok_or_else(refused)?;
    let poses = found.get(first..first + scene.frames.len()).ok_or_else(refused)?.to_vec();
    Ok(Cow::Owned(with(scene.into_owned(), poses)))
}

/// `scene` whose own camera has these `poses` in metres; further cameras by the same length of a unit.
fn with(mut scene: Scene, poses: Vec<Pose>) -> Scene {
    let pairs = scene.poses.iter().flatten().zip(&poses);
    let sums = pairs.fold([0.0; 2], |[both, own], (given, found)| {
        [both + given.translation.dot(found.translation), own + given.translation.length_squared()]
    });
    let length = if sums[1] > 0.0 { sums[0] / sums[1] } else { 1.0 };
    let further = scene.more.iter_mut().flat_map(|view| &mut view.poses);
    further.for_each(|pose| pose.translation *= length);
    Scene { poses: Some(poses), pose_unit: PoseUnit::Metres, ..scene }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_estimate::synth::{Settings, make};

    #[test]
    fn further_cameras_get_the_same_unit() {
        let small = |s: &mut Settings| {
            (s.frames, s.size, s.grid, s.views) = (3, 48, [5, 5], 2);
            (s.orbit, s.apart) = (10.0, 30.0);
        };
        let metric = make(&Settings::default().with(small)).unwrap();
        let mut scene = Scene { pose_unit: PoseUnit::Unknown, ..metric.clone() };
        let all =
            scene.poses.iter_mut().flatten().chain(scene.more.iter_mut().flat_map(|view| &mut view.poses));
        all.for_each(|pose| pose.translation /= 0.37);
        let found = with(scene, metric.poses.clone().unwrap());
        assert_eq!((&found.poses, found.pose_unit), (&metric.poses, PoseUnit::Metres));
        for (a, b) in found.more[0].poses.iter().zip(&metric.more[0].poses) {
            assert!(a.apart(b).iter().all(|off| *off < 1e-9), "{a:?} {b:?}");
        }
    }
}
