//! Points of the surface that were followed through the video.

use std::collections::BTreeMap;

use glam::DVec3;

/// Tracked points: each a fixed place on the mesh, and where it was measured. Shape `[P]`, except `points`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tracks {
    /// Vertices that each point lies between: the corners of a quad, or of a triangle with a weight of 0 for the
    /// fourth.
    pub vertices: Vec<[u32; 4]>,
    /// Their weights, whose sum is 1.
    pub weights: Vec<[f64; 4]>,
    /// Measured positions `[m]` of all points, camera frame, shape `[P]`, in the frames (numbers from the scene's
    /// first one) that have any.
    pub points: BTreeMap<usize, Vec<DVec3>>,
}

impl Tracks {
    /// Where the points are `[m]`, shape `[P]`, on a mesh at `positions` `[m]`, shape `[V]`.
    pub fn on<'a>(&'a self, positions: &'a [DVec3]) -> impl ExactSizeIterator<Item = DVec3> + 'a {
        self.vertices
            .iter()
            .zip(&self.weights)
            .map(|(vertices, weights)| (0..4).map(|k| positions[vertices[k] as usize] * weights[k]).sum())
    }
}
