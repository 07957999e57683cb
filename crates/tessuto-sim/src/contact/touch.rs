//! Contact within one step: the pairs that may meet in it, their sums, and how far an iteration may go.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::advance::advance;
use super::candidates::Bounds;
use super::closest::{Blocks, Corners};
use super::pair::{Gap, Pair};
use super::slip::Slip;
use super::{Contact, Shape};
use crate::state::StepGradients;
use tessuto_core::error::{Error, Result};
use tessuto_core::math::block_matrix::{BlockMatrix, BlockPattern};
use tessuto_core::mesh::Positions;

/// How much larger boxes are than what they are to hold, in thicknesses: smaller ones are left sooner, larger ones
/// meet more.
const MARGIN: f64 = 0.5;
/// Pairs of one parallel task.
const TASK: usize = 256;

/// The contact of a step that begins at given positions.
pub struct Touch<'a> {
    contact: &'a Contact,
    frictions: Vec<f64>,
    /// Every vertex is looked for in its box.
    boxes: Vec<Bounds>,
    pairs: Vec<Pair>,
    slips: Vec<Slip>,
    /// Before the step, with the bodies' nodes.
    before: Positions,
    /// Where the energy was last asked for, with the bodies' nodes, and the pairs that are near there.
    last: (Positions, Vec<Near>),
}

/// A pair within the thickness, its gap and corners.
type Near = (Pair, Gap, Corners);

/// Blocks of a matrix between vertices that its pattern does not couple.
#[derive(Debug, Default)]
pub struct Far(Vec<(u32, u32, DMat3)>);

impl<'a> Touch<'a> {
    /// Of a step of length `h` `[s]` from the positions `x` that leads about as far as `way`, shape `[V]` each.
    ///
    /// # Errors
    /// [`Error::Input`] if the sheet is within a body.
    pub fn new(contact: &'a Contact, x: &[DVec3], way: &[DVec3], h: f64) -> Result<Self> {
        let margin = MARGIN * contact.law.thickness;
        let boxes = x.iter().zip(way).map(|(x, way)| Bounds::of(*x, *x + *way).grown(margin)).collect();
        let mut touch = Self {
            contact,
            frictions: contact.frictions(),
            pairs: Vec::new(),
            slips: Vec::new(),
            before: contact.with_bodies(x),
            boxes,
            last: Default::default(),
        };
        touch.pairs = contact.pairs(&touch.boxes);
        let near = touch.near(&touch.before);
        if let Some((pair, gap, _)) = near.iter().find(|(_, gap, _)| gap.size <= 0.0) {
            return Err(contact.within(pair, gap));
        }
        let reach = contact.settings.slip * h;
        touch.slips = near.iter().map(|(pair, gap, _)| Slip::new(*pair, *gap, &contact.law, reach)).collect();
        Ok(touch)
    }

    /// Looks for the pairs anew, if a vertex of `x` is out of its box.
    pub fn cover(&mut self, x: &[DVec3]) {
        if self.boxes.iter().zip(x).all(|(b, x)| b.holds(*x)) {
            return;
        }
        let margin = MARGIN * self.contact.law.thickness;
        for (bounds, x) in self.boxes.iter_mut().zip(x) {
            if !bounds.holds(*x) {
                *bounds = bounds.with(*x).grown(margin);
            }
        }
        self.pairs = self.contact.pairs(&self.boxes);
    }

    /// The pairs within the thickness at `nodes`, with their gaps and corners.
    fn near(&self, nodes: &[DVec3]) -> Vec<Near> {
        let reach = self.contact.law.thickness;
        let of = |pair: &Pair| {
            let corners = pair.corners(nodes);
            pair.gap(&corners, reach).map(|gap| (*pair, gap, corners))
        };
        self.pairs.par_iter().with_min_len(TASK).filter_map(of).collect()
    }

    /// Adds the derivatives of the energy of contact and friction at `x` to `out`, and returns it `[J]`. The boxes
    /// must [`cover`](Self::cover) `x`.
    pub fn add_gradient(&mut self, x: &[DVec3], out: &mut [DVec3]) -> f64 {
        let nodes = self.contact.with_bodies(x);
        let near = self.near(&nodes);
        let mut energy = 0.0;
        for (pair, gap, _) in &near {
            let (value, gradient) = pair.energy_and_gradient(&self.contact.law, gap);
            energy += value;
            scatter(pair, &gradient, out);
        }
        for slip in &self.slips {
            let friction = self.frictions[slip.pair.surface];
            let (value, gradient) = slip.energy_and_gradient(friction, &self.way(slip, &nodes));
            energy += value;
            scatter(&slip.pair, &gradient, out);
        }
        self.last = (nodes, near);
        energy
    }

