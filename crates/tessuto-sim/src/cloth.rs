//! The cloth as a mechanical system: masses, springs, and sums over them.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::contact::Contact;
use super::continuum::Continuum;
use super::stiffness::{Energy, HessianKind, Stiffness};
use super::{angle, lattice::Lattice, stretch};
use tessuto_core::math::block_matrix::{BlockMatrix, BlockPattern, Columns};
use tessuto_core::math::factor::Analysis;
use tessuto_core::mesh::{Mesh, triangle_area};

/// Area density ρ [kg/m²]. Only force per mass can be seen in a video, so its value sets a scale only.
pub const AREA_DENSITY: f64 = 0.1;
/// Angle pairs whose rest deflection is below this bend, the others shear `[rad]`.
const BEND_LIMIT: f64 = std::f64::consts::FRAC_PI_4;
/// Elements of one parallel task; fewer cost more to hand over than to do.
const TASK: usize = 1000;

/// A spring along a mesh edge.
#[derive(Debug, Clone, Copy)]
pub struct Edge {
    /// End points.
    pub vertices: [u32; 2],
    /// Length without load `[m]`.
    pub rest_length: f64,
    /// Factor on its stiffness where it is shorter than that: 1 is a spring, 0 a thread.
    pub compression: f64,
    /// Pattern's pair (second, first end point).
    pub pair: usize,
}

/// An angle spring over the path a → o → c.
#[derive(Debug, Clone, Copy)]
pub struct AngleSpring {
    /// a, o, c.
    pub vertices: [u32; 3],
    /// Deflection without load `[rad]`.
    pub rest_angle: f64,
    /// Pattern's pairs (a, o), (a, c), (o, c).
    pub pairs: [usize; 3],
}

/// A third of each triangle's mass at each of its corners `[kg]`, shape `[V]`.
pub(super) fn lumped_masses(template: &Mesh) -> Vec<f64> {
    let x = &template.positions;
    let mut masses = vec![0.0; x.len()];
    for t in template.triangles() {
        let third = AREA_DENSITY * triangle_area(x, t) / 3.0;
        t.iter().for_each(|&v| masses[v as usize] += third);
    }
    masses
}

/// Masses and springs of a mesh, with the sparse pattern of their second derivatives, which clones share.
#[derive(Debug, Clone)]
pub struct Cloth {
    /// Lumped masses `[kg]`, shape `[V]`.
    pub masses: Vec<f64>,
    /// Stretch springs.
    pub edges: Vec<Edge>,
    /// Bending pairs.
    pub bends: Vec<AngleSpring>,
    /// Shearing pairs.
    pub shears: Vec<AngleSpring>,
    /// The mesh's triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Instead of all springs.
    pub continuum: Option<Continuum>,
    /// Pattern's pairs (corner 1, 0), (2, 0), (2, 1) of every triangle, for terms that act on triangles.
    pub triangle_pairs: Vec<[usize; 3]>,
    /// Pattern of Hessians and of the systems to solve.
    pub pattern: Arc<BlockPattern>,
    /// Symbolic factorisation of `pattern`.
    pub analysis: Arc<Analysis>,
    /// Of springs on a regular grid.
    pub lattice: Option<Arc<Lattice>>,
    /// What it touches; `None` lets it pass through everything.
    pub contact: Option<Arc<Contact>>,
}

impl Cloth {
    /// The cloth of springs that is at rest in the shape of `template`.
    pub fn new(template: &Mesh) -> Self {
        Self::with_angles_of(template, &template.positions)
    }

    /// The cloth whose edges are at rest in the shape of `template`, its angles in the positions `angles_of`,
    /// shape `[V]`.
    pub(super) fn with_angles_of(template: &Mesh, angles_of: &[DVec3]) -> Self {
        let x = &template.positions;
        let mut pairs = Vec::new();
        let edges: Vec<Edge> = template
            .edges()
            .into_iter()
            .map(|[a, b]| {
                pairs.push([b, a]);
                let rest_length = x[a as usize].distance(x[b as usize]);
                Edge { vertices: [a, b], rest_length, compression: 1.0, pair: pairs.len() - 1 }
            })
            .collect();
        let (mut bends, mut shears) = (Vec::new(), Vec::new());
        for (o, around) in template.neighbours().iter().enumerate() {
            for (k, &a) in around.iter().enumerate() {
                for &c in &around[k + 1..] {
                    let o = o as u32;
                    let [u, w] = arms(angles_of, [a, o, c]);
                    let rest_angle = angle::angle(u, w);
                    let first = pairs.len();
                    pairs.extend([[a, o], [a, c], [o, c]]);
                    let spring =
                        AngleSpring { vertices: [a, o, c], rest_angle, pairs: [first, first + 1, first + 2] };
                    if rest_angle < BEND_LIMIT { &mut bends } else { &mut shears }.push(spring);
                }
            }
        }
        let triangle_pairs = template
            .triangles()
            .into_iter()
            .map(|[a, b, c]| {
                let first = pairs.len();
                pairs.extend([[b, a], [c, a], [c, b]]);
                [first, first + 1, first + 2]
            })
            .collect();
        let pattern = BlockPattern::new(x, &pairs);
        let analysis = Analysis::new(&pattern);
        Self {
            masses: lumped_masses(template),
            edges,
            bends,
            shears,
            triangles: template.triangles(),
            continuum: None,
            triangle_pairs,
            pattern: Arc::new(pattern),
            analysis: Arc::new(analysis),
            lattice: Lattice::of(template).map(Arc::new),
            contact: None,
        }
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.masses.len()
    }

