//! The cloth as a mechanical system: masses, springs, and sums over them.

use std::ops::{AddAssign, Sub, SubAssign};
use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::contact::Contact;
use super::continuum::Continuum;
use super::springs::{self, SpringSides, Springs};
use super::stiffness::{Energy, HessianKind, Stiffness};
use super::{angle, lattice::Lattice, stretch};
use tessuto_core::math::block_matrix::{BlockMatrix, BlockPattern, Columns};
use tessuto_core::math::factor::Analysis;
use tessuto_core::mesh::{Mesh, triangle_area};

/// Area density ρ [kg/m²]. Only force per mass can be seen in a video, so its value sets a scale only.
pub const AREA_DENSITY: f64 = 0.1;
/// Angle pairs whose rest deflection is below this bend, the others shear `[rad]`.
const BEND_LIMIT: f64 = std::f64::consts::FRAC_PI_4;

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
    /// Of its springs.
    pub(super) sides: SpringSides,
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
        let sides = springs::sides(&pattern, &edges, [&bends, &shears]);
        Self {
            masses: lumped_masses(template),
            edges,
            bends,
            shears,
            triangles: template.triangles(),
            continuum: None,
            sides,
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
        self.springs(stiffness).add_gradient(x, scale, out)
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
        self.springs(stiffness).add_hessian(x, kind, scale, matrix);
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
        self.springs(stiffness).add_third(x, [a, b], scale, out);
    }

    /// Adds `scale`·λᵀ ∂(∂E/∂x)/∂k to `out` for the stiffness k of every element.
    pub fn add_gradient_by_stiffness(&self, x: &[DVec3], lambda: &[DVec3], scale: f64, out: &mut Stiffness) {
        if let Some(continuum) = &self.continuum {
            return continuum.add_gradient_by_stiffness(x, lambda, scale, out);
        }
        springs::add_gradient_by_stiffness(self, x, lambda, scale, out);
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
        springs::add_hessian_by_stiffness(self, x, [a, b], scale, out);
    }

    fn springs<'a>(&'a self, stiffness: &'a Stiffness) -> Springs<'a> {
        Springs { cloth: self, stiffness }
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
    pub fn scatter<V: Copy + AddAssign + SubAssign>(&self, gradient: V, out: &mut [V]) {
        out[self.vertices[0] as usize] -= gradient;
        out[self.vertices[1] as usize] += gradient;
    }
}

impl AngleSpring {
    /// Adds the gradients by (u, w) to those by the positions.
    #[inline]
    pub fn scatter<V: Copy + Sub<Output = V> + AddAssign + SubAssign>(
        &self,
        [gu, gw]: [V; 2],
        out: &mut [V],
    ) {
        let [a, o, c] = self.vertices.map(|v| v as usize);
        out[a] -= gu;
        out[o] += gu - gw;
        out[c] += gw;
    }

    /// Adds the second derivatives by (u, w) to those by the positions.
    #[inline]
    pub fn scatter_hessian(&self, h: &angle::Hessian, pattern: &BlockPattern, columns: &mut Columns) {
        h.blocks(|place, block| {
            let block = &DMat3::from_cols_array_2d(block);
            match self.vertices.get(place) {
                Some(vertex) => columns.add_diagonal(pattern, *vertex as usize, block),
                None => columns.add_pair(pattern, self.pairs[place - 3], block),
            }
        });
    }
}

/// (o − a, c − o) of a field.
#[inline]
pub fn arms(field: &[DVec3], [a, o, c]: [u32; 3]) -> [DVec3; 2] {
    let o = field[o as usize];
    [o - field[a as usize], field[c as usize] - o]
}
