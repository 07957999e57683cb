//! What the machine reaches, measured where the kernels are.

use faer::{Accum, Mat, Par};

use crate::kernels::Precision;
use crate::shortest;

/// Highest rates that were seen.
#[derive(Default)]
pub struct Machine {
    /// Operations per second of a loop of fused multiplications and additions: double, single precision.
    pub loop_rates: [f64; 2],
    /// The same of a product of two dense matrices.
    pub product_rates: [f64; 2],
    /// Bytes of a triad's arrays, and bytes per second.
    triads: Vec<[f64; 2]>,
}

/// Independent sums, so that none waits for the one before: two operations a cycle that take four cycles each.
const SUMS: usize = 10;
/// Steps of the loop between two looks at the clock.
const STEPS: usize = 20_000;
/// Side of the matrices whose product is timed: 2 MB each in double precision.
const SIDE: usize = 512;

impl Machine {
    /// Measures once more and keeps the best.
    pub fn measure(&mut self) {
        let keep = |rate: &mut f64, new: f64| *rate = rate.max(new);
        keep(&mut self.loop_rates[0], loop_rate::<f64, 4>(1.0 + 1e-9, 1e-9, f64::mul_add));
        keep(&mut self.loop_rates[1], loop_rate::<f32, 8>(1.0 + 1e-6, 1e-6, f32::mul_add));
        keep(&mut self.product_rates[0], product_rate::<f64>(1.0, 0.5));
        keep(&mut self.product_rates[1], product_rate::<f32>(1.0, 0.5));
        let sizes = [1.5e4, 2e5, 7e5, 1.5e6, 3e6, 6e6, 1.2e7, 2.4e7, 1.92e8];
        if self.triads.is_empty() {
            self.triads = sizes.map(|size| [size, 0.0]).to_vec();
        }
        for [size, rate] in &mut self.triads {
            keep(rate, triad_rate(*size));
        }
    }

    /// The highest rate of arithmetic that any loop reached.
    pub fn flops_per_second(&self, precision: Precision) -> f64 {
        let k = precision.index();
        self.loop_rates[k].max(self.product_rates[k])
    }

    /// Rate of the smallest triad that is not smaller than these `bytes`.
    pub fn bytes_per_second(&self, bytes: f64) -> f64 {
        let found = self.triads.iter().find(|[size, _]| *size >= bytes).or(self.triads.last());
        found.expect("the machine has been measured")[1]
    }
}

fn loop_rate<T: Copy, const N: usize>(factor: T, term: T, mul_add: impl Fn(T, T, T) -> T) -> f64 {
    let seconds = shortest(|| {
        let (factor, term) = (std::hint::black_box(factor), std::hint::black_box(term));
        let mut sums = [[term; N]; SUMS];
        for _ in 0..STEPS {
            for sum in &mut sums {
                *sum = std::array::from_fn(|k| mul_add(sum[k], factor, term));
            }
        }
        sums
    });
    (2 * N * SUMS * STEPS) as f64 / seconds
}

fn product_rate<T: faer::traits::ComplexField>(one: T, half: T) -> f64 {
    let [a, b] = [one.clone(), half].map(|value| Mat::from_fn(SIDE, SIDE, |_, _| value.clone()));
    let mut c = Mat::<T>::zeros(SIDE, SIDE);
    let seconds = shortest(|| {
        faer::linalg::matmul::matmul(&mut c, Accum::Replace, &a, &b, one.clone(), Par::Seq);
    });
    2.0 * (SIDE as f64).powi(3) / seconds
}

/// Two arrays are read and one is written; what a cache reads of the written one before is not counted.
fn triad_rate(bytes: f64) -> f64 {
    let len = (bytes / 24.0) as usize;
    let (mut a, b, c) = (vec![0.0f64; len], vec![1.0f64; len], vec![2.0f64; len]);
    // Long enough for the clock.
    let repeats = (200_000 / len).max(1);
    let seconds = shortest(|| {
        for _ in 0..repeats {
            let s = std::hint::black_box(0.5);
            for ((a, b), c) in a.iter_mut().zip(&b).zip(&c) {
                *a = b + s * c;
            }
            std::hint::black_box(&mut a);
        }
    });
    24.0 * (len * repeats) as f64 / seconds
}
