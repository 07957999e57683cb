//! Images of several channels with a border of zeros, and what a convolutional network does with them.
//!
//! Generic over the precision: networks run in f32, and in f64 where their derivatives are tested.

use std::ops::{Add, AddAssign, Mul, Sub};

/// f32 or f64.
pub trait Float:
    Copy
    + Default
    + PartialEq
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + AddAssign
    + Send
    + Sync
{
    /// Nearest number.
    fn of(x: f64) -> Self;
    /// The number as f64.
    fn wide(self) -> f64;
    /// √self.
    fn root(self) -> Self;
    /// self·a + b, rounded once.
    fn fused(self, a: Self, b: Self) -> Self;
    /// self / a.
    fn over(self, a: Self) -> Self;
}

macro_rules! float {
    ($type:ty) => {
        impl Float for $type {
            fn of(x: f64) -> Self {
                x as Self
            }
            fn wide(self) -> f64 {
                f64::from(self)
            }
            fn root(self) -> Self {
                self.sqrt()
            }
            #[inline(always)]
            fn fused(self, a: Self, b: Self) -> Self {
                self.mul_add(a, b)
            }
            fn over(self, a: Self) -> Self {
                self / a
            }
        }
    };
}
float!(f32);
float!(f64);

/// Pixels that are convolved together.
const RUN: usize = 4;
/// Edge of every kernel.
const EDGE: usize = 3;

/// An image, shape [rows + 2, columns + 2, channels]; the border is 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Planes<T> {
    /// Rows without the border.
    pub rows: usize,
    /// Columns without the border.
    pub columns: usize,
    /// Channels.
    pub channels: usize,
    data: Vec<T>,
}

impl<T: Float> Planes<T> {
    /// All 0.
    pub fn zeros(rows: usize, columns: usize, channels: usize) -> Self {
        Self { rows, columns, channels, data: vec![T::default(); (rows + 2) * (columns + 2) * channels] }
    }

    /// Zeros of the same shape.
    pub fn zeros_like(&self) -> Self {
        Self::zeros(self.rows, self.columns, self.channels)
    }

    fn start(&self, row: usize, column: usize) -> usize {
        ((row + 1) * (self.columns + 2) + column + 1) * self.channels
    }

    /// Channels of a pixel.
    pub fn pixel(&self, row: usize, column: usize) -> &[T] {
        let start = self.start(row, column);
        &self.data[start..start + self.channels]
    }

    /// Channels of a pixel.
    pub fn pixel_mut(&mut self, row: usize, column: usize) -> &mut [T] {
        let start = self.start(row, column);
        &mut self.data[start..start + self.channels]
    }

    /// The pixels of a row, one after another.
    fn row(&self, row: usize) -> &[T] {
        let start = self.start(row, 0);
        &self.data[start..start + self.columns * self.channels]
    }

    fn row_mut(&mut self, row: usize) -> &mut [T] {
        let start = self.start(row, 0);
        let end = start + self.columns * self.channels;
        &mut self.data[start..end]
    }

    /// Sets every pixel to `value`.
    pub fn fill(&mut self, value: &[T]) {
        for row in 0..self.rows {
            self.row_mut(row).chunks_exact_mut(value.len()).for_each(|pixel| pixel.copy_from_slice(value));
        }
    }

    /// Sets every number to `of` its own and that of `other`.
    pub fn combine(&mut self, other: &Self, of: impl Fn(T, T) -> T) {
        for row in 0..self.rows {
            let pairs = self.row_mut(row).iter_mut().zip(other.row(row));
            pairs.for_each(|(own, other)| *own = of(*own, *other));
        }
    }

    /// Half as large, rounded up: means over two by two pixels, or as many as there are.
    pub fn halved(&self) -> Self {
        let mut out = Self::zeros(self.rows.div_ceil(2), self.columns.div_ceil(2), self.channels);
        for row in 0..self.rows {
            for column in 0..self.columns {
                let share = self.share(row, column);
                let from = self.pixel(row, column);
                let to = out.pixel_mut(row / 2, column / 2);
                to.iter_mut().zip(from).for_each(|(to, from)| *to += *from * share);
            }
        }
        out
    }

