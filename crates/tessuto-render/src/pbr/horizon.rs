//! Horizon of a triangle: a slope for every azimuth above which no ray from anywhere on the triangle meets the
//! cloth. It is never too low, so rays above it need no tracing.
//!
//! For a ray from a on triangle A to b on B, the differences b − a fill a convex body P with the nine
//! differences of corners as vertices; the ray's slope over A's plane at its azimuth is at most that of P.

use glam::{DVec2, DVec3};

use super::bvh::{Bvh, Node};

/// Sectors of azimuth, equal in the pseudo-angle of [`pseudo_angle`].
pub(super) const SECTORS: usize = 32;

/// Slopes [m/m] by sector.
pub(super) type Horizon = [f32; SECTORS];

/// Added to every slope, relative and absolute: far above the rounding of a traced ray in f32.
const MARGIN: f64 = 2e-3;

/// Lengths `[m]` below this are rounding.
const TINY: f64 = 1e-11;

/// Monotonic in the azimuth of (x, y), from 0 at +x to 4: the way along the square |x| + |y| = 1.
fn pseudo_angle(p: DVec2) -> f64 {
    let s = p.y / (p.x.abs() + p.y.abs());
    if p.x < 0.0 {
        2.0 - s
    } else if p.y < 0.0 {
        4.0 + s
    } else {
        s
    }
}

/// Unit vector with that pseudo-angle.
fn from_pseudo_angle(a: f64) -> DVec2 {
    let a = a.rem_euclid(4.0);
    let p = match a {
        a if a < 1.0 => DVec2::new(1.0 - a, a),
        a if a < 2.0 => DVec2::new(1.0 - a, 2.0 - a),
        a if a < 3.0 => DVec2::new(a - 3.0, 2.0 - a),
        a => DVec2::new(a - 3.0, a - 4.0),
    };
    p.normalize()
}

/// The sector of an azimuth.
fn sector(p: DVec2) -> usize {
    ((pseudo_angle(p) * (SECTORS as f64 / 4.0)) as usize).min(SECTORS - 1)
}

/// Directions of the sectors' borders and middles.
pub(super) struct Sectors {
    borders: [DVec2; SECTORS],
    middles: [DVec2; SECTORS],
}

impl Sectors {
    pub fn new() -> Self {
        let at = |k: f64| from_pseudo_angle(k * 4.0 / SECTORS as f64);
        Self {
            borders: std::array::from_fn(|k| at(k as f64)),
            middles: std::array::from_fn(|k| at(k as f64 + 0.5)),
        }
    }
}

/// One triangle, and its frame: origin at the centroid, z along the normal.
struct Site<'a> {
    sectors: &'a Sectors,
    triangles: &'a [[u32; 3]],
    positions: &'a [DVec3],
    bvh: &'a Bvh,
    own: u32,
    centre: DVec3,
    axes: [DVec3; 3],
    /// Corners in the plane.
    corners: [DVec2; 3],
    /// Radius of the corners around the centroid `[m]`.
    radius: f64,
    slopes: [f64; SECTORS],
}

/// The horizon of triangle `own` on the side of its unit `normal`, azimuths counted from the unit `tangent`.
pub(super) fn horizon(
    sectors: &Sectors,
    triangles: &[[u32; 3]],
    positions: &[DVec3],
    bvh: &Bvh,
    own: u32,
    normal: DVec3,
    tangent: DVec3,
) -> Horizon {
    let corners = triangles[own as usize].map(|v| positions[v as usize]);
    let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
    let axes = [tangent, normal.cross(tangent), normal];
    let flat = corners.map(|c| DVec2::new((c - centre).dot(axes[0]), (c - centre).dot(axes[1])));
    let radius = flat.iter().map(|c| c.length()).fold(0.0, f64::max);
    let slopes = [0.0; SECTORS];
    let mut site =
        Site { sectors, triangles, positions, bvh, own, centre, axes, corners: flat, radius, slopes };
    if !normal.is_finite() || normal == DVec3::ZERO {
        return [f32::INFINITY; SECTORS];
    }
    site.descend(0);
    site.slopes.map(|s| (s * (1.0 + MARGIN) + MARGIN) as f32)
}

