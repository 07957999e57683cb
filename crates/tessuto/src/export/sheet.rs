//! The simulated sheet of a clip: its triangles, flat as it was cut, its masses.

use glam::DVec3;

use super::Clip;
use super::shell::Shell;
use tessuto_core::error::{Error, Result};
use tessuto_sim::panel;

/// What to do where stiffnesses per width are missing.
pub(super) const WAY_OUT: &str = "reconstruct with the default method, from a template whose texture \
     coordinates are a flat panel to scale";

/// What a simulator needs beside the first frame.
pub(super) struct Sheet {
    /// The fabric's numbers.
    pub shell: Shell,
    /// Triangles of the template, wound as its polygons are.
    pub triangles: Vec<[u32; 3]>,
    /// Vertices of the flat panel in the plane z = 0, shape `[V]` `[m]`.
    pub flat: Vec<DVec3>,
    /// A third of the weight of the triangles around each vertex, shape `[V]` `[kg]`.
    pub masses: Vec<f64>,
}

impl Sheet {
    /// That of `clip`; `None` of results without stiffnesses per width, and where the texture coordinates are no
    /// flat panel to scale.
    pub fn of(clip: &Clip) -> Option<Self> {
        let shell = Shell::of(&clip.fabric?.per_width);
        let (flat, triangles) = (panel(&clip.mesh)?, clip.mesh.triangles());
        let mut masses = vec![0.0; flat.len()];
        for triangle in &triangles {
            let [a, b, c] = triangle.map(|v| flat[v as usize]);
            let third = shell.area_density * 0.5 * (b - a).cross(c - a).length() / 3.0;
            triangle.iter().for_each(|v| masses[*v as usize] += third);
        }
        Some(Self { shell, triangles, flat, masses })
    }

    /// The same for `format`, which is nothing without.
    ///
    /// # Errors
    /// [`Error::Input`] naming the result.
    pub fn needed(clip: &Clip, format: &str) -> Result<Self> {
        Self::of(clip).ok_or_else(|| {
            let problem =
                format!("has no stiffnesses per width of a flat panel, which the format {format} is made of");
            Error::input(format!("result {}", clip.name), problem, WAY_OUT)
        })
    }
}
