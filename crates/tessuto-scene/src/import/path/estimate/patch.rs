//! A window of a frame, and where it is in another one: B. Lucas and T. Kanade's method with an affine window that is
//! held near the one that is expected, and with its brightness as a factor.

use glam::{DMat2, DVec2};

use super::surroundings::Level;
use tessuto_core::math::root::Root;

const STEPS: usize = 30;
/// A step of less than this many pixels is the last; one that is found ends with a step of less than the second.
const LITTLE: [f64; 2] = [0.001, 0.05];
/// How far the window's shape may change without a reason, standard deviation.
const SHAPE: f64 = 0.02;

/// Where a window is `[px]`, and how it is deformed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Warp {
    pub at: DVec2,
    pub linear: DMat2,
}

/// A window.
pub(super) struct Patch {
    radius: isize,
    values: Vec<f32>,
    slopes: Vec<[f32; 2]>,
    /// Pixels that are not the fabric.
    free: Vec<bool>,
    mean: f64,
    /// Mean square of the values' deviations from their mean `[grey levels²]`.
    pub contrast: f64,
    /// Σ of the slopes' squares, xx, xy, yy [grey levels²/px²].
    pub tensor: [f64; 3],
}

impl Patch {
    /// The window around the pixel (x, y); `None` beyond the border.
    pub fn of(level: &Level, x: usize, y: usize, radius: usize) -> Option<Self> {
        let grey = &level.grey;
        let beyond = |v: usize, n: usize| v < radius + 1 || v + radius + 1 >= n;
        if beyond(x, grey.width) || beyond(y, grey.height) {
            return None;
        }
        let side = 2 * radius + 1;
        let pixels = (0..side * side).map(|k| (x - radius + k % side, y - radius + k / side));
        let place = |(x, y): (usize, usize)| y * grey.width + x;
        let values: Vec<f32> = pixels.clone().map(|p| grey.data[place(p)]).collect();
        let slopes: Vec<[f32; 2]> = pixels.clone().map(|(x, y)| grey.slope(x, y)).collect();
        let free: Vec<bool> = pixels.map(|p| level.free[place(p)]).collect();
        let of = |f: &dyn Fn(usize) -> f64| (0..values.len()).filter(|k| free[*k]).map(f).sum::<f64>();
        let count = of(&|_| 1.0).max(1.0);
        let mean = of(&|k| f64::from(values[k])) / count;
        let contrast = of(&|k| (f64::from(values[k]) - mean).powi(2)) / count;
        let product = |a: usize, b: usize| of(&|k| f64::from(slopes[k][a]) * f64::from(slopes[k][b]));
        let tensor = [product(0, 0), product(0, 1), product(1, 1)];
        Some(Self { radius: radius as isize, values, slopes, free, mean, contrast, tensor })
    }

