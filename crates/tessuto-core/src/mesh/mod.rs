//! Polygon mesh: the template of the first frame, whose edges are the threads of the cloth.

mod attributes;
#[doc(hidden)]
pub mod boxes;
mod motion;
mod sides;
pub mod surface;
mod topology;
mod weld;

use glam::{DVec2, DVec3};

pub use attributes::{SEAM, vertex_normals, vertex_uvs};
pub use motion::Motion;
pub use sides::Side;
pub use topology::{EdgeUse, boundary_edges, edge_uses, pieces, pinched};
pub use weld::weld;

/// Vertex positions `[m]` of one moment, camera frame, shape `[V]`.
pub type Positions = Vec<DVec3>;

/// Diagonal of the bounding box `[m]`.
pub fn diagonal(positions: &[DVec3]) -> f64 {
    let low = positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    (high - low).length()
}

/// One polygon: corner k has vertex `vertices[k]` and texture coordinate `uvs[k]`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Face {
    /// Indices into [`Mesh::positions`].
    pub vertices: Vec<u32>,
    /// Indices into [`Mesh::uvs`], as many as `vertices`.
    pub uvs: Vec<u32>,
}

/// Polygon mesh with texture coordinates. Vertices are never split at uv seams.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// Vertex positions `[m]`, camera frame, shape `[V]`.
    pub positions: Vec<DVec3>,
    /// Texture coordinates; (0, 0) is the lower left corner of the texture image, row 0 is v = 1.
    pub uvs: Vec<DVec2>,
    /// Polygons, wound alike.
    pub faces: Vec<Face>,
}

impl Mesh {
    /// Vertices of the triangles: each polygon is a fan around its corner 0. Shape `[T]`.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        self.faces.iter().flat_map(|f| fan(&f.vertices)).collect()
    }

    /// Texture coordinates of the [triangles](Self::triangles), indices into `uvs`. Shape `[T]`.
    pub fn triangle_uvs(&self) -> Vec<[u32; 3]> {
        self.faces.iter().flat_map(|f| fan(&f.uvs)).collect()
    }

    /// Polygon edges (no diagonals), each once as `[smaller, larger]`, in ascending order.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        let mut edges: Vec<[u32; 2]> = self
            .faces
            .iter()
            .flat_map(|f| {
                let n = f.vertices.len();
                (0..n).map(move |k| {
                    let (a, b) = (f.vertices[k], f.vertices[(k + 1) % n]);
                    [a.min(b), a.max(b)]
                })
            })
            .collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    /// Neighbours along polygon edges of every vertex, ascending. Shape `[V]`.
    pub fn neighbours(&self) -> Vec<Vec<u32>> {
        let mut neighbours = vec![Vec::new(); self.positions.len()];
        for [a, b] in self.edges() {
            neighbours[a as usize].push(b);
            neighbours[b as usize].push(a);
        }
        for list in &mut neighbours {
            list.sort_unstable();
        }
        neighbours
    }

    /// Area `[m²]` of the triangulated surface at `positions`.
    pub fn area(&self) -> f64 {
        self.triangles().iter().map(|t| triangle_area(&self.positions, *t)).sum()
    }
}

/// Area `[m²]` of one triangle.
#[inline]
pub fn triangle_area(positions: &[DVec3], [a, b, c]: [u32; 3]) -> f64 {
    let (a, b, c) = (positions[a as usize], positions[b as usize], positions[c as usize]);
    0.5 * (b - a).cross(c - a).length()
}

fn fan(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> + '_ {
    (1..corners.len().saturating_sub(1)).map(|k| [corners[0], corners[k], corners[k + 1]])
}

/// Flat grid of quads in the plane z = `depth` `[m]`, centred on the optical axis: `columns`×`rows`
/// vertices, row-major from the upper left, uv = (column/(columns−1), 1 − row/(rows−1)).
pub fn grid(columns: usize, rows: usize, size: DVec2, depth: f64) -> Mesh {
    assert!(columns >= 2 && rows >= 2, "a grid needs at least 2×2 vertices, not {columns}×{rows}");
    let mut mesh = Mesh { positions: Vec::new(), uvs: Vec::new(), faces: Vec::new() };
    for r in 0..rows {
        for c in 0..columns {
            let (u, v) = (c as f64 / (columns - 1) as f64, r as f64 / (rows - 1) as f64);
            mesh.positions.push(DVec3::new((u - 0.5) * size.x, (v - 0.5) * size.y, depth));
            mesh.uvs.push(DVec2::new(u, 1.0 - v));
        }
    }
    for r in 0..rows - 1 {
        for c in 0..columns - 1 {
            let o = (r * columns + c) as u32;
            let w = columns as u32;
            let corners = vec![o, o + w, o + w + 1, o + 1];
            mesh.faces.push(Face { vertices: corners.clone(), uvs: corners });
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_has_the_expected_counts_and_area() {
        let mesh = grid(5, 4, DVec2::new(0.4, 0.3), 1.0);
        assert_eq!(mesh.positions.len(), 20);
        assert_eq!(mesh.edges().len(), 4 * 4 + 5 * 3);
        assert_eq!(mesh.triangles().len(), 24);
        assert!((mesh.area() - 0.12).abs() < 1e-15);
        assert_eq!(mesh.neighbours()[6], [1, 5, 7, 11]);
    }
}
