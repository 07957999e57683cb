//! Frames whose print was lost, found again by patches of frames where it was not.
//!
//! Gradients lead to the right place only from nearby. So where the print is not where the sheet was found, patches of the first frame, of the
//! nearest good one before and of that after are looked for all over the frame ([`patch`]). Matches that do not agree with
//! their neighbours on the sheet are left out ([`agreement`]), and the sheet is drawn to what is left, keeping its lengths and angles,
//! by a kernel that lets go of what still does not fit ([`places`], [`drawn`](Finder::drawn)). From there the usual search goes on. All are
//! offered to the [best path](super::best_path); what it takes makes more good frames to start from.

mod agreement;
mod drawn;
mod finder;
mod patch;
mod places;

use rayon::prelude::*;

use self::finder::Finder;
use super::settle::settled;
use super::{Positions, Problem};
use crate::math::factor::Scratch;

/// The print of a frame is lost if more than this part of its contrast is not where the sheet is.
const LOST: f64 = 0.5;
/// Times that the frames are gone through: what was found may lead to more.
const ROUNDS: usize = 3;
/// A lost frame is looked for from the good one before, from that after, and from where it is.
const STARTS: usize = 3;

impl Problem<'_> {
    /// `frames` with those whose print is lost found again; `None` if none is lost or none was found.
    pub(super) fn rematched(&self, frames: &[Positions]) -> Option<Vec<Positions>> {
        let finder = Finder::new(self);
        let mut found = frames.to_vec();
        for _ in 0..ROUNDS {
            let misfits = self.texture_misfits(&found);
            let good: Vec<usize> = (0..frames.len()).filter(|n| misfits[*n] <= LOST).collect();
            let starts = |n: usize| -> [Option<usize>; STARTS] {
                let before = good.iter().rev().find(|m| **m < n).copied();
                [before, good.iter().find(|m| **m > n).copied(), Some(n)]
            };
            let lost = (0..frames.len()).filter(|n| misfits[*n] > LOST);
            let tasks: Vec<(usize, usize, usize)> = lost
                .flat_map(|n| {
                    starts(n).into_iter().enumerate().filter_map(move |(side, start)| Some((side, n, start?)))
                })
                .collect();
            let find = |(levels, scratch): &mut (Vec<_>, Scratch), (_, n, start): &(usize, usize, usize)| {
                let x = finder.find(*n, *start, &found, &good, scratch)?;
                Some(settled(levels, *n, &x, &x, scratch))
            };
            let new: Vec<Option<Positions>> =
                tasks.par_iter().map_init(|| (self.settling(), Scratch::default()), find).collect();
            let mut sides = vec![found.clone(); STARTS + 1];
            for ((side, n, _), x) in tasks.iter().zip(new) {
                if let Some(x) = x {
                    sides[1 + side][*n] = x;
                }
            }
            let path = self.best_path(&sides);
            if path == found {
                break;
            }
            found = path;
        }
        (found != frames).then_some(found)
    }

    /// Whether the print of each of `frames` is lost; that of the first is known.
    pub(super) fn prints_lost(&self, frames: &[Positions]) -> Vec<bool> {
        self.texture_misfits(frames).iter().map(|misfit| *misfit > LOST).collect()
    }

    /// What part of the print's contrast is not where the sheet is, by frame; nothing of the first, which is known.
    fn texture_misfits(&self, frames: &[Positions]) -> Vec<f64> {
        let mut finest = self.at_level(self.observed.range[0]);
        finest.fit_anew(&frames.iter().enumerate().skip(1).collect::<Vec<_>>());
        let misfit = |n: usize| if n == 0 { 0.0 } else { finest.misfit(n, &frames[n]).texture };
        (0..frames.len()).into_par_iter().map(misfit).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::super::SpacetimeSettings;
    use super::*;
    use crate::sim::Cloth;
    use crate::synth::{Settings, make};

    /// Mean distance [m].
    fn off(a: &Positions, b: &Positions) -> f64 {
        a.iter().zip(b).map(|(a, b)| a.distance(*b)).sum::<f64>() / a.len() as f64
    }

    #[test]
    fn a_lost_sheet_is_found_again() {
        let settings = Settings {
            frames: 4,
            size: 128,
            grid: [9, 9],
            fps: 50.0,
            wind: 8.0,
            seed: 5,
            ..Settings::default()
        };
        let scene = make(&settings).unwrap();
        let truth: Vec<Positions> = scene.truth.vertices.as_ref().unwrap().iter().cloned().collect();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
        assert!(problem.rematched(&truth).is_none(), "nothing is lost");
        // Turned by 25° and a fifth of the sheet aside.
        let size = scene.template.area().sqrt();
        let turn = DMat3::from_rotation_z(0.44);
        let mut lost = truth.clone();
        let centre = truth[2].iter().sum::<DVec3>() / truth[2].len() as f64;
        lost[2].iter_mut().for_each(|x| *x = centre + turn * (*x - centre) + DVec3::X * (0.2 * size));
        let found = problem.rematched(&lost).expect("found");
        let errors = [&lost, &found].map(|frames| off(&frames[2], &truth[2]) / size);
        println!("off by {errors:?} of the sheet");
        assert!(errors[0] > 0.2 && errors[1] < 0.01);
        assert_eq!([&found[1], &found[3]], [&truth[1], &truth[3]], "frames that are found stay");
    }
}
