//! Where hands hold the cloth.
//!
//! Held vertices are stretches of the border, the grips, three vertices each. Beside what [`super::held`] guesses, places to either side are
//! tried: cloth that is simulated from the wrong grip leaves the found positions within tenths of a second. All grips are tried at their
//! next places at once, what is near a grip decides about it, and it goes from the guess as far as the misfit falls without a rise:
//! with causes that are not known well yet the lowest place of all may be a wrong one.

use glam::DVec3;
use rayon::prelude::*;

use super::drive::Drive;
use super::forces::Causes;
use super::held::border_loop;
use crate::mesh::{Mesh, Positions};

/// Time that is simulated for a try `[s]`, and least number of frames.
const TIME: f64 = 0.4;
const FRAMES: usize = 8;
/// Vertices that a hand holds beside its middle.
const BESIDE: isize = 1;
/// Places are this fraction of the border apart, so many to either side of the guess.
const STRIDE: f64 = 1.0 / 96.0;
const PLACES: isize = 8;

/// A stretch of the border: number of its first vertex along the loop, and of vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Grip {
    first: isize,
    count: isize,
}

impl Grip {
    /// About the middle of this one, moved by `way` vertices.
    fn about(self, way: isize) -> Self {
        Self { first: self.first + self.count / 2 + way - BESIDE, count: 2 * BESIDE + 1 }
    }
}

/// What hands hold about the vertices of `guess`, in ascending order.
pub fn about(template: &Mesh, guess: &[usize]) -> Vec<usize> {
    let border = border_loop(template);
    let grips: Vec<Grip> = grips_of(&border, guess).into_iter().map(|g| g.about(0)).collect();
    // Nothing of the guess is on the border: a closed mesh, or a hole in one.
    if grips.is_empty() { guess.to_vec() } else { held_by(&border, &grips) }
}

/// What a drive needs beside the grips.
pub struct Tries<'a> {
    /// The drive, with the ties of cloth that nothing holds.
    pub drive: &'a Drive<'a>,
    /// Strength of the ties of held vertices [1/s²].
    pub hold: f64,
    /// The found positions, shape [N, V] `[m]`.
    pub found: &'a [Positions],
    /// What acts on the cloth, as far as it is known.
    pub causes: &'a Causes,
    /// Time between frames `[s]`.
    pub interval: f64,
}

impl Tries<'_> {
    /// Where hands hold the cloth, about the vertices of `guess` or away from these as long as the misfit falls; vertices in ascending order.
    pub fn best(&self, template: &Mesh, guess: &[usize]) -> Vec<usize> {
        let border = border_loop(template);
        let grips = grips_of(&border, guess);
        if grips.is_empty() {
            return guess.to_vec();
        }
        let zones = zones(template, &border, &grips);
        let stride = ((border.len() as f64 * STRIDE).round() as isize).max(1);
        let at = |place: usize| (place as isize - PLACES) * stride;
        let tried: Vec<Option<Vec<f64>>> = (0..=2 * PLACES as usize)
            .into_par_iter()
            .map(|place| {
                let moved: Vec<Grip> = grips.iter().map(|g| g.about(at(place))).collect();
                self.misfit(&border, &moved, &zones)
            })
            .collect();
        let descend = |g: usize| {
            let misfit =
                |place: usize| tried.get(place).and_then(Option::as_ref).map_or(f64::INFINITY, |m| m[g]);
            let mut place = PLACES as usize;
            loop {
                let lower = if misfit(place - 1) < misfit(place + 1) { place - 1 } else { place + 1 };
                if misfit(lower) >= misfit(place) || lower == 0 {
                    return grips[g].about(at(place));
                }
                place = lower;
            }
        };
        held_by(&border, &(0..grips.len()).map(descend).collect::<Vec<_>>())
    }

    /// Sum of the squared distances of the vertices of each zone when `grips` hold the cloth; `None` if that cannot be simulated.
    fn misfit(&self, border: &[usize], grips: &[Grip], zones: &[usize]) -> Option<Vec<f64>> {
        let frames = ((TIME / self.interval).ceil() as usize).max(FRAMES);
        let steps = (frames * self.drive.substeps).min(self.drive.targets.len() - 1);
        let mut ties = self.drive.ties.clone();
        held_by(border, grips).into_iter().for_each(|v| ties[v] = self.hold);
        let drive = Drive { targets: &self.drive.targets[..=steps], ties, ..*self.drive };
        let simulated = drive.run(self.causes, false).ok()?.frames;
        let mut out = vec![0.0; grips.len()];
        for (x, found) in simulated.iter().zip(self.found) {
            x.iter().zip(found).zip(zones).for_each(|((a, b), zone)| out[*zone] += a.distance_squared(*b));
        }
        out.iter().all(|m| m.is_finite()).then_some(out)
    }
}

/// The stretches of the loop `border` that `held` vertices are.
fn grips_of(border: &[usize], held: &[usize]) -> Vec<Grip> {
    let is_held: Vec<bool> = border.iter().map(|v| held.contains(v)).collect();
    let n = border.len();
    let starts = (0..n).filter(|k| is_held[*k] && !is_held[(*k + n - 1) % n]);
    starts
        .map(|k| {
            let count = (0..n).take_while(|j| is_held[(k + j) % n]).count();
            Grip { first: k as isize, count: count as isize }
        })
        .collect()
}

fn held_by(border: &[usize], grips: &[Grip]) -> Vec<usize> {
    let n = border.len() as isize;
    let at = |g: &Grip| {
        let first = g.first;
        (0..g.count.min(n)).map(move |k| border[(first + k).rem_euclid(n) as usize])
    };
    let mut out: Vec<usize> = grips.iter().flat_map(at).collect();
    out.sort_unstable();
    out.dedup();
    out
}

/// The nearest grip of every vertex.
fn zones(template: &Mesh, border: &[usize], grips: &[Grip]) -> Vec<usize> {
    let x: &Positions = &template.positions;
    let n = border.len() as isize;
    let middle = |g: &Grip| x[border[(g.first + g.count / 2).rem_euclid(n) as usize]];
    let middles: Vec<DVec3> = grips.iter().map(middle).collect();
    let nearest = |p: &DVec3| {
        let by = |a: &usize, b: &usize| {
            p.distance_squared(middles[*a]).total_cmp(&p.distance_squared(middles[*b]))
        };
        (0..middles.len()).min_by(by).unwrap_or(0)
    };
    x.iter().map(nearest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::grid;
    use glam::DVec2;

    #[test]
    fn grips_are_stretches_of_the_border() {
        let mesh = grid(5, 4, DVec2::splat(0.4), 1.0);
        let border = border_loop(&mesh);
        assert_eq!(border.len(), 14);
        let held = [0, 1, 4, 5, 9];
        let grips = grips_of(&border, &held);
        assert_eq!(grips.len(), 2);
        assert_eq!(held_by(&border, &grips), held);
        assert_eq!(about(&mesh, &[0]), [0, 1, 5]);
        assert_eq!(about(&mesh, &[7]), [7], "within the sheet there is no grip to widen");
        assert_eq!(about(&mesh, &held).len(), 6);
        let zones = zones(&mesh, &border, &grips);
        assert_ne!(zones[0], zones[4]);
        assert!(grips_of(&border, &[]).is_empty());
    }
}
