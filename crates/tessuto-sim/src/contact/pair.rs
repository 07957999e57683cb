//! What may touch: two elements, their gap, and the energy, force and stiffness of the barrier between them.
//!
//!   E = W κ t m B(δ/t),   δ = d − offset,
//!
//! with the area W of the elements, the barrier's stiffness κ, the thickness t and B of [`super::barrier`]. The
//! nearest points of two edges that become parallel jump along them; m takes their energy away before they do:
//! m = (2 − c/ε) c/ε for c = ‖u × v‖² below ε, else 1.

use glam::{DMat3, DVec3};

use super::barrier::barrier;
use super::closest::{Blocks, Closest, Corners, outer};

/// ε of two edges, as a part of the square of the product of their lengths at rest.
const PARALLEL: f64 = 1e-3;
/// Edges are taken as parallel, and without energy, below this part of ε.
const NOTHING: f64 = 1e-9;

/// What the two elements are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A point and a triangle.
    PointTriangle,
    /// Two edges; their ε `[m⁴]`.
    EdgeEdge(f64),
    /// A point and the plane n·x = height.
    Plane(DVec3, f64),
}

/// Two elements that may touch.
#[derive(Debug, Clone, Copy)]
pub struct Pair {
    /// Vertices, then the nodes of bodies. Of a plane the first alone counts.
    pub nodes: [u32; 4],
    /// What they are.
    pub kind: Kind,
    /// W `[m²]`.
    pub area: f64,
    /// What the elements' distance is larger by than their gap `[m]`.
    pub offset: f64,
    /// Which friction acts.
    pub surface: usize,
}

/// t `[m]` and κ [N/m²].
#[derive(Debug, Clone, Copy)]
pub struct Law {
    /// The gap at which elements begin to feel each other.
    pub thickness: f64,
    /// Stiffness of the barrier.
    pub stiffness: f64,
}

/// A gap and how it depends on the corners.
#[derive(Debug, Clone, Copy)]
pub struct Gap {
    /// δ `[m]`.
    pub size: f64,
    /// Unit vector from the second side to the first.
    pub normal: DVec3,
    /// ∂δ/∂xₖ = wₖ n.
    pub weights: [f64; 4],
    /// The nearest points; none of a plane.
    closest: Option<Closest>,
    /// m, and its derivatives by the edges' vectors u and v; 1 and none where it does not change.
    fade: Fade,
}

#[derive(Debug, Clone, Copy)]
struct Fade {
    size: f64,
    /// Whether it changes.
    acts: bool,
    /// ∂m.
    first: [DVec3; 2],
    /// ∂²m: uu, uv, vv.
    second: [DMat3; 3],
}

impl Fade {
    const NONE: Self = Self { size: 1.0, acts: false, first: [DVec3::ZERO; 2], second: [DMat3::ZERO; 3] };

    /// Of the edges' vectors; `None` where nothing is left.
    fn new(u: DVec3, v: DVec3, epsilon: f64) -> Option<Self> {
        let c = u.cross(v).length_squared();
        if c >= epsilon {
            return Some(Self::NONE);
        }
        if c < NOTHING * epsilon {
            return None;
        }
        let (uu, vv, uv) = (u.dot(u), v.dot(v), u.dot(v));
        let (cu, cv) = ((u * vv - v * uv) * 2.0, (v * uu - u * uv) * 2.0);
        let (slope, bend) = ((2.0 - 2.0 * c / epsilon) / epsilon, -2.0 / (epsilon * epsilon));
        let by_uu = (DMat3::IDENTITY * vv - outer(v, v)) * 2.0;
        let by_vv = (DMat3::IDENTITY * uu - outer(u, u)) * 2.0;
        let by_uv = (outer(u, v) * 2.0 - outer(v, u) - DMat3::IDENTITY * uv) * 2.0;
        let second = [
            by_uu * slope + outer(cu, cu) * bend,
            by_uv * slope + outer(cu, cv) * bend,
            by_vv * slope + outer(cv, cv) * bend,
        ];
        Some(Self {
            size: (2.0 - c / epsilon) * c / epsilon,
            acts: true,
            first: [cu * slope, cv * slope],
            second,
        })
    }

