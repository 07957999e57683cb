//! Further cameras on the command line.

use std::path::{Path, PathBuf};

use tessuto::Error;
use tessuto::import::{Masks, Place, Rig, Settings, ViewSettings, expect_files, read_calibration, read_path};

use super::Arguments;

/// The views asked for: all but clip, masks, lens and place as in `settings`.
pub fn asked(
    arguments: &Arguments,
    rig: Option<&Rig>,
    settings: &Settings,
) -> tessuto::Result<Vec<ViewSettings>> {
    let names = |named: &[(String, PathBuf)]| named.iter().map(|(name, _)| name.clone()).collect();
    let all: [(&str, Vec<String>); 4] = [
        ("--view-masks", names(&arguments.view_masks)),
        ("--view-camera", names(&arguments.view_camera)),
        ("--view-poses", names(&arguments.view_poses)),
        ("--view-late", arguments.view_late.iter().map(|(name, _)| name.clone()).collect()),
    ];
    for (option, named) in all {
        if let Some(name) = named.iter().find(|name| arguments.view.iter().all(|(v, _)| v != *name)) {
            return Err(Error::usage(
                format!("{option} names the view {name}, which is not there"),
                format!("add --view {name}=CLIP, or correct the name"),
            ));
        }
    }
    let counted = |rig: &Rig| rig.poses.len() - 1;
    if let Some(found) = rig.map(counted).filter(|found| *found < arguments.view.len()) {
        return Err(Error::usage(
            format!("{} views, but the rig holds {} cameras", arguments.view.len(), found + 1),
            "give the rig of all cameras, the first clip's first, or --view-poses",
        ));
    }
    let of =
        |(k, (name, clip)): (usize, &(String, PathBuf))| view(arguments, rig, settings, (k + 1, name, clip));
    arguments.view.iter().enumerate().map(of).collect()
}

/// View number `k`.
fn view(
    arguments: &Arguments,
    rig: Option<&Rig>,
    settings: &Settings,
    (k, name, clip): (usize, &str, &Path),
) -> tessuto::Result<ViewSettings> {
    let of_view =
        |named: &[(String, PathBuf)]| named.iter().find(|(of, _)| of == name).map(|(_, path)| path.clone());
    let masks = match of_view(&arguments.view_masks) {
        Some(path) => Masks::Path(path),
        None if arguments.alpha => Masks::Alpha,
        None => {
            let hint = format!("add --view-masks {name}=PATH: a folder of images, or a video");
            return Err(Error::usage(format!("the view {name} has no masks"), hint));
        }
    };
    expect_files(&[Some(clip), if let Masks::Path(path) = &masks { Some(path) } else { None }])?;
    let calibration = match of_view(&arguments.view_camera) {
        Some(path) => read_calibration(&path, None)?,
        None => rig.and_then(|rig| rig.cameras[k].clone()).ok_or_else(|| {
            let hint = format!("add --view-camera {name}=FILE, or a --rig that holds the cameras");
            Error::usage(format!("the view {name} has no camera"), hint)
        })?,
    };
    let place = match (of_view(&arguments.view_poses), rig) {
        (Some(path), _) => Place::Path(read_path(&path)?),
        (None, Some(rig)) => Place::Fixed(rig.poses[k]),
        (None, None) => {
            let hint = format!("add --rig FILE, or --view-poses {name}=FILE");
            return Err(Error::usage(format!("where the view {name} stands is not given"), hint));
        }
    };
    let settings = Settings {
        input: clip.to_path_buf(),
        masks,
        calibration,
        poses: None,
        refine_poses: arguments.refine_poses && matches!(place, Place::Path(_)),
        camera_motion: None,
        depths: None,
        template: None,
        plate: None,
        ..settings.clone()
    };
    let late = arguments.view_late.iter().find(|(of, _)| of == name).map_or(0.0, |(_, late)| *late);
    Ok(ViewSettings { name: name.to_owned(), settings, place, late })
}
