//! The mesh that the arguments ask for.

use std::path::PathBuf;

use tessuto::glam::DVec2;
use tessuto::io::scene::{CameraRecord, TemplateKind, TemplateRecord, template_misfit};
use tessuto::template::fix::Fix;
use tessuto::template::focal;
use tessuto::template::make::{Changes, CornersFrom, Resample, from_file, from_rectangle};
use tessuto::template::remesh::Resolution;
use tessuto::{Error, Image, Result};

use super::{Arguments, Made, View};
use crate::say::say;
use crate::values::Pair;

/// How well a person or the mask knows a corner of fabric, in either direction `[px]`.
const CLICK: f64 = 1.0;

pub(super) fn say_line(line: String) {
    say!("{line}");
}

/// A rectangle of fabric of `size` `[m]`; its corners determine the camera, too, if that is asked for.
pub(super) fn flat(arguments: &Arguments, view: &mut View, size: Pair) -> Result<Made> {
    let mask = view.mask.take();
    let place = place_of(mask.as_ref());
    let corners = corners(arguments, mask.as_ref(), &place)?;
    let camera = match arguments.lens.is_estimated() {
        true => Some(estimated(view, size, &corners)?),
        false => None,
    };
    let found = from_rectangle(&view.camera, size.into(), arguments.grid, corners, &mut say_line)?;
    let record = TemplateRecord {
        size: Some(size),
        corners: Some(found.corners.map(Into::into)),
        residual: Some(found.residual),
        plane: Some(found.plane),
        ambiguous: Some(found.ambiguous),
        camera,
        ..TemplateRecord::new(TemplateKind::Flat)
    };
    view.mask = mask;
    let misfit = (!found.plane).then_some(found.residual);
    Ok(Made { mesh: found.mesh, record, misfit, table: None, raw: false })
}

/// What messages call the mask.
pub(super) fn place_of(mask: Option<&(Image, PathBuf)>) -> String {
    mask.map_or_else(String::new, |(_, path)| path.display().to_string())
}

/// The corners in the mask, or those that were given.
pub(super) fn corners<'a>(
    arguments: &Arguments,
    mask: Option<&'a (Image, PathBuf)>,
    place: &'a str,
) -> Result<CornersFrom<'a>> {
    Ok(match (mask, arguments.from_mask) {
        (Some((mask, _)), true) => CornersFrom::Mask { mask, place, straight: arguments.straight },
        (None, true) => {
            let hint = "give the corners with --corners, or make or name masks first";
            return Err(Error::usage("--from-mask without a mask", hint));
        }
        _ => CornersFrom::Points(points(arguments)?),
    })
}

/// The corners that were given.
fn points(arguments: &Arguments) -> Result<[DVec2; 4]> {
    let missing = || {
        let hint = "add --corners X,Y X,Y X,Y X,Y (clockwise from the upper left), or --from-mask";
        Error::usage("the corners are not given", hint)
    };
    Ok(arguments.corners.ok_or_else(missing)?.map(Into::into))
}

/// Finds the camera from the corners, and looks through it from now on.
fn estimated(view: &mut View, size: Pair, corners: &CornersFrom) -> Result<CameraRecord> {
    let image = [view.camera.width, view.camera.height];
    let (camera, found) = focal::estimate(size.into(), corners.found()?, image, CLICK)?;
    let [low, high] = found.interval;
    say!(
        "focal length from the corners: {:.0} px ({low:.0} to {high:.0}, ± {:.1} %, if corners are known to \
         {CLICK} px)",
        found.focal,
        100.0 * found.uncertainty()
    );
    view.camera = camera;
    let source = "estimated from the corners of the sheet".to_owned();
    Ok(CameraRecord { source, fx: camera.fx, fy: camera.fy, interval: Some(found.interval) })
}

/// A given mesh, changed. The misfit of the rectangle that it was made of stays with it.
pub(super) fn from_mesh(arguments: &Arguments, scene: bool) -> Result<Made> {
    let nothing = arguments.remesh.is_none()
        && arguments.weld.is_none()
        && arguments.scale.is_none()
        && arguments.flip.is_none()
        && arguments.swap.is_none();
    let path = match &arguments.from {
        Some(path) => path.clone(),
        None if nothing => {
            return Err(Error::usage(
                "nothing to do",
                "make a rectangle (--flat WxH --from-mask), re-sample a mesh (--remesh 32 --from FILE), or \
                 repair the template (--scale, --flip, --swap, --weld)",
            ));
        }
        None if scene => arguments.target.join("template.obj"),
        None => return Err(Error::usage("the mesh is not given", "add --from FILE")),
    };
    let remesh = match (arguments.remesh, arguments.irregular) {
        (Some(Resolution::Longer(count)), true) => Some(Resample::Irregular(count)),
        (Some(Resolution::Grid(_)), true) => {
            let hint = "give the vertices of an irregular mesh as one number: --remesh 400 --irregular";
            return Err(Error::usage("--irregular with columns x rows", hint));
        }
        (grid, _) => grid.map(Resample::Grid),
    };
    let changes = Changes { fix: fix(arguments)?, weld: arguments.weld, remesh };
    let record = TemplateRecord::new(TemplateKind::Mesh);
    Ok(Made {
        mesh: from_file(&path, &changes, &mut say_line)?,
        record,
        misfit: template_misfit(&path),
        table: None,
        raw: true,
    })
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
