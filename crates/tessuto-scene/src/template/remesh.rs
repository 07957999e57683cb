//! Any textured sheet as a regular grid of quads: over its texture coordinates where they fill a rectangle, else over
//! its border, whose four corners become those of the grid.

use glam::{DMat3, DVec2, DVec3};

use super::outline::widest_quad_indices;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::math::block_matrix::{BlockMatrix, BlockPattern};
use tessuto_core::math::factor::{Analysis, Scratch};
use tessuto_core::mesh::{Mesh, SEAM, edge_uses, grid, pieces, vertex_uvs};

/// Fraction of their bounding box that texture coordinates fill at least to be the grid's own.
const FULL: f64 = 0.97;
/// Most vertices in either direction.
pub const MAX_GRID: usize = 512;

/// How the grid lies on the mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Over {
    /// Lines of equal texture coordinates.
    Uv,
    /// Lines that divide the border evenly.
    Border,
}

/// How fine the grid is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Resolution {
    /// Vertices along the longer side; the other follows, for squares.
    Longer(usize),
    /// Columns and rows of vertices.
    Grid([usize; 2]),
}

impl Resolution {
    /// Columns and rows of a sheet of this width and height.
    ///
    /// # Errors
    /// [`Error::Usage`] outside 3 to [`MAX_GRID`].
    pub fn grid(self, size: DVec2) -> Result<[usize; 2]> {
        let grid = match self {
            Self::Grid(grid) => grid,
            Self::Longer(n) if n < 3 => [n, n],
            Self::Longer(n) => {
                let cells = n.saturating_sub(1) as f64;
                size.to_array().map(|side| (side / size.max_element() * cells).round().max(2.0) as usize + 1)
            }
        };
        if grid.iter().any(|n| !(3..=MAX_GRID).contains(n)) {
            return Err(Error::usage(
                format!("a grid of {}×{} vertices", grid[0], grid[1]),
                format!("ask for 3 to {MAX_GRID} vertices in each direction; 20 to 40 are usual"),
            ));
        }
        Ok(grid)
    }
}

/// A grid, and how it was made.
#[derive(Debug, Clone)]
pub struct Remeshed {
    /// The grid; row-major from the upper left, uv from the mesh where it has any.
    pub mesh: Mesh,
    /// Columns and rows of vertices.
    pub grid: [usize; 2],
    /// What it lies over.
    pub over: Over,
    /// Grid vertices that lie in a hole of the mesh and were put on its rim.
    pub in_holes: usize,
}

/// Makes the grid. `has_uv` says whether the mesh's texture coordinates mean anything; `place` is named in errors.
///
/// # Errors
/// [`Error::Input`] if the mesh is not one sheet with a border; [`Error::Usage`] of the resolution.
pub fn remesh(mesh: &Mesh, has_uv: bool, resolution: Resolution, place: &str) -> Result<Remeshed> {
    let (over, params) = parametrised(mesh, has_uv, place)?;
    sample(mesh, has_uv, &params, over, resolution)
}

/// Where in the unit square, rows down, every vertex of a sheet is, and by what.
pub(super) fn parametrised(mesh: &Mesh, has_uv: bool, place: &str) -> Result<(Over, Vec<DVec2>)> {
    let border = border(mesh, place)?;
    let vertex_uvs = if has_uv { vertex_uvs(mesh, SEAM) } else { None };
    // A chart that folds back over itself is not a map of the sheet.
    let chart = vertex_uvs.filter(|uvs| one_sided(mesh, uvs));
    let area = |uvs: &[DVec2]| {
        mesh.triangles().iter().map(|t| doubled_area(t.map(|v| uvs[v as usize])).abs() / 2.0).sum::<f64>()
    };
    let full = chart.as_ref().filter(|uvs| {
        let (low, high) = bounds(uvs);
        area(uvs) > FULL * (high - low).x * (high - low).y
    });
    Ok(match full {
        Some(uvs) => {
            let (low, high) = bounds(uvs);
            // Rows go down, v goes up.
            (
                Over::Uv,
                uvs.iter().map(|uv| (*uv - low) / (high - low)).map(|p| DVec2::new(p.x, 1.0 - p.y)).collect(),
            )
        }
        None => (Over::Border, over_border(mesh, &border, chart.as_deref())),
    })
}

