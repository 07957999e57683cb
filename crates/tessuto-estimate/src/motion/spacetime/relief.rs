//! Motions with the other relief.
//!
//! A dent and a bulge look alike: a part of a sheet that is reflected along the view rays stays where it is in the
//! image, keeps its lengths nearly, and differs by shading and perspective alone. Which of the two is found depends
//! on the first hint, and no small step leads from one to the other. So both are tried
//! ([`fuse`](super::Problem::fuse)).

use super::{Positions, Problem};

/// Reliefs that are reflected: what is finer than this part of the sheet's size.
pub(super) const RELIEFS: [f64; 2] = [0.4, 0.2];

impl Problem<'_> {
    /// `frames` with what is finer than `part` of the sheet's size reflected along the view rays, but for the first,
    /// which is known.
    pub(super) fn reflected(&self, frames: &[Positions], part: f64) -> Vec<Positions> {
        let mut out = frames.to_vec();
        for (x, view) in out.iter_mut().zip(&self.eyes[0].observed.views).skip(1) {
            let distances: Vec<f64> = x.iter().map(|x| view.offset(*x).length()).collect();
            let smooth = self.smoothed(distances.clone(), part);
            for (x, (distance, smooth)) in x.iter_mut().zip(distances.iter().zip(smooth)) {
                *x -= view.direction(*x) * (2.0 * (distance - smooth));
            }
        }
        out
    }

    /// `values` of the vertices, averaged with those of their neighbours until they are smooth over this `part` of
    /// the sheet's size.
    pub(super) fn smoothed(&self, mut values: Vec<f64>, part: f64) -> Vec<f64> {
        let edges = &self.cloth.edges;
        let edge = edges.iter().map(|edge| edge.rest_length).sum::<f64>() / edges.len() as f64;
        let rounds = (part * self.scene.template.area().sqrt() / edge).powi(2).ceil() as usize;
        let mut next = values.clone();
        for _ in 0..rounds {
            for (next, (own, around)) in next.iter_mut().zip(values.iter().zip(&self.adjacency)) {
                let sum: f64 = around.iter().map(|v| values[*v as usize]).sum();
                *next = if around.is_empty() { *own } else { 0.5 * (own + sum / around.len() as f64) };
            }
            std::mem::swap(&mut values, &mut next);
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::SpacetimeSettings;
    use super::super::proof::scene;
    use super::*;
    use tessuto_sim::Cloth;

    #[test]
    fn a_bulge_becomes_a_dent_of_the_same_image() {
        let scene = scene();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
        let template = &scene.template.positions;
        // One vertex in the middle nearer, the whole sheet farther.
        let (middle, _) = template
            .iter()
            .enumerate()
            .min_by(|(_, a), (_, b)| a.truncate().length().total_cmp(&b.truncate().length()))
            .unwrap();
        let mut bulge: Positions = template.iter().map(|x| *x * 1.01).collect();
        let around = bulge.clone();
        bulge[middle] *= 0.99;
        let frames = vec![template.clone(), bulge.clone(), bulge.clone()];
        let reflected = problem.reflected(&frames, 0.4);
        assert_eq!(reflected[0], *template);
        for n in 1..3 {
            let view = &problem.eyes[0].observed.views[n];
            for (a, b) in reflected[n].iter().zip(&bulge) {
                assert!((view.project(*a) - view.project(*b)).length() < 1e-9);
            }
            let nearer = |x: &[DVec3]| around[middle].z - x[middle].z;
            println!("nearer by {} before, {} after", nearer(&bulge), nearer(&reflected[n]));
            assert!(nearer(&reflected[n]) < -0.5 * nearer(&bulge));
        }
        // What is finer than nothing is nothing.
        let same = problem.smoothed(vec![1.0, 2.0], 0.0);
        assert_eq!(same, [1.0, 2.0]);
    }
}
