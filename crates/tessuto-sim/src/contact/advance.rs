//! How far two elements may go along a step before their gap is nearly gone: conservative advancement.
//!
//! No two points of them come nearer to each other than by the sum of the fastest points' ways. The elements go on by
//! as much as their gap surely allows, again and again, until a part of it is left (Li et al. 2021, "Codimensional
//! Incremental Potential Contact", additive continuous collision detection).

use super::closest::Corners;
use super::pair::{Kind, Pair};

/// What is left of the gap where they are stopped, at least.
const LEFT: f64 = 0.1;
/// Part of what surely is free that they go on by.
const SURELY: f64 = 0.9;
/// Elements that have not met after so many advances are stopped where they are: nowhere wrong, only early.
const LIMIT: usize = 1000;

/// The part of the way `step` `[m]` from `x` that keeps the gap above [`LEFT`] of what it is; 1: all of it.
pub fn advance(pair: &Pair, x: &Corners, step: &Corners) -> f64 {
    let speed = match pair.kind {
        Kind::Plane(normal, _) => (-normal.dot(step[0])).max(0.0),
        Kind::PointTriangle => fastest(step, 1),
        Kind::EdgeEdge(_) => fastest(step, 2),
    };
    if SURELY * pair.gap_at_least(x) >= speed {
        return 1.0;
    }
    let start = pair.gap_size(x);
    if SURELY * start >= speed {
        return 1.0;
    }
    let (mut gone, mut gap) = (0.0, start);
    for _ in 0..LIMIT {
        // A plane's gap is linear: this is where LEFT of it remains.
        let next = (SURELY * gap / speed).min(1.0 - gone);
        let at = [0, 1, 2, 3].map(|k| x[k] + step[k] * (gone + next));
        gap = pair.gap_size(&at);
        if gap < LEFT * start * SURELY {
            break;
        }
        gone += next;
        if gone >= 1.0 {
            return 1.0;
        }
        if matches!(pair.kind, Kind::Plane(..)) {
            break;
        }
    }
    gone
}

/// The most that two points can come nearer to each other in the step, the first side having `count` corners.
fn fastest(step: &Corners, count: usize) -> f64 {
    // What all have in common brings nothing nearer.
    let common = step.iter().copied().sum::<glam::DVec3>() / 4.0;
    let side = |side: &[glam::DVec3]| side.iter().map(|s| (*s - common).length()).fold(0.0, f64::max);
    let (first, second) = step.split_at(count);
    side(first) + side(second)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn no_pair_passes_through_and_none_is_stopped_far_from_the_other() {
        let mut rng = Rng::new(5, 0);
        let kinds = [Kind::PointTriangle, Kind::EdgeEdge(1e-3), Kind::Plane(DVec3::Z, -1.0)];
        let (mut stopped, mut whole, mut near) = (0, 0, 0);
        for k in 0..3000 {
            let pair = Pair { nodes: [0, 1, 2, 3], kind: kinds[k % 3], area: 1.0, offset: 0.01, surface: 0 };
            let x = [0; 4].map(|_| rng.vector());
            let step = [0; 4].map(|_| rng.vector() * 2.0);
            let start = pair.gap_size(&x);
            if start < 1e-3 {
                continue;
            }
            let part = advance(&pair, &x, &step);
            let at = |s: f64| [0, 1, 2, 3].map(|k| x[k] + step[k] * s);
            let least =
                (0..=400).map(|i| pair.gap_size(&at(part * f64::from(i) / 400.0))).fold(f64::MAX, f64::min);
            assert!(least > 0.05 * start, "{least} of {start} m left");
            if part < 1.0 {
                stopped += 1;
                // As far as it goes, about a tenth of the gap or less is what stands between them.
                near += usize::from(pair.gap_size(&at(part)) < 0.5 * start);
            } else {
                whole += 1;
            }
        }
        println!("{stopped} stopped, {near} of them near the other; {whole} went all the way");
        assert!(stopped > 100 && whole > 100 && near == stopped);
    }
}
