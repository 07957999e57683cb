//! Whether a camera that moves was where its poses say: what stands still around the fabric has to follow them.

use super::findings::{doubt, ok};
use super::{Finding, Level};
use tessuto_core::camera::Pose;
use tessuto_core::error::{Hint, Remedy, Result};
use tessuto_core::scene::Scene;
use tessuto_estimate::import::{Known, pose_fit};
use tessuto_estimate::io::image;
use tessuto_estimate::io::scene::{FrameFiles, frame_files};

/// A finding about every camera that moves.
///
/// # Errors
/// Those of reading frames.
pub(super) fn findings(scene: &Scene) -> Result<Vec<Finding>> {
    let further = scene.more.iter().map(|view| (format!("poses of {}", view.name), &view.poses[..]));
    let own = scene.poses.iter().map(|poses| ("poses".to_owned(), &poses[..]));
    // The scene's own camera is number 0 whether it moves or not.
    let all = own.map(|own| (0, own)).chain((1..).zip(further));
    let moving: Vec<_> = all.filter(|(_, (_, poses))| poses.iter().any(|pose| *pose != poses[0])).collect();
    if moving.is_empty() {
        return Ok(Vec::new());
    }
    // A scene in memory holds what its crop shows alone, without what is around the fabric.
    let files = match scene.folder.join("scene.json").is_file() {
        true => frame_files(&scene.folder)?,
        false => Vec::new(),
    };
    moving.into_iter().map(|(v, (what, poses))| finding(scene, what, poses, files.get(v))).collect()
}

fn finding(scene: &Scene, what: String, poses: &[Pose], files: Option<&FrameFiles>) -> Result<Finding> {
    let first = scene.first_frame;
    let [turned, moved] = farthest(poses);
    let detail = format!(
        "{} poses: the camera moves by up to {moved:.3} {} and turns by up to {:.1}° from where it is in frame {first}",
        poses.len(),
        scene.pose_unit.name(),
        turned.to_degrees()
    );
    let Some(files) = files.filter(|files| files.colours.len() >= first + poses.len()) else {
        return Ok(ok(&what, format!("{detail}; what is around the fabric is not at hand to test them")));
    };
    let look =
        |n: usize| Ok((image::read(&files.colours[first + n])?, image::read_grey(&files.masks[first + n])?));
    let mut fit = pose_fit(&files.camera, poses, Known::All, &look)?;
    fit.frames.iter_mut().for_each(|frame| frame.frame += first);
    let detail = format!("{detail}; {}", fit.sentence());
    let found = match (fit.doubt(), fit.mistake) {
        (None, _) => ok(&what, detail),
        (Some(why), Some(_)) => doubt(&what, detail, why),
        (Some(why), None) => {
            let hint = Hint::from(format!("{why}; if they are right, but not exact, refine them"));
            doubt(&what, detail, hint.with(Remedy::RefinePoses))
        }
    };
    debug_assert!(found.level != Level::Error);
    Ok(found)
}

