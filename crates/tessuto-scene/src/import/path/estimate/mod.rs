//! Where the camera was, from what stands still around the fabric: by the clip alone, by the program COLMAP, or refined
//! from poses that are given.
//!
//! Windows with texture are followed through the frames, and the poses and depths are found that explain best where
//! they were seen. A hand that shakes moves a camera by a centimetre; whether windows shift against each other by
//! that, and how far the camera moved thus, is only told where it is more than the noise. Else rotations are.

mod bundle;
mod colmap;
mod features;
mod fits;
#[cfg(test)]
mod made;
mod observed;
mod patch;
mod refine;
mod resect;
mod smooth;
mod solve;
mod start;
mod surroundings;
mod track;
mod turn;

use std::path::Path;

use super::{CameraPath, Entry};
use bundle::Freedom;
use refine::{Refined, refine};
use solve::{Found, solve};
use tessuto_core::camera::{Camera, Pose};
use tessuto_core::error::{Error, Hint, Remedy, Result};
use track::{Followed, follow};

pub use colmap::estimate as by_colmap;
pub use fits::{FrameFit, Known, Mistake, PoseFit, pose_fit};

/// Fewest windows that a frame must share with others, and how far they must spread in both directions, standard
/// deviation as a part of the image's side.
const FEWEST: usize = 30;
const WIDEST: f64 = 0.1;
/// What is left of the place of a window is at most this part of the image's width.
const LEFT: f64 = 1.0 / 400.0;
/// Most of the windows must stand still.
const STILL: f64 = 0.5;

/// Finds where the camera was in the frames of the scene in `folder`, which has masks; `said` hears of every frame.
/// Also says what was found, in words.
///
/// # Errors
/// [`Error::Input`] where too little is seen around the fabric, or too little of that stands still.
pub fn from_clip(
    folder: &Path,
    camera: &Camera,
    frames: usize,
    said: &(dyn Fn(&str) + Sync),
) -> Result<(CameraPath, String)> {
    let followed = follow(folder, camera, frames, said)?;
    enough(camera, &followed, frames, &hint)?;
    said("the camera's poses");
    let found = solve(camera, &followed, frames);
    let text = checked(camera, &found)?;
    let entry = |camera_from_world: Pose| Entry { name: None, number: None, camera_from_world };
    let path = CameraPath {
        place: "the clip".to_owned(),
        entries: found.poses.into_iter().map(entry).collect(),
        metric: found.freedom != Freedom::All,
        up: None,
    };
    Ok((path, text))
}

/// Refines the poses of `path`, one of each frame of the scene in `folder`, which has masks, by what stands still
/// around the fabric. Also says what became better, in words.
///
/// # Errors
/// [`Error::Input`] where too little is seen around the fabric.
pub fn refined(
    path: CameraPath,
    folder: &Path,
    camera: &Camera,
    said: &(dyn Fn(&str) + Sync),
) -> Result<(CameraPath, String)> {
    let given: Vec<Pose> = path.entries.iter().map(|entry| entry.camera_from_world).collect();
    let followed = follow(folder, camera, given.len(), said)?;
    let hint = || Hint::from("film more of what stands still, or take the poses as they are given");
    enough(camera, &followed, given.len(), &hint)?;
    said("the camera's poses");
    let Refined { poses, better, windows: [still, all], left: [before, after] } =
        refine(camera, &followed, &given);
    let of = format!("{still} of {all} places around the fabric");
    if !better {
        let text =
            format!("poses are kept as given: they explain {of} to {before:.2} px, refined ones no better");
        return Ok((path, text));
    }
    let far = poses
        .iter()
        .zip(&given)
        .map(|(a, b)| a.apart(b))
        .fold([0.0; 2], |most: [f64; 2], way| [most[0].max(way[0]), most[1].max(way[1])]);
    let text = format!(
        "poses are refined by {of}, which they explain to {after:.2} px, before to {before:.2} px: by up to {:.2}° and \
         {:.4} {}",
        far[0].to_degrees(),
        far[1],
        if path.metric { "m" } else { "units" }
    );
    let entries = path.entries.iter().zip(poses);
    let entries = entries.map(|(entry, camera_from_world)| Entry { camera_from_world, ..entry.clone() });
    Ok((CameraPath { entries: entries.collect(), ..path }, text))
}

/// The same of poses that are good enough as they are: where too little is seen, they are kept, and the words say so.
pub fn refined_or_not(
    path: CameraPath,
    folder: &Path,
    camera: &Camera,
    said: &(dyn Fn(&str) + Sync),
) -> (CameraPath, String) {
    let kept = path.clone();
    refined(path, folder, camera, said)
        .unwrap_or_else(|error| (kept, format!("the poses are not refined: {error}")))
}

