//! `tessuto template`.

use std::path::{Path, PathBuf};

use clap::Args;
use tessuto::io::scene::first_frame;
use tessuto::io::{image, model, obj};
use tessuto::mesh::weld;
use tessuto::output::manifest;
use tessuto::template::fix::Fix;
use tessuto::template::outline::Outline;
use tessuto::template::rectangle::{locate, patch};
use tessuto::template::remesh::{Over, Resolution, remesh};
use tessuto::template::{hem::hem, overlap_with_mask};
use tessuto::text::quoted;
use tessuto::{Camera, Error, Image, Mesh, Result};

use crate::lens::Lens;
use crate::say::say;

/// A point [px] or a size.
type Pair = [f64; 2];

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
    #[arg(long, value_name = "WxH", value_parser = parse_size, conflicts_with_all = ["remesh", "from", "scale", "flip", "swap", "weld"])]
    flat: Option<Pair>,
    /// Where its corners are in the first frame [px].
    #[arg(long, value_name = "X,Y", num_args = 4, value_parser = parse_point, requires = "flat", allow_negative_numbers = true)]
    corners: Vec<Pair>,
    /// Find the corners in the mask of the first frame, and let the sides follow the mask's outline.
    #[arg(long, requires = "flat", conflicts_with = "corners")]
    from_mask: bool,
    /// Keep the sides straight between the corners.
    #[arg(long, requires = "from_mask")]
    straight: bool,
    /// Vertices along the longer side, or columns x rows.
    #[arg(long, value_name = "N|CxR", value_parser = parse_resolution, requires = "flat", default_value = "32")]
    grid: Resolution,
    /// Re-sample a mesh as a regular grid of quads: vertices along the longer side, or columns x rows.
    #[arg(long, value_name = "N|CxR", value_parser = parse_resolution)]
    remesh: Option<Resolution>,
    /// The mesh to start from: OBJ, PLY or glTF [default: the scene's template.obj].
    #[arg(long, value_name = "FILE")]
    from: Option<PathBuf>,
    /// Multiply all coordinates, e.g. 0.001 for millimetres.
    #[arg(long, value_name = "FACTOR")]
    scale: Option<f64>,
    /// Negate these coordinates, such as yz.
    #[arg(long, value_name = "AXES", value_parser = parse_axes)]
    flip: Option<[bool; 3]>,
    /// Swap two coordinates before that, such as xy.
    #[arg(long, value_name = "AXES", value_parser = parse_axes)]
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

/// `WxH` with an optional unit; metres.
fn parse_size(text: &str) -> std::result::Result<Pair, String> {
    let hint = "write width x height and the unit, such as 0.7x0.5m, 70x50cm or 700x500mm";
    let units = [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("", 1.0)];
    let (number, scale) = units.iter().find_map(|(u, s)| Some((text.strip_suffix(u)?, *s))).ok_or(hint)?;
    let (w, h) = number.split_once('x').ok_or(hint)?;
    let side =
        |text: &str| text.trim().parse::<f64>().ok().map(|v| v * scale).filter(|v| *v > 0.0 && *v < 1e3);
    Ok([side(w).ok_or(hint)?, side(h).ok_or(hint)?])
}

/// `X,Y`.
fn parse_point(text: &str) -> std::result::Result<Pair, String> {
    let parsed = text.split_once(',').and_then(|(x, y)| Some([x.parse().ok()?, y.parse().ok()?]));
    parsed
        .filter(|p: &Pair| p.iter().all(|v| v.is_finite()))
        .ok_or_else(|| "write column,row in pixels, such as 312,208".to_owned())
}

/// `N` or `CxR`.
fn parse_resolution(text: &str) -> std::result::Result<Resolution, String> {
    let hint = "write a number, such as 32, or columns x rows, such as 32x24";
    match text.split_once('x') {
        Some((c, r)) => Ok(Resolution::Grid([c.parse().map_err(|_| hint)?, r.parse().map_err(|_| hint)?])),
        None => Ok(Resolution::Longer(text.parse().map_err(|_| hint)?)),
    }
}

