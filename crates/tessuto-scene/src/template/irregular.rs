//! Any textured sheet as an irregular mesh of triangles: points of even density, at random except at the border, and
//! the Delaunay triangles over them. A grid has directions of its own, which a continuum of few triangles feels;
//! this has none.

use std::borrow::Cow;

use glam::DVec2;

use super::remesh::{Finder, Over, Place, parametrised, size};
use tessuto_core::error::{Error, Result};
use tessuto_core::math::delaunay::delaunay;
use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::{Face, Mesh, Motion};
use tessuto_core::scene::{Known, Scene, Truth};

/// Fewest and most vertices.
pub const VERTICES: [usize; 2] = [16, 4000];
/// Places that every point is the best of: the farthest from all points before it.
const CANDIDATES: usize = 30;
/// Moves of every point to the middle of what is nearest to it.
const RELAXATIONS: usize = 8;
/// Places by which that middle is found, per point.
const PLACES: usize = 40;

/// An irregular mesh, and how it was made.
#[derive(Debug, Clone)]
pub struct Irregular {
    /// The mesh; uv from the sheet where it has any.
    pub mesh: Mesh,
    /// Where in the sheet every vertex is.
    places: Vec<Place>,
    /// What its points are spread over.
    pub over: Over,
    /// Vertices that lie in a hole of the sheet and were put on its rim.
    pub in_holes: usize,
}

/// Makes a mesh of `count` vertices, up to rounding at the border. `has_uv` says whether the sheet's texture
/// coordinates mean anything; `place` is named in errors.
///
/// # Errors
/// [`Error::Input`] if `sheet` is not one with a border; [`Error::Usage`] outside [`VERTICES`].
pub fn irregular(sheet: &Mesh, has_uv: bool, count: usize, place: &str) -> Result<Irregular> {
    let [fewest, most] = VERTICES;
    if !(fewest..=most).contains(&count) {
        let hint = format!("ask for {fewest} to {most} vertices in all; 400 are usual");
        return Err(Error::usage(format!("an irregular mesh of {count} vertices"), hint));
    }
    let (over, params) = parametrised(sheet, has_uv, place)?;
    let (triangles, triangle_uvs) = (sheet.triangles(), sheet.triangle_uvs());
    let finder = Finder::new(&triangles, &params);
    let size = size(sheet, &triangles, &finder);
    let points = spread(size, count);
    let mut mesh = Mesh { positions: Vec::new(), uvs: Vec::new(), faces: Vec::new() };
    let (mut places, mut in_holes) = (Vec::new(), 0);
    for p in &points {
        let q = *p / size;
        let (outside, place) = finder.find(q);
        // A tenth of a triangle beyond the border is rounding of its corners.
        in_holes += usize::from(outside > 0.1 / (count as f64).sqrt());
        mesh.positions.push(place.position(&sheet.positions, &triangles));
        mesh.uvs.push(match has_uv {
            true => place.uv(sheet, &triangle_uvs),
            false => DVec2::new(q.x, 1.0 - q.y),
        });
        places.push(place);
    }
    // Rows go down: the other way round, faces are wound as those of a grid.
    mesh.faces = delaunay(&points)
        .into_iter()
        .map(|[a, b, c]| Face { vertices: vec![a, c, b], uvs: vec![a, c, b] })
        .collect();
    Ok(Irregular { mesh, places, over, in_holes })
}

/// `scene` with an irregular mesh of `count` vertices in place of its template; as it is where `count` is 0. True
/// vertices, where there are any, are those of the template in the same places.
///
/// # Errors
/// As [`irregular`].
pub fn of_scene(scene: &Scene, count: usize) -> Result<Cow<'_, Scene>> {
    if count == 0 {
        return Ok(Cow::Borrowed(scene));
    }
    let place = scene.folder.join("template.obj").display().to_string();
    let sheet = &scene.template;
    let made = irregular(sheet, true, count, &place)?;
    let triangles = sheet.triangles();
    let vertices = scene.truth.vertices.as_ref().map(|motion| {
        let at = |x: &Vec<_>| made.places.iter().map(|place| place.position(x, &triangles)).collect();
        Motion::new(motion.iter().map(at).collect()).expect("as many finite positions in every frame")
    });
    let truth = Truth { vertices, ..scene.truth.clone() };
    let known = Known { held: None, ..scene.known.clone() };
    Ok(Cow::Owned(Scene { template: made.mesh, truth, known, ..scene.clone() }))
}

