//! Further cameras that filmed the same: each clip is imported into a folder of its name within the scene's.

use std::path::Path;

use super::frames::Source;
use super::moving::inputs;
use super::path::{self, CameraPath, Inputs};
use super::{Imported, Settings, import};
use crate::io::scene::{ListedView, write_poses, write_views};
use tessuto_core::camera::{Camera, Pose};
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::scene::PoseUnit;

/// A clip of a further camera, and where that is.
#[derive(Debug, Clone)]
pub struct ViewSettings {
    /// Its name, and that of its folder.
    pub name: String,
    /// Clip, masks and lens, and whether a path is refined; all else is as in the scene's settings.
    pub settings: Settings,
    /// Where it is.
    pub place: Place,
    /// How much later than the scene's own camera it took its frames `[s]`.
    pub late: f64,
}

/// Where a further camera is.
#[derive(Debug, Clone, PartialEq)]
pub enum Place {
    /// Fixed to the scene's own camera: from that one's frame to its own, in a unit of length that is scaled as those
    /// of the scene's poses are.
    Fixed(Pose),
    /// As a file says, in the world of the scene's own poses.
    Path(CameraPath),
}

/// Rates of two clips may differ by this fraction.
const SAME_RATE: f64 = 1e-3;

/// Imports the further cameras of `settings` into `folder`, where the scene was `imported`, whose own camera has these
/// `poses` in the world of their file.
///
/// # Errors
/// Those of importing a clip; [`Error::Usage`] for a name that is no folder's, or is taken; [`Error::Input`] for clips
/// of other lengths or rates.
pub(super) fn write(
    settings: &Settings,
    imported: &mut Imported,
    poses: Option<&[Pose]>,
    folder: &Path,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<()> {
    let mut listed = Vec::new();
    for view in &settings.views {
        let own = folder.join(&view.name);
        let plain = |c: char| c.is_alphanumeric() || "-_".contains(c);
        if view.name.is_empty() || !view.name.chars().all(plain) || own.exists() {
            let hint = "give each view a name of its own, of letters, digits, - and _, such as right";
            return Err(Error::usage(format!("a view's name is \"{}\"", view.name), hint));
        }
        std::fs::create_dir(&own).map_err(|source| Error::Output { path: own.clone(), source })?;
        let of_view = |error: Error| error.within(&format!("view {}", view.name));
        let found = import(&view.settings, &view.name, &own, progress).map_err(of_view)?;
        expect_same(imported, &found, view)?;
        let mut notes = found.notes;
        let written = Written { folder: &own, camera: &found.camera, frames: found.frames, said: progress };
        let (there, unit) = placed(view, poses, &written, &mut notes).map_err(of_view)?;
        write_poses(&own, &there, unit)?;
        let manifest = own.join("scene.json");
        std::fs::remove_file(&manifest).map_err(|source| Error::Output { path: manifest, source })?;
        imported.notes.extend(notes.iter().map(|note| format!("view {}: {note}", view.name)));
        let [angle, way] = there[0].apart(&Pose::IDENTITY);
        imported.notes.push(format!(
            "view {} stands {way:.3} {} from the first camera and is turned by {:.1}°",
            view.name,
            unit.name(),
            angle.to_degrees()
        ));
        listed.push(ListedView {
            name: view.name.clone(),
            camera: found.camera,
            depth: false,
            late: view.late,
        });
    }
    if listed.is_empty() { Ok(()) } else { write_views(folder, &listed) }
}

/// Refuses a clip that cannot be of the same moments.
fn expect_same(first: &Imported, other: &Imported, view: &ViewSettings) -> Result<()> {
    let fail = |problem: String| {
        let hint =
            Hint::from("cut both clips to the same moments, frame by frame").with(Remedy::Frames(None));
        Err(Error::input(format!("view {}", view.name), problem, hint))
    };
    if other.frames != first.frames {
        return fail(format!("has {} frames, the first camera {}", other.frames, first.frames));
    }
    if (other.fps / first.fps - 1.0).abs() > SAME_RATE {
        return fail(format!("has {} frames per second, the first camera {}", other.fps, first.fps));
    }
    Ok(())
}

/// A view that was written.
struct Written<'a> {
    folder: &'a Path,
    camera: &'a Camera,
    frames: usize,
    /// Hears of every step.
    said: &'a (dyn Fn(&str) + Sync),
}

/// Where a view's camera is in every frame, or in all, in the world of the scene, and the unit of that. A path that is
/// to be refined is laid on the given one as a whole, so it stays in the world of the first camera's.
fn placed(
    view: &ViewSettings,
    first: Option<&[Pose]>,
    written: &Written,
    notes: &mut Vec<String>,
) -> Result<(Vec<Pose>, PoseUnit)> {
    let back = first.map_or(Pose::IDENTITY, |poses| poses[0].inverse());
    match &view.place {
        Place::Fixed(pose) => {
            let scale = view.settings.pose_scale.unwrap_or(1.0);
            let pose = Pose { translation: pose.translation * scale, ..*pose };
            let moving = first.unwrap_or(&[]).iter().map(|first| pose.after(first).after(&back));
            let poses = if first.is_some() { moving.collect() } else { vec![pose] };
            Ok((poses, PoseUnit::Metres))
        }
        Place::Path(path) => {
            let (settings, unit) = (&view.settings, path.unit(&view.settings));
            let source = Source::open(settings, &mut Vec::new())?;
            let start = settings.frames.as_ref().map_or(0, |range| range.start);
            let (inputs, chosen) = match path.len() {
                1 => (Inputs { names: None, count: 1 }, vec![0]),
                read => {
                    let chosen = (0..written.frames).map(|k| start + k * settings.stride).collect();
                    (inputs(settings, &source, read, path)?, chosen)
                }
            };
            let mut path = path.of(&inputs, &chosen)?;
            if settings.refine_poses && path.moves() {
                let found = path::refined(path, written.folder, written.camera, written.said)?;
                notes.push(found.1);
                path = found.0;
            }
            let (poses, _) = path.poses(settings);
            Ok((poses.iter().map(|pose| pose.after(&back)).collect(), unit))
        }
    }
}