/// Width and height of a sheet `[m]`, along its middle row and column.
pub(super) fn size(mesh: &Mesh, triangles: &[[u32; 3]], finder: &Finder) -> DVec2 {
    let at = |s: f64, t: f64| finder.find(DVec2::new(s, t)).1.position(&mesh.positions, triangles);
    let length = |f: &dyn Fn(f64) -> DVec3| {
        (0..32).map(|k| f(f64::from(k) / 32.0).distance(f(f64::from(k + 1) / 32.0))).sum()
    };
    DVec2::new(length(&|s| at(s, 0.5)), length(&|t| at(0.5, t)))
}

/// The longest loop of edges with one face, as vertices in order.
fn border(mesh: &Mesh, place: &str) -> Result<Vec<u32>> {
    let mut next = std::collections::BTreeMap::new();
    for (&[low, high], found) in &edge_uses(mesh) {
        let (a, b) = match (found.ascending, found.descending) {
            (_, 0) => (low, high),
            (0, _) => (high, low),
            _ => continue,
        };
        next.entry(a).or_insert_with(Vec::new).push(b);
    }
    if let Some((vertex, _)) = next.iter().find(|(_, ends)| ends.len() > 1) {
        return Err(Error::input(
            place,
            format!("its border passes vertex {} more than once", vertex + 1),
            Hint::from(
                "wind all faces alike (recalculate normals), remove what hangs on single vertices, or \
                 merge double ones",
            )
            .with(Remedy::Weld),
        ));
    }
    let mut longest: (f64, Vec<u32>) = (0.0, Vec::new());
    while let Some((&start, _)) = next.first_key_value() {
        let (mut at, mut ring, mut length) = (start, Vec::new(), 0.0);
        while let Some(ends) = next.remove(&at) {
            ring.push(at);
            length += mesh.positions[at as usize].distance(mesh.positions[ends[0] as usize]);
            at = ends[0];
        }
        if length > longest.0 {
            longest = (length, ring);
        }
    }
    if longest.1.len() < 4 {
        return Err(Error::input(
            place,
            "is closed: it has no border",
            "a template is a sheet: cut it open, or delete its back",
        ));
    }
    let pieces = pieces(mesh).len();
    if pieces > 1 {
        return Err(Error::input(
            place,
            format!("has {pieces} separate pieces"),
            Hint::from("keep one sheet; if they touch, merge their vertices").with(Remedy::Weld),
        ));
    }
    Ok(longest.1)
}

fn doubled_area([a, b, c]: [DVec2; 3]) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Whether all triangles but a thousandth of the area have the same sign.
fn one_sided(mesh: &Mesh, uvs: &[DVec2]) -> bool {
    let areas: Vec<f64> = mesh.triangles().iter().map(|t| doubled_area(t.map(|v| uvs[v as usize]))).collect();
    let (sum, all): (f64, f64) = (areas.iter().sum(), areas.iter().map(|a| a.abs()).sum());
    all > 0.0 && sum.abs() > 0.998 * all
}

fn bounds(points: &[DVec2]) -> (DVec2, DVec2) {
    (
        points.iter().copied().fold(DVec2::INFINITY, DVec2::min),
        points.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max),
    )
}

/// A map to the unit square, rows down: the border goes to its border, evenly between the corners, and what is inside
/// follows as a net of springs.
fn over_border(mesh: &Mesh, ring: &[u32], chart: Option<&[DVec2]>) -> Vec<DVec2> {
    // Seen flat: in the chart, v up, or else from the camera.
    let flat = |v: u32| match chart {
        Some(uvs) => DVec2::new(uvs[v as usize].x, -uvs[v as usize].y),
        None => mesh.positions[v as usize].truncate(),
    };
    let mut ring = ring.to_vec();
    let outline: Vec<DVec2> = ring.iter().map(|v| flat(*v)).collect();
    let area: f64 = (0..outline.len()).map(|k| outline[k].perp_dot(outline[(k + 1) % outline.len()])).sum();
    if area < 0.0 {
        ring.reverse();
    }
    let outline: Vec<DVec2> = ring.iter().map(|v| flat(*v)).collect();
    let corners = corners_of(&outline);
    let n = ring.len();
    let mut square = vec![None; mesh.positions.len()];
    let ends = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
    for side in 0..4 {
        let (from, to) = (corners[side], corners[(side + 1) % 4]);
        let count = (to + n - from) % n;
        let at = |k: usize| mesh.positions[ring[(from + k) % n] as usize];
        let total: f64 = (0..count).map(|k| at(k).distance(at(k + 1))).sum();
        let mut length = 0.0;
        for k in 0..count {
            square[ring[(from + k) % n] as usize] =
                Some(ends[side].lerp(ends[(side + 1) % 4], length / total));
            length += at(k).distance(at(k + 1));
        }
    }
    harmonic(mesh, &square)
}