    /// Adds ∂² of the same to `matrix`; `exact`, or an approximation that is never negative. Returns what the
    /// pattern has no place for.
    pub fn add_hessian(
        &self,
        x: &[DVec3],
        exact: bool,
        (pattern, matrix): (&BlockPattern, &mut BlockMatrix),
    ) -> Far {
        let nodes = self.contact.with_bodies(x);
        let fresh = (self.last.0 != nodes).then(|| self.near(&nodes));
        let near = fresh.as_ref().unwrap_or(&self.last.1);
        let blocks: Vec<Blocks> = near
            .par_iter()
            .with_min_len(TASK / 4)
            .map(|(pair, gap, corners)| pair.hessian(&self.contact.law, gap, corners, exact))
            .collect();
        let mut far = Far::default();
        let mut columns = matrix.whole();
        let mut add = |pair: &Pair, block: &dyn Fn(usize, usize) -> DMat3| {
            let own = |k: usize| (pair.nodes[k] as usize) < self.contact.vertex_count;
            for k in (0..pair.node_count()).filter(|k| own(*k)) {
                columns.add_diagonal(pattern, pair.nodes[k] as usize, &block(k, k));
                for l in (0..k).filter(|l| own(*l)) {
                    let (a, b, block) = (pair.nodes[k], pair.nodes[l], block(k, l));
                    match self.contact.place(a, b) {
                        Some((place, false)) => columns.add_pair(pattern, place, &block),
                        Some((place, true)) => columns.add_pair(pattern, place, &block.transpose()),
                        None => far.0.push((a, b, block)),
                    }
                }
            }
        };
        for ((pair, ..), blocks) in near.iter().zip(&blocks) {
            add(pair, &|k, l| blocks[k][l]);
        }
        for slip in &self.slips {
            let stiff = slip.hessian(self.frictions[slip.pair.surface], &self.way(slip, &nodes));
            let w = slip.weights();
            add(&slip.pair, &|k, l| stiff * (w[k] * w[l]));
        }
        far
    }

    /// The part of `step` from `x`, shape `[V]` each, that no pair passes through in. The boxes must cover both ends.
    pub fn free_part(&self, x: &[DVec3], step: &[DVec3]) -> f64 {
        let nodes = self.contact.with_bodies(x);
        let still = DVec3::ZERO;
        let of = |pair: &Pair| {
            let ways = pair.nodes.map(|k| step.get(k as usize).copied().unwrap_or(still));
            advance(pair, &pair.corners(&nodes), &ways)
        };
        self.pairs.par_iter().with_min_len(TASK).map(of).reduce(|| 1.0, f64::min)
    }

    /// Adds what friction takes from the adjoint `mu` of the positions after the step, `after`, to the derivatives by
    /// the positions before it and by the coefficients.
    pub fn add_vjp(&self, after: &[DVec3], mu: &[DVec3], gradients: &mut StepGradients) {
        let nodes = self.contact.with_bodies(after);
        for slip in &self.slips {
            let pair = &slip.pair;
            let m = pair.nodes.map(|k| mu.get(k as usize).copied().unwrap_or(DVec3::ZERO));
            let friction = self.frictions[pair.surface];
            let way = self.way(slip, &nodes);
            let own = slip.vjp(&self.contact.law, friction, &pair.corners(&self.before), &way, &m);
            let negative = own.before.map(|g| -g);
            scatter(pair, &negative, &mut gradients.x);
            gradients.friction[pair.surface] -= own.friction;
        }
    }

    /// How far the corners of a slip have gone since the step began.
    fn way(&self, slip: &Slip, nodes: &[DVec3]) -> Corners {
        slip.pair.nodes.map(|k| nodes[k as usize] - self.before[k as usize])
    }
}

impl Far {
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Adds the blocks' product with `field` to `out`.
    pub fn add_product(&self, field: &[DVec3], out: &mut [DVec3]) {
        for (a, b, block) in &self.0 {
            let (a, b) = (*a as usize, *b as usize);
            out[a] += *block * field[b];
            out[b] += block.transpose() * field[a];
        }
    }
}

impl Contact {
    fn with_bodies(&self, x: &[DVec3]) -> Positions {
        [x, &self.nodes].concat()
    }

    fn within(&self, pair: &Pair, gap: &Gap) -> Error {
        let vertex =
            pair.nodes.iter().find(|k| (**k as usize) < self.vertex_count).copied().unwrap_or_default();
        let problem = match pair.surface.checked_sub(1) {
            None => "two of its layers have no gap between them".to_owned(),
            Some(k) => {
                let what = match &self.settings.bodies[k].shape {
                    Shape::Plane { .. } => "plane",
                    Shape::Sphere { .. } => "sphere",
                    Shape::Mesh { .. } => "mesh",
                };
                format!("the sheet is {:.3} mm within body {k}, a {what}", -1e3 * gap.size)
            }
        };
        Error::input(
            format!("contact, vertex {vertex}"),
            problem,
            "begin with a sheet that passes through nothing",
        )
    }
}

/// Adds derivatives by the corners to those by the vertices.
fn scatter(pair: &Pair, gradient: &[DVec3; 4], out: &mut [DVec3]) {
    for (k, g) in pair.nodes.iter().zip(gradient).take(pair.node_count()) {
        if let Some(out) = out.get_mut(*k as usize) {
            *out += *g;
        }
    }
}
