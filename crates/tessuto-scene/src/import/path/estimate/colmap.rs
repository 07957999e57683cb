//! Where the camera was, by the program COLMAP, from what stands still around the fabric.

use std::path::{Path, PathBuf};
use std::process::Command;

use tessuto_core::parallel;

use super::super::{CameraPath, read_path};
use super::surroundings::{find, margin, widened};
use crate::io::image;
use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::image::Image;

/// Most frames of which each is compared with each.
const ALL_PAIRS: usize = 60;
/// Bytes of what the program printed that a message repeats.
const TOLD: usize = 400;

/// One of the program's commands.
struct Step<'a> {
    name: &'a str,
    options: &'a [[&'a str; 2]],
    /// Names of the option that says whether a graphics card is used.
    processor: &'a [String],
}

/// Runs `program` on the frames and masks that the scene in `folder` has, which `camera` sees; `said` hears of every
/// step. Lengths of what it finds have no unit.
///
/// # Errors
/// [`Error::Input`] if the program is not there, or finds no camera; [`Error::Output`].
pub fn estimate(
    program: &Path,
    folder: &Path,
    camera: &Camera,
    frames: usize,
    said: &(dyn Fn(&str) + Sync),
) -> Result<CameraPath> {
    let work = folder.join(".colmap");
    let found = run(program, folder, &work, camera, frames, said);
    let _ = std::fs::remove_dir_all(&work);
    found
}

fn run(
    program: &Path,
    folder: &Path,
    work: &Path,
    camera: &Camera,
    frames: usize,
    said: &(dyn Fn(&str) + Sync),
) -> Result<CameraPath> {
    let [masks, sparse] = ["masks", "sparse"].map(|name| work.join(name));
    for path in [&masks, &sparse] {
        std::fs::create_dir_all(path).map_err(|source| Error::Output { path: path.clone(), source })?;
    }
    said("masks of all but the fabric");
    parallel::try_map(frames, |n| {
        let path = find(folder, &format!("masks/mask_{n:03}"))?;
        let name = find(folder, &format!("rgbs/rgb_{n:03}"))?;
        let name = name.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        image::write_png(&masks.join(format!("{name}.png")), &surroundings(&image::read_grey(&path)?))
    })?;
    let text = |path: &Path| path.display().to_string();
    let (database, images) = (text(&work.join("database.db")), text(&folder.join("rgbs")));
    // Its origin is the corner of the first pixel.
    let lens = format!("{},{},{},{}", camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5);
    let [masks, out] = [&masks, &sparse].map(|path| text(path));
    let matcher = if frames > ALL_PAIRS { "sequential_matcher" } else { "exhaustive_matcher" };
    let extract = [
        ["image_path", &images],
        ["ImageReader.mask_path", &masks],
        ["ImageReader.single_camera", "1"],
        ["ImageReader.camera_model", "PINHOLE"],
        ["ImageReader.camera_params", &lens],
    ];
    let map = [
        ["image_path", &images],
        ["output_path", &out],
        ["Mapper.ba_refine_focal_length", "0"],
        ["Mapper.ba_refine_principal_point", "0"],
        ["Mapper.ba_refine_extra_params", "0"],
    ];
    // Names before and since version 3.12.
    let [extraction, matching] =
        ["Extraction", "Matching"].map(|what| ["Sift", "Feature"].map(|of| format!("{of}{what}.use_gpu")));
    let steps = [
        Step { name: "feature_extractor", options: &extract, processor: &extraction },
        Step { name: matcher, options: &[], processor: &matching },
        Step { name: "mapper", options: &map, processor: &[] },
    ];
    for Step { name: step, options, processor } in steps {
        said(&format!("colmap {step}"));
        let call = |processor: Option<&String>| {
            let mut command = Command::new(program);
            let all = [["database_path", &database]].into_iter().chain(options.iter().copied());
            let all = all.chain(processor.map(|option| [option.as_str(), "0"]));
            // Every option has two dashes.
            command.arg(step).args(all.flat_map(|[option, value]| [format!("--{option}"), value.to_owned()]));
            // It draws nothing here.
            command.env("QT_QPA_PLATFORM", "offscreen");
            command.output().map_err(|e| {
                let hint = Hint::from("install COLMAP, or give its poses").with(Remedy::Poses);
                Error::input(program.display().to_string(), format!("cannot be run: {e}"), hint)
            })
        };
        let mut output = call(processor.first())?;
        if !output.status.success() && processor.len() > 1 {
            output = call(processor.get(1))?;
        }
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr).into_owned()
                + &String::from_utf8_lossy(&output.stdout);
            let last: String =
                said.trim().chars().rev().take(TOLD).collect::<Vec<_>>().into_iter().rev().collect();
            let hint = Hint::from("run it by hand, and give its poses").with(Remedy::Poses);
            return Err(Error::input(format!("colmap {step}"), format!("failed: {last}"), hint));
        }
    }
    largest(&sparse)
}

/// The model with most images.
fn largest(sparse: &Path) -> Result<CameraPath> {
    let entries = std::fs::read_dir(sparse).into_iter().flatten().flatten();
    let mut models: Vec<PathBuf> = entries.map(|entry| entry.path().join("images.bin")).collect();
    models.sort();
    let mut found: Vec<CameraPath> = models.iter().map(|path| read_path(path)).collect::<Result<_>>()?;
    // Of equals the first.
    found.sort_by_key(|path| std::cmp::Reverse(path.len()));
    found.into_iter().next().ok_or_else(|| {
        let hint = Hint::from("film more of what stands still, or give poses").with(Remedy::Poses);
        Error::input("colmap mapper", "finds no camera: the surroundings show too little", hint)
    })
}

/// White where there is no fabric within the margin.
fn surroundings(mask: &Image) -> Image {
    let fabric: Vec<bool> = mask.data.iter().map(|m| *m > 0.0).collect();
    let taken = widened(&fabric, mask.width, margin(mask.width));
    let data = taken.iter().map(|taken| f32::from(u8::from(!taken))).collect();
    Image { width: mask.width, height: mask.height, channels: 1, data }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fabric_and_its_margin_are_black() {
        let mut mask = Image::new(40, 30, 1);
        mask.data[15 * 40 + 20] = 1.0;
        let around = surroundings(&mask);
        assert_eq!(around.data.iter().filter(|v| **v == 0.0).count(), 25);
        assert_eq!(around.data[15 * 40 + 18], 0.0);
    }

    #[test]
    fn a_program_that_is_not_there_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let camera = Camera { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, width: 4, height: 4 };
        let nothing = Path::new("/nowhere/colmap");
        let error = estimate(nothing, folder.path(), &camera, 0, &|_| ()).unwrap_err().to_string();
        assert!(error.contains("/nowhere/colmap") && error.contains("install COLMAP"), "{error}");
        assert!(!folder.path().join(".colmap").exists());
    }
}