/// Indices of the upper left, upper right, lower right and lower left corner of an outline, y down.
fn corners_of(outline: &[DVec2]) -> [usize; 4] {
    // The search is cubic; every n-th point of a long outline is near enough to find the right neighbourhood.
    let step = outline.len().div_ceil(160);
    let coarse: Vec<usize> = (0..outline.len()).step_by(step).collect();
    let mut corners =
        widest_quad_indices(&coarse.iter().map(|k| outline[*k]).collect::<Vec<_>>()).map(|k| coarse[k]);
    let middle = corners.iter().map(|k| outline[*k]).sum::<DVec2>() / 4.0;
    let n = outline.len();
    for corner in &mut corners {
        let near = (0..=2 * step).map(|k| (*corner + n + k - step) % n);
        *corner = near
            .max_by(|a, b| outline[*a].distance(middle).total_cmp(&outline[*b].distance(middle)))
            .unwrap_or(*corner);
    }
    corners.sort_unstable();
    let height = |k: usize| (outline[corners[k]] + outline[corners[(k + 1) % 4]]).y;
    let first = (0..4).min_by(|a, b| height(*a).total_cmp(&height(*b))).expect("four sides");
    std::array::from_fn(|k| corners[(first + k) % 4])
}

/// The harmonic map with the given values at the border (cotangent weights, which keep distances best).
fn harmonic(mesh: &Mesh, fixed: &[Option<DVec2>]) -> Vec<DVec2> {
    let triangles = mesh.triangles();
    let sides = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    let pairs: Vec<[u32; 2]> = triangles.iter().flat_map(sides).collect();
    let pattern = BlockPattern::new(&mesh.positions, &pairs);
    let mut matrix = BlockMatrix::zeros(&pattern);
    let mut right = vec![DVec3::ZERO; mesh.positions.len()];
    let p = |v: u32| mesh.positions[v as usize];
    for (t, triangle) in triangles.iter().enumerate() {
        for (k, [a, b]) in sides(triangle).into_iter().enumerate() {
            let o = triangle[(k + 2) % 3];
            let (u, v) = (p(a) - p(o), p(b) - p(o));
            // Blunt angles have negative cotangents, which would fold the map; a small weight does not.
            let weight =
                (u.dot(v) / u.cross(v).length().max(1e-12 * u.length() * v.length())).clamp(0.02, 50.0);
            let block = DMat3::IDENTITY * weight;
            matrix.add_diagonal(&pattern, a as usize, &block);
            matrix.add_diagonal(&pattern, b as usize, &block);
            matrix.add_pair(&pattern, 3 * t + k, &-block);
        }
    }
    const HOLD: f64 = 1e8;
    for (v, value) in fixed.iter().enumerate() {
        // Vertices without faces are held anywhere.
        let hold = if value.is_some() { HOLD } else { 1e-9 };
        matrix.add_diagonal(&pattern, v, &(DMat3::IDENTITY * hold));
        right[v] = value.unwrap_or(DVec2::ZERO).extend(0.0) * hold;
    }
    let analysis = Analysis::new(&pattern);
    let mut scratch = Scratch::default();
    let factor = analysis.factorize(&pattern, &matrix, &mut scratch);
    analysis.solve(&pattern, &factor, &right, &mut scratch).iter().map(|p| p.truncate()).collect()
}

/// The grid whose vertex (s, t) is where the mesh has the parameter (s, t).
fn sample(
    mesh: &Mesh,
    has_uv: bool,
    params: &[DVec2],
    over: Over,
    resolution: Resolution,
) -> Result<Remeshed> {
    let (triangles, triangle_uvs) = (mesh.triangles(), mesh.triangle_uvs());
    let finder = Finder::new(&triangles, params);
    let [columns, rows] = resolution.grid(size(mesh, &triangles, &finder))?;
    let mut out = grid(columns, rows, DVec2::ONE, 1.0);
    let mut in_holes = 0;
    for k in 0..out.positions.len() {
        let q =
            DVec2::new((k % columns) as f64 / (columns - 1) as f64, (k / columns) as f64 / (rows - 1) as f64);
        let (outside, place) = finder.find(q);
        // A tenth of a cell beyond the border is rounding of its corners.
        in_holes += usize::from(outside > 0.1 / (columns.max(rows) - 1) as f64);
        out.positions[k] = place.position(&mesh.positions, &triangles);
        if has_uv {
            out.uvs[k] = place.uv(mesh, &triangle_uvs);
        }
    }
    Ok(Remeshed { mesh: out, grid: [columns, rows], over, in_holes })
}

/// A point of a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    triangle: usize,
    weights: [f64; 3],
}

