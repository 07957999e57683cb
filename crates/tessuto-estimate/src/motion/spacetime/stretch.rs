//! Frames that are lost on the way and found again later.
//!
//! A part of a sheet that is quickly turned over leaves the way that a follower expects, and is crumpled from there on
//! until it comes back. Two proposals mend that:
//!
//! - The frames after it are right, once all are refined, and lead back into the stretch more surely than those before
//!   it led there, for they begin with the part where it lies. Followers that start from the end of the clip (`again`)
//!   are off again by the time they come there.
//! - A part of the sheet is folded over (`fold`), and followed from there to both ends of the stretch.

use tessuto_core::parallel;

use super::fuse::Fused;
use super::track::{Follower, Start};
use super::{LevelSearch, Positions, Problem};
use tessuto_core::math::factor::Scratch;

/// A stretch ends where the pictures of a frame cost at most this part of what those of its worst frame do.
const ENDS: f64 = 0.5;
/// Ways to fold that are fitted, of those that the pictures speak for most, in every frame that is tried.
const FITTED: usize = 3;

/// What is proposed for the worst stretch.
#[derive(Debug, Clone, Copy)]
pub(super) enum Mending {
    /// It is followed from the frame after it.
    Back(Start),
    /// A part of the sheet is folded over.
    Fold,
}

/// All of them, in the order in which they are tried.
pub(super) const MENDINGS: [Mending; 3] =
    [Mending::Back(Start::Strict), Mending::Back(Start::Loose), Mending::Fold];

/// Frames around the one whose pictures cost most, and the first ones before and after it whose pictures cost little.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Stretch {
    before: usize,
    worst: usize,
    after: usize,
}

impl Stretch {
    /// By the `costs` of all frames; `None` if one side has no frame that costs little.
    fn of(costs: &[f64]) -> Option<Self> {
        let worst = (0..costs.len()).max_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
        let ends = |n: &usize| costs[*n] <= ENDS * costs[worst];
        let (before, after) = ((0..worst).rev().find(ends)?, (worst + 1..costs.len()).find(ends)?);
        Some(Self { before, worst, after })
    }

    /// Frames in which a fold is looked for, each with the frame outside of the stretch that it is nearer to: the
    /// middles between the worst one and both ends, and that itself.
    fn places(&self) -> [[usize; 2]; 4] {
        let Self { before, worst, after } = *self;
        [
            [before.midpoint(worst).max(before + 1), before],
            [worst, before],
            [worst, after],
            [worst.midpoint(after), after],
        ]
    }
}

