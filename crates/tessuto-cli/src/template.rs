//! `tessuto template`.

use std::path::{Path, PathBuf};

use clap::Args;
use tessuto::io::scene::first_frame;
use tessuto::io::{image, obj};
use tessuto::output::manifest;
use tessuto::template::fix::Fix;
use tessuto::template::make::{Changes, CornersFrom, from_file, from_rectangle};
use tessuto::template::overlap_with_mask;
use tessuto::template::remesh::Resolution;
use tessuto::text::quoted;
use tessuto::{Camera, Error, Image, Mesh, Result};

use crate::lens::Lens;
use crate::say::say;
use crate::values::{self, Pair};

/// Make or repair the template, the mesh of the fabric in the first frame.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto template scenes/towel --flat 70x50cm --from-mask
  tessuto template scenes/towel --flat 0.7x0.5m --corners 312,208 930,215 941,640 305,622
  tessuto template scenes/flag --remesh 32 --from flag.glb
  tessuto template scenes/flag --flip yz --scale 0.001 --force
  tessuto template first.png --mask mask.png --fov 63 --flat 70x50cm --from-mask --out towel.obj

The size is width along the upper side times height, as measured on the fabric laid flat. Corners are clockwise from
the upper left, as seen in the image. tessuto check SCENE --picture check.png shows the template on the first frame.")]
pub struct Arguments {
    /// Scene folder; or an image of the fabric, with --mask, a camera and --out.
    target: PathBuf,
    /// A flat or nearly flat rectangle of this size, such as 0.7x0.5m, 70x50cm or 700x500mm.
    #[arg(long, value_name = "WxH", value_parser = values::lengths, conflicts_with_all = ["remesh", "from", "scale", "flip", "swap", "weld"])]
    flat: Option<Pair>,
    /// Where its corners are in the first frame [px].
    #[arg(long, value_name = "X,Y", num_args = 4, value_parser = values::point, requires = "flat", allow_negative_numbers = true)]
    corners: Vec<Pair>,
    /// Find the corners in the mask of the first frame, and let the sides follow the mask's outline.
    #[arg(long, requires = "flat", conflicts_with = "corners")]
    from_mask: bool,
    /// Keep the sides straight between the corners.
    #[arg(long, requires = "from_mask")]
    straight: bool,
    /// Vertices along the longer side, or columns x rows.
    #[arg(long, value_name = "N|CxR", value_parser = values::resolution, requires = "flat", default_value = "32")]
    grid: Resolution,
    /// Re-sample a mesh as a regular grid of quads: vertices along the longer side, or columns x rows.
    #[arg(long, value_name = "N|CxR", value_parser = values::resolution)]
    remesh: Option<Resolution>,
    /// The mesh to start from: OBJ, PLY or glTF [default: the scene's template.obj].
    #[arg(long, value_name = "FILE")]
    from: Option<PathBuf>,
    /// Multiply all coordinates, e.g. 0.001 for millimetres.
    #[arg(long, value_name = "FACTOR")]
    scale: Option<f64>,
    /// Negate these coordinates, such as yz.
    #[arg(long, value_name = "AXES", value_parser = values::axes)]
    flip: Option<[bool; 3]>,
    /// Swap two coordinates before that, such as xy.
    #[arg(long, value_name = "AXES", value_parser = values::axes)]
    swap: Option<[bool; 3]>,
    /// Merge vertices that lie at the same place.
    #[arg(long)]
    weld: bool,
    /// Mask of the image, where the first argument is an image.
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    /// File to write [default: the scene's template.obj].
    #[arg(long, value_name = "FILE.obj")]
    out: Option<PathBuf>,
    /// Replace an existing file; one that tessuto did not write is kept under another name.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    lens: Lens,
}

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
    let mut mesh = match arguments.flat {
        Some(size) => flat(arguments, &view, size)?,
        None => from_mesh(arguments, scene)?,
    };
    keep_foreign(&out)?;
    obj::write(&out, &mesh, None)?;
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

fn told(line: String) {
    say!("{line}");
}

/// A rectangle of fabric of `size` `[m]`.
fn flat(arguments: &Arguments, view: &View, size: Pair) -> Result<Mesh> {
    let place = view.mask.as_ref().map_or_else(String::new, |(_, path)| path.display().to_string());
    let corners = match (&view.mask, arguments.from_mask) {
        (Some((mask, _)), true) => CornersFrom::Mask { mask, place: &place, straight: arguments.straight },
        (None, true) => {
            let hint = "add --mask FILE, or give the corners with --corners";
            return Err(Error::usage("--from-mask without a mask", hint));
        }
        _ => {
            let missing = |_| {
                let hint = "add --corners X,Y X,Y X,Y X,Y (clockwise from the upper left), or --from-mask";
                Error::usage("the corners are not given", hint)
            };
            let points = <[Pair; 4]>::try_from(&arguments.corners[..]).map_err(missing)?;
            CornersFrom::Points(points.map(Into::into))
        }
    };
    let mut mesh = from_rectangle(&view.camera, size.into(), arguments.grid, corners, &mut told)?;
    mesh.positions.iter_mut().for_each(|p| *p /= view.metres);
    Ok(mesh)
}

/// A given mesh, changed.
fn from_mesh(arguments: &Arguments, scene: bool) -> Result<Mesh> {
    let nothing = arguments.remesh.is_none()
        && !arguments.weld
        && arguments.scale.is_none()
        && arguments.flip.is_none()
        && arguments.swap.is_none();
    let path = match &arguments.from {
        Some(path) => path.clone(),
        None if nothing => {
            return Err(Error::usage(
                "nothing to do",
                "make a rectangle (--flat WxH --from-mask), re-sample a mesh (--remesh 32 --from FILE), or repair the template (--scale, --flip, --swap, --weld)",
            ));
        }
        None if scene => arguments.target.join("template.obj"),
        None => return Err(Error::usage("the mesh is not given", "add --from FILE")),
    };
    let changes = Changes { fix: fix(arguments)?, weld: arguments.weld, remesh: arguments.remesh };
    from_file(&path, &changes, &mut told)
}

fn fix(arguments: &Arguments) -> Result<Fix> {
    let scale = arguments.scale.unwrap_or(1.0);
    if !(scale > 0.0 && scale.is_finite()) {
        return Err(Error::usage(format!("--scale is {scale}"), "give a factor above 0; mirror with --flip"));
    }
    let swap = match arguments.swap {
        None => None,
        Some(axes) => {
            let chosen: Vec<usize> = (0..3).filter(|k| axes[*k]).collect();
            let pair = <[usize; 2]>::try_from(chosen);
            Some(pair.map_err(|_| Error::usage("--swap needs two axes", "such as xy, xz or yz"))?)
        }
    };
    Ok(Fix { swap, flip: arguments.flip.unwrap_or_default(), scale })
}
