//! A template of a garment that lies on a table.

use tessuto::glam::DVec3;
use tessuto::io::scene::{TableRecord, TemplateKind, TemplateRecord, first_depth};
use tessuto::template::remesh::Resolution;
use tessuto::template::table::{Plane, PlaneFrom, Side, from_outline};
use tessuto::{Error, Mesh, Result};

use super::depth::{Measured, measured};
use super::mesh::{place_of, say_line};
use super::{Arguments, Made, View};
use crate::say::say;
use crate::values::{Pair, Tilt};

/// The fabric in the mask of the first frame, flat on a table whose plane the arguments or the scene's depth say.
pub(super) fn on_table(arguments: &Arguments, view: &mut View, scene: bool) -> Result<Made> {
    if arguments.lens.is_estimated() {
        let hint = "give the camera when the clip is imported, or estimate it first, from a flat rectangle \
                    (--flat WxH --corners … --camera estimate)";
        return Err(Error::usage("--on-table with --camera estimate", hint));
    }
    let depth = measured_depth(arguments, view, scene)?;
    let Some((mask, _)) = &view.mask else {
        let hint = "make masks first (tessuto masks), or name one with --mask";
        return Err(Error::usage("--on-table without a mask", hint));
    };
    let place = place_of(view.mask.as_ref());
    let table = &arguments.table;
    let (from, source) = match (
        table.paper.zip(table.paper_corners),
        table.plane,
        table.distance.zip(table.between),
    ) {
        (Some((size, corners)), ..) => {
            let corners = corners.map(Into::into);
            (PlaneFrom::Paper { size: size.into(), corners }, "a sheet of paper".to_owned())
        }
        (_, Some([x, y, z, nx, ny, nz]), _) => {
            let plane = Plane::new(DVec3::new(x, y, z) * view.metres, DVec3::new(nx, ny, nz))?;
            (PlaneFrom::Given(plane), "its point and normal".to_owned())
        }
        (.., Some((length, between))) => {
            (by_distance(table.tilt, view, length, between)?, "one distance".to_owned())
        }
        _ => match &depth {
            Some((Measured { captured, sensor, .. }, file)) => {
                (PlaneFrom::Depth { map: &captured.map, sensor }, format!("the depth map {file}"))
            }
            None => {
                let hint = "lay a sheet of paper on it (--paper A4 --paper-corners X,Y X,Y X,Y X,Y), name a depth map \
                            (--depth FILE), measure a distance (--distance 62cm --between X,Y X,Y --tilt facing), or \
                            give the plane (--plane X,Y,Z,NX,NY,NZ)";
                return Err(Error::usage(
                    "the plane of the table is not given, and the scene has no depth maps",
                    hint,
                ));
            }
        },
    };
    let side = match (table.side, arguments.grid) {
        (Some(length), _) => Side::Length(length),
        (None, Resolution::Longer(count)) => Side::Longer(count),
        (None, Resolution::Grid(_)) => {
            let hint = "give the vertices along the longer side as one number, or --side 20mm";
            return Err(Error::usage("--on-table with a grid of columns x rows", hint));
        }
    };
    let found = from_outline(&view.camera, (mask, &place), from, side, &mut say_line)?;
    let record = TemplateRecord {
        size: Some(found.size.to_array()),
        table: Some(TableRecord::of(&found.plane, source)),
        camera: depth.and_then(|(measured, _)| measured.record),
        ..TemplateRecord::new(TemplateKind::Outline)
    };
    let table = Some(found.plane.plane.scaled(1.0 / view.metres));
    Ok(Made { mesh: found.mesh, record, misfit: None, table, raw: false })
}

/// The plane in which the flat `mesh` lies `[m]`.
pub(super) fn below(mesh: &Mesh) -> Result<Plane> {
    let x = &mesh.positions;
    let across = |[a, b, c]: [u32; 3]| {
        let [a, b, c] = [a, b, c].map(|k| x[k as usize]);
        (b - a).cross(c - a)
    };
    Plane::new(x.iter().sum::<DVec3>() / x.len() as f64, mesh.triangles().into_iter().map(across).sum())
}

/// The plane as an argument of this command, in the scene's unit.
pub(super) fn say_plane(plane: &Plane) {
    let Plane { point: p, normal: n } = plane;
    say!("plane of the table: --plane {:.5},{:.5},{:.5},{:.6},{:.6},{:.6}", p.x, p.y, p.z, n.x, n.y, n.z);
}

/// The depth map that was named, or, where nothing else says where the table is, that of the scene's first frame; and
/// its name.
fn measured_depth(arguments: &Arguments, view: &mut View, scene: bool) -> Result<Option<(Measured, String)>> {
    let table = &arguments.table;
    let named = |file: &std::path::Path| file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if let Some(path) = &arguments.depth {
        let measured = measured(arguments, view, path)?;
        let name = named(&measured.captured.file);
        return Ok(Some((measured, name)));
    }
    if !scene || table.paper.is_some() || table.plane.is_some() || table.distance.is_some() {
        return Ok(None);
    }
    Ok(first_depth(&arguments.target)?.map(|(map, sensor, file)| {
        let name = named(&file);
        let captured = tessuto::import::Captured { map, calibration: None, file };
        (Measured { captured, sensor, record: None }, name)
    }))
}

/// The plane with a known tilt on which two points have a known distance `[m]`.
fn by_distance(
    tilt: Option<Tilt>,
    view: &View,
    length: f64,
    between: [Pair; 2],
) -> Result<PlaneFrom<'static>> {
    let normal = match tilt.unwrap_or(Tilt::Facing) {
        Tilt::Facing => DVec3::NEG_Z,
        Tilt::Normal(n) => DVec3::from_array(n),
        Tilt::Level => -view.down.ok_or_else(|| {
            let hint = "write \"gravity\": [x, y, z] in scene.json, or give the table's normal: --tilt X,Y,Z";
            Error::usage("--tilt level, but which way gravity pulls is not known", hint)
        })?,
    };
    Ok(PlaneFrom::Distance { normal, between: between.map(Into::into), length })
}