    /// Pattern's pair of the edge between two vertices.
    ///
    /// # Panics
    /// If there is no such edge.
    pub fn edge_pair(&self, [a, b]: [u32; 2]) -> usize {
        let key = [a.min(b), a.max(b)];
        let edge = self.edges.binary_search_by(|e| e.vertices.cmp(&key)).expect("an edge of the mesh");
        self.edges[edge].pair
    }

    /// Elastic energy of shape `x` `[m]`.
    pub fn energy(&self, stiffness: &Stiffness, x: &[DVec3]) -> Energy {
        if let Some(continuum) = &self.continuum {
            return continuum.energy(stiffness, x);
        }
        let hinges = |hinges: &[AngleSpring], k: &[f64]| {
            let of = |(h, &k): (&AngleSpring, &f64)| {
                let [u, w] = arms(x, h.vertices);
                angle::value(u, w, k, h.rest_angle)
            };
            hinges.iter().zip(k).map(of).sum()
        };
        let of = |(e, &k): (&Edge, &f64)| stretch::value(e.along(x), e.stiffness(k, x), e.rest_length);
        let ((stretch, shear), bend) = rayon::join(
            || {
                let stretch = self.edges.iter().zip(&stiffness.stretch).map(of).sum();
                (stretch, hinges(&self.shears, &stiffness.shear))
            },
            || hinges(&self.bends, &stiffness.bend),
        );
        Energy { stretch, bend, shear }
    }

    /// Adds `scale`·∂E/∂x of [`energy`](Self::energy) to `out` `[N]`, shape `[V]`, and returns E, which takes
    /// little more.
    pub fn add_gradient(&self, stiffness: &Stiffness, x: &[DVec3], scale: f64, out: &mut [DVec3]) -> f64 {
        if let Some(continuum) = &self.continuum {
            return continuum.add_gradient(stiffness, x, scale, out);
        }
        let mut second = vec![DVec3::ZERO; out.len()];
        let [first_half, second_half] = self.angle_halves(stiffness);
        let of_spring = |(h, k): (&AngleSpring, f64), out: &mut [DVec3]| {
            let [u, w] = arms(x, h.vertices);
            let (value, gradient) = angle::value_and_gradient(u, w, k, h.rest_angle);
            h.scatter(gradient.map(|g| g * scale), out);
            value
        };
        let of_edge = |(e, &k): (&Edge, &f64), out: &mut [DVec3]| {
            let (along, k) = (e.along(x), e.stiffness(k, x));
            e.scatter(stretch::gradient(along, k, e.rest_length) * scale, out);
            stretch::value(along, k, e.rest_length)
        };
        let (first_sum, second_sum) = rayon::join(
            || {
                let edges: f64 =
                    self.edges.iter().zip(&stiffness.stretch).map(|edge| of_edge(edge, out)).sum();
                edges + first_half.map(|h| of_spring(h, out)).sum::<f64>()
            },
            || second_half.map(|h| of_spring(h, &mut second)).sum::<f64>(),
        );
        out.iter_mut().zip(&second).for_each(|(out, g)| *out += *g);
        first_sum + second_sum
    }

