//! The layers: from latent images and weights to tiles, and the gradient back, by the crate `burn`.

use burn::tensor::activation::{leaky_relu, sigmoid};
use burn::tensor::module::{conv_transpose2d, conv2d};
use burn::tensor::ops::{ConvOptions, ConvTransposeOptions};
use burn::tensor::{Device, Tensor, TensorData};

use super::{CHANNELS, DecoderConfig};
use tessuto_core::math::rng::Rng;

/// Slope of the rectifiers for negative values.
const SLOPE: f64 = 0.2;

/// One layer; its weights are followed by `outputs` biases.
#[derive(Debug, Clone, Copy)]
struct Layer {
    inputs: usize,
    outputs: usize,
    kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Transposed convolution, kernel 4, stride 2: twice the edge. Weights [inputs, outputs, 4, 4].
    Double,
    /// Convolution, kernel 3. Weights [outputs, inputs, 3, 3].
    Smooth,
}

impl Layer {
    fn kernel(&self) -> usize {
        match self.kind {
            Kind::Double => 4,
            Kind::Smooth => 3,
        }
    }

    fn weight_count(&self) -> usize {
        self.inputs * self.outputs * self.kernel() * self.kernel()
    }

    /// Terms that one output value sums.
    fn fan_in(&self) -> usize {
        match self.kind {
            // A quarter of the kernel meets any one pixel.
            Kind::Double => self.inputs * 4,
            Kind::Smooth => self.inputs * 9,
        }
    }
}

/// Layers and latent images.
pub(super) struct Network {
    layers: Vec<Layer>,
    /// Uniform in [−1, 1), shape [tiles², channels, latent edge, latent edge].
    latent: Vec<f32>,
    latent_shape: [usize; 4],
}

/// One evaluation, ready for its gradient.
pub(super) struct Graph {
    /// Weights and biases of every layer.
    leaves: Vec<(Tensor<4>, Tensor<1>)>,
    /// Shape [tiles², 5, tile edge, tile edge].
    output: Tensor<4>,
}

impl Network {
    pub(super) fn new(config: &DecoderConfig, rng: &mut Rng) -> Self {
        let pairs = config.channels.windows(2);
        let mut layers: Vec<Layer> =
            pairs.map(|p| Layer { inputs: p[0], outputs: p[1], kind: Kind::Double }).collect();
        let last = *config.channels.last().expect("a decoder has channels");
        layers.push(Layer { inputs: last, outputs: last, kind: Kind::Smooth });
        layers.push(Layer { inputs: last, outputs: CHANNELS, kind: Kind::Double });
        layers.push(Layer { inputs: CHANNELS, outputs: CHANNELS, kind: Kind::Smooth });
        let latent_shape =
            [config.tiles * config.tiles, config.channels[0], config.latent_edge, config.latent_edge];
        let count = latent_shape.iter().product();
        let latent = std::iter::repeat_with(|| rng.signed() as f32).take(count).collect();
        Self { layers, latent, latent_shape }
    }

    /// Uniform weights that keep the variance of the signal (He et al. 2015, "Delving deep into
    /// rectifiers", for leaky rectifiers), no biases.
    pub(super) fn initial_weights(&self, rng: &mut Rng) -> Vec<f32> {
        let mut weights = Vec::new();
        for layer in &self.layers {
            let variance = 2.0 / ((1.0 + SLOPE * SLOPE) * layer.fan_in() as f64);
            let bound = (3.0 * variance).sqrt();
            weights.extend((0..layer.weight_count()).map(|_| (bound * rng.signed()) as f32));
            weights.extend(std::iter::repeat_n(0.0, layer.outputs));
        }
        weights
    }

    pub(super) fn forward(&self, weights: &[f32]) -> Graph {
        let constant = Device::flex();
        let device = Device::flex().autodiff();
        let mut x =
            Tensor::<4>::from_data(TensorData::new(self.latent.clone(), self.latent_shape), &constant)
                .autodiff();
        let mut leaves = Vec::with_capacity(self.layers.len());
        let mut rest = weights;
        for layer in &self.layers {
            let (values, tail) = rest.split_at(layer.weight_count());
            let (biases, tail) = tail.split_at(layer.outputs);
            rest = tail;
            let k = layer.kernel();
            let shape = match layer.kind {
                Kind::Double => [layer.inputs, layer.outputs, k, k],
                Kind::Smooth => [layer.outputs, layer.inputs, k, k],
            };
            let w = Tensor::<4>::from_data(TensorData::new(values.to_vec(), shape), &device).require_grad();
            let b = Tensor::<1>::from_data(TensorData::new(biases.to_vec(), [layer.outputs]), &device)
                .require_grad();
            leaves.push((w.clone(), b.clone()));
            x = leaky_relu(x, SLOPE);
            x = match layer.kind {
                Kind::Double => {
                    let options = ConvTransposeOptions::new([2, 2], [1, 1], [0, 0], [1, 1], 1);
                    conv_transpose2d(x, w, Some(b), options)
                }
                Kind::Smooth => conv2d(x, w, Some(b), ConvOptions::new([1, 1], [1, 1], [1, 1], 1)),
            };
        }
        Graph { leaves, output: sigmoid(x) }
    }
}

impl Graph {
    /// Shape [tiles², 5, tile edge, tile edge].
    pub(super) fn tiles(&self) -> Vec<f32> {
        values(self.output.clone().into_data())
    }

    /// ∂loss/∂weights, in their order, for ∂loss/∂tiles.
    pub(super) fn backward(self, gradient: &[f32]) -> Vec<f32> {
        // The gradient of Σ output · g with constant g is what leads g back.
        let data = TensorData::new(gradient.to_vec(), self.output.dims());
        let g = Tensor::<4>::from_data(data, &Device::flex()).autodiff();
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

fn values(data: TensorData) -> Vec<f32> {
    data.try_to_vec().expect("the tensors hold f32")
}
