//! The point-to-surface distance of the published evaluator, kept to compare with printed figures.
//!
//! It adds 1e-5 m⁴ to the denominator of the barycentric coordinates. For triangles of a few
//! centimetres that denominator is about 1e-7 m⁴, so the inside test accepts a region some 100
//! times too wide and takes the distance to the *plane* there: values read far too small.

use glam::DVec3;

/// What the published formula adds to the denominator `[m⁴]`.
const EXTRA: f64 = 1e-5;

/// Squared distances `[m²]` as in [`super::surface::distances_squared`], with the inexact inside test.
///
/// - `exact`: the exact ones. They bound the result: whatever is truly inside is also accepted
///   here, and where a pair is accepted its plane distance is not above the exact one.
///
/// All pairs are visited, since a plane is accepted far away from its triangle.
pub fn distances_squared(
    points: &[DVec3],
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    exact: &[Vec<f64>; 2],
) -> [Vec<f64>; 2] {
    let mut blocks: Vec<Block> = points.chunks(LANES).zip(exact[0].chunks(LANES)).map(Block::new).collect();
    let plane = |(t, exact): (&[u32; 3], &f64)| {
        let [a, b, c] = t.map(|i| positions[i as usize]);
        Plane::new(a, b, c).map_or(*exact, |plane| plane.reduce(&mut blocks).min(*exact))
    };
    let triangle_distances = triangles.iter().zip(&exact[1]).map(plane).collect();
    let point_distances = blocks.iter().flat_map(|b| b.best).take(points.len()).collect();
    [point_distances, triangle_distances]
}

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
    fn new((points, best): (&[DVec3], &[f64])) -> Self {
        let [x, y, z] =
            [0, 1, 2].map(|axis| std::array::from_fn(|k| points.get(k).map_or(f64::NAN, |p| p[axis])));
        Self { x, y, z, best: std::array::from_fn(|k| best.get(k).copied().unwrap_or(f64::INFINITY)) }
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
    /// smallest accepted one (infinite if none).
    fn reduce(&self, blocks: &mut [Block]) -> f64 {
        let mut smallest = [f64::INFINITY; LANES];
        for block in blocks {
            for (k, smallest) in smallest.iter_mut().enumerate() {
                let at = |(g, o): &(DVec3, f64)| g.x * block.x[k] + g.y * block.y[k] + g.z * block.z[k] + o;
                let (v, w, h) = (at(&self.v), at(&self.w), at(&self.h));
                let accepted = (v >= 0.0) & (w >= 0.0) & (v + w <= 1.0);
                let squared = if accepted { h * h } else { f64::INFINITY };
                block.best[k] = if squared < block.best[k] { squared } else { block.best[k] };
                *smallest = if squared < *smallest { squared } else { *smallest };
            }
        }
        smallest.into_iter().fold(f64::INFINITY, f64::min)
    }
}