    /// Adds the adjoint of [`halved`](Self::halved) for `grad`, a gradient by its result.
    pub fn add_halved_vjp(&mut self, grad: &Self) {
        for row in 0..self.rows {
            for column in 0..self.columns {
                let share = self.share(row, column);
                let from = grad.pixel(row / 2, column / 2);
                let to = self.pixel_mut(row, column);
                to.iter_mut().zip(from).for_each(|(to, from)| *to += *from * share);
            }
        }
    }

    /// One over the number of pixels that share this pixel's half-size pixel.
    fn share(&self, row: usize, column: usize) -> T {
        let of = |at: usize, len: usize| if (at | 1) < len { 0.5 } else { 1.0 };
        T::of(of(row, self.rows) * of(column, self.columns))
    }

    /// `rows`×`columns` pixels, each that of half its row and column.
    pub fn doubled(&self, rows: usize, columns: usize) -> Self {
        let mut out = Self::zeros(rows, columns, self.channels);
        for row in 0..rows {
            for column in 0..columns {
                out.pixel_mut(row, column).copy_from_slice(self.pixel(row / 2, column / 2));
            }
        }
        out
    }

    /// Adds the adjoint of [`doubled`](Self::doubled) for `grad`, a gradient by its result.
    pub fn add_doubled_vjp(&mut self, grad: &Self) {
        for row in 0..grad.rows {
            for column in 0..grad.columns {
                let to = self.pixel_mut(row / 2, column / 2);
                to.iter_mut().zip(grad.pixel(row, column)).for_each(|(to, from)| *to += *from);
            }
        }
    }
}

/// Weights of a convolution with kernels of 3×3 pixels.
#[derive(Debug, Clone)]
pub struct Kernel<T> {
    inputs: usize,
    outputs: usize,
    /// Shape [outputs / block, 3, 3, inputs, block].
    packed: Vec<T>,
}

impl<T: Float> Kernel<T> {
    /// Weights by output, input, row and column of the kernel.
    pub fn new(inputs: usize, outputs: usize, weight: impl Fn(usize, usize, usize, usize) -> T) -> Self {
        let block = block(outputs);
        let mut packed = Vec::with_capacity(inputs * outputs * EDGE * EDGE);
        for first in (0..outputs).step_by(block) {
            for row in 0..EDGE {
                for column in 0..EDGE {
                    for input in 0..inputs {
                        packed
                            .extend((first..first + block).map(|output| weight(output, input, row, column)));
                    }
                }
            }
        }
        Self { inputs, outputs, packed }
    }

    /// Adds the convolution of `input` to `out`, of the same size.
    pub fn add_to(&self, input: &Planes<T>, out: &mut Planes<T>) {
        assert_eq!([input.channels, out.channels], [self.inputs, self.outputs]);
        assert_eq!([input.rows, input.columns], [out.rows, out.columns]);
        match block(self.outputs) {
            16 => self.add_blocks::<16>(input, out),
            _ => self.add_blocks::<4>(input, out),
        }
    }

    fn add_blocks<const BLOCK: usize>(&self, input: &Planes<T>, out: &mut Planes<T>) {
        let len = EDGE * EDGE * self.inputs * BLOCK;
        for (index, weights) in self.packed.chunks_exact(len).enumerate() {
            for row in 0..out.rows {
                let mut column = 0;
                while column + RUN <= out.columns {
                    add_run::<T, BLOCK, RUN>(weights, input, out, [row, column, index * BLOCK]);
                    column += RUN;
                }
                for column in column..out.columns {
                    add_run::<T, BLOCK, 1>(weights, input, out, [row, column, index * BLOCK]);
                }
            }
        }
    }
}

/// Channels that are computed together.
fn block(outputs: usize) -> usize {
    assert!(outputs.is_multiple_of(4));
    if outputs.is_multiple_of(16) { 16 } else { 4 }
}

