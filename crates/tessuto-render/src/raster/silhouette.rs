//! Analytic antialiasing: blends of neighbouring pixels where a silhouette edge passes between their
//! centres.
//!
//! Of two horizontal or vertical neighbours that show different triangles, the one with the greater
//! inverse depth (background has 0) is the occluder. Starting in its triangle we walk over the surface
//! towards the other pixel's centre, from triangle to triangle, until we either leave the surface
//! across a silhouette edge (its border, or a fold), at the fraction d of the way, or arrive. If d > ½
//! the other pixel receives the occluder's colour with weight d − ½, else the occluder receives the
//! other's with weight ½ − d. A pixel may receive from several neighbours: out = c + Σ w (c_partner −
//! c), all of them unblended colours.
//!
//! Horizontal pairs take edges steeper than 45° in the image, vertical pairs the others. Then the
//! blends of one edge sum to its exact area between pixel rows (or columns); were both kinds of pair
//! to take an edge, its coverage and its gradient would count twice.
//!
//! Source: Laine et al. 2020, "Modular Primitives for High-Performance Differentiable Rendering",
//! §3.5. We differ: the walk also finds edges of triangles that cover no pixel centre, and blends do
//! not depend on their order.

use glam::{DVec3, Vec4};

use super::adjacency::{Across, NONE, edge};
use super::bins::BAND_ROWS;
use super::blend::Blend;
use super::{Rasterizer, Rendering};

/// Triangles that the walk between two pixel centres may cross; more only fit if triangles are far
/// smaller than pixels.
pub(super) const MAX_STEPS: usize = 16;

/// A silhouette edge between two pixel centres.
struct Crossing {
    /// Vertices A and B of the edge, with A × B pointing to the surface.
    edge: [u32; 2],
    /// (A × B) · r at the occluder's and the other pixel's ray.
    values: [f64; 2],
    /// A × B `[m²]`.
    plane: DVec3,
}

/// Finds where the surface goes on smoothly: an edge is a silhouette if it is a border or if its
/// neighbour is not drawn or shows its other side.
pub(super) fn join_triangles(across: &[[Across; 3]], rendering: &mut Rendering) {
    let projected = &rendering.projected;
    rendering.joined.clear();
    rendering.joined.extend(across.iter().zip(projected).map(|(across, p)| {
        across.map(|a| {
            let same_side = if a.wound_differently { -p.facing } else { p.facing };
            let smooth = a.triangle != NONE && projected[a.triangle as usize].facing == same_side;
            if smooth { a.triangle } else { NONE }
        })
    }));
}

/// Finds all blends whose upper or left pixel lies in band `band`.
pub(super) fn find_blends(
    rasterizer: &Rasterizer,
    rendering: &Rendering,
    band: usize,
    blends: &mut Vec<Blend>,
) {
    let Some(bounds) = rendering.bins.bounds else { return };
    // One pixel more on each side, to see the pairs of an outline pixel with the background.
    let (x0, x1) = (bounds.x0.saturating_sub(1), (bounds.x1 + 1).min(rendering.width));
    let first = (band * BAND_ROWS).max(bounds.y0.saturating_sub(1));
    let end = ((band + 1) * BAND_ROWS).min(bounds.y1 + 1).min(rendering.height);
    let width = rendering.width;
    for j in first..end {
        let row = &rendering.triangle[j * width + x0..j * width + x1];
        for (i, pair) in row.windows(2).enumerate() {
            if may_blend(rendering, pair[0], pair[1]) {
                let pixel = j * width + x0 + i;
                blends.extend(find_blend(rasterizer, rendering, pixel, pixel + 1));
            }
        }
        if j + 1 < rendering.height {
            let below = &rendering.triangle[(j + 1) * width + x0..(j + 1) * width + x1];
            for (i, (upper, lower)) in row.iter().zip(below).enumerate() {
                if may_blend(rendering, *upper, *lower) {
                    let pixel = j * width + x0 + i;
                    blends.extend(find_blend(rasterizer, rendering, pixel, pixel + width));
                }
            }
        }
    }
}

/// False for pixels that show the same triangle or, the most frequent case else, two that are joined
/// smoothly.
#[inline]
fn may_blend(rendering: &Rendering, t0: u32, t1: u32) -> bool {
    t0 != t1 && (t0 == NONE || t1 == NONE || !rendering.joined[t0 as usize].contains(&t1))
}

