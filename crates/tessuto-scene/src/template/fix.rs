//! Unit and axis fixes of a mesh.

use glam::DVec3;

use tessuto_core::mesh::Mesh;

/// What is done to a mesh, in this order: axes swapped, axes negated, scaled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fix {
    /// Two axes (0, 1, 2) that change places.
    pub swap: Option<[usize; 2]>,
    /// Which of x, y, z are negated.
    pub flip: [bool; 3],
    /// Factor of all coordinates.
    pub scale: f64,
}

impl Fix {
    /// Nothing to do.
    pub const NONE: Self = Self { swap: None, flip: [false; 3], scale: 1.0 };

    /// The changed position.
    pub fn apply(&self, p: DVec3) -> DVec3 {
        let mut p = p;
        if let Some([a, b]) = self.swap {
            (p[a], p[b]) = (p[b], p[a]);
        }
        for k in 0..3 {
            if self.flip[k] {
                p[k] = -p[k];
            }
        }
        p * self.scale
    }

    /// Changes a mesh; a mirrored one is wound the other way round, so that its faces look where they looked.
    pub fn apply_to(&self, mesh: &mut Mesh) {
        mesh.positions.iter_mut().for_each(|p| *p = self.apply(*p));
        let mirrors = self.flip.iter().filter(|f| **f).count() + usize::from(self.swap.is_some());
        if mirrors % 2 == 1 {
            for face in &mut mesh.faces {
                face.vertices.reverse();
                face.uvs.reverse();
            }
        }
    }
}
