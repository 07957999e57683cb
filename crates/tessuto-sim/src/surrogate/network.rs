//! The network: a pyramid of convolutions from the coarsest image of the inputs to the finest. Forward and adjoint
//! in plain code.

use std::sync::OnceLock;

use super::planes::{Float, Kernel, Planes};
use tessuto_core::error::{Error, Result};

/// Channels of the inputs.
pub const INPUTS: usize = 16;
/// Channels of the outputs; one more than is used.
pub const OUTPUTS: usize = 4;
/// Hidden channels of every level, from the finest, which has as many pixels as the inputs, each half as large as
/// the one before.
pub const CHANNELS: [usize; 4] = [16, 32, 32, 32];

/// Inputs and outputs of the convolutions in the order of their weights: of every level from the coarsest on two,
/// at last that to the outputs.
pub fn layers() -> Vec<[usize; 2]> {
    let mut out = Vec::new();
    for (level, &channels) in CHANNELS.iter().enumerate().rev() {
        let coarse = CHANNELS.get(level + 1).copied().unwrap_or(0);
        out.extend([[INPUTS + coarse, channels], [channels, channels]]);
    }
    out.push([CHANNELS[0], OUTPUTS]);
    out
}

/// Number of weights: of every layer [outputs, inputs, 3, 3], then its biases.
pub fn weight_count() -> usize {
    layers().iter().map(|[inputs, outputs]| outputs * (inputs * 9 + 1)).sum()
}

/// The rectifier ½ (x + √(x² + 1) − 1): smooth, and 0 where x is.
fn rectified<T: Float>(x: T) -> T {
    T::of(0.5) * (x + (x * x + T::of(1.0)).root() - T::of(1.0))
}

fn slope<T: Float>(x: T) -> T {
    T::of(0.5) * (T::of(1.0) + x.over((x * x + T::of(1.0)).root()))
}

/// A convolution with its adjoint.
#[derive(Debug, Clone)]
struct Convolution<T> {
    forward: Kernel<T>,
    backward: Kernel<T>,
}

impl<T: Float> Convolution<T> {
    /// Of the inputs from `first` on of a layer with `inputs` in all.
    fn new(weights: &[f32], inputs: usize, outputs: usize, first: usize, count: usize) -> Self {
        let weight = |o: usize, i: usize, r: usize, c: usize| {
            T::of(f64::from(weights[((o * inputs + first + i) * 3 + r) * 3 + c]))
        };
        Self {
            forward: Kernel::new(count, outputs, weight),
            backward: Kernel::new(outputs, count, |o, i, r, c| weight(i, o, 2 - r, 2 - c)),
        }
    }
}

#[derive(Debug, Clone)]
struct Level<T> {
    of_inputs: Convolution<T>,
    of_coarse: Option<Convolution<T>>,
    second: Convolution<T>,
    biases: [Vec<T>; 2],
}

/// The network with its weights.
#[derive(Debug, Clone)]
pub struct Network<T> {
    /// From the finest on.
    levels: Vec<Level<T>>,
    last: Convolution<T>,
    last_biases: Vec<T>,
}

/// What one level computed, before the rectifiers and after.
#[derive(Debug)]
struct LevelTape<T> {
    before: [Planes<T>; 2],
    after: Planes<T>,
}

/// What [`Network::forward`] computed.
#[derive(Debug)]
pub struct Tape<T> {
    levels: Vec<LevelTape<T>>,
    /// Shape [rows, columns, [`OUTPUTS`]].
    pub output: Planes<T>,
}

impl<T: Float> Network<T> {
    /// With the `weights` of [`layers`], one after another.
    ///
    /// # Errors
    /// [`Error::Numerical`] if they are not as many as the network has, or not finite.
    pub fn new(weights: &[f32]) -> Result<Self> {
        if weights.len() != weight_count() || weights.iter().any(|w| !w.is_finite()) {
            let problem =
                format!("{} weights, some perhaps not finite, instead of {}", weights.len(), weight_count());
            return Err(Error::numerical("surrogate", problem, "train it again"));
        }
        let mut rest = weights;
        let mut take = |count: usize| {
            let (head, tail) = rest.split_at(count);
            rest = tail;
            head
        };
        let biases = |values: &[f32]| values.iter().map(|b| T::of(f64::from(*b))).collect::<Vec<T>>();
        let mut levels = Vec::new();
        for (level, &channels) in CHANNELS.iter().enumerate().rev() {
            let coarse = CHANNELS.get(level + 1).copied().unwrap_or(0);
            let inputs = INPUTS + coarse;
            let first = take(channels * inputs * 9);
            let first_biases = biases(take(channels));
            let second = take(channels * channels * 9);
            levels.push(Level {
                of_inputs: Convolution::new(first, inputs, channels, 0, INPUTS),
                of_coarse: (coarse > 0).then(|| Convolution::new(first, inputs, channels, INPUTS, coarse)),
                second: Convolution::new(second, channels, channels, 0, channels),
                biases: [first_biases, biases(take(channels))],
            });
        }
        levels.reverse();
        let last = Convolution::new(take(CHANNELS[0] * OUTPUTS * 9), CHANNELS[0], OUTPUTS, 0, CHANNELS[0]);
        Ok(Self { levels, last, last_biases: biases(take(OUTPUTS)) })
    }

