//! Sheets with a part folded over: hypotheses that no small step leads to.
//!
//! A part that is turned over lies on the rest, or behind it, about as a mirror image across the line of the fold,
//! and so it can be made of the rest alone, however crumpled it was found: each of its vertices comes to where the
//! sheet is at the mirror image of its place in the flat panel. Lines of all directions and parts of all sizes are
//! tried, to either side; the pictures say which is right.

use std::f64::consts::TAU;

use glam::{DMat2, DVec2, DVec3};
use tessuto_core::parallel;

use super::fuse::Fused;
use super::{Positions, Problem};
use tessuto_sim::panel;

/// Directions of the line, and sizes of the part that is folded over, up to half of the sheet.
const DIRECTIONS: usize = 24;
const SIZES: usize = 16;
/// Angle by which the part is open `[rad]`.
const OPEN: f64 = 0.1;

/// A place in the panel: a vertex, and how far from that it lies `[m]`.
#[derive(Debug, Clone, Copy)]
struct Place {
    vertex: usize,
    offset: DVec2,
}

/// One way to fold the sheet.
struct Fold {
    /// Direction of the line in the panel.
    along: DVec2,
    /// Every vertex of the part that is folded over, the place on the line next to it and its mirror image.
    over: Vec<(usize, [Place; 2])>,
}

/// All ways to fold the sheet that lies like this in the plane, shape `[V]` `[m]`.
fn folds(panel: &[DVec2]) -> Vec<Fold> {
    let ways = (0..DIRECTIONS).flat_map(|k| (1..=SIZES).map(move |size| (k, size)));
    let fold = |(k, size): (usize, usize)| {
        let across = DVec2::from_angle(TAU * k as f64 / DIRECTIONS as f64);
        let heights: Vec<f64> = panel.iter().map(|p| p.dot(across)).collect();
        let [least, most] = [f64::min, f64::max].map(|of| heights.iter().copied().reduce(of).unwrap_or(0.0));
        let line = most - (most - least) * 0.5 * size as f64 / SIZES as f64;
        let rest: Vec<usize> = (0..panel.len()).filter(|v| heights[*v] <= line).collect();
        let place = |p: DVec2| {
            let near = |v: &usize| panel[*v].distance_squared(p);
            let vertex = rest.iter().copied().min_by(|a, b| near(a).total_cmp(&near(b)))?;
            Some(Place { vertex, offset: p - panel[vertex] })
        };
        let over = (0..panel.len()).filter(|v| heights[*v] > line).filter_map(|v| {
            let beyond = across * (heights[v] - line);
            Some((v, [place(panel[v] - beyond)?, place(panel[v] - beyond * 2.0)?]))
        });
        Fold { along: across.perp(), over: over.collect() }
    };
    ways.map(fold).collect()
}

/// How the sheet at `x` lies around every vertex: ∂x/∂p along both axes of the panel, by least squares over its
/// neighbours; zero where these lie on a line.
fn slopes(x: &[DVec3], panel: &[DVec2], adjacency: &[Vec<u32>]) -> Vec<[DVec3; 2]> {
    let of_vertex = |v: usize| {
        let (mut pp, mut xp) = (DMat2::ZERO, [DVec3::ZERO; 2]);
        for &w in &adjacency[v] {
            let (dp, dx) = (panel[w as usize] - panel[v], x[w as usize] - x[v]);
            pp += DMat2::from_cols(dp * dp.x, dp * dp.y);
            xp = [xp[0] + dx * dp.x, xp[1] + dx * dp.y];
        }
        let inverse = pp.inverse();
        if !inverse.is_finite() {
            return [DVec3::ZERO; 2];
        }
        [inverse.x_axis, inverse.y_axis].map(|c| xp[0] * c.x + xp[1] * c.y)
    };
    (0..x.len()).map(of_vertex).collect()
}

impl Fold {
    /// The sheet at `x` folded towards the `eye`, or away from it.
    fn folded(&self, x: &[DVec3], slopes: &[[DVec3; 2]], eye: DVec3, away: bool) -> Positions {
        let mut out = x.to_vec();
        for &(v, places) in &self.over {
            let [line, mirror] = places.map(|p| {
                let [u, v] = slopes[p.vertex];
                x[p.vertex] + u * p.offset.x + v * p.offset.y
            });
            let [u, w] = slopes[places[0].vertex];
            let axis = (u * self.along.x + w * self.along.y).normalize_or_zero();
            let lying = mirror - line;
            let up = axis.cross(lying);
            let side = if (up.dot(eye - line) < 0.0) == away { 1.0 } else { -1.0 };
            out[v] = line + lying * OPEN.cos() + up * (side * OPEN.sin());
        }
        out
    }
}

