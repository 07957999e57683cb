//! The template: read, scaled to metres, and refused where the simulation could not use it.

use std::path::Path;

use glam::DVec3;

use super::inside;
use super::manifest::{Manifest, Units};
use super::rectangle;
use crate::io::obj;
use tessuto_core::error::{Error, Hint, Remedy, Repair, Result, Warning};
use tessuto_core::image::Image;
use tessuto_core::mesh::{Mesh, diagonal, edge_uses, pieces, pinched, triangle_area};
use tessuto_core::scene::Scene;
use tessuto_render::raster::coverage::{
    VARIANT_GAIN, axis_variants, best_variant, overlap, template_coverage,
};

/// Sizes of cloth taken seriously: length of the bounding box's diagonal `[m]`.
pub const DIAGONAL: std::ops::RangeInclusive<f64> = 0.05..=10.0;
/// Overlap with the first mask below which the template is refused, and below which it is doubted.
pub(super) const OVERLAP_REFUSED: f64 = 0.3;
pub(super) const OVERLAP_DOUBTED: f64 = 0.85;

/// Reads template.obj; `None` if it cannot be read, a mesh and more `errors` if it cannot be used.
pub(crate) fn read(
    folder: &Path,
    manifest: &Manifest,
    errors: &mut Vec<Error>,
    warnings: &mut Vec<Warning>,
) -> Option<Mesh> {
    let path = folder.join("template.obj");
    if !path.exists() {
        let hint = Hint::from("make it of a rectangle of fabric, or of any mesh in camera coordinates")
            .with(Remedy::MakeTemplate(folder.to_path_buf()));
        errors.push(Error::input(path.display().to_string(), "cannot be read: it does not exist", hint));
        return None;
    }
    let mut mesh = match inside(folder, &path).and_then(|p| obj::read(&p)) {
        Ok(mesh) => mesh,
        Err(error) => {
            errors.push(error);
            return None;
        }
    };
    mesh.positions.iter_mut().for_each(|p| *p *= manifest.units.scale());
    let place = path.display().to_string();
    check(&mesh, manifest.units, (folder, &place), rectangle::warning(&path), errors, warnings);
    Some(mesh)
}

/// Adds to `errors` what the simulation could not use, and to `warnings` what is odd, with what is known of its
/// `origin`; `place` is the mesh of the scene in `folder`.
pub(super) fn check(
    mesh: &Mesh,
    units: Units,
    (folder, place): (&Path, &str),
    origin: Option<Warning>,
    errors: &mut Vec<Error>,
    warnings: &mut Vec<Warning>,
) {
    let checks =
        [check_depth(mesh, place, folder), check_scale(mesh, units, place, folder), check_faces(mesh, place)];
    errors.extend(checks.into_iter().filter_map(Result::err));
    if let Err(error) = check_edges(mesh, place, warnings) {
        errors.push(error);
    }
    warnings.extend(origin);
    check_vertices(mesh, folder, warnings);
    check_pieces(mesh, folder, warnings);
}

fn check_depth(mesh: &Mesh, place: &str, folder: &Path) -> Result<()> {
    let Some(vertex) = mesh.positions.iter().position(|p| p.z <= 0.0) else { return Ok(()) };
    let depths = || mesh.positions.iter().map(|p| p.z);
    let (low, high) = (depths().fold(f64::INFINITY, f64::min), depths().fold(f64::NEG_INFINITY, f64::max));
    let hint = if high < 0.0 {
        let repair = Repair { flip: [false, true, true], ..Repair::of(folder) };
        Hint::from("looks like OpenGL axes (y up, z backwards): negate y and z of every vertex")
            .with(Remedy::RepairTemplate(repair))
    } else {
        "vertices are in camera coordinates: x right, y down, z forward; move the mesh to where it was filmed"
            .into()
    };
    let count = depths().filter(|z| *z <= 0.0).count();
    Err(Error::input(
        place,
        format!(
            "{count} of {} vertices are behind the camera, first vertex {} (z from {low:.3} to {high:.3} m)",
            mesh.positions.len(),
            vertex + 1
        ),
        hint,
    ))
}

