//! One iteration: what the network sees of a shape that shall become the minimum of the incremental potential, and
//! how far the shape moves; with the adjoint.

use glam::DVec3;

use super::frames::{Frame, add_frame_vjp, frame};
use super::network::{INPUTS, Network, OUTPUTS, Tape};
use super::planes::{Float, Planes};
use super::smoother::{Smoother, along_laplacian};
use crate::cloth::{AREA_DENSITY, Cloth};
use crate::implicit_euler::hessian;
use crate::lattice::Lattice;
use crate::stiffness::{HessianKind, Stiffness};
use crate::stretch;
use tessuto_core::math::dot;
use tessuto_core::math::factor::Scratch;
use tessuto_core::mesh::Positions;

/// A residual below this fraction of the spacing is none.
const FLOOR: f64 = 1e-9;
/// Edges are taken as this long at least `[m]`.
const SHORTEST: f64 = 1e-9;
/// Between the squares of the Laplacian that bending and shearing are of, and the Laplacian.
const OF_ANGLES: f64 = 4.0;
/// Strain that makes the tension which the normals feel, about.
const OF_TENSION: f64 = 0.02;

/// The incremental potential Φ(z) = ½ (z − y)ᵀ M (z − y)/h² + E(z) of a step.
#[derive(Debug)]
pub struct Descent<'a> {
    cloth: &'a Cloth,
    lattice: &'a Lattice,
    stiffness: &'a Stiffness,
    /// Where the cloth would be without elastic forces `[m]`, shape `[V]`.
    y: Positions,
    h: f64,
    /// Means of the stretch, bend and shear stiffnesses, and over how many elements.
    means: [(f64, f64); 3],
    /// Each times its factor is the stiffness per mass of a vertex inside, times h².
    to_ratio: [f64; 3],
    /// Stands for ∂²Φ in the surface, and for it along the normals.
    smoothers: [Smoother; 2],
    /// How their Laplacians' factors grow with the means.
    by_means: [[f64; 3]; 2],
    total_mass: f64,
}

/// A shape as the network sees it.
#[derive(Debug)]
pub struct View<T> {
    /// Shape [rows, columns, [`INPUTS`]].
    pub inputs: Planes<T>,
    residual: Positions,
    /// The smoother's step `[m]`, shape `[V]`.
    step: Positions,
    /// The soft smoother's step along the normals `[m]`, shape `[V]`.
    soft: Vec<f64>,
    /// Of every pixel.
    frames: Vec<Frame>,
    /// Root mean square of the step `[m]`.
    scale: f64,
}

/// One iteration, for its adjoint.
#[derive(Debug)]
pub struct Iteration<T> {
    view: View<T>,
    /// `None` where the network's answer would not have lowered Φ, and the step alone was taken.
    tape: Option<Tape<T>>,
    from: Positions,
}

/// ∂L/∂ what a descent depends on, added up.
#[derive(Debug)]
pub struct DescentGradients<'a> {
    /// By y.
    pub y: Positions,
    /// By every element's stiffness.
    pub stiffness: &'a mut Stiffness,
    /// By every edge's rest length.
    pub rest_lengths: &'a mut [f64],
}

impl<T> View<T> {
    /// How far Φ would fall if the smoother were ∂²Φ `[J]`: half of residual times step.
    pub fn promised(&self) -> f64 {
        0.5 * dot(&self.residual, &self.step)
    }
}

impl<T> Iteration<T> {
    /// Whether the network's answer was taken.
    pub fn is_answered(&self) -> bool {
        self.tape.is_some()
    }
}