/// Adds one block of channels, from channel `first` on, of `COUNT` neighbouring pixels.
#[inline(always)]
fn add_run<T: Float, const BLOCK: usize, const COUNT: usize>(
    weights: &[T],
    input: &Planes<T>,
    out: &mut Planes<T>,
    [row, column, first]: [usize; 3],
) {
    let (inputs, outputs) = (input.channels, out.channels);
    let target = out.start(row, column) + first;
    let mut sums = [[T::default(); BLOCK]; COUNT];
    for (k, sums) in sums.iter_mut().enumerate() {
        sums.copy_from_slice(&out.data[target + k * outputs..][..BLOCK]);
    }
    let of_row = EDGE * inputs * BLOCK;
    for (offset, weights) in weights.chunks_exact(of_row).enumerate() {
        // Row 0 of the data is the border, so that kernel row `offset` meets data row row + offset.
        let start = ((row + offset) * (input.columns + 2) + column) * inputs;
        let near = &input.data[start..start + (COUNT + EDGE - 1) * inputs];
        for (k, weights) in weights.chunks_exact(BLOCK).enumerate() {
            let weights: &[T; BLOCK] = weights.try_into().expect("a block");
            for (pixel, sums) in sums.iter_mut().enumerate() {
                let value = near[k + pixel * inputs];
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    *sum = value.fused(*weight, *sum);
                }
            }
        }
    }
    for (k, sums) in sums.iter().enumerate() {
        out.data[target + k * outputs..][..BLOCK].copy_from_slice(sums);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;

    fn random(rows: usize, columns: usize, channels: usize, seed: u64) -> Planes<f64> {
        let mut rng = Rng::new(seed, 0);
        let mut out = Planes::zeros(rows, columns, channels);
        for row in 0..rows {
            out.row_mut(row).iter_mut().for_each(|x| *x = rng.signed());
        }
        out
    }

    fn dot(a: &Planes<f64>, b: &Planes<f64>) -> f64 {
        a.data.iter().zip(&b.data).map(|(a, b)| a * b).sum()
    }

    #[test]
    fn convolution_is_its_sum() {
        let (rows, columns) = (5, 6);
        for (inputs, outputs) in [(3, 4), (5, 32)] {
            let weight = |o: usize, i: usize, r: usize, c: usize| ((o * 7 + i * 5 + r * 3 + c) as f64).sin();
            let input = random(rows, columns, inputs, 1);
            let mut out = random(rows, columns, outputs, 2);
            let before = out.clone();
            Kernel::new(inputs, outputs, weight).add_to(&input, &mut out);
            for (row, column, output) in [(0, 0, 0), (0, 5, 3), (4, 4, outputs - 1), (2, 3, 1)] {
                let mut sum = before.pixel(row, column)[output];
                for (r, c, i) in (0..9).flat_map(|k| (0..inputs).map(move |i| (k / 3, k % 3, i))) {
                    let (y, x) = ((row + r).wrapping_sub(1), (column + c).wrapping_sub(1));
                    if y < rows && x < columns {
                        sum += weight(output, i, r, c) * input.pixel(y, x)[i];
                    }
                }
                assert!((out.pixel(row, column)[output] - sum).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn adjoints_belong_to_their_operations() {
        for (rows, columns) in [(4, 6), (5, 7)] {
            let x = random(rows, columns, 3, 1);
            let half = x.halved();
            assert_eq!([half.rows, half.columns], [rows.div_ceil(2), columns.div_ceil(2)]);
            let y = random(half.rows, half.columns, 3, 2);
            let mut back = x.zeros_like();
            back.add_halved_vjp(&y);
            assert!((dot(&half, &y) - dot(&x, &back)).abs() < 1e-12);
            let mut sums = y.zeros_like();
            sums.add_doubled_vjp(&x);
            assert!((dot(&y.doubled(rows, columns), &x) - dot(&y, &sums)).abs() < 1e-12);
        }
    }
}
