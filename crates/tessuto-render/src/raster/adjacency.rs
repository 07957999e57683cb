//! Which triangle lies across each edge.

use std::collections::HashMap;

/// No triangle.
pub(super) const NONE: u32 = u32::MAX;

/// The other side of one triangle edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Across {
    /// Triangle on the other side, [`NONE`] at the border of the mesh.
    pub triangle: u32,
    /// Corner of that triangle opposite to the edge.
    pub corner: u8,
    /// Whether both triangles run through the edge in the same direction, which they do only where
    /// they are wound differently.
    pub wound_differently: bool,
}

/// For every triangle, what lies across the edge opposite to its corner k (from corner k+1 to k+2).
/// An edge of more than two triangles counts as a border for each of them. Shape [T, 3].
pub(super) fn adjacency(triangles: &[[u32; 3]]) -> Vec<[Across; 3]> {
    let border = Across { triangle: NONE, corner: 0, wound_differently: false };
    let mut across = vec![[border; 3]; triangles.len()];
    let mut edges: HashMap<[u32; 2], Vec<(usize, usize)>> = HashMap::new();
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let [a, b] = edge(corners, k);
            edges.entry([a.min(b), a.max(b)]).or_default().push((t, k));
        }
    }
    for sides in edges.values() {
        let &[(t0, k0), (t1, k1)] = sides.as_slice() else { continue };
        let wound_differently = edge(&triangles[t0], k0) == edge(&triangles[t1], k1);
        across[t0][k0] = Across { triangle: t1 as u32, corner: k1 as u8, wound_differently };
        across[t1][k1] = Across { triangle: t0 as u32, corner: k0 as u8, wound_differently };
    }
    across
}

/// The edge opposite to corner `k`, in the direction in which the triangle runs.
pub(super) fn edge(corners: &[u32; 3], k: usize) -> [u32; 2] {
    [corners[(k + 1) % 3], corners[(k + 2) % 3]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_edge_is_found_from_both_sides() {
        let across = adjacency(&[[0, 1, 2], [2, 1, 3], [1, 3, 4], [5, 6, 7]]);
        assert_eq!(across[0][0], Across { triangle: 1, corner: 2, wound_differently: false });
        assert_eq!(across[1][2], Across { triangle: 0, corner: 0, wound_differently: false });
        assert_eq!(across[1][0], Across { triangle: 2, corner: 2, wound_differently: true });
        assert!(across[3].iter().all(|a| a.triangle == NONE));
    }
}
