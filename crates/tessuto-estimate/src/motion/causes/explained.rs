//! A motion and its causes, in numbers that give their sizes.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{Found, Parts};
use tessuto_core::error::Warning;
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_sim::per_width::{PerWidth, per_width};
use tessuto_sim::{Cloth, Stiffness};

/// What was found, the accelerations by each cause, and their sizes.
#[derive(Debug, Clone, PartialEq)]
pub struct Explained {
    /// Stiffnesses, gravity, air, held vertices.
    pub found: Found,
    /// Accelerations of every vertex.
    pub parts: Parts,
    /// How large they are.
    pub sizes: Sizes,
    /// The motion without the correction ([`Parts::correction`]), shape [N, V] `[m]`.
    pub led: Vec<Positions>,
    /// The stiffnesses whatever the mesh, where the texture coordinates are a flat panel.
    pub per_width: Option<PerWidth>,
}

/// Root mean squares over vertices and frames [m/s²], and one distance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sizes {
    /// The motion's own acceleration, without held vertices: second differences of its frames.
    pub motion: f64,
    /// By the cloth's springs, without held vertices.
    pub elastic: f64,
    /// Gravity.
    pub gravity: f64,
    /// Wind and drag.
    pub air: f64,
    /// By what holds held vertices.
    pub hold: f64,
    /// What is left, of the other vertices.
    pub residual: f64,
    /// What leads them exactly to where they were found, besides; 0 in results of earlier versions.
    #[serde(default)]
    pub correction: f64,
    /// Distance of the motion without the correction from the one with it, of all vertices `[m]`; likewise.
    #[serde(default)]
    pub beside: f64,
    /// Largest distance of the motion that all forces make from the one that is reported, where compressed cloth
    /// buckles another way under them than it was found `[m]`; 0 where they make the motion that is reported, and in
    /// results of earlier versions.
    #[serde(default)]
    pub replay: f64,
}

impl Sizes {
    /// Why the forces do not make the motion that is reported, if they do not.
    pub fn doubt(&self) -> Option<Warning> {
        let mm = 1e3 * self.replay;
        let found = format!(
            "under its forces the cloth buckles another way than it was found: a replay is up to {mm:.1} mm \
             beside the motion"
        );
        let hint = "take the motion from motion.npy, which is as it was found";
        (self.replay > 0.0).then(|| Warning::new("causes", found, hint))
    }
}

impl Explained {
    /// Of the motion `frames`, shape [N, V], of `cloth`, cut as `template`, `fps` frames per second; without the
    /// correction it is `led`.
    pub fn new(
        (cloth, template): (&Cloth, &Mesh),
        found: Found,
        parts: Parts,
        (frames, led): (&[Positions], Vec<Positions>),
        fps: f64,
    ) -> Self {
        let stiffness = Stiffness::uniform(cloth, found.causes.stiffness());
        let mut is_held = vec![false; cloth.vertex_count()];
        found.held.iter().for_each(|v| is_held[*v] = true);
        let rms = |fields: &[Positions], of_held: Option<bool>| {
            let (mut sum, mut count) = (0.0, 0usize);
            for (i, a) in fields.iter().flat_map(|field| field.iter().enumerate()) {
                if of_held.is_none_or(|held| held == is_held[i]) {
                    sum += a.length_squared();
                    count += 1;
                }
            }
            (sum / count.max(1) as f64).sqrt()
        };
        let elastic = |x: &Positions| {
            let mut force = vec![DVec3::ZERO; x.len()];
            cloth.add_gradient(&stiffness, x, -1.0, &mut force);
            force.iter_mut().zip(&cloth.masses).for_each(|(f, m)| *f /= *m);
            force
        };
        let second = |x: &[Positions]| -> Positions {
            (0..x[0].len()).map(|i| (x[2][i] - x[1][i] * 2.0 + x[0][i]) * (fps * fps)).collect()
        };
        let less = |(a, b): (&Positions, &Positions)| a.iter().zip(b).map(|(a, b)| *a - *b).collect();
        let apart: Vec<Positions> = led.iter().zip(frames).map(less).collect();
        let sizes = Sizes {
            motion: rms(&frames.windows(3).map(second).collect::<Vec<_>>(), Some(false)),
            elastic: rms(&frames.iter().map(elastic).collect::<Vec<_>>(), Some(false)),
            gravity: parts.gravity.length(),
            air: rms(&parts.air, None),
            hold: rms(&parts.hold, Some(true)),
            residual: rms(&parts.residual, Some(false)),
            correction: rms(&parts.correction, Some(false)),
            beside: rms(&apart, None),
            replay: 0.0,
        };
        let per_width = per_width(cloth, template, found.causes.stiffness(), frames);
        Self { found, parts, sizes, led, per_width }
    }
}