/// Points of even density in a rectangle from the origin to `size`, those of the border first and at even distances.
fn spread(size: DVec2, count: usize) -> Vec<DVec2> {
    // Equilateral triangles of this side have one vertex for each 0.866 of its square.
    let side = (size.x * size.y / (0.866 * count as f64)).sqrt();
    let [columns, rows] = (size / side).to_array().map(|n| (n.round() as usize).clamp(1, count / 6));
    let mut points = Vec::with_capacity(count);
    let mut edge = |from: DVec2, to: DVec2, n: usize| {
        points.extend((0..n).map(|k| from.lerp(to, k as f64 / n as f64) * size));
    };
    edge(DVec2::ZERO, DVec2::X, columns);
    edge(DVec2::X, DVec2::ONE, rows);
    edge(DVec2::ONE, DVec2::Y, columns);
    edge(DVec2::Y, DVec2::ZERO, rows);
    let border = points.len();
    // The same mesh every time.
    let mut rng = Rng::new(0, 0);
    let nearest = |points: &[DVec2], q: DVec2| {
        let to = |k: &usize| points[*k].distance_squared(q);
        (0..points.len()).min_by(|a, b| to(a).total_cmp(&to(b))).expect("a border")
    };
    while points.len() < count {
        let candidates = (0..CANDIDATES).map(|_| DVec2::new(rng.uniform(), rng.uniform()) * size);
        let room = |q: &DVec2| points[nearest(&points, *q)].distance_squared(*q);
        points.extend(candidates.max_by(|a, b| room(a).total_cmp(&room(b))));
    }
    let across = ((PLACES * count) as f64).sqrt().ceil() as usize;
    for _ in 0..RELAXATIONS {
        let mut sums = vec![(DVec2::ZERO, 0.0); count];
        for k in 0..across * across {
            let q = (DVec2::new((k % across) as f64, (k / across) as f64) + 0.5) / across as f64 * size;
            let (sum, weight) = &mut sums[nearest(&points, q)];
            (*sum, *weight) = (*sum + q, *weight + 1.0);
        }
        let moved = points.iter_mut().zip(sums).skip(border).filter(|(_, (_, weight))| *weight > 0.0);
        moved.for_each(|(p, (sum, weight))| *p = sum / weight);
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::mesh::{boundary_edges, grid, pieces};

    fn sheet() -> Mesh {
        let mut mesh = grid(12, 9, DVec2::new(0.5, 0.4), 1.0);
        mesh.positions.iter_mut().for_each(|p| p.z += 0.03 * (9.0 * p.x).sin() * (7.0 * p.y).cos());
        mesh
    }

    #[test]
    fn an_even_mesh_of_triangles_lies_on_the_sheet() {
        let sheet = sheet();
        let made = irregular(&sheet, true, 200, "sheet").unwrap();
        let mesh = &made.mesh;
        assert_eq!((mesh.positions.len(), made.in_holes, made.over), (200, 0, Over::Uv));
        assert_eq!(pieces(mesh).len(), 1);
        let border = boundary_edges(mesh).len();
        assert_eq!(mesh.faces.len(), 2 * 200 - 2 - border, "a disc");
        assert!((mesh.area() / sheet.area() - 1.0).abs() < 0.01);
        let lengths: Vec<f64> = mesh
            .edges()
            .iter()
            .map(|e| mesh.positions[e[0] as usize].distance(mesh.positions[e[1] as usize]))
            .collect();
        let (low, high) = lengths.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!(low > 0.015 && high < 0.07, "{low} to {high} m");
        // No direction is preferred: edges as often in every sector of 30°.
        let mut sectors = [0; 6];
        for e in mesh.edges() {
            let d = mesh.positions[e[0] as usize] - mesh.positions[e[1] as usize];
            let angle = d.y.atan2(d.x).rem_euclid(std::f64::consts::PI);
            sectors[((angle / std::f64::consts::PI * 6.0) as usize).min(5)] += 1;
        }
        let mean = mesh.edges().len() / 6;
        assert!(sectors.iter().all(|n| *n > mean / 2 && *n < 2 * mean), "{sectors:?}");
        // Wound as the sheet is, with its texture coordinates.
        for face in &mesh.faces {
            let [a, b, c] = [0, 1, 2].map(|k| mesh.uvs[face.uvs[k] as usize]);
            assert!((b - a).perp_dot(c - a) > 0.0);
        }
        let uv_of_sheet = &sheet.faces[0].uvs;
        let [a, b, c] = [0, 1, 2].map(|k| sheet.uvs[uv_of_sheet[k] as usize]);
        assert!((b - a).perp_dot(c - a) > 0.0);
        let again = irregular(&sheet, true, 200, "sheet").unwrap();
        assert_eq!(again.mesh, made.mesh);
    }

    #[test]
    fn every_vertex_is_one_of_a_face_whatever_their_number() {
        let whole = |size: DVec2, count: usize| {
            let sheet = grid(3, 3, size, 1.0);
            let mesh = irregular(&sheet, true, count, "sheet").unwrap().mesh;
            let mut used = vec![false; count];
            mesh.faces.iter().flat_map(|f| &f.vertices).for_each(|v| used[*v as usize] = true);
            assert!(used.iter().all(|u| *u), "{count} on {size}: {:?}", used.iter().position(|u| !u));
            // A disc: Euler's formula.
            assert_eq!(mesh.faces.len(), 2 * count - 2 - boundary_edges(&mesh).len(), "{count} on {size}");
            assert!((mesh.area() / sheet.area() - 1.0).abs() < 1e-6, "{count} on {size}");
        };
        for size in [[0.4, 0.4], [0.9, 0.3], [0.2, 1.1], [1.0, 0.05]].map(DVec2::from_array) {
            (16..130)
                .step_by(3)
                .chain([126, 150, 200, 300, 333, 400, 500, 600])
                .for_each(|count| whole(size, count));
        }
    }

    #[test]
    fn too_few_vertices_and_what_has_no_border_are_refused() {
        assert!(irregular(&sheet(), true, 3, "sheet").unwrap_err().to_string().contains("16 to 4000"));
        let mut closed = sheet();
        let back: Vec<Face> = closed
            .faces
            .iter()
            .map(|f| Face {
                vertices: f.vertices.iter().rev().copied().collect(),
                uvs: f.uvs.iter().rev().copied().collect(),
            })
            .collect();
        closed.faces.extend(back);
        assert!(irregular(&closed, true, 100, "sheet").unwrap_err().to_string().contains("is closed"));
    }
}
