//! Which elements can come near each other while every node stays within its box: by a grid.

use glam::DVec3;
use rayon::prelude::*;

/// Elements of one parallel task.
const TASK: usize = 64;

/// Axis-aligned box, `low <= high` `[m]`.
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Bounds {
    /// The smallest box around two points.
    pub fn of(a: DVec3, b: DVec3) -> Self {
        Self { low: a.min(b), high: a.max(b) }
    }

    /// The smallest box around those of `nodes`.
    pub fn around(boxes: &[Self], nodes: &[u32]) -> Self {
        let all = nodes.iter().map(|k| boxes[*k as usize]);
        all.reduce(|a, b| Self { low: a.low.min(b.low), high: a.high.max(b.high) })
            .expect("an element has nodes")
    }

    /// Larger by `margin` on every side.
    pub fn grown(self, margin: f64) -> Self {
        Self { low: self.low - margin, high: self.high + margin }
    }

    /// With `point` within.
    pub fn with(self, point: DVec3) -> Self {
        Self { low: self.low.min(point), high: self.high.max(point) }
    }

    /// Whether `point` is within.
    pub fn holds(&self, point: DVec3) -> bool {
        self.low.cmple(point).all() && self.high.cmpge(point).all()
    }

    /// Whether they have a point in common.
    pub fn meets(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    /// Distance of `point`, squared `[m²]`.
    pub fn square_distance(&self, point: DVec3) -> f64 {
        (self.low - point).max(point - self.high).max(DVec3::ZERO).length_squared()
    }

    /// Signed distance of the corner that is farthest against `normal` from the origin's plane `[m]`.
    pub fn lowest(&self, normal: DVec3) -> f64 {
        DVec3::select(normal.cmpgt(DVec3::ZERO), self.low, self.high).dot(normal)
    }
}

/// Indices of all `first` and `second` boxes that meet, in ascending order of the first.
pub fn meetings(first: &[Bounds], second: &[Bounds]) -> Vec<[u32; 2]> {
    let Some(grid) = Grid::new(second) else { return Vec::new() };
    let of = |(i, own): (usize, &Bounds)| grid.meeting(*own).map(move |j| [i as u32, j]);
    first.par_iter().enumerate().with_min_len(TASK).flat_map_iter(of).collect()
}

/// Boxes in the cells of a grid over the two axes along which they spread most, each in the cell of its low corner.
struct Grid {
    axes: [usize; 2],
    /// Low corner of the grid, and of a cell the size, on these axes.
    low: [f64; 2],
    cell: [f64; 2],
    counts: [usize; 2],
    /// Largest size of a box on these axes.
    longest: [f64; 2],
    /// Where every cell begins in `order`, then the end.
    starts: Vec<u32>,
    order: Vec<u32>,
    sorted: Vec<Bounds>,
}

impl Grid {
    /// `None` of no boxes.
    fn new(boxes: &[Bounds]) -> Option<Self> {
        let join = |a: Bounds, b: Bounds| Bounds { low: a.low.min(b.low), high: a.high.max(b.high) };
        let all = boxes.iter().copied().reduce(join)?;
        let size = all.high - all.low;
        let least = size.min_position();
        let axes = [(least + 1) % 3, (least + 2) % 3];
        let longest = axes.map(|axis| boxes.iter().map(|b| b.high[axis] - b.low[axis]).fold(0.0, f64::max));
        // About one box in a cell, but no cell smaller than the largest box.
        let side = (boxes.len() as f64).sqrt();
        let count = |k: usize| {
            let most = size[axes[k]] / longest[k];
            if most.is_finite() { (most.min(side).floor() as usize).max(1) } else { 1 }
        };
        let counts = [count(0), count(1)];
        let cell = [0, 1].map(|k| size[axes[k]] / counts[k] as f64);
        let low = axes.map(|axis| all.low[axis]);
        let mut grid = Self {
            axes,
            low,
            cell,
            counts,
            longest,
            starts: vec![0; counts[0] * counts[1] + 1],
            order: vec![0; boxes.len()],
            sorted: Vec::new(),
        };
        let cells: Vec<usize> = boxes
            .iter()
            .map(|b| {
                let [i, j] = [0, 1].map(|k| grid.index(k, b.low[grid.axes[k]]));
                i * grid.counts[1] + j
            })
            .collect();
        cells.iter().for_each(|c| grid.starts[c + 1] += 1);
        (1..grid.starts.len()).for_each(|c| grid.starts[c] += grid.starts[c - 1]);
        let mut next = grid.starts.clone();
        for (item, c) in cells.iter().enumerate() {
            grid.order[next[*c] as usize] = item as u32;
            next[*c] += 1;
        }
        grid.sorted = grid.order.iter().map(|k| boxes[*k as usize]).collect();
        Some(grid)
    }

    /// The cell of a coordinate on the `k`-th of the axes.
    fn index(&self, k: usize, at: f64) -> usize {
        // Casts of what is below 0, or no number, give 0.
        (((at - self.low[k]) / self.cell[k]) as usize).min(self.counts[k] - 1)
    }

    /// The boxes that meet `own`.
    fn meeting(&self, own: Bounds) -> impl Iterator<Item = u32> + '_ {
        let range = |k: usize| {
            let axis = self.axes[k];
            self.index(k, own.low[axis] - self.longest[k])..=self.index(k, own.high[axis])
        };
        let (rows, columns) = (range(0), range(1));
        rows.flat_map(move |i| {
            let cell = |j: usize| self.starts[i * self.counts[1] + j] as usize;
            let in_row = cell(*columns.start())..cell(columns.end() + 1);
            self.sorted[in_row.clone()].iter().zip(&self.order[in_row])
        })
        .filter(move |(b, _)| b.meets(&own))
        .map(|(_, j)| *j)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn those_that_meet_are_found_and_no_others() {
        let mut rng = Rng::new(4, 0);
        let mut boxes = |count: usize| -> Vec<Bounds> {
            (0..count)
                .map(|_| {
                    let at = rng.vector();
                    Bounds::of(at, at + rng.vector() * 0.4)
                })
                .collect()
        };
        let (first, second) = (boxes(300), boxes(400));
        let mut found = meetings(&first, &second);
        let plain: Vec<[u32; 2]> = (0..300u32)
            .flat_map(|i| (0..400).map(move |j| [i, j]))
            .filter(|[i, j]| first[*i as usize].meets(&second[*j as usize]))
            .collect();
        found.sort_unstable();
        println!("{} of {}", found.len(), 300 * 400);
        assert!(plain.len() > 100 && found == plain);
        assert!(meetings(&first, &[]).is_empty());
    }
}
