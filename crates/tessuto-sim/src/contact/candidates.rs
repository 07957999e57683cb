//! Which elements can come near each other while every node stays within its box: sorted along one axis, swept.

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
    let Some(all) =
        second.iter().copied().reduce(|a, b| Bounds { low: a.low.min(b.low), high: a.high.max(b.high) })
    else {
        return Vec::new();
    };
    let axis = (all.high - all.low).max_position();
    let mut order: Vec<u32> = (0..second.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| {
        second[a as usize].low[axis].total_cmp(&second[b as usize].low[axis]).then(a.cmp(&b))
    });
    let sorted: Vec<Bounds> = order.iter().map(|k| second[*k as usize]).collect();
    let longest = sorted.iter().map(|b| b.high[axis] - b.low[axis]).fold(0.0, f64::max);
    let of = |(i, own): (usize, &Bounds)| {
        let start = sorted.partition_point(|b| b.low[axis] < own.low[axis] - longest);
        let own = *own;
        let near = sorted[start..].iter().zip(&order[start..]);
        near.take_while(move |(b, _)| b.low[axis] <= own.high[axis])
            .filter(move |(b, _)| b.meets(&own))
            .map(move |(_, j)| [i as u32, *j])
    };
    first.par_iter().enumerate().with_min_len(TASK).flat_map_iter(of).collect()
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
