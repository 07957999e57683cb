//! Distances of tracked points from their places on the mesh.

use glam::DVec3;

use tessuto_core::scene::Tracks;

/// Mean, 90 % quantile and largest of some distances `[m]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Distances {
    pub mean: f64,
    pub p90: f64,
    pub worst: f64,
}

impl Distances {
    /// Those of `distances` `[m]`; None if there are none.
    pub fn of(mut distances: Vec<f64>) -> Option<Self> {
        let last = distances.len().checked_sub(1)?;
        let mean = distances.iter().sum::<f64>() / distances.len() as f64;
        distances.sort_unstable_by(f64::total_cmp);
        // Linear between the two nearest, as numpy.quantile.
        let at = 0.9 * last as f64;
        let (low, part) = (at as usize, at.fract());
        let p90 = distances[low] + part * (distances[(low + 1).min(last)] - distances[low]);
        Some(Self { mean, p90, worst: distances[last] })
    }
}

/// Distance `[m]` of every point of `tracks` in frame `index` from its place on the mesh at `positions` `[m]`;
/// none where none was measured.
pub(super) fn distances(tracks: &Tracks, positions: &[DVec3], index: usize) -> Vec<f64> {
    let Some(points) = tracks.points.get(&index) else { return Vec::new() };
    tracks.on(positions).zip(points).map(|(p, q)| p.distance(*q)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantile_is_that_of_numpy() {
        // numpy.quantile([0, 1, 2, 3, 10], 0.9) = 7.2
        let d = Distances::of(vec![3.0, 0.0, 10.0, 1.0, 2.0]).unwrap();
        assert!((d.p90 - 7.2).abs() < 1e-12 && d.mean == 3.2 && d.worst == 10.0);
        let one = Distances::of(vec![0.5]).unwrap();
        assert_eq!((one.mean, one.p90, one.worst), (0.5, 0.5, 0.5));
        assert_eq!(Distances::of(Vec::new()), None);
    }
}