    /// ∂m by corner k.
    fn gradient(&self, k: usize) -> DVec3 {
        self.first[k / 2] * SIGNS[k]
    }

    /// ∂²m by corners k and l.
    fn hessian(&self, k: usize, l: usize) -> DMat3 {
        let block = match [k / 2, l / 2] {
            [0, 0] => self.second[0],
            [0, 1] => self.second[1],
            [1, 0] => self.second[1].transpose(),
            _ => self.second[2],
        };
        block * (SIGNS[k] * SIGNS[l])
    }
}

/// Of the corners in the edges' vectors x₁ − x₀ and x₃ − x₂.
const SIGNS: [f64; 4] = [-1.0, 1.0, -1.0, 1.0];

impl Kind {
    /// Of two edges that are `first` and `second` at rest.
    pub fn of_edges(first: DVec3, second: DVec3) -> Self {
        Self::EdgeEdge(PARALLEL * first.length_squared() * second.length_squared())
    }
}

impl Pair {
    /// Its corners among all nodes `[m]`.
    #[inline]
    pub fn corners(&self, nodes: &[DVec3]) -> Corners {
        self.nodes.map(|k| nodes[k as usize])
    }

    /// How many of its nodes count.
    #[inline]
    pub fn node_count(&self) -> usize {
        if matches!(self.kind, Kind::Plane(..)) { 1 } else { 4 }
    }

    /// Less than δ, or δ itself, by boxes around the two elements `[m]`: much sooner known.
    #[inline]
    pub fn gap_at_least(&self, x: &Corners) -> f64 {
        let between = match self.kind {
            Kind::Plane(normal, height) => return normal.dot(x[0]) - height - self.offset,
            Kind::PointTriangle => {
                let (low, high) = (x[1].min(x[2]).min(x[3]), x[1].max(x[2]).max(x[3]));
                (low - x[0]).max(x[0] - high)
            }
            Kind::EdgeEdge(_) => {
                let (low, high) = (x[0].min(x[1]), x[0].max(x[1]));
                (low - x[2].max(x[3])).max(x[2].min(x[3]) - high)
            }
        };
        between.max(DVec3::ZERO).length() - self.offset
    }

    /// δ alone `[m]`.
    pub fn gap_size(&self, x: &Corners) -> f64 {
        let distance = match self.kind {
            Kind::Plane(normal, height) => normal.dot(x[0]) - height,
            Kind::PointTriangle => Closest::of_point_and_triangle(x).distance(),
            Kind::EdgeEdge(_) => Closest::of_edges(x).distance(),
        };
        distance - self.offset
    }

    /// The gap, if it is below `reach` `[m]` and has energy.
    pub fn gap(&self, x: &Corners, reach: f64) -> Option<Gap> {
        if self.gap_at_least(x) >= reach {
            return None;
        }
        let closest = match self.kind {
            Kind::Plane(normal, height) => {
                let size = normal.dot(x[0]) - height - self.offset;
                let weights = [1.0, 0.0, 0.0, 0.0];
                let gap = Gap { size, normal, weights, closest: None, fade: Fade::NONE };
                return (size < reach).then_some(gap);
            }
            Kind::PointTriangle => Closest::of_point_and_triangle(x),
            Kind::EdgeEdge(_) => Closest::of_edges(x),
        };
        let distance = closest.distance();
        if distance - self.offset >= reach {
            return None;
        }
        let fade = match self.kind {
            Kind::EdgeEdge(epsilon) => Fade::new(x[1] - x[0], x[3] - x[2], epsilon)?,
            _ => Fade::NONE,
        };
        Some(Gap {
            size: distance - self.offset,
            normal: closest.between / distance,
            weights: closest.weights,
            closest: Some(closest),
            fade,
        })
    }

