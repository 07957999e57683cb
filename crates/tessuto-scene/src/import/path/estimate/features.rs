//! Windows that can be found again: for every cell of a grid over the image the one with most texture in both
//! directions (J. Shi, C. Tomasi, "Good features to track", 1994), if it is more than noise.

use glam::DVec2;
use tessuto_core::parallel;

use super::surroundings::Surroundings;

/// About as many cells has the grid.
const CELLS: f64 = 1600.0;
/// Sides of a cell `[px]`, at least, and radius of windows, at least and at most.
const SIDE: usize = 12;
const RADIUS: [usize; 2] = [10, 14];
/// A window whose place noise makes uncertain by more than this in some direction is left out `[px]`.
const UNCERTAIN: f64 = 0.6;

/// Radius of windows in images of this size `[px]`.
pub(super) fn radius(size: [usize; 2]) -> usize {
    (cell(size) * 5 / 6).clamp(RADIUS[0], RADIUS[1])
}

fn cell([width, height]: [usize; 2]) -> usize {
    (((width * height) as f64 / CELLS).sqrt() as usize).max(SIDE)
}

/// Centres of windows, best first, none near one of `taken`.
pub(super) fn detect(seen: &Surroundings, taken: &[DVec2]) -> Vec<[usize; 2]> {
    let grey = &seen.levels[0].grey;
    let (width, height) = (grey.width, grey.height);
    let (cell, radius) = (cell([width, height]), radius([width, height]));
    let apart_by = 2.0 / 3.0 * cell as f64;
    let sums = Sums::of(seen);
    let (columns, rows) = (width.div_ceil(cell), height.div_ceil(cell));
    let best = |k: usize| {
        let (x0, y0) = (k % columns * cell, k / columns * cell);
        let pixels =
            (y0..(y0 + cell).min(height)).flat_map(|y| (x0..(x0 + cell).min(width)).map(move |x| (x, y)));
        let clear = pixels.filter(|(x, y)| seen.clear(*x as f64, *y as f64));
        let scored = clear.map(|(x, y)| (sums.weakest(x, y, radius), [x, y]));
        // Of equals the first.
        scored.fold(
            None,
            |best: Option<(f64, [usize; 2])>, s| {
                if best.is_some_and(|b| b.0 >= s.0) { best } else { Some(s) }
            },
        )
    };
    let mut found: Vec<(f64, [usize; 2])> =
        parallel::map(columns * rows, best).into_iter().flatten().collect();
    found.retain(|(weakest, _)| *weakest > (seen.noise / UNCERTAIN).powi(2));
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let apart = |a: [usize; 2], b: DVec2| (a[0] as f64 - b.x).abs().max((a[1] as f64 - b.y).abs());
    let mut chosen: Vec<[usize; 2]> = Vec::new();
    for (_, at) in found {
        let near = |p: &[usize; 2]| apart(at, DVec2::new(p[0] as f64, p[1] as f64)) <= apart_by;
        if !chosen.iter().any(near) && taken.iter().all(|p| apart(at, *p) > apart_by) {
            chosen.push(at);
        }
    }
    chosen
}

/// Sums of the slopes' products over all pixels above and to the left.
struct Sums {
    width: usize,
    data: Vec<[f64; 3]>,
}

impl Sums {
    fn of(seen: &Surroundings) -> Self {
        let grey = &seen.levels[0].grey;
        let (w, h) = (grey.width, grey.height);
        let width = w + 1;
        let mut data = vec![[0.0; 3]; width * (h + 1)];
        for y in 0..h {
            let mut row = [0.0; 3];
            for x in 0..w {
                if x > 0 && y > 0 && x + 1 < w && y + 1 < h {
                    let [gx, gy] = grey.slope(x, y).map(f64::from);
                    row = [row[0] + gx * gx, row[1] + gx * gy, row[2] + gy * gy];
                }
                let above = data[y * width + x + 1];
                data[(y + 1) * width + x + 1] = std::array::from_fn(|c| above[c] + row[c]);
            }
        }
        Self { width, data }
    }

    /// The smaller eigenvalue of the slopes' products in a window within the image.
    fn weakest(&self, x: usize, y: usize, radius: usize) -> f64 {
        let at = |x: usize, y: usize| self.data[y * self.width + x];
        let (x0, y0, x1, y1) = (x - radius, y - radius, x + radius + 1, y + radius + 1);
        let corners = [at(x1, y1), at(x0, y1), at(x1, y0), at(x0, y0)];
        let [a, b, c]: [f64; 3] =
            std::array::from_fn(|k| corners[0][k] - corners[1][k] - corners[2][k] + corners[3][k]);
        0.5 * (a + c - ((a - c).powi(2) + 4.0 * b * b).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::super::made;
    use super::*;

    #[test]
    fn windows_are_where_there_is_texture_in_both_directions() {
        // Waves on the right, stripes in the middle, nothing on the left.
        let shown = |p: DVec2| match p.x {
            x if x > 200.0 => made::waves(p),
            x if x > 100.0 => 128.0 + 60.0 * (0.5 * p.x).sin(),
            _ => 100.0,
        };
        let seen = made::plain(300, 200, shown);
        let found = detect(&seen, &[]);
        assert!(found.len() > 20, "{}", found.len());
        assert!(found.iter().all(|p| p[0] >= 190), "{found:?}");
        let first = DVec2::new(found[0][0] as f64, found[0][1] as f64);
        let others = detect(&seen, &[first]);
        assert!(others.len() < found.len() && !others.contains(&found[0]));
    }
}