impl Problem<'_> {
    /// The present motion with its worst stretch mended; `None` if no stretch is much worse than what is around it, or
    /// nothing better is found there.
    pub(super) fn mended(&self, fused: &Fused, mending: Mending) -> Option<Vec<Positions>> {
        let stretch = Stretch::of(&self.costs_of_frames(fused))?;
        let Stretch { before, after, .. } = stretch;
        let mut motion = fused.frames.clone();
        match mending {
            Mending::Back(start) => {
                // It comes from the frame beyond, which says how fast it moves.
                let beyond = (after + 1).min(motion.len() - 1);
                self.follow_on(fused, start, &mut motion, [beyond, after], before)?;
            }
            Mending::Fold => {
                let (at, folded) = self.fold_in(fused, stretch)?;
                motion[at] = folded;
                self.follow_on(fused, Start::Strict, &mut motion, [at, at], before)?;
                self.follow_on(fused, Start::Strict, &mut motion, [at, at], after)?;
            }
        }
        Some(motion)
    }

    /// Follows the sheet from where `motion` has it in the frame `from`, to which it comes from `beyond`, until the
    /// frame `to`, which stays; `None` if its objective is no longer finite.
    fn follow_on(
        &self,
        fused: &Fused,
        start: Start,
        motion: &mut [Positions],
        [beyond, from]: [usize; 2],
        to: usize,
    ) -> Option<()> {
        let mut levels = self.levels_for(fused, start);
        let mut follower = Follower::at(from, motion, &mut levels);
        follower.frames.insert(0, motion[beyond].clone());
        let frame_at = |k: usize| match k {
            0 => beyond,
            _ if to < from => from + 1 - k,
            _ => from + k - 1,
        };
        for k in 2..=from.abs_diff(to) {
            follower.follow(k, frame_at, &mut levels);
            if follower.lost.is_some() {
                return None;
            }
            motion[frame_at(k)].clone_from(&follower.frames[k]);
        }
        Some(())
    }

    fn levels_for(&self, fused: &Fused, start: Start) -> Vec<LevelSearch<'_, '_>> {
        let inform = |level: &mut LevelSearch| level.asked.clone_from(&fused.asked);
        self.levels(inform, |left| start.loosened(&self.settings, left))
    }

    /// The frame of the stretch in which E falls most if a part of the sheet is folded over, with its positions;
    /// `None` if it falls in none.
    fn fold_in(&self, fused: &Fused, stretch: Stretch) -> Option<(usize, Positions)> {
        let ways = self.ways_to_fold();
        let of_place = |[frame, base]: [usize; 2]| {
            let folded = self.folded(fused, &ways, (frame, &fused.frames[base]), FITTED);
            folded.into_iter().map(move |x| (frame, x))
        };
        let tried: Vec<_> = stretch.places().into_iter().flat_map(of_place).collect();
        let start = || {
            let mut finest = self.search(fused);
            finest.compares = true;
            (self.levels_for(fused, Start::Strict), finest, Scratch::default())
        };
        // The coarser levels that only tracking uses show too little of a part.
        let coarser = self.level_count() - self.refined_levels().len();
        let fitted: Vec<(f64, Positions)> =
            parallel::map_with(tried.len(), start, |(levels, finest, scratch), k| {
                let (frame, folded) = &tried[k];
                let mut x = folded.clone();
                for level in &mut levels[coarser..] {
                    let from = x.clone();
                    x = level.fit_frame(*frame, x, &from, 1.0, scratch).0;
                }
                let mut value = |x: &Positions| {
                    finest.fit_anew(&[(*frame, x)]);
                    finest.terms(*frame).value(x)
                };
                (value(&x) - value(&fused.frames[*frame]), x)
            });
        let (k, (change, x)) = fitted.into_iter().enumerate().min_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
        (change < 0.0).then(|| (tried[k].0, x))
    }

    /// What the pictures of every frame cost, shape `[N]`; nothing of the first, which is known.
    fn costs_of_frames(&self, fused: &Fused) -> Vec<f64> {
        let frames = &fused.frames;
        let mut search = self.search(fused);
        search.compares = true;
        search.looks.iter_mut().for_each(|look| look.set_ways(frames));
        search.fit_anew(&frames.iter().enumerate().skip(1).collect::<Vec<_>>());
        let of_frame = |n: usize| if n == 0 { 0.0 } else { search.terms(n).of_pictures(&frames[n]) };
        parallel::map(frames.len(), of_frame)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::deviation::tests::{at_the_finest_level, still};
    use super::super::{SpacetimeSettings, apart};
    use super::*;
    use tessuto_core::scene::Scene;
    use tessuto_sim::Cloth;

    /// How far vertices are off in the worst frame, root mean square, after `mending` a motion that has `shapes` in
    /// frames 1, 2 and 3 `[m]`.
    fn off(scene: &Scene, mending: Mending, right: &[Positions], shapes: [&Positions; 3]) -> Option<f64> {
        let cloth = Cloth::new(&scene.template);
        let settings = SpacetimeSettings { resolution: 160.0, ..at_the_finest_level() };
        let problem = Problem::new(scene, &cloth, settings).unwrap();
        let mut frames = vec![scene.template.positions.clone()];
        frames.extend(shapes.into_iter().cloned());
        let mended = problem.mended(&Fused::of(frames), mending)?;
        Some(mended.iter().zip(right).map(|(a, b)| apart(a, b)).fold(0.0, f64::max))
    }

    #[test]
    fn a_lost_frame_is_found_from_the_one_after_it() {
        let scene = still();
        let right = &scene.template.positions;
        let aside: Positions = right.iter().map(|x| *x + DVec3::new(0.02, 0.01, 0.0)).collect();
        let all = vec![right.clone(); 4];
        for start in [Start::Strict, Start::Loose] {
            let off = off(&scene, Mending::Back(start), &all, [right, &aside, right]).unwrap();
            println!("{off} m off, {} before", aside[0].distance(right[0]));
            assert!(off < 0.05 * aside[0].distance(right[0]));
        }
        // Nothing is mended where all is right, or where it is lost to the end.
        assert_eq!(off(&scene, Mending::Back(Start::Strict), &all, [right, &aside, &aside]), None);
    }

    #[test]
    fn a_part_that_is_turned_over_is_found() {
        let mut scene = still();
        // The right third of the sheet lies on the rest in the third frame, and shows the same print.
        let line = 57.5;
        let mut frames: Vec<_> = (0..4).map(|n| scene.frames.frame(n).unwrap().into_owned()).collect();
        let width = frames[0].rgb.width;
        // A print that does not repeat.
        for frame in &mut frames {
            for (k, rgb) in frame.rgb.data.chunks_mut(3).enumerate() {
                let (x, y) = ((k % width) as f32, (k / width) as f32);
                rgb[0] += 0.2 * (0.17 * x + 0.11 * y).sin();
                rgb[2] += 0.2 * (0.08 * x - 0.06 * y).cos();
            }
        }
        let (flat, turned) = (frames[0].clone(), &mut frames[2]);
        for (k, inside) in turned.mask.data.iter_mut().enumerate() {
            let (x, y) = (k % width, k / width);
            let from = (2.0 * line - x as f64) as usize;
            if x as f64 > line {
                *inside = 0.0;
            } else if from < 78 {
                for c in 0..3 {
                    turned.rgb.data[3 * k + c] = flat.rgb.data[3 * (y * width + from) + c];
                }
            }
        }
        scene.frames = frames.into();
        let open = &scene.template.positions;
        let folded: Positions = open
            .iter()
            .map(|x| match (line - 47.5) / 300.0 {
                at if x.x > at => DVec3::new(2.0 * at - x.x, x.y, x.z),
                _ => *x,
            })
            .collect();
        let right = vec![open.clone(), open.clone(), folded.clone(), open.clone()];
        let before = apart(open, &folded);
        let off = off(&scene, Mending::Fold, &right, [open, open, open]).unwrap();
        println!("{off} m off, {before} before");
        assert!(off < 0.1 * before);
    }

    #[test]
    fn a_stretch_lies_between_frames_that_cost_little() {
        let costs = [0.0, 3.0, 4.0, 9.0, 12.0, 10.0, 7.0, 5.0, 4.0];
        let stretch = Stretch::of(&costs).unwrap();
        assert_eq!(stretch, Stretch { before: 2, worst: 4, after: 7 });
        assert_eq!(stretch.places(), [[3, 2], [4, 2], [4, 7], [5, 7]]);
        assert_eq!(Stretch::of(&[0.0, 3.0, 2.0, 1.0]), Some(Stretch { before: 0, worst: 1, after: 3 }));
        assert_eq!(Stretch::of(&costs[..6]), None, "it lasts to the end of the clip");
        assert_eq!(Stretch::of(&[0.0, 3.0, 4.0, 3.0]), None, "no frame is much worse");
        assert_eq!(Stretch::of(&[]), None);
    }
}
