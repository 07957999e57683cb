//! Positions again, given the motion that their causes make.

use super::joint::{Joint, POLICY};
use super::{Positions, Problem};

impl Problem<'_> {
    /// Lowers E over all `frames` at the finest level, where accelerations are expected to be those of the motion `made`, shape [N, V] `[m]`,
    /// instead of none.
    pub fn along(&self, mut frames: Vec<Positions>, made: &[Positions]) -> Vec<Positions> {
        let mut search = self.at_level(self.observed.range[0]);
        search.still = self.still_vertices(&frames);
        search.asked = self.asked(&frames);
        search.expect(made);
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
    use tessuto_sim::Cloth;

    #[test]
    fn accelerations_come_closer_to_the_expected_ones_the_surer_these_are() {
        let scene = scene();
        let cloth = Cloth::new(&scene.template);
        let x = &scene.template.positions;
        let start = vec![x.clone(); scene.frames.len()];
        let swing = |n: usize| x.iter().map(|p| *p + DVec3::Z * (1e-3 * (n * n) as f64)).collect();
        let made: Vec<Positions> = (0..scene.frames.len()).map(swing).collect();
        let off = |acceleration_along: f64| {
            let settings = SpacetimeSettings { acceleration_along, ..SpacetimeSettings::default() };
            let problem = Problem::new(&scene, &cloth, settings).unwrap();
            let found = problem.along(start.clone(), &made);
            let apart = |(a, b): (&Positions, &Positions)| a.iter().zip(b).map(|(a, b)| *a - *b).collect();
            let departure: Vec<Positions> = found.iter().zip(&made).map(apart).collect();
            (value(&departure, 1.0) / value(&made, 1.0)).sqrt()
        };
        let [firm, usual, weak] = [1e-3, 2.0, 1e3].map(off);
        println!("off by {firm:.1e}, {usual:.2}, {weak:.2} of them");
        assert!(firm < 0.01 && firm < usual && usual < weak, "{firm} {usual} {weak}");
    }
}
