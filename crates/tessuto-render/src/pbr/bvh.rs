//! Bounding volume hierarchy of the triangles of one frame: which of eight rays from one point are blocked.

use glam::{DVec3, Vec3};
use wide::f32x8;

/// Triangles per leaf, at most.
const LEAF: usize = 4;

/// Hits nearer than this `[m]` do not count: a point's own place on the cloth is known no better.
pub(super) const NEAREST: f32 = 1e-5;

/// Axis-aligned box with two children, or with triangles.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    /// Lower corner `[m]`.
    pub low: Vec3,
    /// Upper corner `[m]`.
    pub high: Vec3,
    /// Inner node: the second child; the first one follows the node. Leaf: the first triangle.
    pub index: u32,
    /// Number of triangles of a leaf; 0 in an inner node.
    pub count: u32,
}

/// A corner and the edges from it.
#[derive(Debug, Clone, Copy)]
struct Triangle {
    corner: Vec3,
    edges: [Vec3; 2],
    id: u32,
}

/// Binary tree of boxes, split at the median of the longest side.
#[derive(Debug, Clone)]
pub(super) struct Bvh {
    pub nodes: Vec<Node>,
    triangles: Vec<Triangle>,
}

impl Bvh {
    /// The tree of `triangles` with vertices at `positions` `[m]`.
    pub fn new(triangles: &[[u32; 3]], positions: &[DVec3]) -> Self {
        let corners = |t: &[u32; 3]| t.map(|v| positions[v as usize].as_vec3());
        let mut items: Vec<Triangle> = triangles
            .iter()
            .enumerate()
            .map(|(id, t)| {
                let [a, b, c] = corners(t);
                Triangle { corner: a, edges: [b - a, c - a], id: id as u32 }
            })
            .collect();
        let mut nodes = Vec::with_capacity(triangles.len());
        if !items.is_empty() {
            build(&mut items, 0, &mut nodes);
        }
        Self { nodes, triangles: items }
    }

    /// Ids of the triangles of leaf `node`.
    pub fn leaf(&self, node: &Node) -> impl Iterator<Item = u32> + '_ {
        let first = node.index as usize;
        self.triangles[first..first + node.count as usize].iter().map(|t| t.id)
    }

    /// Which of eight rays from `origin`, those with `active` set, meet a triangle other than `own`. Both sides
    /// block.
    pub fn blocked(&self, origin: Vec3, own: u32, direction: &[f32x8; 3], active: f32x8) -> f32x8 {
        let zero = f32x8::ZERO;
        let mut hit = zero;
        // A tiny component in place of 0 keeps the slab test free of 0 · ∞.
        let inverse = direction.map(|d| {
            let tiny = d.abs().simd_lt(f32x8::splat(1e-18));
            f32x8::ONE / tiny.select(f32x8::splat(1e-18), d)
        });
        let mut stack = [0u32; 64];
        let mut height = usize::from(!self.nodes.is_empty());
        while height > 0 {
            height -= 1;
            let at = stack[height];
            let node = &self.nodes[at as usize];
            let (low, high) = ((node.low - origin).to_array(), (node.high - origin).to_array());
            let (mut near, mut far) = (zero, f32x8::splat(f32::MAX));
            for axis in 0..3 {
                let (a, b) =
                    (f32x8::splat(low[axis]) * inverse[axis], f32x8::splat(high[axis]) * inverse[axis]);
                near = near.fast_max(a.fast_min(b));
                far = far.fast_min(a.fast_max(b));
            }
            let open = near.simd_le(far) & active & !hit;
            if !open.any() {
                continue;
            }
            if node.count == 0 {
                stack[height] = node.index;
                stack[height + 1] = at + 1;
                height += 2;
                continue;
            }
            let first = node.index as usize;
            for triangle in &self.triangles[first..first + node.count as usize] {
                if triangle.id != own {
                    hit |= meets(triangle, origin, direction) & active;
                }
            }
            if (hit & active).to_bitmask() == active.to_bitmask() {
                break;
            }
        }
        hit
    }
}

/// Möller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection".
#[inline]
fn meets(triangle: &Triangle, origin: Vec3, d: &[f32x8; 3]) -> f32x8 {
    let splat = |v: Vec3| v.to_array().map(f32x8::splat);
    let cross = |a: &[f32x8; 3], b: &[f32x8; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let dot = |a: &[f32x8; 3], b: &[f32x8; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let [e1, e2] = triangle.edges;
    let from = origin - triangle.corner;
    // The origin is common, so what does not depend on the direction is computed once.
    let q = from.cross(e1);
    let p = cross(d, &splat(e2));
    let det = dot(&splat(e1), &p);
    let inverse = f32x8::ONE / det;
    let u = dot(&splat(from), &p) * inverse;
    let v = dot(d, &splat(q)) * inverse;
    let t = f32x8::splat(e2.dot(q)) * inverse;
    let zero = f32x8::ZERO;
    // A ray in the triangle's plane has det 0: infinities and NaN, and all comparisons with NaN fail.
    u.simd_ge(zero) & v.simd_ge(zero) & (u + v).simd_le(f32x8::ONE) & t.simd_gt(f32x8::splat(NEAREST))
}

fn bounds(t: &Triangle) -> [Vec3; 2] {
    let (b, c) = (t.corner + t.edges[0], t.corner + t.edges[1]);
    [t.corner.min(b).min(c), t.corner.max(b).max(c)]
}

fn build(items: &mut [Triangle], first: usize, nodes: &mut Vec<Node>) {
    let empty = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    let [low, high] = items.iter().map(bounds).fold(empty, |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    // Above the rounding of the slab test, so that no triangle on the box's face is missed.
    let margin = (high - low).max_element() * 1e-4 + 1e-7;
    let at = nodes.len();
    nodes.push(Node {
        low: low - margin,
        high: high + margin,
        index: first as u32,
        count: items.len() as u32,
    });
    if items.len() <= LEAF {
        return;
    }
    let axis = (high - low).max_position();
    let middle = items.len() / 2;
    let key = |t: &Triangle| bounds(t)[0][axis] + bounds(t)[1][axis];
    items.sort_unstable_by(|a, b| key(a).total_cmp(&key(b)).then(a.id.cmp(&b.id)));
    let (left, right) = items.split_at_mut(middle);
    build(left, first, nodes);
    nodes[at].index = nodes.len() as u32;
    nodes[at].count = 0;
    build(right, first + middle, nodes);
}