    /// Adds `scale`·∂²E/∂x² of [`energy`](Self::energy) to `matrix` [N/m].
    pub fn add_hessian(
        &self,
        stiffness: &Stiffness,
        x: &[DVec3],
        kind: HessianKind,
        scale: f64,
        matrix: &mut BlockMatrix,
    ) {
        if let Some(continuum) = &self.continuum {
            return continuum.add_hessian(stiffness, x, kind, scale, (&self.pattern, matrix));
        }
        let of_edge = match kind {
            HessianKind::Exact => stretch::hessian,
            HessianKind::Projected | HessianKind::GaussNewton => stretch::hessian_projected,
        };
        let of_angle = match kind {
            HessianKind::Exact => angle::hessian,
            HessianKind::Projected => angle::hessian_projected,
            HessianKind::GaussNewton => angle::hessian_gauss_newton,
        };
        // Springs on the border are computed for both halves: the same bits on one thread and on two.
        let add = |mut columns: Columns| {
            let span = columns.span();
            for (e, &k) in self.edges.iter().zip(&stiffness.stretch) {
                if span.holds_any(&self.pattern, &e.vertices) {
                    let h = of_edge(e.along(x), e.stiffness(k, x) * scale, e.rest_length);
                    e.vertices.iter().for_each(|&v| columns.add_diagonal(&self.pattern, v as usize, &h));
                    columns.add_pair(&self.pattern, e.pair, &-h);
                }
            }
            for (spring, k) in self.angles(stiffness) {
                if span.holds_any(&self.pattern, &spring.vertices) {
                    let [u, w] = arms(x, spring.vertices);
                    let h = of_angle(u, w, k * scale, spring.rest_angle);
                    spring.scatter_hessian(&h, &self.pattern, &mut columns);
                }
            }
        };
        let [first, second] = matrix.halves(&self.pattern);
        rayon::join(|| add(first), || add(second));
    }

    /// Adds `scale`·∂/∂x [ aᵀ (∂²E/∂x²) b ] to `out`.
    pub fn add_third(
        &self,
        stiffness: &Stiffness,
        x: &[DVec3],
        [a, b]: [&[DVec3]; 2],
        scale: f64,
        out: &mut [DVec3],
    ) {
        if let Some(continuum) = &self.continuum {
            return continuum.add_third(stiffness, x, [a, b], scale, out);
        }
        let mut second = vec![DVec3::ZERO; out.len()];
        let [first_half, second_half] = self.angle_halves(stiffness);
        let of_spring = |(h, k): (&AngleSpring, f64), out: &mut [DVec3]| {
            let (at, va, vb) = (arms(x, h.vertices), arms(a, h.vertices), arms(b, h.vertices));
            h.scatter(angle::third(at, k * scale, h.rest_angle, va, vb), out);
        };
        rayon::join(
            || {
                for (e, &k) in self.edges.iter().zip(&stiffness.stretch) {
                    let k = e.stiffness(k, x) * scale;
                    let third = stretch::third(e.along(x), k, e.rest_length, e.along(a), e.along(b));
                    e.scatter(third, out);
                }
                first_half.for_each(|h| of_spring(h, out));
            },
            || second_half.for_each(|h| of_spring(h, &mut second)),
        );
        out.iter_mut().zip(&second).for_each(|(out, g)| *out += *g);
    }

    /// Adds `scale`·λᵀ ∂(∂E/∂x)/∂k to `out` for the stiffness k of every element.
    pub fn add_gradient_by_stiffness(&self, x: &[DVec3], lambda: &[DVec3], scale: f64, out: &mut Stiffness) {
        if let Some(continuum) = &self.continuum {
            return continuum.add_gradient_by_stiffness(x, lambda, scale, out);
        }
        for (e, out) in self.edges.iter().zip(&mut out.stretch) {
            let unit = stretch::gradient(e.along(x), e.stiffness(1.0, x), e.rest_length);
            *out += scale * unit.dot(e.along(lambda));
        }
        for (hinges, out) in [(&self.bends, &mut out.bend), (&self.shears, &mut out.shear)] {
            hinges.par_iter().zip(out).with_min_len(TASK).for_each(|(h, out)| {
                let [u, w] = arms(x, h.vertices);
                let [gu, gw] = angle::gradient(u, w, 1.0, h.rest_angle);
                let [lu, lw] = arms(lambda, h.vertices);
                *out += scale * (gu.dot(lu) + gw.dot(lw));
            });
        }
    }

    /// Adds `scale`·aᵀ ∂(∂²E/∂x²)/∂k b to `out` for the stiffness k of every element.
    pub fn add_hessian_by_stiffness(
        &self,
        x: &[DVec3],
        [a, b]: [&[DVec3]; 2],
        scale: f64,
        out: &mut Stiffness,
    ) {
        if let Some(continuum) = &self.continuum {
            return continuum.add_hessian_by_stiffness(x, [a, b], scale, out);
        }
        for (e, out) in self.edges.iter().zip(&mut out.stretch) {
            let unit = stretch::hessian(e.along(x), e.stiffness(1.0, x), e.rest_length);
            *out += scale * e.along(a).dot(unit * e.along(b));
        }
        for (hinges, out) in [(&self.bends, &mut out.bend), (&self.shears, &mut out.shear)] {
            hinges.par_iter().zip(out).with_min_len(TASK).for_each(|(spring, out)| {
                let [u, w] = arms(x, spring.vertices);
                let h = angle::hessian(u, w, 1.0, spring.rest_angle);
                let ([au, aw], [bu, bw]) = (arms(a, spring.vertices), arms(b, spring.vertices));
                *out += scale
                    * (au.dot(h.uu * bu + h.uw * bw) + aw.dot(h.uw.transpose() * bu) + aw.dot(h.ww * bw));
            });
        }
    }

