//! Whether the sheet lies on something: the plane of a flat template that most of it stays in.
//!
//! A cloth that is spread out on a table, lifted at a side and laid down keeps in the table's plane but for what is
//! lifted, and that is on one side of it. Cloth that hangs or is carried seldom does so. Where scene.json names no
//! plane, such a one is treated as if it were named.

use super::{Positions, Problem};
use glam::DVec3;
use tessuto_core::math::median::median;
use tessuto_core::scene::Plane;

/// A template is flat, and a vertex in its plane, within this part of the sheet's size.
const FLAT: f64 = 0.01;
/// In half of the frames the plane has this part of the vertices at least.
const LYING: f64 = 0.25;
/// In half of the frames no larger part of the vertices is behind it.
const BELOW: f64 = 0.1;

impl Problem<'_> {
    /// The plane that the sheet lies on, by the `frames` whose print is found, the template the first of them; none
    /// if scene.json names one. Its normal points to where the sheet is lifted.
    pub(super) fn lies_on(&self, frames: &[&Positions]) -> Option<Plane> {
        let template = &self.scene.template;
        if !self.scene.known.planes.is_empty() {
            return None;
        }
        let x = &template.positions;
        let area = |t: [u32; 3]| {
            let [a, b, c] = t.map(|v| x[v as usize]);
            (b - a).cross(c - a)
        };
        let normal = template.triangles().into_iter().map(area).sum::<DVec3>().normalize_or_zero();
        let height = x.iter().map(|x| normal.dot(*x)).sum::<f64>() / x.len() as f64;
        let mut plane = Plane { normal, height };
        let within = FLAT * template.area().sqrt();
        let squares: f64 = x.iter().map(|x| plane.above(*x).powi(2)).sum();
        if normal == DVec3::ZERO || (squares / x.len() as f64).sqrt() > within {
            return None;
        }
        // What part of the vertices is in it in every frame, and to either side.
        let parts = |is: &dyn Fn(f64) -> bool| -> Vec<f64> {
            let of =
                |x: &&Positions| x.iter().filter(|x| is(plane.above(**x))).count() as f64 / x.len() as f64;
            frames.iter().skip(1).map(of).collect()
        };
        let lying = median(parts(&|h| h.abs() <= within))?;
        let mut sides = [parts(&|h| h > within), parts(&|h| h < -within)];
        let [above, below] = sides.each_ref().map(|parts| parts.iter().sum::<f64>());
        if below > above {
            plane = Plane { normal: -normal, height: -height };
            sides.swap(0, 1);
        }
        let [_, below_it] = sides;
        // Of what hardly moves nothing tells on which side it would be lifted.
        (above != below && lying >= LYING && median(below_it)? <= BELOW).then_some(plane)
    }
}

#[cfg(test)]
mod tests {
    use super::super::SpacetimeSettings;
    use super::super::deviation::tests::still;
    use super::*;
    use tessuto_sim::Cloth;

    /// What is found in frames in which the part of the sheet right of the middle is at `lifted(frame)` times its
    /// distance from there above the plane of the template, which is bent by `bent` of its size.
    fn found(lifted: impl Fn(usize) -> f64, bent: f64) -> Option<Plane> {
        let mut scene = still();
        let size = scene.template.area().sqrt();
        let middle =
            scene.template.positions.iter().map(|x| x.x).sum::<f64>() / scene.template.positions.len() as f64;
        scene.template.positions.iter_mut().for_each(|x| x.z += bent * size * (20.0 * x.x / size).sin());
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
        let at = |n: usize| -> Positions {
            let lift = |x: &DVec3| *x - DVec3::Z * (lifted(n) * (x.x - middle).max(0.0));
            scene.template.positions.iter().map(lift).collect()
        };
        problem.lies_on(&(0..4).map(at).collect::<Vec<_>>().iter().collect::<Vec<_>>())
    }

    #[test]
    fn a_sheet_of_which_one_side_is_lifted_lies_on_a_plane() {
        for side in [1.0, -1.0] {
            let plane = found(|n| side * 0.3 * n as f64, 0.0).expect("it lies on a table");
            assert!(
                (plane.normal - DVec3::NEG_Z * side).length() < 1e-9,
                "to the side that is lifted: {plane:?}"
            );
            let first = still().template.positions;
            assert!(first.iter().all(|x| plane.above(*x).abs() < 1e-9));
        }
    }

    #[test]
    fn nothing_is_below_a_plane_that_was_found() {
        let scene = still();
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
        let below: Positions = scene.template.positions.iter().map(|x| *x + DVec3::Z * 0.01).collect();
        let mut search = problem.at_level(0);
        let mut cost = |plane: Option<Plane>| {
            search.asked.plane = plane;
            let terms = search.terms(1);
            let planes = terms.list().into_iter().find(|term| term.name() == "planes").unwrap();
            planes.value(&below)
        };
        assert_eq!(cost(None), 0.0);
        let found = cost(found(|n| 0.3 * n as f64, 0.0));
        // Ten spreads of a millimetre, of every vertex.
        assert!((found / (50.0 * below.len() as f64) - 1.0).abs() < 1e-6, "{found}");
    }

    #[test]
    fn what_swings_or_rests_or_was_never_flat_lies_on_nothing() {
        assert_eq!(found(|n| [0.0, 0.3, -0.3, 0.0][n], 0.0), None, "swings");
        assert_eq!(found(|_| 0.0, 0.0), None, "at rest");
        assert_eq!(found(|n| 0.3 * n as f64, 0.03), None, "in folds");
        let mut named = still();
        named.known.planes = vec![Plane { normal: DVec3::NEG_Z, height: -1.0 }];
        let cloth = Cloth::new(&named.template);
        let problem = Problem::new(&named, &cloth, SpacetimeSettings::default()).unwrap();
        assert_eq!(problem.lies_on(&[&named.template.positions; 4]), None, "scene.json tells");
    }
}
