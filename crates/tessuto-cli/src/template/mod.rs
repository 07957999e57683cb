//! `tessuto template`.

mod arguments;
mod mesh;

use std::path::{Path, PathBuf};

use tessuto::io::image;
use tessuto::io::scene::{first_frame, write_template};
use tessuto::output::manifest;
use tessuto::template::overlap_with_mask;
use tessuto::text::quoted;
use tessuto::{Camera, Error, Image, Result};

pub use arguments::Arguments;
use mesh::{flat, from_mesh};

use crate::say::say;

/// What the template is for.
struct View {
    camera: Camera,
    mask: Option<(Image, PathBuf)>,
    /// Metres in one unit of the file to write.
    metres: f64,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let scene = arguments.target.is_dir();
    let out = match (&arguments.out, scene) {
        (Some(out), _) => out.clone(),
        (None, true) => arguments.target.join("template.obj"),
        (None, false) => {
            let problem =
                format!("{} is not a scene folder, and --out is not given", arguments.target.display());
            return Err(Error::usage(
                problem,
                "name a scene folder, or an image with --mask FILE, a camera and --out FILE.obj",
            )
            .into());
        }
    };
    if out.exists() && !arguments.force {
        let hint = "add --force to replace it, or write elsewhere with --out";
        return Err(
            Error::input(out.display().to_string(), "already exists and would be replaced", hint).into()
        );
    }
    let view = view(arguments, scene)?;
    let (mut mesh, misfit) = match arguments.flat {
        Some(size) => flat(arguments, &view, size)?,
        None => from_mesh(arguments, scene)?,
    };
    keep_foreign(&out)?;
    write_template(&out, &mesh, misfit)?;
    manifest::record(&[&out])?;
    mesh.positions.iter_mut().for_each(|p| *p *= view.metres);
    say!("{}: {} vertices, {} faces", out.display(), mesh.positions.len(), mesh.faces.len());
    if let Some((mask, _)) = &view.mask {
        let overlap = overlap_with_mask(&mesh, &view.camera, mask);
        say!(
            "overlap with the mask of the first frame: {overlap:.3}{}",
            if overlap < 0.85 { ", 0.85 expected" } else { "" }
        );
    }
    if scene {
        say!("next: tessuto check {} --picture check.png", quoted(&arguments.target));
    }
    Ok(())
}

/// Renames a mesh that tessuto did not write, or that was changed since: it is not lost.
fn keep_foreign(out: &Path) -> Result<()> {
    if manifest::check_parts(&[out], true).is_ok() {
        return Ok(());
    }
    let place = |n: usize| out.with_extension(format!("before{n}.obj"));
    let kept = (1..).map(place).find(|path| path.symlink_metadata().is_err()).expect("names do not end");
    std::fs::rename(out, &kept).map_err(|source| Error::Output { path: kept.clone(), source })?;
    say!("note: {} is kept as {}", out.display(), kept.display());
    Ok(())
}

fn view(arguments: &Arguments, scene: bool) -> Result<View> {
    if scene {
        let first = first_frame(&arguments.target)?;
        return Ok(View {
            camera: first.camera,
            mask: Some((first.mask, first.mask_path)),
            metres: first.metres,
        });
    }
    let size = image::size(&arguments.target)?;
    let calibration = arguments.lens.calibration()?;
    if !calibration.distortion.is_none() {
        let hint = "import the images first, which removes it, and name the scene folder here";
        return Err(Error::input(&calibration.place, "has lens distortion, which is not removed here", hint));
    }
    let mut notes = Vec::new();
    let camera = calibration.scaled_to(size, &mut notes)?;
    note(&notes);
    let mask = arguments.mask.as_ref().map(|path| {
        let (mask, _) = image::read_mask(path)?;
        if [mask.width, mask.height] != size {
            let problem =
                format!("is {}×{} pixels, but the image {}×{}", mask.width, mask.height, size[0], size[1]);
            return Err(Error::input(path.display().to_string(), problem, "give the mask of this image"));
        }
        Ok((mask, path.clone()))
    });
    Ok(View { camera, mask: mask.transpose()?, metres: 1.0 })
}

fn note(notes: &[String]) {
    notes.iter().for_each(|note| say!("note: {note}"));
}
