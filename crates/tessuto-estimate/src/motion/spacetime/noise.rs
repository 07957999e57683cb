//! How much is to be made of a clip's colours, outlines and shading, and of the priors on its strain and bending:
//! from the residuals of each.
//!
//! A camera's noise, a loose mask, a light that changes: each clip has its own. Once a level is refined, its
//! residuals of colours and outlines show it. Medians over the frames, so that a few that are lost do not count.
//! What keeps its lengths better than most, as paper does, is held to them more firmly. How it bends is said in
//! `bent`, what its light explains in `light`.

use serde::{Deserialize, Serialize};
use tessuto_core::parallel;

use super::bent::Bent;
use super::{Positions, Problem};
use crate::motion::terms::Term;
use tessuto_core::math::median::median;
use tessuto_core::scene::Plane;
use tessuto_sim::cloth::Edge;

/// Residuals on clips that the settings are chosen on: root mean square difference of colours, all channels
/// together, of half of a pair of comparisons `[sRGB]`, and of outlines [px of the finest level], both by their
/// robust kernels. That is 1.17 of the settings' `colour` and 1.29 of `outline`: these were chosen by the errors
/// of the motion, and are the noise of one pixel all the same. Where the residuals are f times these, a clip's noise is
/// f times the settings', with the same cut-off: its pixels count as 1/f² each ([`crate::motion::terms::robust`]).
pub(super) const NOMINAL: [f64; 2] = [0.032, 0.6];
/// Bounds of what a pixel counts as. Colours that differ by less than usual are not worth more: their residuals
/// are mostly other than noise.
const BOUNDS: [[f64; 2]; 2] = [[0.0625, 1.0], [0.0625, 4.0]];

/// Median size of strain in spreads on clips that its spread is set for, and how much smaller that may get. Never
/// larger: more is left where a sheet is badly found.
const STRAINED: f64 = 0.25;
const LEAST_SPREAD: f64 = 0.4;

/// Power of the part of the brightness that the light explains by which shading counts: what it leaves
/// unexplained, shadows and light from the sheet and the table, varies together over large areas, so that the more
/// of it there is the fewer witnesses there are.
const LIT: i32 = 3;

/// What a clip asks for, relative to the settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Asked {
    /// What a pixel's colour counts as, by the noise of the clip's.
    pub colours: f64,
    /// What a pixel of outline counts as, likewise.
    pub outlines: f64,
    /// Spread of strain.
    pub strain: f64,
    /// What a pixel's brightness counts as, by what of it the light explains.
    pub shading: f64,
    /// How the sheet bends.
    pub bent: Bent,
    /// What it lies on, where scene.json names nothing (`lies`).
    pub plane: Option<Plane>,
}

/// The settings as they are.
impl Default for Asked {
    fn default() -> Self {
        Self { colours: 1.0, outlines: 1.0, strain: 1.0, shading: 1.0, bent: Bent::default(), plane: None }
    }
}

