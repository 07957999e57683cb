//! Positions again, given the motion that their causes make.

use super::joint::{Joint, POLICY};
use super::{Positions, Problem};

impl Problem<'_> {
    /// Lowers E over all `frames` at the finest level, where accelerations are expected to be those of the motion
    /// `made`, shape [N, V] `[m]`, instead of none. How far causes explain a motion differs from clip to clip: the
    /// motion that was found gives the spread about those expected, as it gives the spread about none.
    pub fn along(&self, mut frames: Vec<Positions>, made: &[Positions]) -> Vec<Positions> {
        let mut search = self.at_level(0);
        search.still = self.still_vertices(&frames);
        search.asked = self.asked(&frames);
        search.expect(&frames, made);
        POLICY.minimise(&mut Joint::new(&mut search), &mut frames, self.settings.iterations_along);
        frames
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::acceleration::value;
    use super::super::proof::scene;
    use super::*;
    use crate::motion::spacetime::SpacetimeSettings;
    use tessuto_core::scene::Scene;
    use tessuto_sim::Cloth;

    #[test]
    fn accelerations_come_closer_to_the_expected_ones_the_nearer_these_are() {
        // Measured depth would say how it moves.
        let scene = Scene { depths: None, ..scene() };
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
        let x = &scene.template.positions;
        let start = vec![x.clone(); scene.frames.len()];
        // The rest of the departure from a swing of accelerations of that many m/s².
        let left = |size: f64| {
            let step = 0.5 * size / scene.fps.powi(2);
            let swing = |n: usize| x.iter().map(|p| *p + DVec3::Z * (step * (n * n) as f64)).collect();
            let made: Vec<Positions> = (0..scene.frames.len()).map(swing).collect();
            let found = problem.along(start.clone(), &made);
            let apart = |(a, b): (&Positions, &Positions)| a.iter().zip(b).map(|(a, b)| *a - *b).collect();
            let departure: Vec<Positions> = found.iter().zip(&made).map(apart).collect();
            (value(&departure, 1.0) / value(&made, 1.0)).sqrt()
        };
        let [near, far] = [10.0, 100.0].map(left);
        println!("off by {near:.2}, {far:.2} of them");
        assert!(near < 0.5 && near < 0.6 * far, "{near} {far}");
    }
}
