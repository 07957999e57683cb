//! How much of a print the sheet has, how well its colours locate it, and whether it is where the sheet
//! was found.

use tessuto_core::parallel;

use super::noise::NOMINAL;
use super::{Positions, Problem};

/// The print of a frame is lost if more than this part of its contrast is not where the sheet is.
const LOST: f64 = 0.5;

impl Problem<'_> {
    /// What part of the variance of colours around its vertices is print, and not what clips have left of colours
    /// where they are found: noise, and light that no gain follows. Mean over the sheet as the first frame shows
    /// it at `level`: above 0.9 of printed ones at the finest, 0.1 to 0.2 of plain ones; the less the coarser the
    /// level, most of all of a fine print that repeats, of which nothing is left to show where the sheet is.
    pub(super) fn part_printed(&self, v: usize, level: usize) -> f64 {
        let look = self.look(v, level);
        // Around every vertex area, squares and the sums of the channels.
        let mut sums = vec![[0.0; 5]; self.cloth.vertex_count()];
        for (point, seen) in look.samples.points.iter().zip(&look.reference) {
            let Some([r, g, b]) = seen.map(|colour| colour.map(f64::from)) else { continue };
            for v in look.samples.triangles[point.triangle as usize] {
                let added = [1.0, r * r + g * g + b * b, r, g, b];
                let sum = sums[v as usize].iter_mut().zip(added);
                sum.for_each(|(sum, number)| *sum += number * point.area);
            }
        }
        let part = |[area, squares, channels @ ..]: &[f64; 5]| {
            let of_mean: f64 = channels.iter().map(|sum| (sum / area).powi(2)).sum();
            let variance = (squares / area - of_mean).max(0.0);
            (*area > 0.0).then_some(variance / (variance + NOMINAL[0].powi(2)))
        };
        let parts: Vec<f64> = sums.iter().filter_map(part).collect();
        parts.iter().sum::<f64>() / parts.len().max(1) as f64
    }

    /// Whether the print of each of `frames` is lost; that of the first is known.
    pub(super) fn prints_lost(&self, frames: &[Positions]) -> Vec<bool> {
        let mut finest = self.at_level(0);
        finest.looks.iter_mut().for_each(|look| look.set_ways(frames));
        finest.fit_anew(&frames.iter().enumerate().skip(1).collect::<Vec<_>>());
        let lost = |n: usize| n > 0 && finest.misfit(n, &frames[n]).texture > LOST;
        parallel::map(frames.len(), lost)
    }
}

#[cfg(test)]
mod tests {
    use super::super::SpacetimeSettings;
    use super::*;
    use crate::synth::{Settings, make};
    use tessuto_sim::Cloth;

    #[test]
    fn a_plain_sheet_has_no_print() {
        let settings = Settings::default().with(|s| {
            s.frames = 2;
            s.size = 160;
            s.grid = [9, 9];
        });
        let mut scene = make(&settings).unwrap();
        let part = |scene: &tessuto_core::Scene| {
            let cloth = Cloth::new(&scene.template);
            let problem = Problem::new(scene, &cloth, SpacetimeSettings::default()).unwrap();
            problem.eyes[0].print[0]
        };
        let printed = part(&scene);
        // A tenth of its contrast.
        let mut frames: Vec<_> = (0..2).map(|n| scene.frames.frame(n).unwrap().into_owned()).collect();
        frames.iter_mut().flat_map(|f| f.rgb.data.iter_mut()).for_each(|c| *c = 0.5 + 0.1 * (*c - 0.5));
        scene.frames = frames.into();
        let plain = part(&scene);
        println!("printed {printed:.3}, plain {plain:.3}");
        assert!(printed > 0.8 && plain < 0.5 * printed);
    }

    #[test]
    fn fine_stripes_are_no_print_in_coarse_images() {
        let settings = Settings::default().with(|s| {
            s.frames = 2;
            s.size = 320;
            s.grid = [13, 13];
        });
        let mut scene = make(&settings).unwrap();
        let width = scene.camera.width;
        let mut frames: Vec<_> = (0..2).map(|n| scene.frames.frame(n).unwrap().into_owned()).collect();
        for (k, c) in frames.iter_mut().flat_map(|f| f.rgb.data.iter_mut().enumerate()) {
            *c = if (k / 3 / width) % 8 < 4 { 0.2 } else { 0.8 };
        }
        scene.frames = frames.into();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
        let print = &problem.eyes[0].print;
        println!("print {print:?}, fine to coarse");
        assert!(print[0] > 0.9 && print[print.len() - 1] < 0.1);
    }
}
