//! Brightness of the sheet against the light of the scene.
//!
//! Cloth that turns towards the light gets brighter. The logarithm of the light that falls on a surface of normal
//! n is f(n) = Σ_k c_k Y_k(n), with the eight polynomials Y of n's parts x, y, z, xy, yz, zx, x² − y², 3z² − 1:
//! harmonics of first and second order, which hold nearly all of what comes from afar (Ramamoorthi and Hanrahan
//! 2001). Its brightness relative to the first frame, e^h, then shows how a part of the sheet has turned, and
//! which of several shapes with one image it has:
//!
//!   E = Σ_v w_v c(r_v/σ_v; τ),  r_v = f(n_v) − f(n_0v) − h_v + o,
//!
//! over the vertices v that are seen, with their normals n_v, the mean of those of the triangles around them by
//! area, the same of the template n_0v, and Cauchy's c of the noise σ_v of one pixel and its tail τ. The weight
//! w_v is the number of independent pixels that are seen around the vertex. The light, h, what the whole frame is
//! brighter by o, σ_v and w_v are held fixed; where they come from is said in `spacetime/light.rs`.

use glam::DVec3;

use super::robust::Noise;
use super::{FrameSystem, Term, outer};
use tessuto_sim::Cloth;

/// Number of harmonics.
pub const HARMONICS: usize = 8;
/// A vertex whose triangles' normals add up to so small a part of their lengths lies on a fold, and has no normal.
const FOLDED: f64 = 0.3;

/// Coefficients c of the light.
pub type Light = [f64; HARMONICS];

/// Y(n).
pub fn harmonics(n: DVec3) -> Light {
    let DVec3 { x, y, z } = n;
    [x, y, z, x * y, y * z, z * x, x * x - y * y, 3.0 * z * z - 1.0]
}

/// f(n).
pub fn brightness(light: &Light, n: DVec3) -> f64 {
    harmonics(n).iter().zip(light).map(|(y, c)| y * c).sum()
}

/// ∂f/∂n.
fn slope(c: &Light, n: DVec3) -> DVec3 {
    DVec3::new(
        c[0] + c[3] * n.y + c[5] * n.z + 2.0 * c[6] * n.x,
        c[1] + c[3] * n.x + c[4] * n.z - 2.0 * c[6] * n.y,
        c[2] + c[4] * n.y + c[5] * n.x + 6.0 * c[7] * n.z,
    )
}

/// Normal of a triangle, its length twice the area.
fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// What is known of one vertex in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// f(n_0v) + h_v − o.
    pub target: f64,
    /// w_v.
    pub weight: f64,
    /// σ_v and τ.
    pub noise: Noise,
}

/// See the module.
pub struct Shading<'a> {
    /// The cloth.
    pub cloth: &'a Cloth,
    /// Its triangles.
    pub triangles: &'a [[u32; 3]],
    /// c.
    pub light: &'a Light,
    /// What is known of every vertex; empty while no light is.
    pub seen: &'a [Option<Seen>],
}

/// One vertex that counts.
struct Vertex {
    residual: f64,
    value: f64,
    /// Weight of the squared residual.
    scale: f64,
    /// Derivative of the residual by the vertex's normal, of the sum of its triangles' normals.
    slope: DVec3,
}

impl Shading<'_> {
    /// Normal of every triangle, and at every vertex the sum of them and of their lengths.
    fn normals(&self, x: &[DVec3]) -> (Vec<DVec3>, Vec<(DVec3, f64)>) {
        let of_triangle = |t: &[u32; 3]| normal(t.map(|v| x[v as usize]));
        let normals: Vec<DVec3> = self.triangles.iter().map(of_triangle).collect();
        let sums = sums_at_vertices(self.triangles, &normals, x.len());
        (normals, sums)
    }

    fn at_vertex(&self, seen: &Seen, (sum, lengths): (DVec3, f64)) -> Option<Vertex> {
        let length = sum.length();
        if length <= FOLDED * lengths {
            return None;
        }
        let n = sum / length;
        let s = slope(self.light, n);
        let residual = brightness(self.light, n) - seen.target;
        let (rho, ratio) = seen.noise.cauchy(residual);
        Some(Vertex {
            residual,
            value: seen.weight * rho,
            scale: seen.weight * ratio,
            slope: (s - n * s.dot(n)) / length,
        })
    }

    /// Adds what of the value every vertex bears, shape `[V]`.
    pub fn add_shares(&self, x: &[DVec3], shares: &mut [f64]) {
        if self.seen.is_empty() {
            return;
        }
        let (_, sums) = self.normals(x);
        for (share, vertex) in shares.iter_mut().zip(self.at_vertices(&sums)) {
            *share += vertex.map_or(0.0, |vertex| vertex.value);
        }
    }

    fn at_vertices(&self, sums: &[(DVec3, f64)]) -> Vec<Option<Vertex>> {
        let of = |(seen, sum): (&Option<Seen>, &(DVec3, f64))| self.at_vertex(seen.as_ref()?, *sum);
        self.seen.iter().zip(sums).map(of).collect()
    }
}

/// At every vertex the sum of the normals of its triangles, and of their lengths.
fn sums_at_vertices(triangles: &[[u32; 3]], normals: &[DVec3], count: usize) -> Vec<(DVec3, f64)> {
    let mut sums = vec![(DVec3::ZERO, 0.0); count];
    for (corners, n) in triangles.iter().zip(normals) {
        for v in corners {
            let (sum, lengths) = &mut sums[*v as usize];
            *sum += *n;
            *lengths += n.length();
        }
    }
    sums
}

impl Term for Shading<'_> {
    fn name(&self) -> &'static str {
        "shading"
    }

    fn value(&self, x: &[DVec3]) -> f64 {
        if self.seen.is_empty() {
            return 0.0;
        }
        let (_, sums) = self.normals(x);
        self.at_vertices(&sums).iter().flatten().map(|vertex| vertex.value).sum()
    }

    /// The matrix is an upper bound of Gauss and Newton's, whose blocks would join all triangles around a vertex:
    /// exact where these turn together.
    fn add_system(&self, x: &[DVec3], system: &mut FrameSystem) -> f64 {
        if self.seen.is_empty() {
            return 0.0;
        }
        let pattern = &self.cloth.pattern;
        let (normals, sums) = self.normals(x);
        let vertices = self.at_vertices(&sums);
        for ((corners, pairs), n) in self.triangles.iter().zip(&self.cloth.triangle_pairs).zip(&normals) {
            let [a, b, c] = corners.map(|v| x[v as usize]);
            for v in corners {
                let Some(vertex) = &vertices[*v as usize] else { continue };
                let g = vertex.slope;
                let (by_b, by_c) = ((c - a).cross(g), g.cross(b - a));
                let j = [-(by_b + by_c), by_b, by_c];
                let part = (n.length() / sums[*v as usize].1).max(1e-3);
                let scale = vertex.scale / part;
                for k in 0..3 {
                    let corner = corners[k] as usize;
                    system.gradient[corner] += j[k] * (vertex.scale * vertex.residual);
                    system.matrix.add_diagonal(pattern, corner, &(outer(j[k], j[k]) * scale));
                }
                for (k, (i, o)) in [(1, 0), (2, 0), (2, 1)].into_iter().enumerate() {
                    system.matrix.add_pair(pattern, pairs[k], &(outer(j[i], j[o]) * scale));
                }
            }
        }
        vertices.iter().flatten().map(|vertex| vertex.value).sum()
    }
}