    /// E `[J]` and ∂E of every corner `[N]`; E is infinite where elements pass through each other.
    pub fn energy_and_gradient(&self, law: &Law, gap: &Gap) -> (f64, [DVec3; 4]) {
        if gap.size <= 0.0 {
            return (f64::INFINITY, [DVec3::ZERO; 4]);
        }
        let [value, slope, _] = barrier(gap.size / law.thickness);
        let scale = self.area * law.stiffness;
        let along = gap.normal * (scale * slope * gap.fade.size);
        let mut gradient = gap.weights.map(|w| along * w);
        let energy = scale * law.thickness * value;
        if gap.fade.acts {
            gradient.iter_mut().enumerate().for_each(|(k, g)| *g += gap.fade.gradient(k) * energy);
        }
        (energy * gap.fade.size, gradient)
    }

    /// ∂²E of every two corners [N/m]; `exact`, or the part of the gap's change alone, which is never negative.
    pub fn hessian(&self, law: &Law, gap: &Gap, x: &Corners, exact: bool) -> Blocks {
        let [value, slope, bend] = barrier(gap.size / law.thickness);
        let scale = self.area * law.stiffness;
        let n = gap.normal;
        let stiff = outer(n, n) * (scale * bend * gap.fade.size / law.thickness);
        let mut blocks =
            [0, 1, 2, 3].map(|k| [0, 1, 2, 3].map(|l| stiff * (gap.weights[k] * gap.weights[l])));
        let Some(closest) = gap.closest.as_ref().filter(|_| exact) else { return blocks };
        let turned = closest.hessian(x);
        for (k, row) in blocks.iter_mut().enumerate() {
            for (l, block) in row.iter_mut().enumerate() {
                *block += turned[k][l] * (scale * slope * gap.fade.size);
                if gap.fade.acts {
                    let mixed = outer(n * gap.weights[k], gap.fade.gradient(l))
                        + outer(gap.fade.gradient(k), n * gap.weights[l]);
                    *block += mixed * (scale * slope);
                    *block += gap.fade.hessian(k, l) * (scale * law.thickness * value);
                }
            }
        }
        blocks
    }

    /// The force that presses the elements apart `[N]`.
    pub fn pressing(&self, law: &Law, gap: &Gap) -> f64 {
        -self.area * law.stiffness * gap.fade.size * barrier(gap.size / law.thickness)[1]
    }

