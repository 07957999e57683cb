//! The mesh that the arguments ask for.

use tessuto::io::scene::template_misfit;
use tessuto::template::fix::Fix;
use tessuto::template::make::{Changes, CornersFrom, FromRectangle, from_file, from_rectangle};
use tessuto::{Error, Mesh, Result};

use super::{Arguments, View};
use crate::say::say;
use crate::values::Pair;

fn told(line: String) {
    say!("{line}");
}

/// A rectangle of fabric of `size` `[m]`, and its misfit `[px]`, if it has one.
pub(super) fn flat(arguments: &Arguments, view: &View, size: Pair) -> Result<(Mesh, Option<f64>)> {
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
    let FromRectangle { mut mesh, misfit } =
        from_rectangle(&view.camera, size.into(), arguments.grid, corners, &mut told)?;
    mesh.positions.iter_mut().for_each(|p| *p /= view.metres);
    Ok((mesh, misfit))
}

/// A given mesh, changed, and the misfit `[px]` of the rectangle that it was made of, if it has one.
pub(super) fn from_mesh(arguments: &Arguments, scene: bool) -> Result<(Mesh, Option<f64>)> {
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
    Ok((from_file(&path, &changes, &mut told)?, template_misfit(&path)))
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
