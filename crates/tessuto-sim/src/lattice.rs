//! A regular grid of quads as an image: which vertex is which pixel.

use std::collections::BTreeSet;

use tessuto_core::mesh::{Mesh, boundary_edges};

/// Fewest vertices along either side.
const SHORTEST: usize = 3;

/// Where the vertices and edges of a mesh of quads lie in rows and columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Lattice {
    /// Number of rows of vertices.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Vertex of every pixel, row by row.
    pub vertices: Vec<u32>,
    /// Edge to the next column and to the next row of every pixel, as numbered by [`Mesh::edges`].
    pub edges: Vec<[Option<u32>; 2]>,
    /// Mean length of the edges at rest `[m]`.
    pub spacing: f64,
}

impl Lattice {
    /// That of `mesh`; `None` if it is no grid of quads, three by three vertices at least.
    pub fn of(mesh: &Mesh) -> Option<Self> {
        let around = mesh.neighbours();
        let border = boundary_edges(mesh);
        let is_border: BTreeSet<[u32; 2]> = border.iter().copied().collect();
        let on_border = |a: u32, b: u32| is_border.contains(&[a.min(b), a.max(b)]);
        let first = (0..around.len() as u32).find(|&v| around[v as usize].len() == 2)?;
        // Along the border to the next corner.
        let mut vertices = vec![first];
        let mut placed = vec![false; around.len()];
        placed[first as usize] = true;
        loop {
            let here = *vertices.last()?;
            if vertices.len() > 1 && around[here as usize].len() == 2 {
                break;
            }
            let next =
                around[here as usize].iter().copied().find(|&n| !placed[n as usize] && on_border(here, n))?;
            placed[next as usize] = true;
            vertices.push(next);
        }
        let columns = vertices.len();
        while vertices.len() < around.len() {
            for k in vertices.len() - columns..vertices.len() {
                let mut below = around[vertices[k] as usize].iter().copied().filter(|&n| !placed[n as usize]);
                let next = below.next().filter(|_| below.next().is_none())?;
                placed[next as usize] = true;
                vertices.push(next);
            }
        }
        let rows = vertices.len() / columns;
        let all = mesh.edges();
        let edge = |a: u32, b: u32| all.binary_search(&[a.min(b), a.max(b)]).ok().map(|e| e as u32);
        let mut edges = vec![[None; 2]; vertices.len()];
        let mut length = 0.0;
        for (k, edges) in edges.iter_mut().enumerate() {
            let has = [k % columns + 1 < columns, k / columns + 1 < rows];
            for side in (0..2).filter(|side| has[*side]) {
                let [a, b] = [vertices[k], vertices[k + [1, columns][side]]];
                edges[side] = Some(edge(a, b)?);
                length += mesh.positions[a as usize].distance(mesh.positions[b as usize]);
            }
        }
        let is_whole = all.len() == rows * (columns - 1) + columns * (rows - 1)
            && mesh.faces.len() == (rows - 1) * (columns - 1)
            && rows.min(columns) >= SHORTEST;
        is_whole.then(|| Self { rows, columns, vertices, spacing: length / all.len() as f64, edges })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use tessuto_core::mesh::{Face, grid};

    #[test]
    fn a_shuffled_grid_is_found() {
        let mesh = grid(5, 4, DVec2::new(0.4, 0.3), 1.0);
        // Vertices in another order, mirrored on the way.
        let place = |v: usize| (v * 7 + 3) % 20;
        let mut other = mesh.clone();
        mesh.positions.iter().enumerate().for_each(|(v, p)| other.positions[place(v)] = *p);
        for face in &mut other.faces {
            face.vertices.iter_mut().for_each(|v| *v = place(*v as usize) as u32);
        }
        for mesh in [&mesh, &other] {
            let lattice = Lattice::of(mesh).unwrap();
            assert_eq!(lattice.rows * lattice.columns, 20);
            assert!((lattice.spacing - 0.1).abs() < 1e-12);
            let at = |k: usize| mesh.positions[lattice.vertices[k] as usize];
            let [along, down] = [at(1) - at(0), at(lattice.columns) - at(0)];
            assert!(along.dot(down).abs() < 1e-12);
            for (k, edges) in lattice.edges.iter().enumerate() {
                for (edge, (arm, next)) in edges.iter().zip([(along, 1), (down, lattice.columns)]) {
                    let Some(edge) = edge else { continue };
                    let ends = mesh.edges()[*edge as usize];
                    let [a, b] = [k, k + next].map(|k| lattice.vertices[k]);
                    assert_eq!(ends, [a.min(b), a.max(b)]);
                    assert!((at(k + next) - at(k)).distance(arm) < 1e-12, "{k}");
                }
            }
            assert_eq!(lattice.edges.iter().flatten().flatten().count(), mesh.edges().len());
        }
    }

    #[test]
    fn other_meshes_are_none() {
        let mesh = grid(5, 4, DVec2::new(0.4, 0.3), 1.0);
        let mut triangles = mesh.clone();
        let split = |f: &Face, corners: [usize; 3]| Face {
            vertices: corners.map(|c| f.vertices[c]).to_vec(),
            uvs: corners.map(|c| f.uvs[c]).to_vec(),
        };
        triangles.faces =
            mesh.faces.iter().flat_map(|f| [split(f, [0, 1, 2]), split(f, [0, 2, 3])]).collect();
        let mut with_hole = mesh.clone();
        with_hole.faces.remove(5);
        for other in [triangles, with_hole, grid(2, 5, DVec2::ONE, 1.0)] {
            assert_eq!(Lattice::of(&other), None);
        }
    }
}