    /// Bending, then shearing pairs, each with its stiffness.
    fn angles<'a>(&'a self, stiffness: &'a Stiffness) -> impl Iterator<Item = (&'a AngleSpring, f64)> + Send {
        let bends = self.bends.iter().zip(stiffness.bend.iter().copied());
        bends.chain(self.shears.iter().zip(stiffness.shear.iter().copied()))
    }

    /// [`Self::angles`] in two halves, always the same.
    fn angle_halves<'a>(
        &'a self,
        stiffness: &'a Stiffness,
    ) -> [Box<dyn Iterator<Item = (&'a AngleSpring, f64)> + Send + 'a>; 2] {
        let half = usize::midpoint(self.bends.len(), self.shears.len());
        [Box::new(self.angles(stiffness).take(half)), Box::new(self.angles(stiffness).skip(half))]
    }
}

impl Stiffness {
    /// The same stretch, bend and shear stiffness for every spring of `cloth`; zeros for the elements of a
    /// continuum, whose stiffness is [`super::fabric::Fabric::stiffness`].
    pub fn uniform(cloth: &Cloth, [stretch, bend, shear]: [f64; 3]) -> Self {
        Self {
            stretch: vec![stretch; cloth.edges.len()],
            bend: vec![bend; cloth.bends.len()],
            shear: vec![shear; cloth.shears.len()],
            membrane: vec![[0.0; 4]; cloth.continuum.as_ref().map_or(0, |c| c.membranes.len())],
            hinge: vec![0.0; cloth.continuum.as_ref().map_or(0, |c| c.hinges.len())],
        }
    }

    /// Given `self` = ∂L/∂k of every element, ∂L/∂log10 of the three uniform stiffnesses `k`.
    pub fn grad_log10(&self, k: [f64; 3]) -> [f64; 3] {
        let sums = [&self.stretch, &self.bend, &self.shear].map(|g| g.iter().sum::<f64>());
        [0, 1, 2].map(|i| sums[i] * k[i] * std::f64::consts::LN_10)
    }
}

impl Edge {
    /// Difference of a field along the edge.
    pub fn along(&self, field: &[DVec3]) -> DVec3 {
        field[self.vertices[1] as usize] - field[self.vertices[0] as usize]
    }

    /// Its stiffness at `x`, given `k` [N/m] where it is stretched.
    pub fn stiffness(&self, k: f64, x: &[DVec3]) -> f64 {
        let is_short = self.along(x).length_squared() < self.rest_length * self.rest_length;
        if is_short { k * self.compression } else { k }
    }

    /// Adds the gradient by the vector between its ends to those by the positions.
    #[inline]
    pub fn scatter(&self, gradient: DVec3, out: &mut [DVec3]) {
        out[self.vertices[0] as usize] -= gradient;
        out[self.vertices[1] as usize] += gradient;
    }
}

impl AngleSpring {
    /// Adds the gradients by (u, w) to those by the positions.
    #[inline]
    pub fn scatter(&self, [gu, gw]: [DVec3; 2], out: &mut [DVec3]) {
        let [a, o, c] = self.vertices.map(|v| v as usize);
        out[a] -= gu;
        out[o] += gu - gw;
        out[c] += gw;
    }

    /// Adds the second derivatives by (u, w) to those by the positions.
    #[inline]
    pub fn scatter_hessian(&self, h: &angle::Hessian, pattern: &BlockPattern, columns: &mut Columns) {
        let [a, o, c] = self.vertices.map(|v| v as usize);
        let [ao, ac, oc] = self.pairs;
        // u = o − a, w = c − o.
        columns.add_diagonal(pattern, a, &h.uu);
        columns.add_diagonal(pattern, o, &(h.uu + h.ww - h.uw - h.uw.transpose()));
        columns.add_diagonal(pattern, c, &h.ww);
        columns.add_pair(pattern, ao, &(h.uw - h.uu));
        columns.add_pair(pattern, ac, &-h.uw);
        columns.add_pair(pattern, oc, &(h.uw - h.ww));
    }
}

/// (o − a, c − o) of a field.
#[inline]
pub fn arms(field: &[DVec3], [a, o, c]: [u32; 3]) -> [DVec3; 2] {
    let o = field[o as usize];
    [o - field[a as usize], field[c as usize] - o]
}
