//! A mesh whose texture has a seam, for the tests of exports.

use glam::DVec2;
use tessuto::{Mesh, mesh};

/// A 5×3 grid of quads with a seam down the middle: the right half has texture coordinates of its own there.
pub fn seamed() -> Mesh {
    let mut grid = mesh::grid(5, 3, DVec2::new(0.4, 0.2), 1.2);
    let seam = grid.uvs.len() as u32;
    for row in 0..3 {
        grid.uvs.push(DVec2::new(0.9, 1.0 - 0.5 * f64::from(row)));
    }
    for face in &mut grid.faces {
        if face.vertices.iter().all(|v| v % 5 >= 2) {
            face.uvs = face.vertices.iter().map(|v| if v % 5 == 2 { seam + v / 5 } else { *v }).collect();
        }
    }
    grid
}
