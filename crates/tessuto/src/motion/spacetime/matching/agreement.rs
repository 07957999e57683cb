//! Which matches are right: those that agree with their neighbours on the sheet.
//!
//! Points next to each other on the sheet stay next to each other in the image: their distance may shrink and turn, but what lies between them
//! moves by little more or less than both. Wrong matches lie anywhere, and each of a patch's neighbours votes against them.

use glam::DVec2;

/// Neighbours on the sheet that vote on a match.
const NEIGHBOURS: usize = 8;
/// Two matches agree if what they moved by differs by no more than this part of their distance, and so many pixels.
const STRETCH: f64 = 0.6;
const SLACK: f64 = 1.0;
/// A match stays while so large a share of its neighbours that stayed so far agrees with it, from pass to pass: the worst go first.
const MAJORITIES: [f64; 5] = [0.2, 0.3, 0.4, 0.5, 0.5];
/// And at least so many.
const LEAST_VOTES: usize = 2;

/// Whether each of `movements` `[px]` of points at `points` `[px]` agrees with those around it; those without any do not count.
pub(super) fn agreeing(points: &[DVec2], movements: &[Option<DVec2>]) -> Vec<bool> {
    let mut kept: Vec<bool> = movements.iter().map(Option::is_some).collect();
    let around: Vec<Vec<usize>> = (0..points.len())
        .map(|i| {
            let mut others: Vec<usize> = (0..points.len()).filter(|&j| j != i && kept[j]).collect();
            others.sort_by(|a, b| {
                points[*a].distance_squared(points[i]).total_cmp(&points[*b].distance_squared(points[i]))
            });
            others.truncate(NEIGHBOURS);
            others
        })
        .collect();
    let agree = |i: usize, j: usize| match (movements[i], movements[j]) {
        (Some(a), Some(b)) => a.distance(b) <= STRETCH * points[i].distance(points[j]) + SLACK,
        _ => false,
    };
    // Those that are left out no longer vote.
    for majority in MAJORITIES {
        let stays = |i: &usize| {
            let voters = || around[*i].iter().filter(|&&j| kept[j]);
            let votes = voters().filter(|&&j| agree(*i, j)).count();
            votes >= LEAST_VOTES && votes as f64 >= majority * voters().count() as f64
        };
        kept = (0..points.len()).map(|i| kept[i] && stays(&i)).collect();
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Rng;

    #[test]
    fn right_matches_stay_and_wrong_ones_go() {
        let mut rng = Rng::new(3, 0);
        let points: Vec<DVec2> =
            (0..144).map(|k| DVec2::new((k % 12) as f64, (k / 12) as f64) * 5.0).collect();
        // A turn by 20° that shrinks the sheet, and a third of the matches anywhere.
        let turn = DVec2::from_angle(0.35) * 0.8;
        let right: Vec<DVec2> =
            points.iter().map(|p| turn.rotate(*p) - *p + DVec2::new(30.0, -12.0)).collect();
        let wrong: Vec<bool> = points.iter().map(|_| rng.uniform() < 0.33).collect();
        let movements: Vec<Option<DVec2>> = (right.iter().zip(&wrong))
            .map(|(m, wrong)| Some(if *wrong { DVec2::new(rng.signed(), rng.signed()) * 40.0 } else { *m }))
            .collect();
        let kept = agreeing(&points, &movements);
        let count = |wanted: bool| {
            let both = kept.iter().zip(&wrong).filter(|(kept, wrong)| **kept && **wrong == wanted);
            (both.count(), wrong.iter().filter(|w| **w == wanted).count())
        };
        let ((bad, all_bad), (good, all_good)) = (count(true), count(false));
        println!("{good} of {all_good} right ones kept, {bad} of {all_bad} wrong ones");
        assert!(good as f64 > 0.8 * all_good as f64);
        assert!((bad as f64) < 0.1 * all_bad as f64);
        assert!(agreeing(&points[..3], &[None, Some(DVec2::ZERO), None]).iter().all(|kept| !kept));
    }
}
