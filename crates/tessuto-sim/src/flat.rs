//! Cloth as it was cut: flat.

use glam::{DVec2, DVec3};

use super::cloth::Cloth;
use tessuto_core::mesh::{Mesh, SEAM, vertex_uvs};

/// The panel is believed where lengths measured in it are off by less than this, root mean square relative to the
/// template's.
const BELIEVED: f64 = 0.1;

impl Cloth {
    /// The cloth of `template` as it was cut: edges with the template's lengths, straight and right-angled as in
    /// the flat [`panel`]. Edges shorter than that resist with `compression` times their stiffness: cloth wrinkles
    /// within a cell. Where the texture coordinates are no flat panel, it rests in the template's own folds.
    pub fn flat(template: &Mesh, compression: f64) -> Self {
        let mut cloth = match panel(template) {
            Some(flat) => Self::with_angles_of(template, &flat),
            None => Self::new(template),
        };
        cloth.edges.iter_mut().for_each(|edge| edge.compression = compression);
        cloth
    }
}

/// The vertices of `template` in the plane, shape `[V]` `[m]`: its texture coordinates, each of the two stretched
/// so that edges come nearest to the template's lengths. `None` where they do not: a texture with seams or one
/// that is not to scale.
pub fn panel(template: &Mesh) -> Option<Vec<DVec3>> {
    let uvs = vertex_uvs(template, SEAM)?;
    let edges = template.edges();
    let along = |[a, b]: [u32; 2]| {
        let d = uvs[b as usize] - uvs[a as usize];
        let length = template.positions[a as usize].distance(template.positions[b as usize]);
        (d * d, length * length)
    };
    // Least squares of l² = s_u² du² + s_v² dv².
    let (mut matrix, mut rhs) = ([0.0; 3], DVec2::ZERO);
    for edge in &edges {
        let (d, square) = along(*edge);
        matrix[0] += d.x * d.x;
        matrix[1] += d.x * d.y;
        matrix[2] += d.y * d.y;
        rhs += d * square;
    }
    let [a, b, c] = matrix;
    let determinant = a * c - b * b;
    let scale = DVec2::new(c * rhs.x - b * rhs.y, a * rhs.y - b * rhs.x) / determinant;
    if !(scale.x > 0.0 && scale.y > 0.0 && scale.is_finite()) {
        return None;
    }
    let off = |edge: &[u32; 2]| {
        let (d, square) = along(*edge);
        ((d.dot(scale) / square).sqrt() - 1.0).powi(2)
    };
    let error = (edges.iter().map(off).sum::<f64>() / edges.len() as f64).sqrt();
    let scale = DVec2::new(scale.x.sqrt(), scale.y.sqrt());
    (error < BELIEVED).then(|| uvs.iter().map(|uv| (*uv * scale).extend(0.0)).collect())
}
