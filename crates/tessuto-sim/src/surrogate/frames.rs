//! A frame at every vertex: along the row, across it in the surface, and along the normal.

use glam::DVec3;

use crate::lattice::Lattice;

/// Keeps directions finite where the cloth has collapsed `[m]`.
const FLOOR: f64 = 1e-12;

/// Unit vectors t1 along the row, t2 = n × t1, and the normal n of a pixel.
pub type Frame = [DVec3; 3];

/// Differences of `z` between the neighbours of pixel `k` along its row and its column; at the border from the
/// pixel itself.
fn differences(lattice: &Lattice, z: &[DVec3], k: usize) -> [(DVec3, [usize; 2]); 2] {
    let columns = lattice.columns;
    let (row, column) = (k / columns, k % columns);
    let ends = [
        [k - usize::from(column > 0), k + usize::from(column + 1 < columns)],
        [k - columns * usize::from(row > 0), k + columns * usize::from(row + 1 < lattice.rows)],
    ];
    ends.map(|ends| {
        let [a, b] = ends.map(|k| lattice.vertices[k] as usize);
        (z[b] - z[a], [a, b])
    })
}

/// The frame of pixel `k` of the shape `z`.
pub fn frame(lattice: &Lattice, z: &[DVec3], k: usize) -> Frame {
    let [(x, _), (y, _)] = differences(lattice, z, k);
    let normal = x.cross(y);
    let (t1, n) = (x / (x.length() + FLOOR), normal / (normal.length() + FLOOR * FLOOR));
    [t1, n.cross(t1), n]
}

/// Given `grad` = ∂L/∂ the frame of pixel `k`, adds ∂L/∂z to `out`.
pub fn add_frame_vjp(lattice: &Lattice, z: &[DVec3], k: usize, grad: &Frame, out: &mut [DVec3]) {
    let [(x, x_ends), (y, y_ends)] = differences(lattice, z, k);
    let [t1, _, n] = frame(lattice, z, k);
    let by_n = grad[2] + t1.cross(grad[1]);
    let by_t1 = grad[0] + grad[1].cross(n);
    let by_normal = (by_n - n * n.dot(by_n)) / (x.cross(y).length() + FLOOR * FLOOR);
    let by_x = (by_t1 - t1 * t1.dot(by_t1)) / (x.length() + FLOOR) + y.cross(by_normal);
    let by_y = by_normal.cross(x);
    for (by, [a, b]) in [(by_x, x_ends), (by_y, y_ends)] {
        out[a] -= by;
        out[b] += by;
    }
}