fn hint() -> Hint {
    Hint::from("film more of what stands still, or give poses").with(Remedy::Poses)
}

/// Refuses frames that share too little with others.
fn enough(camera: &Camera, followed: &Followed, frames: usize, hint: &dyn Fn() -> Hint) -> Result<()> {
    let mut seen = vec![Vec::new(); frames];
    for track in &followed.tracks {
        seen[track.host].push(track.at);
        track.seen.iter().for_each(|(n, at)| seen[*n].push(*at));
    }
    for (n, places) in seen.iter().enumerate() {
        let count = places.len();
        let refused = |problem: String| Err(Error::input(format!("rgbs/rgb_{n:03}"), problem, hint()));
        if count < FEWEST {
            return refused(format!(
                "shows {count} places around the fabric that other frames show, too, not {FEWEST}"
            ));
        }
        let mean = places.iter().sum::<glam::DVec2>() / count as f64;
        let squares = places.iter().map(|p| (*p - mean) * (*p - mean)).sum::<glam::DVec2>() / count as f64;
        let spread = [squares.x.sqrt() / camera.width as f64, squares.y.sqrt() / camera.height as f64];
        if spread.iter().any(|s| *s < WIDEST) {
            let [x, y] = spread.map(|s| (100.0 * s).round());
            return refused(format!(
                "shows places around the fabric that spread over {x} % of its width and {y} % of its height, not {} %",
                100.0 * WIDEST
            ));
        }
    }
    Ok(())
}

/// Refuses what does not stand still; what was found, in words.
fn checked(camera: &Camera, found: &Found) -> Result<String> {
    let Found { poses, freedom, windows: [still, all], left, parallax } = found;
    let most = LEFT * camera.width as f64;
    if *left > most || (*still as f64) < STILL * *all as f64 {
        let problem = format!(
            "does not stand still: {still} of {all} places follow one motion of the camera, to {left:.2} px (at least \
             half, to {most:.2} px)"
        );
        return Err(Error::input("what is around the fabric", problem, hint()));
    }
    let turned = poses.iter().map(|pose| pose.apart(&poses[0])[0].to_degrees()).fold(0.0, f64::max);
    let of = format!(
        "the camera's motion is from {still} of {all} places around the fabric, each known to {left:.2} px"
    );
    Ok(match freedom {
        Freedom::Still | Freedom::Depths => format!("{of}: it stands still"),
        Freedom::Turns => format!(
            "{of}: it turns by up to {turned:.2}°. They do not shift against each other by more than that, so it is \
             treated as standing at one place"
        ),
        Freedom::All => format!(
            "{of}: it turns by up to {turned:.2}°, and its translation shifts them against each \
             other by {parallax:.2} px"
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    #[test]
    fn too_little_and_what_moves_by_itself_are_refused() {
        let (camera, tracks, truth) = made::tracks(6, 6, 120, 0, 0.1);
        let turns = vec![glam::DMat3::IDENTITY; 6];
        let mut followed = Followed { tracks, turns };
        assert!(enough(&camera, &followed, 6, &hint).is_ok());
        // All of it in one corner.
        let corner = |at: DVec2| DVec2::new(0.05 * at.x, at.y);
        for track in &mut followed.tracks {
            track.at = corner(track.at);
            track.seen.iter_mut().for_each(|(_, at)| *at = corner(*at));
        }
        let text = enough(&camera, &followed, 6, &hint).unwrap_err().to_string();
        assert!(text.contains("rgbs/rgb_000") && text.contains("2 % of its width"), "{text}");
        followed.tracks.truncate(40);
        followed.tracks.iter_mut().for_each(|track| track.seen.retain(|(n, _)| *n != 3));
        let text = enough(&camera, &followed, 6, &hint).unwrap_err().to_string();
        assert!(text.contains("places around the fabric") && text.contains("poses"), "{text}");
        let found = |still: usize, left: f64| Found {
            poses: truth.poses.clone(),
            freedom: Freedom::All,
            windows: [still, 100],
            left,
            parallax: 0.4,
        };
        assert!(checked(&camera, &found(90, 0.1)).unwrap().contains("0.40 px"));
        for (still, left) in [(40, 0.1), (90, 2.0)] {
            let text = checked(&camera, &found(still, left)).unwrap_err().to_string();
            assert!(text.contains("does not stand still") && text.contains("give poses"), "{text}");
        }
    }
}