    /// Where the window is in another frame, beginning with `start`, and the root mean square of the differences that
    /// are left `[grey levels]`; `None` if it runs away. `noise` is that of a pixel `[grey levels]`.
    pub fn matched(&self, level: &Level, start: Warp, noise: f64) -> Option<(Warp, f64)> {
        let mut warp = start;
        let ridge = (noise / SHAPE).powi(2);
        let turned = start.linear.inverse().transpose();
        let side = 2 * self.radius + 1;
        let offset = |k: usize| {
            let k = k as isize;
            DVec2::new((k % side - self.radius) as f64, (k / side - self.radius) as f64)
        };
        let used: Vec<usize> = (0..self.values.len()).filter(|k| self.free[*k]).collect();
        let by_warp = |k: usize| {
            let g = turned * DVec2::new(f64::from(self.slopes[k][0]), f64::from(self.slopes[k][1]));
            let d = offset(k);
            [g.x, g.y, g.x * d.x, g.x * d.y, g.y * d.x, g.y * d.y]
        };
        let mut rows: Vec<[f64; 6]> = used.iter().map(|k| by_warp(*k)).collect();
        let count = used.len() as f64;
        // Without their means, since the brightness is free.
        for c in 0..6 {
            let mean = rows.iter().map(|row| row[c]).sum::<f64>() / count;
            rows.iter_mut().for_each(|row| row[c] -= mean);
        }
        let mut matrix = [0.0; 36];
        for row in &rows {
            (0..36).for_each(|k| matrix[k] += row[k / 6] * row[k % 6]);
        }
        (0..2).for_each(|k| matrix[7 * k] += 1e-6);
        (2..6).for_each(|k| matrix[7 * k] += ridge);
        let root = Root::of(&matrix, 6);
        let (mut last, mut left) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..STEPS {
            let mut seen = Vec::with_capacity(used.len());
            for k in &used {
                let p = warp.at + warp.linear * offset(*k);
                if !level.grey.holds(p.x, p.y, 0.0) {
                    return None;
                }
                seen.push(f64::from(level.grey.sample(p.x, p.y)));
            }
            let brighter = self.mean / (seen.iter().sum::<f64>() / count).max(1.0);
            let mut right = [0.0; 6];
            left = 0.0;
            for ((k, seen), row) in used.iter().zip(&seen).zip(&rows) {
                let off = f64::from(self.values[*k]) - brighter * seen;
                left += off * off;
                (0..6).for_each(|c| right[c] += off * row[c]);
            }
            left = (left / count).sqrt();
            let shape = warp.linear - start.linear;
            let shape = [shape.x_axis.x, shape.y_axis.x, shape.x_axis.y, shape.y_axis.y];
            (0..4).for_each(|k| right[k + 2] -= ridge * shape[k]);
            let step = root.solve(&right);
            warp.at += DVec2::new(step[0], step[1]);
            warp.linear += DMat2::from_cols(DVec2::new(step[2], step[4]), DVec2::new(step[3], step[5]));
            last = step[0].hypot(step[1]);
            if !warp.at.is_finite() || warp.at.distance(start.at) > 2.0 * self.radius as f64 {
                return None;
            }
            if last < LITTLE[0] {
                break;
            }
        }
        (last < LITTLE[1]).then_some((warp, left))
    }
}

#[cfg(test)]
mod tests {
    use super::super::made;
    use super::*;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn a_window_that_moves_and_turns_and_darkens_is_found_to_a_hundredth_of_a_pixel() {
        let mut rng = Rng::new(3, 0);
        let (at, mut worst) = (DVec2::new(60.0, 55.0), 0.0f64);
        for _ in 0..10 {
            let moved = 1.5 * DVec2::new(rng.signed(), rng.signed());
            let linear = DMat2::from_angle(0.03 * rng.signed()) * (1.0 + 0.02 * rng.signed());
            let there = |p: DVec2| at + linear.inverse() * (p - at - moved);
            let [a, b] =
                [made::plain(120, 110, made::waves), made::plain(120, 110, |p| 0.9 * made::waves(there(p)))];
            let patch = Patch::of(&a.levels[0], 60, 55, 8).unwrap();
            let start = Warp { at, linear: DMat2::IDENTITY };
            let (found, left) = patch.matched(&b.levels[0], start, 1.0).unwrap();
            worst = worst.max(found.at.distance(at + moved));
            assert!(left < 1.5, "{left}");
        }
        println!("{worst:.4} px off");
        assert!(worst < 0.02);
        // Nothing is found where there is nothing like it.
        let a = made::plain(120, 110, made::waves);
        let other = made::plain(120, 110, |p| made::waves(p + DVec2::splat(40.0)));
        let patch = Patch::of(&a.levels[0], 60, 55, 8).unwrap();
        let found = patch.matched(&other.levels[0], Warp { at, linear: DMat2::IDENTITY }, 1.0);
        assert!(found.is_none_or(|(_, left)| left > 5.0));
    }
}
