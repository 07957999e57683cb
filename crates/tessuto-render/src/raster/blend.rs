//! What antialiasing adds to one pixel from a neighbour.

use glam::{DVec3, Vec4};

/// One pixel's part in another: `out[receiver]` += weight · (`c[partner]` − `c[receiver]`).
#[derive(Debug, Clone, Copy)]
pub(super) struct Blend {
    /// Pixel that changes.
    pub receiver: u32,
    /// Pixel that it receives from.
    pub partner: u32,
    /// In `[0, ½]`.
    pub weight: f32,
    /// `c[partner]` − `c[receiver]`, unblended.
    pub contrast: [f32; 4],
    /// Vertices A and B of the silhouette edge.
    pub edge: [u32; 2],
    /// Derivative of the weight with respect to the edge plane A × B `[1/m²]`.
    pub weight_by_plane: DVec3,
}

impl Blend {
    /// Gradients with respect to the edge's vertices A and B `[m]`, for the image gradient `grad` at the
    /// receiver.
    pub fn edge_gradients(&self, positions: &[DVec3], grad: Vec4) -> [DVec3; 2] {
        let w = self.weight_by_plane * f64::from(grad.dot(Vec4::from_array(self.contrast)));
        let [a, b] = self.edge.map(|v| positions[v as usize]);
        // d(A × B) · w = dA · (B × w) + dB · (w × A)
        [b.cross(w), w.cross(a)]
    }
}