impl<'a> Descent<'a> {
    /// Towards the minimum for steps of `h` `[s]` from the inertial positions `y` `[m]`.
    pub fn new(
        cloth: &'a Cloth,
        lattice: &'a Lattice,
        stiffness: &'a Stiffness,
        h: f64,
        y: Positions,
    ) -> Self {
        let mean = |values: &[f64]| {
            let count = values.len().max(1) as f64;
            (values.iter().sum::<f64>() / count, count)
        };
        let means = [mean(&stiffness.stretch), mean(&stiffness.bend), mean(&stiffness.shear)];
        let a2 = lattice.spacing * lattice.spacing;
        let per_mass = h * h / (AREA_DENSITY * a2);
        let by_means = [1.0, OF_TENSION].map(|stretch| [stretch, OF_ANGLES / a2, OF_ANGLES / a2]);
        let smoothers = by_means.map(|by_means| {
            let laplacian = by_means.iter().zip(&means).map(|(by, (mean, _))| by * mean).sum();
            Smoother::new(cloth, lattice, h, laplacian)
        });
        Self {
            cloth,
            lattice,
            stiffness,
            y,
            h,
            means,
            to_ratio: [per_mass, per_mass / a2, per_mass / a2],
            smoothers,
            by_means,
            total_mass: cloth.masses.iter().sum(),
        }
    }

    /// Where it starts.
    pub fn start(&self) -> &Positions {
        &self.y
    }

    /// Φ(z) `[J]`.
    pub fn potential(&self, z: &[DVec3]) -> f64 {
        let inertia = |((z, y), m): ((&DVec3, &DVec3), &f64)| m * z.distance_squared(*y);
        let inertia: f64 = z.iter().zip(&self.y).zip(&self.cloth.masses).map(inertia).sum();
        0.5 * inertia / (self.h * self.h) + self.cloth.energy(self.stiffness, z).total()
    }

    /// −∂Φ `[N]`, shape `[V]`.
    pub fn residual(&self, z: &[DVec3]) -> Positions {
        let inverse = 1.0 / (self.h * self.h);
        let parts = z.iter().zip(&self.y).zip(&self.cloth.masses);
        let mut out: Positions = parts.map(|((z, y), m)| (*y - *z) * (m * inverse)).collect();
        self.cloth.add_gradient(self.stiffness, z, -1.0, &mut out);
        out
    }