impl Place {
    /// Where it is, of vertices at `positions`.
    pub(super) fn position(&self, positions: &[DVec3], triangles: &[[u32; 3]]) -> DVec3 {
        let corners = triangles[self.triangle].map(|v| positions[v as usize]);
        corners[0] * self.weights[0] + corners[1] * self.weights[1] + corners[2] * self.weights[2]
    }

    /// Its texture coordinates.
    pub(super) fn uv(&self, mesh: &Mesh, triangle_uvs: &[[u32; 3]]) -> DVec2 {
        let uv = triangle_uvs[self.triangle].map(|t| mesh.uvs[t as usize]);
        uv[0] * self.weights[0] + uv[1] * self.weights[1] + uv[2] * self.weights[2]
    }
}

/// Triangles of the unit square, by cells.
pub(super) struct Finder {
    side: usize,
    cells: Vec<Vec<u32>>,
    corners: Vec<[DVec2; 3]>,
}

impl Finder {
    pub(super) fn new(triangles: &[[u32; 3]], params: &[DVec2]) -> Self {
        let side = ((triangles.len() as f64).sqrt() as usize).clamp(1, 512);
        let corners: Vec<[DVec2; 3]> = triangles.iter().map(|t| t.map(|v| params[v as usize])).collect();
        let mut cells = vec![Vec::new(); side * side];
        for (t, triangle) in corners.iter().enumerate() {
            let (low, high) = bounds(triangle);
            let cell = |v: f64| ((v * side as f64).max(0.0) as usize).min(side - 1);
            for y in cell(low.y - 1e-9)..=cell(high.y + 1e-9) {
                for x in cell(low.x - 1e-9)..=cell(high.x + 1e-9) {
                    cells[y * side + x].push(t as u32);
                }
            }
        }
        Self { side, cells, corners }
    }

    /// The place of the triangles nearest to `q`, and its distance: 0 inside.
    pub(super) fn find(&self, q: DVec2) -> (f64, Place) {
        let cell = |v: f64| ((v * self.side as f64).max(0.0) as usize).min(self.side - 1);
        let (x, y) = (cell(q.x), cell(q.y));
        let mut best = (f64::INFINITY, Place { triangle: 0, weights: [1.0, 0.0, 0.0] });
        // Rings of cells around the point's own, until nothing nearer can come.
        for ring in 0..self.side {
            if best.0 <= (ring as f64 - 1.0) / self.side as f64 || best.0 == 0.0 {
                break;
            }
            for cy in y.saturating_sub(ring)..=(y + ring).min(self.side - 1) {
                for cx in x.saturating_sub(ring)..=(x + ring).min(self.side - 1) {
                    if cx.abs_diff(x).max(cy.abs_diff(y)) != ring {
                        continue;
                    }
                    for t in &self.cells[cy * self.side + cx] {
                        let (distance, weights) = nearest(q, self.corners[*t as usize]);
                        if distance < best.0 {
                            best = (distance, Place { triangle: *t as usize, weights });
                        }
                    }
                }
            }
        }
        best
    }
}

