//! How badly a frame's positions match what they should: what the deviations are scaled by.

use std::borrow::Cow;

use glam::DVec3;

use super::super::LevelSearch;
use super::super::look::Look;
use crate::motion::terms::Term;
use crate::motion::terms::colour::PointColours;
use crate::motion::terms::outline::Outline;
use crate::motion::terms::shear::FEW;
use tessuto_core::mesh::Positions;

/// Distance `[px]` below which outlines cannot be distinguished.
const OUTLINE_FLOOR: f64 = 0.1;
/// Squared difference of colours, summed over the channels, that every video has from rounding `[sRGB²]`. Cloth
/// without any pattern so counts as one whose pattern was not found.
const NOISE: f64 = 1e-6;
/// Misfit of the texture that is as good as none.
const TEXTURE_FLOOR: f64 = 1e-3;

/// Misfits of one frame; of several cameras their mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) struct Misfit {
    /// Root mean square distance of the mesh's outlines to the outline of the mask `[m]`, at the fabric's mean
    /// distance.
    pub outline: f64,
    /// Energy of what colours differ from those of the first frame, relative to that of the texture's own contrast
    /// around a vertex; median over the vertices in sight, at most 1. Near 0: the same pattern; 1: none of it.
    pub texture: f64,
    /// Energy of strain and shear per vertex: of the order of 1 where edges and angles depart from the template's
    /// by their spreads.
    pub prior: f64,
}

impl LevelSearch<'_, '_> {
    /// Misfits of one frame at the positions `x`.
    pub(in super::super) fn misfit(&self, frame: usize, x: &Positions) -> Misfit {
        let terms = self.terms(frame);
        let count = x.len().max(1) as f64;
        let views = self.looks.len() as f64;
        let outline = |(look, (outline, x)): (&Look, (&Outline, Cow<[DVec3]>))| {
            let view = &look.eye.observed.views[frame];
            let depth = x.iter().map(|p| view.depth(*p)).sum::<f64>() / count;
            let pixel = depth / (0.5 * (view.camera.fx + view.camera.fy));
            outline.mean_square(&x).sqrt().max(OUTLINE_FLOOR) * pixel.abs()
        };
        let texture = |look: &Look| look.texture_misfit(frame, &look.observe(frame, x, self.compares));
        // Smooth shear counts by the spread that the settings give, however large it was found to be.
        let mut shear = terms.priors.shear.clone();
        (shear.smooth, shear.rank) = (self.problem.settings.shear_smooth, FEW);
        Misfit {
            outline: self.looks.iter().zip(terms.outline.at(x)).map(outline).sum::<f64>() / views,
            texture: self.looks.iter().map(texture).sum::<f64>() / views,
            prior: (terms.priors.strain.value(x) + shear.value(x)) / count,
        }
    }
}

impl Look<'_, '_> {
    fn texture_misfit(&self, frame: usize, observed: &PointColours) -> f64 {
        // Sums around every vertex over the points in sight: their area, squared difference, and the first two
        // moments of the texture in this frame's light.
        let gain = &self.gains[frame];
        let mut sums = vec![([0.0; 3], [0.0; 3]); gain.len()];
        let turned = &self.occlusions[frame].turned;
        for ((point, t), seen) in self.samples.points.iter().zip(&self.reference).zip(observed) {
            let (Some(t), Some(seen)) = (t, seen) else { continue };
            // The back has no print of which anything is known.
            if turned.get(point.triangle as usize) == Some(&true) {
                continue;
            }
            let corners = self.samples.triangles[point.triangle as usize];
            let lit = [0, 1, 2].map(|k| {
                let gain = |c: usize| point.weights[c] * f64::from(gain[corners[c] as usize][k]);
                (0..3).map(gain).sum::<f64>() * f64::from(t[k])
            });
            let square = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>();
            let difference = square([0, 1, 2].map(|k| lit[k] - f64::from(seen[k])));
            for v in corners {
                let (of, mean) = &mut sums[v as usize];
                let added = [1.0, difference, square(lit)].map(|number| number * point.area);
                of.iter_mut().zip(added).for_each(|(sum, number)| *sum += number);
                mean.iter_mut().zip(lit).for_each(|(sum, number)| *sum += number * point.area);
            }
        }
        let ratio = |([area, difference, squares], mean): &([f64; 3], [f64; 3])| {
            let contrast = squares - mean.iter().map(|m| m * m).sum::<f64>() / area;
            let noise = area * NOISE;
            (*area > 0.0).then(|| ((difference + noise) / (contrast + noise)).min(1.0))
        };
        let mut ratios: Vec<f64> = sums.iter().filter_map(ratio).collect();
        ratios.sort_unstable_by(f64::total_cmp);
        ratios.get(ratios.len() / 2).map_or(1.0, |median| median.max(TEXTURE_FLOOR))
    }
}