    /// Stretch stiffness per mass times h², and what else the network receives about the fabric.
    fn ratios(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| self.means[k].0 * self.to_ratio[k])
    }

    /// What the network sees of `z`.
    pub fn view<T: Float>(&self, z: &[DVec3]) -> View<T> {
        let Lattice { rows, columns, spacing, .. } = *self.lattice;
        let residual = self.residual(z);
        let step = self.smoothers[0].solve(self.lattice, &residual);
        let frames: Vec<Frame> = (0..z.len()).map(|k| frame(self.lattice, z, k)).collect();
        let soft = self.solve_soft(|k, vertex| frames[k][2].dot(residual[vertex]));
        let floor = FLOOR * spacing;
        let square = step.iter().map(|p| p.length_squared()).sum::<f64>() / step.len() as f64;
        let scale = (square + floor * floor).sqrt();
        let ratios = self.ratios();
        let tail = [ratios[0].log10() - 1.5, ratios[1].log10(), ratios[2].log10(), 1.0];
        let mut inputs = Planes::zeros(rows, columns, INPUTS);
        for (k, &vertex) in self.lattice.vertices.iter().enumerate() {
            let mut values = [0.0; INPUTS];
            values[..3].copy_from_slice(&frames[k].map(|t| t.dot(step[vertex as usize]) / scale));
            for side in 0..2 {
                let Some((arm, edge)) = self.arm(z, k, side) else { continue };
                values[3 + 3 * side..6 + 3 * side].copy_from_slice(&frames[k].map(|t| t.dot(arm) / spacing));
                values[9 + side] = squashed(self.tension(ratios[0], arm, edge));
            }
            values[11..15].copy_from_slice(&tail);
            values[15] = soft[vertex as usize] / scale;
            let pixel = inputs.pixel_mut(k / columns, k % columns);
            pixel.iter_mut().zip(values).for_each(|(to, from)| *to = T::of(from));
        }
        View { inputs, residual, step, soft, frames, scale }
    }

    /// The soft smoother's inverse of a scalar field, given by pixel and vertex; shape `[V]`.
    fn solve_soft(&self, of: impl Fn(usize, usize) -> f64) -> Vec<f64> {
        let mut field = vec![DVec3::ZERO; self.y.len()];
        for (k, &vertex) in self.lattice.vertices.iter().enumerate() {
            field[vertex as usize].x = of(k, vertex as usize);
        }
        self.smoothers[1].solve(self.lattice, &field).iter().map(|x| x.x).collect()
    }

    /// The edge from pixel `k` to the next column or row, along which `z` goes by the returned vector.
    fn arm(&self, z: &[DVec3], k: usize, side: usize) -> Option<(DVec3, usize)> {
        let edge = self.lattice.edges[k][side]? as usize;
        let next = self.lattice.vertices[k + [1, self.lattice.columns][side]];
        Some((z[next as usize] - z[self.lattice.vertices[k] as usize], edge))
    }

    /// h²/m of the tension per length.
    fn tension(&self, ratio: f64, arm: DVec3, edge: usize) -> f64 {
        ratio * (1.0 - self.cloth.edges[edge].rest_length / arm.length().max(SHORTEST))
    }

    /// The step and what the network's `output` adds to it, `[m]`, shape `[V]`: without a net momentum.
    pub fn moves<T: Float>(&self, view: &View<T>, output: &Planes<T>) -> Positions {
        let mut out = vec![DVec3::ZERO; self.y.len()];
        for (k, &vertex) in self.lattice.vertices.iter().enumerate() {
            let (p, c) = (view.step[vertex as usize], self.coefficients(output, k));
            let soft = view.frames[k][2] * (c[3] * view.soft[vertex as usize]);
            out[vertex as usize] =
                (0..3).map(|i| view.frames[k][i] * (c[i] * view.frames[k][i].dot(p))).sum::<DVec3>() + soft;
        }
        let masses = &self.cloth.masses;
        let mean = out.iter().zip(masses).map(|(o, m)| *o * *m).sum::<DVec3>() / self.total_mass;
        out.iter_mut().zip(&view.step).for_each(|(o, p)| *o += *p - mean);
        out
    }

    /// What the network answers at pixel `k`: factors of the step along the frame, and of the soft step.
    fn coefficients<T: Float>(&self, output: &Planes<T>, k: usize) -> [f64; OUTPUTS] {
        let pixel = output.pixel(k / self.lattice.columns, k % self.lattice.columns);
        [0, 1, 2, 3].map(|i| pixel[i].wide())
    }

    /// The part of the adjoint of [`moves`](Self::moves) that leads to the network's output; `grad` becomes that
    /// by the moves before their momentum was taken off.
    pub fn moves_vjp<T: Float>(&self, view: &View<T>, grad: &mut [DVec3]) -> Planes<T> {
        let share = grad.iter().copied().sum::<DVec3>() / self.total_mass;
        grad.iter_mut().zip(&self.cloth.masses).for_each(|(g, m)| *g -= share * *m);
        let mut out = Planes::zeros(self.lattice.rows, self.lattice.columns, OUTPUTS);
        for (k, &vertex) in self.lattice.vertices.iter().enumerate() {
            let (p, g, frame) = (view.step[vertex as usize], grad[vertex as usize], &view.frames[k]);
            let by = |i: usize| frame[i].dot(p) * frame[i].dot(g);
            let by_all = [by(0), by(1), by(2), view.soft[vertex as usize] * frame[2].dot(g)];
            let pixel = out.pixel_mut(k / self.lattice.columns, k % self.lattice.columns);
            pixel.iter_mut().zip(by_all).for_each(|(to, from)| *to = T::of(from));
        }
        out
    }

    /// Moves `z` once: by what the network answers if that lowers Φ, else by the step alone.
    pub fn iterate<T: Float>(&self, network: &Network<T>, z: &mut Positions) -> Iteration<T> {
        let view = self.view(z);
        let tape = network.forward(&view.inputs);
        let moved = |moves: &[DVec3]| -> Positions { z.iter().zip(moves).map(|(z, m)| *z + *m).collect() };
        let answered = moved(&self.moves(&view, &tape.output));
        let lowers = self.potential(&answered) < self.potential(z);
        let after = if lowers { answered } else { moved(&view.step) };
        let from = std::mem::replace(z, after);
        Iteration { view, tape: lowers.then_some(tape), from }
    }

    /// Adjoint of [`iterate`](Self::iterate): `grad` is ∂L/∂ the shape after it, then before it.
    pub fn iterate_vjp<T: Float>(
        &self,
        network: &Network<T>,
        iteration: &Iteration<T>,
        grad: &mut Positions,
        gradients: &mut DescentGradients,
        scratch: &mut Scratch,
    ) {
        let Iteration { view, tape, from: z } = iteration;
        let (scale, spacing, columns) = (view.scale, self.lattice.spacing, self.lattice.columns);
        let mut by_step = grad.clone();
        let Some(tape) = tape else {
            let by_residual = self.smoothers[0].solve(self.lattice, &by_step);
            let by_laplacian = -along_laplacian(self.cloth, &by_residual, &view.step);
            self.residual_vjp(z, &by_residual, grad, gradients, scratch);
            return self.means_vjp([by_laplacian, 0.0], [0.0; 3], gradients);
        };
        let mut by_moves = grad.clone();
        let by_output = self.moves_vjp(view, &mut by_moves);
        let by_inputs = network.inputs_vjp(tape, &by_output);

        let ratios = self.ratios();
        let (mut by_scale, mut by_ratio) = (0.0, [0.0; 3]);
        let mut by_soft = vec![0.0; z.len()];
        let mut by_frames = vec![[DVec3::ZERO; 3]; z.len()];
        for (k, &vertex) in self.lattice.vertices.iter().enumerate() {
            let v = vertex as usize;
            let (p, g, frame, by_frame) = (view.step[v], by_moves[v], &view.frames[k], &mut by_frames[k]);
            let c = self.coefficients(&tape.output, k);
            let pixel: [f64; INPUTS] =
                std::array::from_fn(|i| by_inputs.pixel(k / columns, k % columns)[i].wide());
            for i in 0..3 {
                let (along, of_input) = (frame[i].dot(g), pixel[i] / scale);
                by_step[v] += frame[i] * (c[i] * along + of_input);
                by_frame[i] += p * (c[i] * along + of_input) + g * (c[i] * frame[i].dot(p));
                by_scale -= of_input * frame[i].dot(p) / scale;
            }
            by_soft[v] = c[3] * frame[2].dot(g) + pixel[15] / scale;
            by_frame[2] += g * (c[3] * view.soft[v]);
            by_scale -= pixel[15] * view.soft[v] / (scale * scale);
            for side in 0..2 {
                let Some((arm, edge)) = self.arm(z, k, side) else { continue };
                let by_tension = pixel[9 + side] * squashed_slope(self.tension(ratios[0], arm, edge));
                let length = arm.length().max(SHORTEST);
                let rest = self.cloth.edges[edge].rest_length;
                by_ratio[0] += by_tension * (1.0 - rest / length);
                gradients.rest_lengths[edge] -= by_tension * ratios[0] / length;
                let mut by_arm = arm * (by_tension * ratios[0] * rest / length.powi(3));
                for i in 0..3 {
                    by_arm += frame[i] * (pixel[3 + 3 * side + i] / spacing);
                    by_frame[i] += arm * (pixel[3 + 3 * side + i] / spacing);
                }
                let next = self.lattice.vertices[k + [1, columns][side]];
                grad[v] -= by_arm;
                grad[next as usize] += by_arm;
            }
            for (i, by_ratio) in by_ratio.iter_mut().enumerate() {
                *by_ratio += pixel[11 + i] / (ratios[i] * std::f64::consts::LN_10);
            }
        }
        let of_scale = by_scale / (scale * z.len() as f64);
        by_step.iter_mut().zip(&view.step).for_each(|(by, p)| *by += *p * of_scale);
        let mut by_residual = self.smoothers[0].solve(self.lattice, &by_step);
        let of_soft = self.solve_soft(|_, vertex| by_soft[vertex]);
        let product = |a: &[f64], b: &[f64]| {
            let along = |f: &[f64], [a, b]: [u32; 2]| f[b as usize] - f[a as usize];
            self.cloth.edges.iter().map(|e| along(a, e.vertices) * along(b, e.vertices)).sum::<f64>()
        };
        let by_laplacians =
            [-along_laplacian(self.cloth, &by_residual, &view.step), -product(&of_soft, &view.soft)];
        for (k, &vertex) in self.lattice.vertices.iter().enumerate() {
            let v = vertex as usize;
            by_residual[v] += view.frames[k][2] * of_soft[v];
            by_frames[k][2] += view.residual[v] * of_soft[v];
            add_frame_vjp(self.lattice, z, k, &by_frames[k], grad);
        }
        self.residual_vjp(z, &by_residual, grad, gradients, scratch);
        self.means_vjp(by_laplacians, by_ratio, gradients);
    }

    /// Leads ∂L/∂ the Laplacians' factors and the ratios to every element's stiffness.
    fn means_vjp(&self, by_laplacians: [f64; 2], by_ratio: [f64; 3], gradients: &mut DescentGradients) {
        let lists =
            [&mut gradients.stiffness.stretch, &mut gradients.stiffness.bend, &mut gradients.stiffness.shear];
        for (k, list) in lists.into_iter().enumerate() {
            let of_laplacians: f64 = (0..2).map(|i| by_laplacians[i] * self.by_means[i][k]).sum();
            let by_mean = of_laplacians + by_ratio[k] * self.to_ratio[k];
            list.iter_mut().for_each(|g| *g += by_mean / self.means[k].1);
        }
    }

    /// Adjoint of [`residual`](Self::residual) for `lambda`, added to `grad` and `gradients`.
    fn residual_vjp(
        &self,
        z: &[DVec3],
        lambda: &Positions,
        grad: &mut Positions,
        gradients: &mut DescentGradients,
        scratch: &mut Scratch,
    ) {
        let inverse = 1.0 / (self.h * self.h);
        let matrix = hessian(self.cloth, self.stiffness, z, self.h, HessianKind::Exact, scratch);
        let along = matrix.multiply(&self.cloth.pattern, lambda);
        scratch.recycle_matrix(matrix);
        grad.iter_mut().zip(&along).for_each(|(g, h)| *g -= *h);
        let by_y = lambda.iter().zip(&self.cloth.masses).map(|(l, m)| *l * (m * inverse));
        gradients.y.iter_mut().zip(by_y).for_each(|(g, by)| *g += by);
        self.cloth.add_gradient_by_stiffness(z, lambda, -1.0, gradients.stiffness);
        let edges = self.cloth.edges.iter().zip(&self.stiffness.stretch);
        for ((edge, &k), out) in edges.zip(&mut *gradients.rest_lengths) {
            *out -=
                stretch::gradient_by_rest_length(edge.along(z), edge.stiffness(k, z)).dot(edge.along(lambda));
        }
    }
}

/// x/√(1 + x²): within −1 and 1.
fn squashed(x: f64) -> f64 {
    x / (1.0 + x * x).sqrt()
}

fn squashed_slope(x: f64) -> f64 {
    (1.0 + x * x).powf(-1.5)
}