fn check_scale(mesh: &Mesh, units: Units, place: &str, folder: &Path) -> Result<()> {
    let length = diagonal(&mesh.positions);
    if DIAGONAL.contains(&length) {
        return Ok(());
    }
    let raw = length / units.scale();
    let strangeness = |u: &Units| (raw * u.scale() / 0.7).ln().abs();
    let guess = Units::ALL.into_iter().min_by(|a, b| strangeness(a).total_cmp(&strangeness(b)));
    let hint = match guess {
        Some(guess) if guess != units && DIAGONAL.contains(&(raw * guess.scale())) => Hint::from(format!(
            "the unit looks like {}: write \"units\": \"{}\" in scene.json ({:.2} m then), or scale the template",
            guess.key(),
            guess.key(),
            raw * guess.scale(),
        ))
        .with(Remedy::RepairTemplate(Repair { scale: guess.scale() / units.scale(), ..Repair::of(folder) })),
        _ => "scale the template (and the truth, if any) to metres".into(),
    };
    let problem = format!("the fabric's bounding box has a diagonal of {length:.4} m, expected 0.05 to 10 m");
    Err(Error::input(place, problem, hint))
}

fn check_faces(mesh: &Mesh, place: &str) -> Result<()> {
    // Relative to the longest edge, so that the unit does not matter; 1e-9 is far beyond any thread.
    let flat: Vec<usize> = (0..mesh.faces.len()).filter(|f| is_flat(mesh, *f)).collect();
    let Some(first) = flat.first() else { return Ok(()) };
    let vertices: Vec<String> = mesh.faces[*first].vertices.iter().map(|v| (v + 1).to_string()).collect();
    Err(Error::input(
        place,
        format!(
            "{} of {} faces have no area, first face {} (vertices {})",
            flat.len(),
            mesh.faces.len(),
            first + 1,
            vertices.join(" ")
        ),
        "remove these faces, or merge or move their vertices",
    ))
}

fn is_flat(mesh: &Mesh, face: usize) -> bool {
    let corners = &mesh.faces[face].vertices;
    let at = |k: usize| mesh.positions[corners[k % corners.len()] as usize];
    let longest = (0..corners.len()).map(|k| at(k).distance_squared(at(k + 1))).fold(0.0, f64::max);
    let area: f64 = (1..corners.len() - 1)
        .map(|k| triangle_area(&mesh.positions, [corners[0], corners[k], corners[k + 1]]))
        .sum();
    area <= 1e-9 * longest
}

/// Refuses edges of three and more faces; doubts faces wound against their neighbours.
fn check_edges(mesh: &Mesh, place: &str, warnings: &mut Vec<Warning>) -> Result<()> {
    let uses = edge_uses(mesh);
    let crowded: Vec<_> = uses.iter().filter(|(_, found)| found.faces() > 2).collect();
    if let Some((edge, found)) = crowded.first() {
        return Err(Error::input(
            place,
            format!(
                "{} edges have more than two faces, first the edge of vertices {} and {} with {}",
                crowded.len(),
                edge[0] + 1,
                edge[1] + 1,
                found.faces()
            ),
            "a fabric is a surface: remove double faces and inner walls",
        ));
    }
    let against = uses.values().filter(|found| found.faces() == 2 && found.ascending != 1).count();
    if against > 0 {
        let found = format!("{against} edges join faces that are wound in opposite directions");
        warnings.push(Warning::new("winding", found, "recalculate the normals in a modelling program"));
    }
    Ok(())
}

/// Doubts templates of several pieces, and faces that meet in a point.
fn check_pieces(mesh: &Mesh, folder: &Path, warnings: &mut Vec<Warning>) {
    let pieces = pieces(mesh);
    if pieces.len() > 1 {
        let found = format!(
            "{} separate pieces, of {} to {} faces",
            pieces.len(),
            pieces[pieces.len() - 1],
            pieces[0]
        );
        let hint =
            Hint::from("one piece of fabric is expected: remove the others, or, if they touch, merge them")
                .with(Remedy::RepairTemplate(Repair { weld: true, ..Repair::of(folder) }));
        warnings.push(Warning::new("pieces", found, hint));
    }
    let pinched = pinched(mesh);
    if let Some(first) = pinched.first() {
        let found = format!(
            "faces meet at {} vertices without sharing an edge there, first vertex {}",
            pinched.len(),
            first + 1
        );
        warnings.push(Warning::new(
            "pieces",
            found,
            "a fabric is a surface: remove such faces, or split the vertices",
        ));
    }
}