/// The blend, if any, of two neighbouring pixels `p` < `q` that show different triangles.
fn find_blend(rasterizer: &Rasterizer, rendering: &Rendering, p: usize, q: usize) -> Option<Blend> {
    let depth = |pixel: usize| rendering.inverse_depth[pixel];
    let (occluder, other) = if depth(p) >= depth(q) { (p, q) } else { (q, p) };
    let (start, target) = (rendering.triangle[occluder], rendering.triangle[other]);
    let ray = |pixel: usize| {
        DVec3::new(rendering.rays.x[pixel % rendering.width], rendering.rays.y[pixel / rendering.width], 1.0)
    };
    let (r0, r1) = (ray(occluder), ray(other));
    let crossing = walk(rasterizer, rendering, [start, target], r0, r1)?;
    // The edge's normal in the image is (n.x/fx, n.y/fy).
    let [fx, fy] = rendering.rays.focal;
    let steep = crossing.plane.x.abs() * fy > crossing.plane.y.abs() * fx;
    if steep != (q == p + 1) {
        return None;
    }
    let [e0, e1] = crossing.values;
    let d = (e0 / (e0 - e1)).clamp(0.0, 1.0);
    // d = −n·r0/(n·dr) for the plane n, so dd/dn = −r(d)/(n·dr) with r(d) the ray that meets the edge.
    let d_by_plane = (r0 + (r1 - r0) * d) / (e0 - e1);
    let (receiver, partner, sign) = if d > 0.5 { (other, occluder, 1.0) } else { (occluder, other, -1.0) };
    if rasterizer.one_sided && rendering.triangle[receiver] == NONE {
        return None;
    }
    let color = |pixel: usize| Vec4::from_array(rendering.rgba[pixel]);
    Some(Blend {
        receiver: receiver as u32,
        partner: partner as u32,
        weight: (d - 0.5).abs() as f32,
        contrast: (color(partner) - color(receiver)).to_array(),
        edge: crossing.edge,
        weight_by_plane: d_by_plane * sign,
    })
}

/// Walks over the surface from ray `r0` in triangle `start` towards ray `r1` until a silhouette edge.
/// `None` if the surface reaches `r1`, or the triangle `target` that is seen there.
fn walk(
    rasterizer: &Rasterizer,
    rendering: &Rendering,
    [start, target]: [u32; 2],
    r0: DVec3,
    r1: DVec3,
) -> Option<Crossing> {
    let mut t = start;
    let mut entered_by = None;
    for _ in 0..MAX_STEPS {
        let p = &rendering.projected[t as usize];
        let values = |k: usize| [p.edge_value(k, r0.x, r0.y), p.edge_value(k, r1.x, r1.y)];
        // The edge through which the way leaves: of those that it crosses outwards, the first.
        let mut exit = None;
        let mut nearest = f64::INFINITY;
        for k in (0..3).filter(|&k| entered_by != Some(k)) {
            let [e0, e1] = values(k);
            let leaves = e0 > e1 && (e1 < 0.0 || (e1 == 0.0 && !p.owns_edge[k]));
            if leaves && e0 / (e0 - e1) < nearest {
                nearest = e0 / (e0 - e1);
                exit = Some(k);
            }
        }
        let k = exit?;
        let next = rendering.joined[t as usize][k];
        if next == NONE {
            let [a, b] = edge(&rasterizer.triangles[t as usize], k);
            let edge = if p.facing > 0 { [a, b] } else { [b, a] };
            return Some(Crossing { edge, values: values(k), plane: p.edges[k] });
        }
        if next == target {
            return None;
        }
        entered_by = Some(usize::from(rasterizer.across[t as usize][k].corner));
        t = next;
    }
    None
}

/// Adds the blends to the image. They hold unblended colours, so their order does not matter to what
/// they mean.
pub(super) fn apply_blends(rendering: &mut Rendering) {
    for blend in rendering.blends.iter().flatten() {
        let rgba = &mut rendering.rgba[blend.receiver as usize];
        *rgba = (Vec4::from_array(*rgba) + Vec4::from_array(blend.contrast) * blend.weight).to_array();
    }
}