impl Site<'_> {
    fn local(&self, p: DVec3) -> DVec3 {
        let d = p - self.centre;
        DVec3::new(d.dot(self.axes[0]), d.dot(self.axes[1]), d.dot(self.axes[2]))
    }

    fn descend(&mut self, at: usize) {
        let bvh = self.bvh;
        let node: &Node = &bvh.nodes[at];
        let (low, high) = (node.low.as_dvec3(), node.high.as_dvec3());
        let (middle, half) = (self.local((low + high) / 2.0), (high - low) / 2.0);
        let top = middle.z + half.dot(self.axes[2].abs());
        if top <= 0.0 {
            return;
        }
        let radius = half.length();
        let distance = middle.truncate().length();
        if distance > 10.0 * radius && distance > 4.0 * self.radius {
            self.far(middle.truncate(), radius, top);
        } else if node.count == 0 {
            self.descend(at + 1);
            self.descend(node.index as usize);
        } else {
            for t in bvh.leaf(node) {
                if t != self.own {
                    self.triangle(t);
                }
            }
        }
    }

    fn triangle(&mut self, t: u32) {
        let corners = self.triangles[t as usize].map(|v| self.local(self.positions[v as usize]));
        let top = corners[0].z.max(corners[1].z).max(corners[2].z);
        // Below the plane, nothing is met; in it, up to rounding, nothing above the margin.
        if top <= TINY {
            return;
        }
        let middle = (corners[0] + corners[1] + corners[2]).truncate() / 3.0;
        let radius = corners.iter().map(|c| c.truncate().distance(middle)).fold(0.0, f64::max);
        if middle.length() > 2.0 * (radius + self.radius) {
            self.far(middle, radius, top);
        } else {
            self.near(&corners);
        }
    }

    /// Something within `radius` of `middle` (in the plane) that rises to `top`.
    fn far(&mut self, middle: DVec2, radius: f64, top: f64) {
        let reach = radius + self.radius;
        let distance = middle.length();
        let slope = top / (distance - reach);
        let sin = reach / distance;
        let cos = (1.0 - sin * sin).sqrt();
        let towards = middle / distance;
        let turned = |s: f64| DVec2::new(towards.x * cos - towards.y * s, towards.x * s + towards.y * cos);
        let (first, last) = (sector(turned(-sin)), sector(turned(sin)));
        let mut k = first;
        loop {
            self.slopes[k] = self.slopes[k].max(slope);
            if k == last {
                break;
            }
            k = (k + 1) % SECTORS;
        }
    }

    /// A triangle nearby, exactly: the slope of P is greatest at P's vertices or where P crosses a border
    /// between sectors, and P's section there is spanned by segments between its vertices.
    fn near(&mut self, corners: &[DVec3; 3]) {
        let p: [DVec3; 9] = std::array::from_fn(|i| corners[i / 3] - self.corners[i % 3].extend(0.0));
        if surrounds_origin(&p) {
            self.slopes = [f64::INFINITY; SECTORS];
            return;
        }
        let middles = &self.sectors.middles;
        let raise = |slopes: &mut [f64; SECTORS], k: usize, q: DVec3| {
            // At most 1/cos of half a sector above the slope itself.
            let along = q.truncate().dot(middles[k]);
            let slope = if along > TINY {
                q.z / along
            } else if q.z > TINY {
                f64::INFINITY
            } else {
                return;
            };
            slopes[k] = slopes[k].max(slope);
        };
        for q in p.iter().filter(|q| q.truncate().length() > TINY) {
            raise(&mut self.slopes, sector(q.truncate()), *q);
        }
        // Opposite borders lie on one line.
        for k in 0..SECTORS / 2 {
            let border = self.sectors.borders[k];
            let across = p.map(|q| border.perp_dot(q.truncate()));
            for i in 0..9 {
                for j in i + 1..9 {
                    if across[i] * across[j] > 0.0 || across[i] == across[j] {
                        continue;
                    }
                    let q = (p[i] * across[j] - p[j] * across[i]) / (across[j] - across[i]);
                    if q.truncate().length() < TINY && q.z < TINY {
                        continue;
                    }
                    let border = if q.truncate().dot(border) >= 0.0 { k } else { k + SECTORS / 2 };
                    raise(&mut self.slopes, border, q);
                    raise(&mut self.slopes, (border + SECTORS - 1) % SECTORS, q);
                }
            }
        }
    }
}

/// Whether the projections of `p` onto the plane have the origin strictly inside their hull: then something is
/// straight above.
fn surrounds_origin(p: &[DVec3; 9]) -> bool {
    let mut azimuths = [0.0; 9];
    let mut n = 0;
    for q in p.iter().map(|q| q.truncate()).filter(|q| q.length() > TINY) {
        azimuths[n] = q.to_angle();
        n += 1;
    }
    let azimuths = &mut azimuths[..n];
    azimuths.sort_by(f64::total_cmp);
    let wrap = std::f64::consts::TAU;
    let gap = (0..n)
        .map(|i| if i + 1 < n { azimuths[i + 1] - azimuths[i] } else { azimuths[0] + wrap - azimuths[i] })
        .fold(0.0, f64::max);
    n > 1 && gap < std::f64::consts::PI - 1e-9
}
