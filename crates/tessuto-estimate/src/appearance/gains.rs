//! How much brighter or darker than the print each part of a frame is: by channel, on a coarse grid of the cloth.

/// Nodes along either side of the cloth.
const NODES: usize = 6;
/// Every node is drawn to the mean factor of the frame as much as by this fraction of the pixels that a node has
/// in the mean.
const COMMON: f32 = 0.05;
/// Factors stay within this of 1.
const MOST: f32 = 8.0;

/// Factors on a grid; bilinear in between.
pub(super) struct Gains(Vec<[f32; 3]>);

impl Gains {
    /// From pixels: place (0 to 1), linear colour, the print's where it is known, weight. All factors are 1 where
    /// nothing is known of the print.
    pub fn new(pixels: impl Iterator<Item = ([f32; 2], [f32; 3], Option<[f32; 3]>, f32)>) -> Self {
        let mut sums = vec![[[0.0f64; 3]; 2]; NODES * NODES];
        for (uv, colour, print, weight) in pixels {
            let Some(print) = print else { continue };
            for (node, share) in nodes(uv) {
                let w = f64::from(share * weight);
                for c in 0..3 {
                    sums[node][0][c] += w * f64::from(colour[c]);
                    sums[node][1][c] += w * f64::from(print[c]);
                }
            }
        }
        let mut total = [[0.0f64; 3]; 2];
        sums.iter().for_each(|s| (0..2).for_each(|k| (0..3).for_each(|c| total[k][c] += s[k][c])));
        let share = f64::from(COMMON) / (NODES * NODES) as f64;
        let factor = |s: &[[f64; 3]; 2], c: usize| {
            let [above, below] = [0, 1].map(|k| s[k][c] + share * total[k][c]);
            if below > 0.0 { ((above / below) as f32).clamp(1.0 / MOST, MOST) } else { 1.0 }
        };
        Self(sums.iter().map(|s| [0, 1, 2].map(|c| factor(s, c))).collect())
    }

    /// `colour` at `uv` as it were with all factors 1.
    pub fn without(&self, uv: [f32; 2], colour: [f32; 3]) -> [f32; 3] {
        let mut gain = [0.0; 3];
        for (node, share) in nodes(uv) {
            (0..3).for_each(|c| gain[c] += share * self.0[node][c]);
        }
        [0, 1, 2].map(|c| colour[c] / gain[c])
    }
}

/// The nodes around a place, and their shares.
fn nodes([u, v]: [f32; 2]) -> [(usize, f32); 4] {
    let at = |s: f32| (s * (NODES - 1) as f32).clamp(0.0, (NODES - 1) as f32 - 1e-3);
    let (x, y) = (at(u), at(v));
    let (column, row) = (x as usize, y as usize);
    let (fx, fy) = (x - column as f32, y - row as f32);
    let first = row * NODES + column;
    [
        (first, (1.0 - fx) * (1.0 - fy)),
        (first + 1, fx * (1.0 - fy)),
        (first + NODES, (1.0 - fx) * fy),
        (first + NODES + 1, fx * fy),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_of_light_is_divided_out_where_the_print_is_known_and_carried_on_where_not() {
        let places = || (0..1024).map(|i| [(i % 32) as f32 / 31.0, (i / 32) as f32 / 31.0]);
        let light = |u: f32| 0.5 + 0.3 * u;
        let pixel = |uv: [f32; 2]| {
            let known = (uv[0] < 0.7).then_some([0.4, 0.2, 0.1]);
            (uv, [0.4, 0.2, 0.1].map(|p: f32| p * light(uv[0])), known, 1.0)
        };
        let gains = Gains::new(places().map(pixel));
        let off = |uv: [f32; 2]| (gains.without(uv, [0.4 * light(uv[0]); 3])[0] / 0.4 - 1.0).abs();
        assert!(places().filter(|uv| uv[0] < 0.6).all(|uv| off(uv) < 0.1));
        assert!(places().all(|uv| off(uv) < 0.35));
        let unknown = Gains::new(places().map(|uv| (uv, [0.4; 3], None, 1.0)));
        assert!((unknown.without([0.3, 0.3], [0.4; 3])[0] - 0.4).abs() < 1e-6);
    }
}
