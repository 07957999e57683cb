//! `tessuto template`.

mod arguments;
mod depth;
mod mesh;
mod table;
mod view;

use std::path::Path;

use tessuto::io::scene::{TemplateRecord, replace_camera, set_planes, write_template};
use tessuto::output::manifest;
use tessuto::template::table::Plane;
use tessuto::template::{gate, overlap_with_mask};
use tessuto::text::quoted;
use tessuto::{Error, Mesh, Result};

pub use arguments::Arguments;
use mesh::{flat, from_mesh};
use view::{View, view};

use crate::say::say;

/// A template, and what is known of its making.
struct Made {
    /// Of lengths in metres.
    mesh: Mesh,
    record: TemplateRecord,
    /// What template.obj says of a rectangle that does not fit `[px]`.
    misfit: Option<f64>,
    /// The table that the fabric lies on, in the scene's unit of length.
    table: Option<Plane>,
    /// Lengths are in the file's unit: a mesh is changed as it is.
    raw: bool,
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
            let hint = "name a scene folder, or an image with --mask FILE, a camera and --out FILE.obj";
            return Err(Error::usage(problem, hint).into());
        }
    };
    if out.exists() && !arguments.force {
        let hint = "add --force to replace it, or write elsewhere with --out";
        return Err(
            Error::input(out.display().to_string(), "already exists and would be replaced", hint).into()
        );
    }
    let mut view = view(arguments, scene)?;
    let mut made = match (arguments.flat, &arguments.depth) {
        (Some(size), _) => {
            let mut made = flat(arguments, &mut view, size)?;
            if arguments.table.on_table {
                made.table = Some(table::below(&made.mesh)?.scaled(1.0 / view.metres));
            }
            made
        }
        _ if arguments.table.on_table => table::on_table(arguments, &mut view, scene)?,
        (None, Some(path)) => depth::from_depth(arguments, &mut view, path)?,
        (None, None) => from_mesh(arguments, scene)?,
    };
    let mask = view.mask.as_ref().map(|(mask, _)| mask);
    let mut metres = made.mesh.clone();
    if made.raw {
        metres.positions.iter_mut().for_each(|p| *p *= view.metres);
        made.record.overlap = mask.map(|mask| overlap_with_mask(&metres, &view.camera, mask));
    } else {
        made.record.overlap = gate::check_place(&metres, &view.camera, mask)?;
        made.mesh.positions.iter_mut().for_each(|p| *p /= view.metres);
    }
    let own = scene && arguments.out.is_none();
    write(&out, &made, own.then_some((&*arguments.target, &view)))?;
    say!("{}: {} vertices, {} faces", out.display(), made.mesh.positions.len(), made.mesh.faces.len());
    if let Some(plane) = &made.table {
        table::say_plane(plane);
    }
    if let Some(overlap) = made.record.overlap {
        let expected = if overlap < 0.85 { ", 0.85 expected" } else { "" };
        say!("overlap with the mask of the first frame: {overlap:.3}{expected}");
    }
    if scene && mask.is_some() {
        say!("next: tessuto check {} --picture check.png", quoted(&arguments.target));
    }
    Ok(())
}

/// Writes the template; in a scene of its own also what is known of it, and the camera that was found with it.
fn write(out: &Path, made: &Made, scene: Option<(&Path, &View)>) -> Result<()> {
    keep_foreign(out)?;
    write_template(out, &made.mesh, made.misfit)?;
    manifest::record(&[out])?;
    let Some((folder, view)) = scene else { return Ok(()) };
    let record = folder.join(TemplateRecord::NAME);
    keep_foreign(&record)?;
    made.record.write(folder)?;
    let mut written = vec![record];
    let path = folder.join("scene.json");
    if made.record.camera.is_some() || made.table.is_some() {
        let before = std::fs::read(&path).map_err(|source| Error::Output { path: path.clone(), source })?;
        if keep_foreign(&path)? {
            tessuto::io::atomic_write(&path, &before)?;
        }
        written.push(path);
    }
    if let Some(camera) = &made.record.camera {
        let doubt = camera.interval.map(|[low, high]| (high - low) / (camera.fx + camera.fy));
        replace_camera(folder, &view.camera, &camera.source, doubt)?;
    }
    if let Some(table) = &made.table {
        let Plane { point, normal } = table.scaled(view.metres);
        set_planes(folder, &[tessuto::Plane { normal, height: normal.dot(point) }])?;
    }
    manifest::record(&written)
}

/// Renames a file that tessuto did not write, or that was changed since: it is not lost.
fn keep_foreign(out: &Path) -> Result<bool> {
    if manifest::check_parts(&[out], true).is_ok() {
        return Ok(false);
    }
    let ending = out.extension().unwrap_or_default().to_string_lossy().into_owned();
    let place = |n: usize| out.with_extension(format!("before{n}.{ending}"));
    let kept = (1..).map(place).find(|path| path.symlink_metadata().is_err()).expect("names do not end");
    std::fs::rename(out, &kept).map_err(|source| Error::Output { path: kept.clone(), source })?;
    say!("note: {} is kept as {}", out.display(), kept.display());
    Ok(true)
}
