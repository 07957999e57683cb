//! The meshes of synthetic cloth.

use glam::{DVec2, DVec3};

use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::{Face, Mesh, grid};

/// How the cloth is divided into faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum MeshKind {
    /// A regular grid of quads.
    Quads,
    /// The same, each cut into two triangles.
    Triangles,
    /// Triangles of uneven size and direction.
    Irregular,
}

/// Vertices are moved by up to this fraction of the distance to their neighbours.
const JITTER: f64 = 0.3;

/// A flat cloth of `size` `[m]` at `depth` `[m]` with `columns`×`rows` vertices, row by row from the upper left.
pub fn lattice(kind: MeshKind, [columns, rows]: [usize; 2], size: DVec2, depth: f64, seed: u64) -> Mesh {
    let mut mesh = grid(columns, rows, size, depth);
    if kind == MeshKind::Quads {
        return mesh;
    }
    let mut rng = Rng::new(seed, 2);
    if kind == MeshKind::Irregular {
        let spacing = DVec2::new(1.0 / (columns - 1) as f64, 1.0 / (rows - 1) as f64) * JITTER;
        for (k, uv) in mesh.uvs.iter_mut().enumerate() {
            let (column, row) = (k % columns, k / columns);
            let (u, v) = (rng.signed() * spacing.x, rng.signed() * spacing.y);
            // The outline stays a rectangle, and its upper edge as it is: pins hold it.
            uv.x += if column == 0 || column + 1 == columns || row == 0 { 0.0 } else { u };
            uv.y += if row == 0 || row + 1 == rows { 0.0 } else { v };
            let p = (DVec2::new(uv.x, 1.0 - uv.y) - 0.5) * size;
            mesh.positions[k] = DVec3::new(p.x, p.y, depth);
        }
    }
    let halves = |face: &Face| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| face.vertices[k]);
        let other = kind == MeshKind::Irregular && rng.uniform() < 0.5;
        let triangles = if other { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] };
        triangles.map(|t| Face { vertices: t.to_vec(), uvs: t.to_vec() })
    };
    mesh.faces = mesh.faces.iter().flat_map(halves).collect();
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_covers_the_same_cloth_once() {
        for kind in [MeshKind::Quads, MeshKind::Triangles, MeshKind::Irregular] {
            for seed in 0..20 {
                let mesh = lattice(kind, [6, 5], DVec2::new(0.5, 0.4), 1.0, seed);
                assert!((mesh.area() - 0.2).abs() < 1e-12, "{kind:?}: {}", mesh.area());
                let area = |t: &[u32; 3]| {
                    let [a, b, c] = t.map(|v| mesh.positions[v as usize].truncate());
                    (b - a).perp_dot(c - a)
                };
                // Together with the area: none is turned over.
                assert!(mesh.triangles().iter().all(|t| area(t) < -1e-6), "{kind:?}, seed {seed}");
                let faces = if kind == MeshKind::Quads { 20 } else { 40 };
                assert_eq!((mesh.positions.len(), mesh.faces.len()), (30, faces));
            }
        }
    }
}