/// How far the camera is turned `[rad]` and moved at most from where it is in the first frame.
fn farthest(poses: &[Pose]) -> [f64; 2] {
    let ways = poses.iter().map(|pose| pose.apart(&poses[0]));
    ways.fold([0.0; 2], |most: [f64; 2], way| [most[0].max(way[0]), most[1].max(way[1])])
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use tempfile::TempDir;

    use super::*;
    use crate::check::check_folder;
    use tessuto_core::scene::PoseUnit;
    use tessuto_estimate::io::scene::{LoadOptions, write_poses};
    use tessuto_estimate::synth::{self, Settings};

    /// A clip of a camera that goes around the sheet in a hand, and its poses.
    fn filmed(seed: u64, views: usize) -> (TempDir, Vec<Pose>) {
        let settings = Settings::default().with(|s| {
            (s.frames, s.size, s.grid, s.seed, s.views) = (10, 240, [9, 9], seed, views);
            (s.orbit, s.shake, s.surroundings) = (10.0, 0.005, true);
        });
        let scene = synth::film(&settings).unwrap();
        let folder = tempfile::tempdir().unwrap();
        synth::write::write(folder.path(), &scene, &settings).unwrap();
        (folder, scene.poses.unwrap())
    }

    fn rows(folder: &Path) -> Vec<Finding> {
        let all = check_folder(folder, &LoadOptions::default()).findings;
        all.into_iter().filter(|finding| finding.what.starts_with("poses")).collect()
    }

    #[test]
    fn poses_of_the_clip_pass_and_others_are_doubted() {
        let mut figures = Vec::new();
        for seed in 1..4 {
            let (folder, poses) = filmed(seed, 1);
            let folder = folder.path();
            let row = |poses: &[Pose]| {
                write_poses(folder, poses, PoseUnit::Metres).unwrap();
                let [found] = &rows(folder)[..] else { panic!("one row") };
                found.clone()
            };
            let right = row(&poses);
            println!("{}", right.detail);
            assert!(right.level == Level::Ok && right.detail.starts_with("10 poses: the camera moves by"));
            assert!(right.detail.contains("at most 0."), "{}", right.detail);
            let off = |poses: &[Pose], hint: &str| {
                let found = row(poses);
                assert_eq!(found.level, Level::Warning, "{}", found.detail);
                let told = found.hint.unwrap().to_string();
                assert!(told.contains(hint), "{told}");
                let (_, rest) = found.detail.split_once("fabric is ").unwrap();
                rest.split_once(" px").unwrap().0.parse::<f64>().unwrap()
            };
            let opposite = |pose: &Pose| {
                let mut rows = pose.rows();
                [1, 2, 4, 7, 8, 11].iter().for_each(|k| rows[*k] = -rows[*k]);
                Pose::from_rows(&rows)
            };
            let opengl: Vec<Pose> = poses.iter().map(opposite).collect();
            let shuffled: Vec<Pose> = (0..10).map(|n| poses[(7 * n + 3) % 10]).collect();
            let reversed: Vec<Pose> = poses.iter().rev().copied().collect();
            let inverted: Vec<Pose> = poses.iter().map(Pose::inverse).collect();
            let none = "check that they are this clip's";
            figures.push([
                off(&opengl, "as OpenGL has them"),
                off(&shuffled, none),
                off(&reversed, "they fit"),
                off(&inverted, "camera from world"),
            ]);
        }
        println!("axes, shuffled, reversed, inverted [px]: {figures:?}");
        assert!(figures.iter().flatten().all(|off| *off > 2.0));
    }

    #[test]
    fn lengths_without_a_unit_are_said_so_and_a_rig_that_moves_has_a_row_of_its_own() {
        let (folder, poses) = filmed(2, 2);
        let unitless: Vec<Pose> =
            poses.iter().map(|pose| Pose { translation: 7.0 * pose.translation, ..*pose }).collect();
        write_poses(folder.path(), &unitless, PoseUnit::Unknown).unwrap();
        let [first] = &rows(folder.path())[..] else { panic!("the second camera stands still") };
        println!("{}", first.detail);
        assert!(first.level == Level::Ok && first.detail.contains("units and turns"), "{}", first.detail);
        // The second one's clip does not move, so such poses are not its own.
        write_poses(&folder.path().join("view1"), &unitless, PoseUnit::Unknown).unwrap();
        let [_, second] = &rows(folder.path())[..] else { panic!("two rows") };
        println!("{}", second.detail);
        assert!(second.level == Level::Warning && second.what == "poses of view1", "{second:?}");
        // No template is needed for that.
        std::fs::remove_file(folder.path().join("template.obj")).unwrap();
        assert_eq!(rows(folder.path()).len(), 2);
    }

    #[test]
    fn nothing_is_said_of_a_camera_that_stands_still_and_little_where_nothing_is_around_the_fabric() {
        let make = |orbit: f64| {
            let small = |s: &mut Settings| (s.frames, s.size, s.grid, s.orbit) = (3, 64, [5, 5], orbit);
            let settings = Settings::default().with(small);
            let (folder, scene) = (tempfile::tempdir().unwrap(), synth::make(&settings).unwrap());
            synth::write::write(folder.path(), &scene, &settings).unwrap();
            (rows(folder.path()), findings(&scene).unwrap())
        };
        assert_eq!(make(0.0), (Vec::new(), Vec::new()));
        let (files, memory) = make(10.0);
        assert!(files[0].detail.contains("too little is around the fabric"), "{files:?}");
        assert!(memory[0].detail.contains("not at hand") && memory[0].level == Level::Ok, "{memory:?}");
    }
}
