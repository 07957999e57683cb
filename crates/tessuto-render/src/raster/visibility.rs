//! Which triangle is seen at each pixel centre.

use super::Rendering;
use super::projected::{Projected, Rays};

/// The rows `first_row..` of an image that one thread works on.
pub(super) struct Rows<'a> {
    /// Row of the image that the slices start with.
    pub first_row: usize,
    /// Image width `[px]`.
    pub width: usize,
    /// See [`Rendering::triangle`].
    pub triangle: &'a mut [u32],
    /// See [`Rendering::inverse_depth`].
    pub inverse_depth: &'a mut [f64],
    /// See [`Rendering::rgba`].
    pub rgba: &'a mut [[f32; 4]],
}

impl Rows<'_> {
    /// Number of rows.
    pub fn count(&self) -> usize {
        self.triangle.len() / self.width
    }
}

/// Draws the triangles `visible` into the columns `x0..x1` of `rows`: at each pixel centre the
/// greatest 1/z wins, of equal ones the lower triangle index. Other pixels become background. Both
/// sides of a triangle are seen. A pixel centre on a shared edge belongs to exactly one of the two
/// triangles; only within rounding error (1e-13 px) of a vertex may it fall between all triangles
/// around.
pub(super) fn draw(
    rows: &mut Rows,
    [x0, x1]: [usize; 2],
    visible: &[u32],
    projected: &[Projected],
    rays: &Rays,
) {
    for row in 0..rows.count() {
        let columns = row * rows.width + x0..row * rows.width + x1;
        rows.triangle[columns.clone()].fill(Rendering::NO_TRIANGLE);
        rows.inverse_depth[columns].fill(0.0);
    }
    // Ascending triangles and a strict comparison make the lower index win ties.
    for &t in visible {
        let p = &projected[t as usize];
        let first = rows.first_row.max(p.rows[0] as usize);
        let end = (rows.first_row + rows.count()).min(p.rows[1] as usize);
        for j in first..end {
            let [begin, end] = p.span(rays, j);
            let c = p.inverse_depth.y * rays.y[j] + p.inverse_depth.z;
            let start = (j - rows.first_row) * rows.width;
            let nearest = &mut rows.inverse_depth[start + begin..start + end];
            let seen = &mut rows.triangle[start + begin..start + end];
            for ((nearest, seen), &x) in nearest.iter_mut().zip(seen).zip(&rays.x[begin..end]) {
                let inverse_depth = p.inverse_depth.x * x + c;
                let nearer = inverse_depth > *nearest;
                *nearest = if nearer { inverse_depth } else { *nearest };
                *seen = if nearer { t } else { *seen };
            }
        }
    }
}
