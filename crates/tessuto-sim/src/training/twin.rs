//! The surrogate's network by the crate `burn`: the gradient by its weights, and the twin that the plain one is
//! tested against.

use burn::tensor::module::conv2d;
use burn::tensor::ops::ConvOptions;
use burn::tensor::{Device, Tensor, TensorData};

use crate::surrogate::network::{CHANNELS, INPUTS, OUTPUTS, layers, pyramid};
use crate::surrogate::planes::Planes;

/// One evaluation of a batch, ready for its gradient.
pub struct Graph {
    /// Weights and biases of every layer.
    leaves: Vec<(Tensor<4>, Tensor<1>)>,
    /// Shape [batch, [`OUTPUTS`], rows, columns].
    output: Tensor<4>,
}

/// The network of `weights` on a `batch` of inputs of one size.
pub fn forward(weights: &[f32], batch: &[Planes<f32>]) -> Graph {
    let device = Device::flex().autodiff();
    let mut rest = weights;
    let leaves: Vec<_> = layers()
        .into_iter()
        .map(|[inputs, outputs]| {
            let (values, tail) = rest.split_at(inputs * outputs * 9);
            let (biases, tail) = tail.split_at(outputs);
            rest = tail;
            let w = TensorData::new(values.to_vec(), [outputs, inputs, 3, 3]);
            let b = TensorData::new(biases.to_vec(), [outputs]);
            let of = (Tensor::<4>::from_data(w, &device), Tensor::<1>::from_data(b, &device));
            (of.0.require_grad(), of.1.require_grad())
        })
        .collect();
    let pyramids: Vec<Vec<Planes<f32>>> = batch.iter().map(pyramid).collect();
    let convolved = |x: Tensor<4>, layer: usize| {
        let (w, b) = leaves[layer].clone();
        conv2d(x, w, Some(b), ConvOptions::new([1, 1], [1, 1], [1, 1], 1))
    };
    let mut coarse: Option<Tensor<4>> = None;
    for (k, level) in (0..CHANNELS.len()).rev().enumerate() {
        let of_level: Vec<&Planes<f32>> = pyramids.iter().map(|p| &p[level]).collect();
        let [rows, columns] = [of_level[0].rows, of_level[0].columns];
        let mut x = tensor(&of_level, INPUTS);
        if let Some(coarse) = coarse.take() {
            x = Tensor::cat(vec![x, doubled(coarse, rows, columns)], 1);
        }
        coarse = Some(rectified(convolved(rectified(convolved(x, 2 * k)), 2 * k + 1)));
    }
    let output = convolved(coarse.expect("a level"), 2 * CHANNELS.len());
    Graph { leaves, output }
}

impl Graph {
    /// Shape [rows, columns, [`OUTPUTS`]] each.
    pub fn outputs(&self) -> Vec<Planes<f32>> {
        let [batch, channels, rows, columns] = self.output.dims();
        let values: Vec<f32> = values(self.output.clone().into_data());
        let of_one = |values: &[f32]| {
            let mut out = Planes::zeros(rows, columns, channels);
            for (k, value) in values.iter().enumerate() {
                let (channel, pixel) = (k / (rows * columns), k % (rows * columns));
                out.pixel_mut(pixel / columns, pixel % columns)[channel] = *value;
            }
            out
        };
        values.chunks_exact(values.len() / batch).map(of_one).collect()
    }

    /// ∂loss/∂weights, in their order, for ∂loss/∂outputs.
    pub fn backward(self, grad: &[Planes<f32>]) -> Vec<f32> {
        // The gradient of Σ output · g with constant g is what leads g back.
        let g = tensor(&grad.iter().collect::<Vec<_>>(), OUTPUTS);
        let mut gradients = (self.output * g).sum().backward();
        let mut out = Vec::new();
        for (w, b) in &self.leaves {
            let missing = "every layer leads to the output";
            out.extend(values(w.grad_remove(&mut gradients).expect(missing).into_data()));
            out.extend(values(b.grad_remove(&mut gradients).expect(missing).into_data()));
        }
        out
    }
}

/// Shape [batch, channels, rows, columns].
fn tensor(batch: &[&Planes<f32>], channels: usize) -> Tensor<4> {
    let [rows, columns] = [batch[0].rows, batch[0].columns];
    let mut data = Vec::with_capacity(batch.len() * channels * rows * columns);
    for planes in batch {
        for channel in 0..channels {
            for row in 0..rows {
                data.extend((0..columns).map(|column| planes.pixel(row, column)[channel]));
            }
        }
    }
    let shape = [batch.len(), channels, rows, columns];
    Tensor::<4>::from_data(TensorData::new(data, shape), &Device::flex()).autodiff()
}

fn rectified(x: Tensor<4>) -> Tensor<4> {
    let root = (x.clone() * x.clone() + 1.0).sqrt();
    (x + root - 1.0) * 0.5
}

/// Every pixel twice in both directions, cut to `rows`×`columns`.
fn doubled(x: Tensor<4>, rows: usize, columns: usize) -> Tensor<4> {
    let [batch, channels, h, w] = x.dims();
    let x: Tensor<6> = x.reshape([batch, channels, h, 1, w, 1]);
    let x: Tensor<4> = x.expand([batch, channels, h, 2, w, 2]).reshape([batch, channels, 2 * h, 2 * w]);
    x.slice([0..batch, 0..channels, 0..rows, 0..columns])
}

fn values(data: TensorData) -> Vec<f32> {
    data.try_to_vec().expect("the tensors hold f32")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surrogate::network::{Network, weight_count};
    use tessuto_core::math::rng::Rng;

    #[test]
    fn the_plain_network_is_the_same() {
        let mut rng = Rng::new(4, 0);
        let weights: Vec<f32> = (0..weight_count()).map(|_| 0.1 * rng.signed() as f32).collect();
        let network = Network::<f32>::new(&weights).unwrap();
        for (rows, columns) in [(8, 8), (7, 13)] {
            let mut inputs = Planes::zeros(rows, columns, INPUTS);
            for k in 0..rows * columns {
                let pixel = inputs.pixel_mut(k / columns, k % columns);
                pixel.iter_mut().for_each(|x| *x = rng.signed() as f32);
            }
            let plain = network.forward(&inputs).output;
            let batch = [Planes::zeros(rows, columns, INPUTS), inputs];
            let twin = &forward(&weights, &batch).outputs()[1];
            let (mut worst, mut largest) = (0.0f32, 0.0f32);
            for k in 0..rows * columns {
                let at = |planes: &Planes<f32>| planes.pixel(k / columns, k % columns).to_vec();
                for (a, b) in at(&plain).into_iter().zip(at(twin)) {
                    worst = worst.max((a - b).abs());
                    largest = largest.max(b.abs());
                }
            }
            println!("{worst} of {largest}");
            assert!(worst < 1e-5 * largest && largest > 0.1, "{worst} of {largest}");
        }
    }
}