/// Distance of `q` to a triangle, and the weights of its corners at the nearest point.
fn nearest(q: DVec2, [a, b, c]: [DVec2; 3]) -> (f64, [f64; 3]) {
    let area = doubled_area([a, b, c]);
    if area != 0.0 {
        let weights =
            [doubled_area([q, b, c]) / area, doubled_area([a, q, c]) / area, doubled_area([a, b, q]) / area];
        if weights.iter().all(|w| *w >= -1e-9) {
            return (0.0, weights);
        }
    }
    let on = |p: DVec2, r: DVec2| {
        let d = r - p;
        let t = ((q - p).dot(d) / d.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        ((p + d * t).distance(q), t)
    };
    let [ab, bc, ca] = [on(a, b), on(b, c), on(c, a)];
    if ab.0 <= bc.0 && ab.0 <= ca.0 {
        (ab.0, [1.0 - ab.1, ab.1, 0.0])
    } else if bc.0 <= ca.0 {
        (bc.0, [0.0, 1.0 - bc.1, bc.1])
    } else {
        (ca.0, [ca.1, 0.0, 1.0 - ca.1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::mesh::Face;
    use tessuto_core::mesh::surface::distances_squared;

    /// A wavy sheet of bad triangles: irregular vertices, diagonals at random.
    fn wavy(turn: f64) -> Mesh {
        let mut rng = tessuto_core::math::rng::Rng::new(3, 0);
        let mut mesh = grid(41, 33, DVec2::new(0.5, 0.4), 1.0);
        for k in 0..mesh.positions.len() {
            let (c, r) = (k % 41, k / 41);
            let inner = c > 0 && r > 0 && c < 40 && r < 32;
            let shift = if inner { DVec2::new(rng.signed(), rng.signed()) * 0.3 } else { DVec2::ZERO };
            mesh.positions[k] += (shift * DVec2::new(0.5 / 40.0, 0.4 / 32.0)).extend(0.0);
            mesh.uvs[k] += shift * DVec2::new(1.0 / 40.0, -1.0 / 32.0);
            let p = &mut mesh.positions[k];
            p.z += 0.03 * (9.0 * p.x).sin() * (7.0 * p.y).cos();
            *p = DMat3::from_rotation_z(turn) * *p;
        }
        let quads = std::mem::take(&mut mesh.faces);
        for q in quads {
            let [a, b, c, d] = [q.vertices[0], q.vertices[1], q.vertices[2], q.vertices[3]];
            let split = if rng.uniform() < 0.5 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
            mesh.faces.extend(split.map(|t| Face { vertices: t.to_vec(), uvs: t.to_vec() }));
        }
        mesh
    }

    fn mean_distance(a: &Mesh, b: &Mesh) -> f64 {
        let [of_points, _] = distances_squared(&a.positions, &b.positions, &b.triangles());
        of_points.iter().map(|d| d.sqrt()).sum::<f64>() / of_points.len() as f64
    }

    #[test]
    fn over_uv_the_grid_lies_on_the_sheet() {
        let mesh = wavy(0.0);
        let made = remesh(&mesh, true, Resolution::Longer(26), "mesh").unwrap();
        assert_eq!((made.grid, made.over, made.in_holes), ([26, 21], Over::Uv, 0));
        assert!(mean_distance(&made.mesh, &mesh) < 1e-9, "grid vertices are points of the mesh");
        assert!(mean_distance(&mesh, &made.mesh) < 5e-4, "{}", mean_distance(&mesh, &made.mesh));
        // Order and uv are those of a grid: the first vertex is the upper left one.
        assert_eq!(made.mesh.uvs[0], DVec2::new(0.0, 1.0));
        assert!(made.mesh.positions[0].truncate().distance(DVec2::new(-0.25, -0.2)) < 1e-9);
        assert!(made.mesh.uvs[25].distance(DVec2::ONE) < 1e-9);
    }

    #[test]
    fn over_the_border_where_the_uv_has_no_use() {
        let mut mesh = wavy(0.2);
        mesh.uvs = vec![DVec2::ZERO];
        mesh.faces.iter_mut().for_each(|f| f.uvs = vec![0; 3]);
        let made = remesh(&mesh, false, Resolution::Grid([26, 21]), "mesh").unwrap();
        assert_eq!((made.over, made.in_holes), (Over::Border, 0));
        assert!(mean_distance(&made.mesh, &mesh) < 1e-9);
        assert!(mean_distance(&mesh, &made.mesh) < 1e-3, "{}", mean_distance(&mesh, &made.mesh));
        for (vertex, corner) in [(0, 0), (25, 40), (26 * 21 - 1, 41 * 33 - 1), (26 * 20, 41 * 32)] {
            assert!(made.mesh.positions[vertex].distance(mesh.positions[corner]) < 1e-6, "corner {vertex}");
        }
        // Cells are of one size, nearly: the map does not crowd.
        let edges = made.mesh.edges();
        let lengths: Vec<f64> = edges
            .iter()
            .map(|e| made.mesh.positions[e[0] as usize].distance(made.mesh.positions[e[1] as usize]))
            .collect();
        let (low, high) = lengths.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!(low > 0.012 && high < 0.03, "{low} to {high} m");
    }

    #[test]
    fn what_is_no_sheet_is_refused() {
        let mut mesh = wavy(0.0);
        let shift = mesh.positions.len() as u32;
        mesh.positions.extend(mesh.positions.clone().iter().map(|p| *p + DVec3::X));
        let more: Vec<Face> = mesh
            .faces
            .iter()
            .map(|f| Face { vertices: f.vertices.iter().map(|v| v + shift).collect(), uvs: f.uvs.clone() })
            .collect();
        mesh.faces.extend(more);
        let text = remesh(&mesh, true, Resolution::Longer(20), "mesh").unwrap_err().to_string();
        assert!(text.contains("2 separate pieces"), "{text}");
        let text = remesh(&wavy(0.0), true, Resolution::Longer(1), "mesh").unwrap_err().to_string();
        assert!(text.contains("3 to 512"), "{text}");
    }
}