/// The ways to fold a sheet, towards the camera and away from it.
pub(super) struct Ways {
    panel: Vec<DVec2>,
    folds: Vec<Fold>,
}

impl Problem<'_> {
    /// The ways to fold the sheet; none if its texture coordinates are no flat panel.
    pub(super) fn ways_to_fold(&self) -> Ways {
        let panel: Vec<DVec2> =
            panel(&self.scene.template).into_iter().flatten().map(|p| p.truncate()).collect();
        Ways { folds: folds(&panel), panel }
    }

    /// The sheet at `x` folded in those `count` of the `ways` that the pictures of `frame` speak for most, at the
    /// coarsest level of `refine`.
    pub(super) fn folded(
        &self,
        fused: &Fused,
        ways: &Ways,
        (frame, x): (usize, &Positions),
        count: usize,
    ) -> Vec<Positions> {
        if ways.panel.len() != x.len() {
            return Vec::new();
        }
        let slopes = slopes(x, &ways.panel, &self.adjacency);
        let view = &self.eyes[0].observed.views[frame];
        let eye = x[0] - view.offset(x[0]);
        let level = self.refined_levels()[0];
        let start = || {
            let mut search = self.at_level(level);
            search.asked.clone_from(&fused.asked);
            search.compares = true;
            search.looks.iter_mut().for_each(|look| look.set_ways(&fused.frames));
            search
        };
        let sides = |away| ways.folds.iter().map(move |fold| (fold, away));
        let all: Vec<(&Fold, bool)> = [false, true].into_iter().flat_map(sides).collect();
        let mut tried: Vec<(f64, &Fold, bool)> = parallel::map_with(all.len(), start, |search, k| {
            let (fold, away) = all[k];
            let folded = fold.folded(x, &slopes, eye, away);
            search.fit_anew(&[(frame, &folded)]);
            (search.terms(frame).of_pictures(&folded), fold, away)
        });
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        tried.into_iter().take(count).map(|(_, fold, away)| fold.folded(x, &slopes, eye, away)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::mesh::grid;

    #[test]
    fn a_folded_sheet_keeps_its_lengths_and_lies_on_itself() {
        let mesh = grid(9, 7, DVec2::new(0.4, 0.3), 1.0);
        let flat: Vec<DVec2> = mesh.positions.iter().map(|x| x.truncate()).collect();
        // The sheet as it was cut, seen from aside.
        let turn = glam::DQuat::from_rotation_y(0.4) * glam::DQuat::from_rotation_x(0.3);
        let x: Positions = mesh.positions.iter().map(|x| turn * (*x - DVec3::Z) + DVec3::Z).collect();
        let neighbours = mesh.neighbours();
        let slopes = slopes(&x, &flat, &neighbours);
        let (eye, normal) = (DVec3::ZERO, turn * -DVec3::Z);
        let mut largest = 0;
        for fold in &folds(&flat) {
            let over: Vec<usize> = fold.over.iter().map(|(v, _)| *v).collect();
            largest = largest.max(over.len());
            for away in [false, true] {
                let folded = fold.folded(&x, &slopes, eye, away);
                for v in 0..x.len() {
                    let height = (folded[v] - x[0]).dot(normal) * if away { -1.0 } else { 1.0 };
                    if over.contains(&v) {
                        assert!(height > -1e-12, "on the side that is asked for");
                    } else {
                        assert_eq!(folded[v], x[v]);
                    }
                    for &w in &neighbours[v] {
                        let pair = [v, w as usize];
                        if pair.map(|v| over.contains(&v)) == [true; 2] {
                            let [now, before] = [&folded, &x].map(|x| x[pair[0]].distance(x[pair[1]]));
                            assert!((now - before).abs() < 1e-12);
                        }
                    }
                }
            }
        }
        assert!(2 * largest < x.len() && 3 * largest > x.len(), "up to half of the sheet: {largest}");
    }
}