    /// Given the derivatives of a number by the pressing force, the normal and the weights, those by the corners.
    pub fn pull_back(
        &self,
        law: &Law,
        gap: &Gap,
        x: &Corners,
        (by_force, by_normal, by_weights): (f64, DVec3, [f64; 4]),
    ) -> [DVec3; 4] {
        let [_, slope, bend] = barrier(gap.size / law.thickness);
        let scale = -self.area * law.stiffness * by_force;
        let by_gap = scale * gap.fade.size * bend / law.thickness;
        let Some(closest) = gap.closest.as_ref() else {
            return gap.weights.map(|w| gap.normal * (w * by_gap));
        };
        // c = (δ + offset) n.
        let across = by_normal - gap.normal * gap.normal.dot(by_normal);
        let by_between = gap.normal * by_gap + across / closest.distance();
        let mut out = closest.pull_back(x, by_between, by_weights);
        if gap.fade.acts {
            out.iter_mut().enumerate().for_each(|(k, out)| *out += gap.fade.gradient(k) * (scale * slope));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;

    const LAW: Law = Law { thickness: 0.3, stiffness: 20.0 };

    /// A pair of each kind whose gap is within the thickness, edges that fade among them.
    fn samples(rng: &mut Rng) -> Vec<(Pair, Corners)> {
        let kinds = [
            Kind::PointTriangle,
            Kind::EdgeEdge(1e-3),
            // Fades at every angle of these edges.
            Kind::EdgeEdge(10.0),
            Kind::Plane(DVec3::new(0.6, 0.0, 0.8), -0.2),
        ];
        let mut found = Vec::new();
        while found.len() < 400 {
            let x = [0; 4].map(|_| rng.vector());
            let kind = kinds[found.len() % 4];
            let pair = Pair { nodes: [0, 1, 2, 3], kind, area: 0.7, offset: 0.02, surface: 0 };
            assert!(pair.gap_at_least(&x) <= pair.gap_size(&x));
            if pair.gap(&x, LAW.thickness).is_some_and(|g| g.size > 0.02 && g.size < 0.29) {
                found.push((pair, x));
            }
        }
        found
    }

    #[test]
    fn derivatives_are_differences() {
        let mut rng = Rng::new(3, 0);
        let mut worst = [0.0f64; 3];
        let mut faded = 0;
        for (pair, x) in samples(&mut rng) {
            let (d, e): (Corners, Corners) = ([0; 4].map(|_| rng.vector()), [0; 4].map(|_| rng.vector()));
            let by = (rng.normal(), rng.vector(), [0; 4].map(|_| rng.normal()));
            let step = 1e-6;
            let moved = |s: f64| [0, 1, 2, 3].map(|k| x[k] + d[k] * s);
            let at = |x: &Corners| pair.gap(x, f64::INFINITY).unwrap();
            let dot = |a: &Corners, b: &Corners| (0..pair.node_count()).map(|k| a[k].dot(b[k])).sum::<f64>();
            let gap = at(&x);
            faded += usize::from(gap.fade.acts);
            let (plus, minus) = (at(&moved(step)), at(&moved(-step)));
            // Where the nearest points change from a side to a corner, second derivatives jump.
            let kept = (0..4).all(|k| {
                let half = 0.5 * (plus.weights[k] + minus.weights[k]);
                (half - gap.weights[k]).abs() < 1e-8
            });
            if !kept {
                continue;
            }
            let mut note = |k: usize, analytic: f64, numeric: f64, size: f64| {
                worst[k] = worst[k].max((analytic - numeric).abs() / (1e-3 * size + numeric.abs()));
            };
            let (_, gradient) = pair.energy_and_gradient(&LAW, &gap);
            let energies = [&plus, &minus].map(|g| pair.energy_and_gradient(&LAW, g));
            let size = gradient.iter().map(|g| g.length()).sum::<f64>();
            note(0, dot(&gradient, &d), (energies[0].0 - energies[1].0) / (2.0 * step), size);
            let blocks = pair.hessian(&LAW, &gap, &x, true);
            let n = pair.node_count();
            let curvature: f64 = (0..n)
                .flat_map(|k| (0..n).map(move |l| (k, l)))
                .map(|(k, l)| e[k].dot(blocks[k][l] * d[l]))
                .sum();
            let numeric = (dot(&energies[0].1, &e) - dot(&energies[1].1, &e)) / (2.0 * step);
            note(1, curvature, numeric, blocks[0][0].to_cols_array().iter().map(|b| b.abs()).sum());
            let number = |g: &Gap| {
                let weights: f64 = (0..n).map(|k| g.weights[k] * by.2[k]).sum();
                pair.pressing(&LAW, g) * by.0 + g.normal.dot(by.1) + weights
            };
            let back = pair.pull_back(&LAW, &gap, &x, by);
            let size = back.iter().map(|g| g.length()).sum::<f64>();
            note(2, dot(&back, &d), (number(&plus) - number(&minus)) / (2.0 * step), size);
        }
        println!(
            "worst: energy {:.1e}, force {:.1e}, pressing {:.1e}; {faded} faded",
            worst[0], worst[1], worst[2]
        );
        assert!(faded > 50 && worst.iter().all(|w| *w > 0.0 && *w < 1e-4), "{worst:?}");
    }

    #[test]
    fn parallel_edges_have_no_energy() {
        let x = [DVec3::ZERO, DVec3::X, DVec3::Z * 0.1, DVec3::new(1.0, 0.0, 0.1)];
        let kind = Kind::of_edges(DVec3::X, DVec3::X);
        let pair = Pair { nodes: [0, 1, 2, 3], kind, area: 1.0, offset: 0.0, surface: 0 };
        assert!(pair.gap(&x, 1.0).is_none());
        let mut turned = x;
        turned[3].y = 1e-3;
        let gap = pair.gap(&turned, 1.0).unwrap();
        assert!(gap.fade.acts && gap.fade.size < 3e-3 && gap.fade.size > 1e-3, "{}", gap.fade.size);
    }
}
