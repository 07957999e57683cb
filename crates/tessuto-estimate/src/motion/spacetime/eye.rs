//! What one camera saw of the clip, at every resolution at which it is looked at.

use std::borrow::Cow;

use glam::DVec2;

use super::SpacetimeSettings;
use crate::motion::observed::Observed;
use crate::motion::observed::outline_distance::OutlineDistance;
use crate::motion::observed::samples::{EdgePoint, border_triangles, boundary_points};
use tessuto_core::camera::Viewpoint;
use tessuto_core::error::Result;
use tessuto_core::mesh::Mesh;
use tessuto_core::scene::Scene;

/// Distance between the points of the boundary at which outlines are compared [px of the finest level].
const BOUNDARY_SPACING: f64 = 2.0;
/// Small images are magnified by at most this power of two, to no more pixels than this a frame.
const MOST_DOUBLINGS: f64 = 2.0;
const MOST_PIXELS: usize = 1 << 21;
/// Size of a sheet [px of the finest level] whose pixels are independent of each other, each with the noise that
/// the settings say.
const NOMINAL_SIZE: f64 = 160.0;

/// One camera's share of the clip. Its levels of the pyramids are numbered as they are kept; those of the search count
/// from the finest that is in use, which is as fine on the sheet in every camera.
pub(super) struct Eye<'a> {
    /// The scene as it alone sees it.
    pub scene: Cow<'a, Scene>,
    /// How much later than the scene's own camera it takes its frames [time between frames].
    pub late: f64,
    pub observed: Observed,
    /// Points of the border, and the triangle of each.
    pub boundary: Vec<EdgePoint>,
    pub border: Vec<u32>,
    /// Outlines between back and front, shape `[N]`; empty where both sides are alike.
    pub seams: Vec<Option<OutlineDistance>>,
    /// Number of independent pixels that one of the finest level counts as: [`NOMINAL_SIZE`] over the sheet's size
    /// in the first frame.
    pub independent: f64,
    /// What part of the first frame's contrast is print, by level of the search: a pixel's colour counts by it.
    pub print: Vec<f64>,
}

impl<'a> Eye<'a> {
    /// Looks at every frame of camera `v` in a part of a `clip`.
    pub fn new(clip: &Scene, part: &'a Scene, v: usize, settings: &SpacetimeSettings) -> Result<Self> {
        let (clip, scene) = (clip.seen_by(v), part.seen_by(v));
        let late = v.checked_sub(1).map_or(0.0, |k| part.more[k].late * part.fps);
        let template = &scene.template;
        let size = size_in_image(template, &clip.viewpoint(0));
        let halvings = (size / settings.resolution).log2().floor();
        let finest = halvings.clamp(0.0, 16.0) as usize;
        let doublings = (-halvings).clamp(0.0, MOST_DOUBLINGS) as usize;
        let pixels = scene.camera.width * scene.camera.height;
        let magnification =
            (0..=doublings).rev().map(|k| 1 << k).find(|m| pixels * m * m <= MOST_PIXELS).unwrap_or(1);
        let coarsest = finest + settings.levels - 1 + settings.track_levels;
        let observed = Observed::new(&clip, &scene, [finest, coarsest], magnification)?;
        let spacing = BOUNDARY_SPACING * f64::from(1u32 << observed.range[0]);
        let boundary = boundary_points(template, &template.positions, &observed.first[0].view, spacing);
        let border = border_triangles(&template.triangles(), &boundary);
        let independent = NOMINAL_SIZE * f64::from(1u32 << observed.range[0]) / size;
        let (seams, print) = (Vec::new(), Vec::new());
        Ok(Self { scene, late, observed, boundary, border, seams, independent, print })
    }

    /// Number of levels in use.
    pub fn level_count(&self) -> usize {
        let [finest, coarsest] = self.observed.range;
        coarsest + 1 - finest
    }

    /// The level of the pyramids that is the search's `level`; the coarsest stands for those that small images lack.
    pub fn kept(&self, level: usize) -> usize {
        let [finest, coarsest] = self.observed.range;
        (finest + level).min(coarsest)
    }

    /// Pixels of level 0 of the pyramids along one of the finest level in use or of the video, whichever is larger:
    /// what settings call a pixel of the finest level. Those of a magnified image are not independent.
    pub fn pixel(&self) -> f64 {
        f64::from(1u32 << self.observed.range[0]) * self.observed.magnification as f64
    }
}

/// Square root of the area of `template`'s image `[px]` in this `view` of the first frame; at least 1 px, since
/// what is seen edge-on has none.
pub(super) fn size_in_image(template: &Mesh, view: &Viewpoint) -> f64 {
    let p: Vec<DVec2> = template.positions.iter().map(|x| view.project(*x)).collect();
    let area = |t: [u32; 3]| {
        let [a, b, c] = t.map(|v| p[v as usize]);
        0.5 * (b - a).perp_dot(c - a).abs()
    };
    template.triangles().into_iter().map(area).sum::<f64>().sqrt().max(1.0)
}
