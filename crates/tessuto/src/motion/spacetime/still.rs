//! Which vertices stand still: an edge that is fixed does not move in the image.

use super::{Positions, Problem};
use crate::camera::Viewpoint;
use crate::mesh::boundary_edges;

/// A clip tells what is fixed if a quarter of the vertices move by so much or more [px of the finest level].
const SEEN: f64 = 2.0;
/// What moves by less than this fraction of that, and by less than so many pixels, stands still if its neighbours do.
const STILL: [f64; 2] = [0.25, 1.0];
/// What moves by less than this fraction and so many pixels surely does.
const SURE: [f64; 2] = [0.1, 0.5];
/// A fixed edge has so many vertices that surely stand still. A single one is not known well enough before the search.
const LEAST: usize = 4;

impl Problem<'_> {
    /// Vertices of fixed edges, ascending: they stand still in the image in nine of ten of the `frames`, while the sheet moves.
    ///
    /// Only of the border: what stands still in the image while the rest moves may still move along its view ray, as the
    /// middle of a sheet that billows towards the camera does, but nothing makes a whole edge do so.
    pub(super) fn still_vertices(&self, frames: &[Positions]) -> Vec<u32> {
        let pixel = self.pixel();
        // In the image of each frame, where the vertex is and where it would be had it not moved.
        let moved = |v: usize| -> f64 {
            let of_frame = |(x, view): (&Positions, &Viewpoint)| {
                let [now, before] = [x, &frames[0]].map(|x| view.project(x[v]) / pixel);
                now.distance(before)
            };
            quantile(frames.iter().zip(&self.observed.views).skip(1).map(of_frame).collect(), 0.9)
        };
        let moved: Vec<f64> = (0..self.cloth.vertex_count()).map(moved).collect();
        let most = quantile(moved.clone(), 0.75);
        if most < SEEN {
            return Vec::new();
        }
        let below = |v: u32, [fraction, pixels]: [f64; 2]| moved[v as usize] < pixels.min(fraction * most);
        let edges = boundary_edges(&self.scene.template);
        let joined: Vec<[u32; 2]> =
            edges.into_iter().filter(|edge| edge.iter().all(|&v| below(v, STILL))).collect();
        let mut still = Vec::new();
        for part in parts(&joined) {
            if part.iter().filter(|&&v| below(v, SURE)).count() >= LEAST {
                still.extend(part);
            }
        }
        still.sort_unstable();
        still
    }
}

/// The vertices of `edges`, those that edges join together.
fn parts(edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut parts: Vec<Vec<u32>> = Vec::new();
    for edge in edges {
        let (touched, mut rest): (Vec<_>, Vec<_>) =
            parts.into_iter().partition(|part| edge.iter().any(|v| part.contains(v)));
        let mut part: Vec<u32> = touched.into_iter().flatten().chain(*edge).collect();
        part.sort_unstable();
        part.dedup();
        rest.push(part);
        parts = rest;
    }
    parts
}

/// The `part` quantile of `values`; 0 of none.
fn quantile(mut values: Vec<f64>, part: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((part * last as f64).round() as usize).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::SpacetimeSettings;
    use super::super::proof::scene;
    use super::*;
    use crate::sim::Cloth;

    /// What is found in frames that move vertex `v`, of a grid of 7 columns and 6 rows, by `displacement(column, row)` `[m]`
    /// in the last of them.
    fn found(displacement: impl Fn(f64, f64) -> DVec3) -> Vec<u32> {
        let scene = scene();
        let cloth = Cloth::new(&scene.template);
        let settings = SpacetimeSettings { resolution: 1e5, levels: 1, ..SpacetimeSettings::default() };
        let problem = Problem::new(&scene, &cloth, settings).unwrap();
        let at = |n: usize| -> Positions {
            let moved = |(v, x): (usize, &DVec3)| {
                *x + displacement((v % 7) as f64, (v / 7) as f64) * (n as f64 / 3.0)
            };
            scene.template.positions.iter().enumerate().map(moved).collect()
        };
        problem.still_vertices(&[0, 1, 2, 3].map(at))
    }

    #[test]
    fn a_fixed_edge_is_found() {
        // 0.1 m are 30 px here: the second row moves by 3 px already.
        assert_eq!(found(|_, row| DVec3::new(0.01, 0.01, 0.02) * row), [0, 1, 2, 3, 4, 5, 6]);
    }

    #[test]
    fn fixed_corners_are_too_little_to_go_by() {
        assert!(found(|column, row| DVec3::X * (0.01 * (row + column.min(6.0 - column)))).is_empty());
    }

    #[test]
    fn nothing_is_found_where_all_or_nothing_moves() {
        assert!(found(|_, _| DVec3::X * 0.05).is_empty());
        assert!(found(|_, row| DVec3::X * (0.001 * row)).is_empty());
    }

    #[test]
    fn the_middle_of_a_sheet_may_move_along_its_view_rays() {
        let outer = |column: f64, row: f64| column.min(6.0 - column).min(row.min(5.0 - row)) == 0.0;
        assert!(
            found(|column, row| if outer(column, row) { DVec3::X * 0.05 } else { DVec3::ZERO }).is_empty()
        );
    }

    #[test]
    fn edges_that_meet_are_one_part() {
        let found = parts(&[[0, 1], [4, 5], [2, 3], [1, 2], [7, 6]]);
        assert_eq!(found, [vec![4, 5], vec![0, 1, 2, 3], vec![6, 7]]);
    }

    #[test]
    fn quantiles_are_of_the_sorted_values() {
        assert_eq!(quantile(vec![3.0, 1.0, 2.0], 0.5), 2.0);
        assert_eq!(quantile(vec![3.0, 1.0, 2.0], 1.0), 3.0);
        assert_eq!(quantile(Vec::new(), 0.5), 0.0);
    }
}
