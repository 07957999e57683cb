//! The point-to-surface distance of the published evaluator, kept to compare with printed figures.
//!
//! It adds 1e-5 m⁴ to the denominator of the barycentric coordinates. For triangles of a few
//! centimetres that denominator is about 1e-7 m⁴, so the inside test accepts a region some 100
//! times too wide and takes the distance to the *plane* there: values read far too small.

use glam::DVec3;

use tessuto_core::mesh::boxes::{Bounds, BoxTree};

/// What the published formula adds to the denominator `[m⁴]`.
const EXTRA: f64 = 1e-5;

/// Squared distances `[m²]` as in [`tessuto_core::mesh::surface::distances_squared`], with the inexact inside test.
///
/// - `exact`: the exact ones. They bound the result: whatever is truly inside is also accepted
///   here, and where a pair is accepted its plane distance is not above the exact one.
///
/// A plane is accepted far away from its triangle; left out are groups of points that it passes at a distance that
/// lowers none of theirs, nor the triangle's.
pub fn distances_squared(
    points: &[DVec3],
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    exact: &[Vec<f64>; 2],
) -> [Vec<f64>; 2] {
    let tree = BoxTree::of_points(points);
    let with_exact: Vec<(DVec3, f64)> =
        tree.order().iter().map(|k| (points[*k as usize], exact[0][*k as usize])).collect();
    let mut groups: Vec<Group> = with_exact.chunks(LANES * BLOCKS).map(Group::new).collect();
    let plane = |(t, exact): (&[u32; 3], &f64)| {
        let [a, b, c] = t.map(|i| positions[i as usize]);
        let Some(plane) = Plane::new(a, b, c) else { return *exact };
        groups.iter_mut().fold(*exact, |smallest, group| plane.reduce(group, smallest))
    };
    let triangle_distances = triangles.iter().zip(&exact[1]).map(plane).collect();
    let mut point_distances = vec![0.0; points.len()];
    let best = groups.iter().flat_map(|group| &group.blocks).flat_map(|block| block.best);
    tree.order().iter().zip(best).for_each(|(k, best)| point_distances[*k as usize] = best);
    [point_distances, triangle_distances]
}

/// Blocks of points that lie close together.
const BLOCKS: usize = 4;

/// Points close together.
struct Group {
    blocks: Vec<Block>,
    /// Centre and half of the size of the box around them.
    bounds: (DVec3, DVec3),
    /// The largest of their smallest squared distances so far.
    worst: f64,
}

impl Group {
    fn new(points: &[(DVec3, f64)]) -> Self {
        Self {
            blocks: points.chunks(LANES).map(Block::new).collect(),
            bounds: Bounds::around(points.iter().map(|(p, _)| *p)).centre(),
            worst: points.iter().map(|(_, best)| *best).fold(0.0, f64::max),
        }
    }
}

/// More than a height may be off by rounding, for scenes of less than a kilometre `[m]`.
const ROUNDING: f64 = 1e-9;

/// Points side by side, for the processor's vector registers.
const LANES: usize = 8;

/// Coordinates of points and their smallest squared distances so far.
struct Block {
    x: [f64; LANES],
    y: [f64; LANES],
    z: [f64; LANES],
    best: [f64; LANES],
}

impl Block {
    /// Missing points are NaN, which no test accepts.
    fn new(points: &[(DVec3, f64)]) -> Self {
        let [x, y, z] =
            [0, 1, 2].map(|axis| std::array::from_fn(|k| points.get(k).map_or(f64::NAN, |(p, _)| p[axis])));
        Self {
            x,
            y,
            z,
            best: std::array::from_fn(|k| points.get(k).map_or(f64::INFINITY, |(_, best)| *best)),
        }
    }
}

/// v(p), w(p): the wrong barycentric coordinates, h(p): height over the plane; each affine in p.
struct Plane {
    v: (DVec3, f64),
    w: (DVec3, f64),
    h: (DVec3, f64),
}

impl Plane {
    /// None for a triangle without area.
    fn new(a: DVec3, b: DVec3, c: DVec3) -> Option<Self> {
        let (e0, e1) = (b - a, c - a);
        let normal = e0.cross(e1).try_normalize()?;
        let (d00, d01, d11) = (e0.dot(e0), e0.dot(e1), e1.dot(e1));
        let denominator = d00 * d11 - d01 * d01 + EXTRA;
        let affine = |g: DVec3| (g, -g.dot(a));
        Some(Self {
            v: affine((e0 * d11 - e1 * d01) / denominator),
            w: affine((e1 * d00 - e0 * d01) / denominator),
            h: affine(normal),
        })
    }

    /// Lower each point's squared distance to that of this plane where it is accepted; returns the
    /// smallest accepted one, or `smallest` if that is not above it.
    fn reduce(&self, group: &mut Group, smallest: f64) -> f64 {
        let (centre, half) = group.bounds;
        let height = (self.h.0.dot(centre) + self.h.1).abs() - self.h.0.abs().dot(half) - ROUNDING;
        if height > 0.0 && height * height > group.worst.max(smallest) {
            return smallest;
        }
        let mut smallest = [smallest; LANES];
        for block in &mut group.blocks {
            for (k, smallest) in smallest.iter_mut().enumerate() {
                let at = |(g, o): &(DVec3, f64)| g.x * block.x[k] + g.y * block.y[k] + g.z * block.z[k] + o;
                let (v, w, h) = (at(&self.v), at(&self.w), at(&self.h));
                let accepted = (v >= 0.0) & (w >= 0.0) & (v + w <= 1.0);
                let squared = if accepted { h * h } else { f64::INFINITY };
                block.best[k] = if squared < block.best[k] { squared } else { block.best[k] };
                *smallest = if squared < *smallest { squared } else { *smallest };
            }
        }
        // Lanes beyond the last point are infinite.
        let best = group.blocks.iter().flat_map(|block| block.best).filter(|best| best.is_finite());
        group.worst = best.fold(0.0, f64::max);
        smallest.into_iter().fold(f64::INFINITY, f64::min)
    }
}
