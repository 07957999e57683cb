//! Connectivity of a mesh: edges and their faces, borders, pieces.

use std::collections::{BTreeMap, HashMap};

use super::Mesh;

/// How the faces along an edge run through it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EdgeUse {
    /// Faces that go from the smaller vertex to the larger one.
    pub ascending: usize,
    /// Faces that go the other way.
    pub descending: usize,
}

impl EdgeUse {
    /// Number of faces along the edge.
    pub fn faces(&self) -> usize {
        self.ascending + self.descending
    }
}

/// The faces along every polygon edge, by its vertices `[smaller, larger]`.
pub fn edge_uses(mesh: &Mesh) -> BTreeMap<[u32; 2], EdgeUse> {
    let mut uses = BTreeMap::<[u32; 2], EdgeUse>::new();
    for face in &mesh.faces {
        for (k, &a) in face.vertices.iter().enumerate() {
            let b = face.vertices[(k + 1) % face.vertices.len()];
            let found = uses.entry([a.min(b), a.max(b)]).or_default();
            *(if a < b { &mut found.ascending } else { &mut found.descending }) += 1;
        }
    }
    uses
}

/// Edges of one face only, as `[smaller, larger]`, in ascending order.
pub fn boundary_edges(mesh: &Mesh) -> Vec<[u32; 2]> {
    edge_uses(mesh).into_iter().filter(|(_, found)| found.faces() == 1).map(|(edge, _)| edge).collect()
}

/// Number of faces of each connected piece, the largest first.
pub fn pieces(mesh: &Mesh) -> Vec<usize> {
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    for face in &mesh.faces {
        for pair in face.vertices.windows(2) {
            let (a, b) = (root(&mut parent, pair[0]), root(&mut parent, pair[1]));
            parent[a as usize] = b;
        }
    }
    let mut counts: HashMap<u32, usize> = HashMap::new();
    for face in &mesh.faces {
        *counts.entry(root(&mut parent, face.vertices[0])).or_default() += 1;
    }
    let mut counts: Vec<usize> = counts.into_values().collect();
    counts.sort_unstable_by(|a, b| b.cmp(a));
    counts
}

/// Vertices at which faces meet that share no edge there, as at the tip of two cones; ascending.
pub fn pinched(mesh: &Mesh) -> Vec<u32> {
    // Per vertex, the neighbours along the two edges of each of its faces.
    let mut around: Vec<Vec<[u32; 2]>> = vec![Vec::new(); mesh.positions.len()];
    for face in &mesh.faces {
        let n = face.vertices.len();
        for (k, v) in face.vertices.iter().enumerate() {
            around[*v as usize].push([face.vertices[(k + n - 1) % n], face.vertices[(k + 1) % n]]);
        }
    }
    let one_fan = |faces: &Vec<[u32; 2]>| {
        let mut left = faces.clone();
        let Some(mut reached) = left.pop().map(|f| f.to_vec()) else { return true };
        while let Some(k) = left.iter().position(|f| reached.contains(&f[0]) || reached.contains(&f[1])) {
            reached.extend(left.swap_remove(k));
        }
        left.is_empty()
    };
    (0..mesh.positions.len() as u32).filter(|v| !one_fan(&around[*v as usize])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Face, grid};

    #[test]
    fn a_grid_is_bounded_by_its_four_sides() {
        let mut mesh = grid(4, 3, glam::DVec2::ONE, 1.0);
        assert_eq!(boundary_edges(&mesh).len(), 2 * (3 + 2));
        assert_eq!(edge_uses(&mesh).len(), mesh.edges().len());
        assert!(edge_uses(&mesh).values().all(|u| u.ascending <= 1 && u.descending <= 1));
        mesh.faces[0].vertices.reverse();
        assert!(edge_uses(&mesh).values().any(|u| *u == EdgeUse { ascending: 2, descending: 0 }));
    }

    #[test]
    fn pieces_and_pinches() {
        let mut mesh = grid(4, 4, glam::DVec2::ONE, 1.0);
        assert_eq!((pieces(&mesh), pinched(&mesh)), (vec![9], vec![]));
        // Two opposite quads at vertex 5 go: the other two meet there only.
        mesh.faces
            .retain(|f| !(f.vertices.contains(&0) || f.vertices.contains(&10) && f.vertices.contains(&5)));
        assert_eq!((pieces(&mesh), pinched(&mesh)), (vec![7], vec![5]));
        let far: Vec<u32> = (16..19).collect();
        mesh.positions.extend([glam::DVec3::ONE; 3]);
        mesh.faces.push(Face { vertices: far, uvs: vec![0, 1, 2] });
        assert_eq!(pieces(&mesh), vec![7, 1]);
    }
}