impl Problem<'_> {
    /// What the clip asks for, by what is left at `frames`.
    pub(super) fn asked(&self, frames: &[Positions]) -> Asked {
        let of_start = self.asked_at_start(frames);
        let levels = self.noise_levels(frames);
        let [colours, outlines] = std::array::from_fn(|k| {
            let [least, most] = BOUNDS[k];
            (NOMINAL[k] / levels[k].max(f64::MIN_POSITIVE)).powi(2).clamp(least, most)
        });
        Asked {
            colours,
            outlines,
            strain: self.strain_spread(&frames[1..]),
            shading: self.light_explains(frames).powi(LIT),
            ..of_start
        }
    }

    /// What the clip asks for, by positions that are those of a start: how it bends.
    pub(super) fn asked_at_start(&self, frames: &[Positions]) -> Asked {
        let lost = self.prints_lost(frames);
        let found: Vec<&Positions> =
            frames.iter().zip(lost).filter(|(_, lost)| !lost).map(|(x, _)| x).collect();
        Asked { bent: self.bent(&found), plane: self.lies_on(&found), ..Asked::default() }
    }

    /// Spread of strain that its residuals at `frames` ask for.
    fn strain_spread(&self, frames: &[Positions]) -> f64 {
        let of_frame = |x: &Positions| {
            let strain = |e: &Edge| {
                (x[e.vertices[0] as usize].distance(x[e.vertices[1] as usize]) / e.rest_length - 1.0).abs()
            };
            median(self.cloth.edges.iter().map(strain).collect())
        };
        let left = median(parallel::filter_map(frames.len(), |n| of_frame(&frames[n])));
        left.map_or(1.0, |left| (left / (STRAINED * self.settings.strain)).clamp(LEAST_SPREAD, 1.0))
    }

    /// Residuals of colours `[sRGB]` and outlines [px of the finest level] at `frames`.
    fn noise_levels(&self, frames: &[Positions]) -> [f64; 2] {
        let mut search = self.at_level(0);
        search.update_references(frames);
        let pairs = 1.0 + self.settings.neighbour_weight;
        let of_frame = |n: usize| {
            let (terms, x) = (search.terms(n), &frames[n]);
            let colours =
                terms.colour.at(x).map(|(c, x)| c.weight * c.area(&x).max(1.0) * pairs).sum::<f64>();
            let spreads = (2.0 * terms.colour.value(x) / colours).sqrt();
            let outlines = terms.outline.at(x).zip(&self.eyes);
            let outlines = outlines.map(|((outline, x), eye)| outline.mean_square(&x).sqrt() / eye.pixel());
            [spreads * self.settings.colour, outlines.sum::<f64>() / self.eyes.len() as f64]
        };
        let levels: Vec<[f64; 2]> = parallel::later(frames, |(n, _)| of_frame(n));
        std::array::from_fn(|k| {
            median(levels.iter().map(|of_frame| of_frame[k]).collect()).unwrap_or(NOMINAL[k])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::SpacetimeSettings;
    use super::*;
    use crate::synth::{Settings, make};
    use tessuto_core::math::rng::Rng;
    use tessuto_core::scene::Scene;
    use tessuto_core::video::Frame;
    use tessuto_sim::Cloth;

    fn clip() -> Scene {
        make(&Settings::default().with(|s| {
            s.frames = 5;
            s.size = 160;
            s.grid = [7, 7];
            s.wind = 4.0;
            s.seed = 3;
        }))
        .unwrap()
    }

    /// Residuals of colours and outlines at the true positions, and the weights that follow.
    fn left(scene: &Scene) -> ([f64; 2], [f64; 2]) {
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(scene, &cloth, SpacetimeSettings::default()).unwrap();
        let truth: Vec<Positions> = scene.truth.vertices.as_ref().unwrap().iter().cloned().collect();
        let asked = problem.asked(&truth);
        (problem.noise_levels(&truth), [asked.colours, asked.outlines])
    }

    /// The clip with every frame changed by `change`.
    fn changed(change: impl Fn(usize, &mut Frame)) -> Scene {
        let mut scene = clip();
        let mut frames: Vec<Frame> = (0..5).map(|n| scene.frames.frame(n).unwrap().into_owned()).collect();
        frames.iter_mut().enumerate().for_each(|(n, frame)| change(n, frame));
        scene.frames = frames.into();
        scene
    }

    #[test]
    fn a_noisy_camera_makes_colours_count_less() {
        let noisy = changed(|n, frame| {
            let mut rng = Rng::new(n as u64, 0);
            frame.rgb.data.iter_mut().for_each(|c| *c = (*c + 0.25 * rng.normal() as f32).clamp(0.0, 1.0));
        });
        let (clean, noisy) = (left(&clip()), left(&noisy));
        println!("{clean:?} {noisy:?}");
        assert!(noisy.0[0] > 2.0 * clean.0[0] && noisy.1[0] < 0.6 && noisy.1[0] < clean.1[0]);
        assert!((noisy.0[1] / clean.0[1] - 1.0).abs() < 0.3, "outlines are the same");
    }

    #[test]
    fn loose_masks_make_outlines_count_less() {
        // Masks too narrow by some pixels, in another way in each frame.
        let loose = changed(|n, frame| {
            let by = 2 + n % 3;
            let (w, mask) = (frame.mask.width, frame.mask.data.clone());
            for (i, m) in frame.mask.data.iter_mut().enumerate() {
                let x = i % w;
                *m = m.min(mask[i - x + (x + by).min(w - 1)]).min(mask[i - x + x.saturating_sub(by)]);
            }
        });
        let (clean, loose) = (left(&clip()), left(&loose));
        println!("{clean:?} {loose:?}");
        assert!(loose.0[1] > 2.0 * clean.0[1] && loose.1[1] < 0.25 && loose.1[1] < 0.5 * clean.1[1]);
    }

    #[test]
    fn a_sheet_that_keeps_its_lengths_is_held_to_them_more_firmly() {
        let scene = clip();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
        let spread = problem.settings.strain;
        let of = |strains: [f64; 3]| {
            let shape = |s: f64| scene.template.positions.iter().map(|p| *p * (1.0 + s * spread)).collect();
            problem.strain_spread(&strains.map(shape))
        };
        // As it is; longer and shorter by a third of what is usual; one frame of three that is lost; nothing after
        // the first frame.
        assert_eq!((of([0.0; 3]), of([0.3; 3])), (LEAST_SPREAD, 1.0));
        let (stiff, lost) = (of([-0.15; 3]), of([0.15, 90.0, 0.15]));
        assert!((stiff - 0.6).abs() < 1e-6 && (lost - 0.6).abs() < 1e-6, "{stiff} {lost}");
        assert_eq!(problem.strain_spread(&[]), 1.0);
    }
}