    /// Of `inputs`, shape [rows, columns, [`INPUTS`]].
    pub fn forward(&self, inputs: &Planes<T>) -> Tape<T> {
        let pyramid = pyramid(inputs);
        let mut tapes: Vec<LevelTape<T>> = Vec::new();
        for (level, inputs) in self.levels.iter().zip(&pyramid).rev() {
            let size = [inputs.rows, inputs.columns];
            let mut first = filled(size, &level.biases[0]);
            level.of_inputs.forward.add_to(inputs, &mut first);
            if let (Some(of_coarse), Some(coarse)) = (&level.of_coarse, tapes.last()) {
                of_coarse.forward.add_to(&coarse.after.doubled(size[0], size[1]), &mut first);
            }
            let mut second = filled(size, &level.biases[1]);
            level.second.forward.add_to(&through_rectifier(&first), &mut second);
            let after = through_rectifier(&second);
            tapes.push(LevelTape { before: [first, second], after });
        }
        tapes.reverse();
        let mut output = filled([inputs.rows, inputs.columns], &self.last_biases);
        self.last.forward.add_to(&tapes[0].after, &mut output);
        Tape { levels: tapes, output }
    }

    /// ∂L/∂inputs for `grad` = ∂L/∂output.
    pub fn inputs_vjp(&self, tape: &Tape<T>, grad: &Planes<T>) -> Planes<T> {
        let mut grad_after = tape.levels[0].after.zeros_like();
        self.last.backward.add_to(grad, &mut grad_after);
        let mut grad_inputs = Vec::new();
        for (k, (level, tape_of)) in self.levels.iter().zip(&tape.levels).enumerate() {
            let [first, second] = &tape_of.before;
            grad_after.combine(second, |g, x| g * slope(x));
            let mut grad_first = first.zeros_like();
            level.second.backward.add_to(&grad_after, &mut grad_first);
            grad_first.combine(first, |g, x| g * slope(x));
            let mut inputs = Planes::zeros(first.rows, first.columns, INPUTS);
            level.of_inputs.backward.add_to(&grad_first, &mut inputs);
            grad_inputs.push(inputs);
            if let Some(of_coarse) = &level.of_coarse {
                let coarse = &tape.levels[k + 1].after;
                let mut doubled = Planes::zeros(first.rows, first.columns, coarse.channels);
                of_coarse.backward.add_to(&grad_first, &mut doubled);
                grad_after = coarse.zeros_like();
                grad_after.add_doubled_vjp(&doubled);
            }
        }
        let coarsest = grad_inputs.pop().expect("the finest level");
        grad_inputs.into_iter().rev().fold(coarsest, |coarse, mut fine| {
            fine.add_halved_vjp(&coarse);
            fine
        })
    }
}

/// The inputs of every level, from the finest on.
pub fn pyramid<T: Float>(inputs: &Planes<T>) -> Vec<Planes<T>> {
    let mut out = vec![inputs.clone()];
    for _ in 1..CHANNELS.len() {
        out.push(out.last().expect("the inputs").halved());
    }
    out
}

fn filled<T: Float>([rows, columns]: [usize; 2], value: &[T]) -> Planes<T> {
    let mut out = Planes::zeros(rows, columns, value.len());
    out.fill(value);
    out
}

fn through_rectifier<T: Float>(x: &Planes<T>) -> Planes<T> {
    let mut out = x.zeros_like();
    out.combine(x, |_, x| rectified(x));
    out
}

/// Trained by `crates/tessuto/examples/train_surrogate.rs`: f32, little-endian, in the order of [`layers`].
static TRAINED: &[u8] = include_bytes!("../../assets/surrogate/weights.f32");

/// The weights that the program comes with.
pub fn trained_weights() -> Vec<f32> {
    TRAINED.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("four bytes"))).collect()
}

/// The network that the program comes with.
pub fn trained() -> &'static Network<f32> {
    static NETWORK: OnceLock<Network<f32>> = OnceLock::new();
    NETWORK.get_or_init(|| Network::new(&trained_weights()).expect("the weights belong to the network"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::gradient_check::check;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn the_adjoint_is_differences() {
        let mut rng = Rng::new(4, 0);
        let weights: Vec<f32> = (0..weight_count()).map(|_| 0.1 * rng.signed() as f32).collect();
        let network = Network::<f64>::new(&weights).unwrap();
        let (rows, columns) = (6, 9);
        let planes = |values: &[f64], channels: usize| {
            let mut out = Planes::zeros(rows, columns, channels);
            for (k, pixel) in values.chunks_exact(channels).enumerate() {
                out.pixel_mut(k / columns, k % columns).copy_from_slice(pixel);
            }
            out
        };
        let numbers = |planes: &Planes<f64>| -> Vec<f64> {
            (0..rows * columns).flat_map(|k| planes.pixel(k / columns, k % columns).to_vec()).collect()
        };
        let x: Vec<f64> = (0..rows * columns * INPUTS).map(|_| rng.signed()).collect();
        let grad: Vec<f64> = (0..rows * columns * OUTPUTS).map(|_| rng.signed()).collect();
        let value = |x: &[f64]| -> f64 {
            let output = numbers(&network.forward(&planes(x, INPUTS)).output);
            output.iter().zip(&grad).map(|(a, b)| a * b).sum()
        };
        let tape = network.forward(&planes(&x, INPUTS));
        let back = numbers(&network.inputs_vjp(&tape, &planes(&grad, OUTPUTS)));
        let worst = check(&x, &back, 1e-4, 20, 5, value);
        println!("network by its inputs: {worst:?}");
        assert!(worst.relative_error < 1e-7, "{worst:?}");
    }

    #[test]
    fn weights_of_another_network_are_refused() {
        assert!(Network::<f32>::new(&[0.0; 7]).is_err());
        assert!(Network::<f32>::new(&vec![f32::NAN; weight_count()]).is_err());
    }
}