fn check_vertices(mesh: &Mesh, folder: &Path, warnings: &mut Vec<Warning>) {
    let mut used = vec![false; mesh.positions.len()];
    mesh.faces.iter().flat_map(|f| &f.vertices).for_each(|v| used[*v as usize] = true);
    if let Some(first) = used.iter().position(|u| !u) {
        let count = used.iter().filter(|u| !**u).count();
        let found = format!("{count} vertices belong to no face, first vertex {}", first + 1);
        warnings.push(Warning::new("vertices", found, "remove them, or add their faces"));
    }
    let mut order: Vec<usize> = (0..mesh.positions.len()).collect();
    let key = |v: usize| mesh.positions[v].to_array();
    order.sort_by(|a, b| key(*a).partial_cmp(&key(*b)).unwrap_or(std::cmp::Ordering::Equal));
    let same = |pair: &&[usize]| key(pair[0]) == key(pair[1]);
    if let Some(pair) = order.windows(2).find(same) {
        let found = format!(
            "{} vertices lie on another one, e.g. {} and {}",
            order.windows(2).filter(same).count(),
            pair[0] + 1,
            pair[1] + 1
        );
        let hint = Hint::from("the fabric comes apart at this seam: merge them")
            .with(Remedy::RepairTemplate(Repair { weld: true, ..Repair::of(folder) }));
        warnings.push(Warning::new("vertices", found, hint));
    }
}

/// Refuses a template that is not where the first mask shows the fabric.
pub(crate) fn check_overlap(scene: &Scene, warnings: &mut Vec<Warning>) -> Result<()> {
    let (mesh, camera, first) = (&scene.template, &scene.camera, scene.frames.frame(0)?);
    let mask = &first.mask;
    let covered = template_coverage(mesh, &mesh.positions, camera);
    let iou = overlap(&covered, mask);
    let outside = |p: &&DVec3| {
        let q = camera.project(**p);
        q.x < -0.5 || q.y < -0.5 || q.x > camera.width as f64 - 0.5 || q.y > camera.height as f64 - 0.5
    };
    let fraction = mesh.positions.iter().filter(outside).count() as f64 / mesh.positions.len() as f64;
    if fraction > 0.02 {
        let found = format!("{:.0} % of the template's vertices are outside the crop", fraction * 100.0);
        warnings.push(Warning::new("crop", found, "make the crop larger, if the fabric is in the image"));
    }
    if iou >= OVERLAP_DOUBTED {
        return Ok(());
    }
    let hint = way_out(scene, mask, iou);
    let found =
        format!("overlap with the mask of frame {} is {iou:.2} (intersection over union)", scene.first_frame);
    if iou < OVERLAP_REFUSED {
        let place = scene.folder.join("template.obj").display().to_string();
        return Err(Error::input(
            place,
            format!("the template is far from the mask: {found}, {OVERLAP_REFUSED} at least"),
            hint,
        ));
    }
    warnings.push(Warning::new(
        "overlap",
        format!("the template's {found}, {OVERLAP_DOUBTED} expected"),
        hint,
    ));
    Ok(())
}

/// Why the template may not lie on the mask.
fn way_out(scene: &Scene, mask: &Image, iou: f64) -> Hint {
    let (mesh, camera) = (&scene.template, &scene.camera);
    let best = best_variant(axis_variants(mesh, camera, mask));
    if best.iou > iou + VARIANT_GAIN {
        let text = format!("axes look different: {} it overlaps by {:.2}", best.name, best.iou);
        return Hint::from(text).with(Remedy::RepairTemplate(best.repair(&scene.folder)));
    }
    let mut inverse = mask.clone();
    inverse.data.iter_mut().for_each(|v| *v = 1.0 - *v);
    let inverse = overlap(&template_coverage(mesh, &mesh.positions, camera), &inverse);
    if inverse > iou + VARIANT_GAIN {
        return "the masks look inverted: white must be fabric".into();
    }
    if scene.first_frame > 0 {
        return "the template shows the fabric in frame 0; start there, or give the template of the first frame used"
            .into();
    }
    Hint::from(
        "check fx, fy, cx, cy, the template's axes (x right, y down, z forward) and that it shows \
         frame 0; look at both",
    )
    .with(Remedy::Check)
}