/// Letters among x, y, z.
fn parse_axes(text: &str) -> std::result::Result<[bool; 3], String> {
    let known = !text.is_empty() && text.chars().all(|c| "xyz".contains(c));
    if known {
        Ok(["x", "y", "z"].map(|axis| text.contains(axis)))
    } else {
        Err("name axes, such as y or yz".to_owned())
    }
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

/// A rectangle of fabric of `size` [m].
fn flat(arguments: &Arguments, view: &View, size: Pair) -> Result<Mesh> {
    let size = size.into();
    let grid = arguments.grid.grid(size)?;
    let outline = match (&view.mask, arguments.from_mask) {
        (Some((mask, path)), true) => Some(Outline::new(mask, &path.display().to_string())?),
        (None, true) => {
            return Err(Error::usage(
                "--from-mask without a mask",
                "add --mask FILE, or give the corners with --corners",
            ));
        }
        _ => None,
    };
    let corners = match &outline {
        Some(outline) => {
            note(&outline.notes);
            outline.corners()
        }
        None => <[Pair; 4]>::try_from(&arguments.corners[..])
            .map_err(|_| {
                Error::usage(
                    "the corners are not given",
                    "add --corners X,Y X,Y X,Y X,Y (clockwise from the upper left), or --from-mask",
                )
            })?
            .map(Into::into),
    };
    let found = locate(&view.camera, size, corners)?;
    say!("corners: {}", corners.map(|p| format!("{:.1},{:.1}", p.x, p.y)).join(" "));
    say!(
        "distances of the corners: {}; {}",
        found.positions.map(|p| format!("{:.3} m", p.length())).join(", "),
        if found.rigid {
            format!("a plane rectangle fits them to {:.2} px", found.rigid_error)
        } else {
            format!(
                "no plane rectangle fits (off by {:.1} px): treated as a sheet that sags or bends",
                found.rigid_error
            )
        }
    );
    if found.ambiguous {
        say!(
            "note: the rectangle tilted the other way fits nearly as well: look at check --picture, and measure the size exactly"
        );
    }
    let mut mesh = patch(found.positions, grid);
    if let (Some(outline), false) = (&outline, arguments.straight) {
        hem(&mut mesh, grid, found.positions, &view.camera, outline, corners);
    }
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
    let fix = fix(arguments)?;
    let place = path.display().to_string();
    let mut model = model::read(&path)?;
    note(&model.notes.iter().map(|n| format!("{place}: {n}")).collect::<Vec<_>>());
    fix.apply_to(&mut model.mesh);
    if arguments.weld {
        let [gone, _] = weld(&mut model.mesh);
        say!("merged {gone} vertices that lay on others");
    }
    let Some(resolution) = arguments.remesh else {
        return if model.has_uv { Ok(model.mesh) } else { Err(without_uv(&path)) };
    };
    let made = remesh(&model.mesh, model.has_uv, resolution, &place)?;
    let over = match made.over {
        Over::Uv => "texture coordinates",
        Over::Border => "border, between its four corners",
    };
    say!("a grid of {}×{} vertices over the {over}", made.grid[0], made.grid[1]);
    if made.in_holes > 0 {
        say!("note: {} vertices lie in holes of the mesh and were put on their rims", made.in_holes);
    }
    Ok(made.mesh)
}

fn without_uv(path: &Path) -> Error {
    Error::input(
        path.display().to_string(),
        "has no texture coordinates (uv), which a template needs",
        "unwrap it in a modelling program, or make a grid of it with --remesh 32",
    )
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units() {
        assert_eq!(parse_size("0.7x0.5m"), Ok([0.7, 0.5]));
        assert_eq!(parse_size("0.7x0.5"), Ok([0.7, 0.5]));
        let [w, h] = parse_size("70x50cm").unwrap();
        assert!((w - 0.7).abs() < 1e-12 && (h - 0.5).abs() < 1e-12);
        for bad in ["70", "70x", "ax5", "-1x5m", "0x5m", "70x50in"] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
    }
}
