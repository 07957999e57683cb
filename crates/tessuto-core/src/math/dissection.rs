//! Nested dissection: an elimination order of a mesh's vertices whose factor is sparse, and which splits the
//! elimination into independent halves.
//!
//! Source: George, "Nested dissection of a regular finite element mesh", 1973; here by coordinate bisection.

use glam::DVec3;

/// Parts of at most this many vertices are not cut further. Denser leaves cost flops, smaller ones overhead.
const LEAF: usize = 12;

/// A part of the graph: its halves are eliminated first, then the vertices that separate them.
#[derive(Debug, Clone)]
pub(super) struct Part {
    /// Vertices eliminated here, in this order: a separator, or a whole leaf.
    pub vertices: Vec<u32>,
    /// The halves: two, or none for a leaf.
    pub halves: Vec<Part>,
}

impl Part {
    /// Number of vertices of the part and its halves.
    pub(super) fn vertex_count(&self) -> usize {
        self.vertices.len() + self.halves.iter().map(Self::vertex_count).sum::<usize>()
    }
}

/// Cuts the graph with the symmetric `neighbours` `[V]` at the medians of `positions` `[V]`.
///
/// The positions steer the quality of the order only; any are allowed.
pub(super) fn dissect(positions: &[DVec3], neighbours: &[Vec<usize>]) -> Part {
    let mut side = vec![0; positions.len()];
    let mut stamp = 0;
    cut((0..positions.len() as u32).collect(), positions, neighbours, &mut side, &mut stamp)
}

/// `side[v] == stamp` marks the vertices of the half that was cut last.
fn cut(
    mut vertices: Vec<u32>,
    positions: &[DVec3],
    neighbours: &[Vec<usize>],
    side: &mut [u32],
    stamp: &mut u32,
) -> Part {
    if vertices.len() <= LEAF {
        return Part { vertices, halves: Vec::new() };
    }
    let bounds = |f: fn(DVec3, DVec3) -> DVec3| vertices.iter().map(|&v| positions[v as usize]).reduce(f);
    let extent = bounds(DVec3::max).zip(bounds(DVec3::min)).map_or(DVec3::ZERO, |(high, low)| high - low);
    let axis = extent.max_position();
    // Equal coordinates are distinguished by the vertex, so that the order never depends on the sort.
    vertices.sort_by(|&a, &b| {
        let [pa, pb] = [a, b].map(|v| positions[v as usize][axis]);
        pa.total_cmp(&pb).then(a.cmp(&b))
    });
    let mut far = vertices.split_off(vertices.len() / 2);
    let mut near = vertices;
    // The separator: the vertices of one half that touch the other; of the half where they are fewer.
    let mut touching = |half: &[u32], other: &[u32]| -> Vec<bool> {
        *stamp += 1;
        other.iter().for_each(|&v| side[v as usize] = *stamp);
        let touches = |&v: &u32| neighbours[v as usize].iter().any(|&n| side[n] == *stamp);
        half.iter().map(touches).collect()
    };
    let (of_near, of_far) = (touching(&near, &far), touching(&far, &near));
    let count = |flags: &[bool]| flags.iter().filter(|&&f| f).count();
    let (half, flags) =
        if count(&of_near) < count(&of_far) { (&mut near, of_near) } else { (&mut far, of_far) };
    let (separator, rest): (Vec<_>, Vec<_>) = half.iter().zip(flags).partition(|(_, touches)| *touches);
    let take = |pairs: Vec<(&u32, bool)>| -> Vec<u32> { pairs.into_iter().map(|(&v, _)| v).collect() };
    let (separator, rest) = (take(separator), take(rest));
    *half = rest;
    let halves = [near, far]
        .into_iter()
        .filter(|half| !half.is_empty())
        .map(|half| cut(half, positions, neighbours, side, stamp))
        .collect();
    Part { vertices: separator, halves }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every vertex once, and no edge between the halves of any part.
    fn check(part: &Part, neighbours: &[Vec<usize>], seen: &mut [bool]) -> Vec<u32> {
        let halves: Vec<Vec<u32>> = part.halves.iter().map(|h| check(h, neighbours, seen)).collect();
        if let [a, b] = &halves[..] {
            for &v in a {
                assert!(neighbours[v as usize].iter().all(|&n| !b.contains(&(n as u32))));
            }
        }
        for &v in &part.vertices {
            assert!(!std::mem::replace(&mut seen[v as usize], true));
        }
        [halves.concat(), part.vertices.clone()].concat()
    }

    #[test]
    fn halves_do_not_touch_and_no_vertex_is_lost() {
        let n = 17;
        let at = |v: usize| DVec3::new((v % n) as f64, (v / n) as f64, 0.0);
        let positions: Vec<DVec3> = (0..n * n).map(at).collect();
        let near = |a: usize, b: usize| a != b && at(a).distance(at(b)) < 2.1;
        let neighbours: Vec<Vec<usize>> =
            (0..n * n).map(|a| (0..n * n).filter(|&b| near(a, b)).collect()).collect();
        for positions in [positions, vec![DVec3::ZERO; n * n]] {
            let mut seen = vec![false; n * n];
            let order = check(&dissect(&positions, &neighbours), &neighbours, &mut seen);
            assert_eq!(order.len(), n * n);
        }
    }
}
