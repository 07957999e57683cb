//! Which vertices stand still: an edge that is fixed does not move in the image.

use super::eye::Eye;
use super::{Positions, Problem};
use tessuto_core::camera::Viewpoint;
use tessuto_core::math::median::median;
use tessuto_core::mesh::boundary_edges;

/// A vertex stands still that moves by less than this part of how far half of the vertices do, and by fewer pixels
/// of the finest level.
const STILL: [f64; 2] = [0.25, 1.0];

impl Problem<'_> {
    /// Vertices of fixed edges, ascending: both ends of an edge stand still in the image of the `frames`, root
    /// mean square, while the sheet moves.
    ///
    /// Only of the border: what stands still in the image while the rest moves may still move along its view ray,
    /// as the middle of a sheet that billows towards the camera does, but nothing makes a whole edge do so.
    pub(super) fn still_vertices(&self, frames: &[Positions]) -> Vec<u32> {
        // In the image of each frame, from where the vertex would be had it not moved; mean over the cameras.
        let moved = |v: usize| -> f64 {
            let of_frame = |(x, view): (&Positions, &Viewpoint)| {
                let [now, before] = [x, &frames[0]].map(|x| view.project(x[v]));
                now.distance_squared(before)
            };
            let of_eye = |eye: &Eye| {
                let squares: f64 = frames.iter().zip(&eye.observed.views).map(of_frame).sum();
                (squares / frames.len() as f64).sqrt() / eye.pixel()
            };
            self.eyes.iter().map(of_eye).sum::<f64>() / self.eyes.len() as f64
        };
        let moved: Vec<f64> = (0..self.cloth.vertex_count()).map(moved).collect();
        let [part, pixels] = STILL;
        let limit = median(moved.clone()).map_or(0.0, |half| pixels.min(part * half));
        let stands = |edge: &[u32; 2]| edge.iter().all(|&v| moved[v as usize] < limit);
        let mut still =
            boundary_edges(&self.scene.template).into_iter().filter(stands).flatten().collect::<Vec<_>>();
        still.sort_unstable();
        still.dedup();
        still
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::SpacetimeSettings;
    use super::super::proof::scene;
    use super::*;
    use tessuto_sim::Cloth;

    /// What is found in frames that move vertex `v`, of a grid of 7 columns and 6 rows, by
    /// `displacement(column, row)` `[m]` in the last of them.
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
        // Of a sheet that hardly moves too: the second row moves by a third of a pixel.
        assert_eq!(found(|_, row| DVec3::X * (0.001 * row)), [0, 1, 2, 3, 4, 5, 6]);
    }

    #[test]
    fn fixed_corners_are_too_little_to_go_by() {
        assert!(found(|column, row| DVec3::X * (0.01 * (row + column.min(6.0 - column)))).is_empty());
    }

    #[test]
    fn nothing_is_found_where_all_moves() {
        assert!(found(|_, _| DVec3::X * 0.05).is_empty());
        assert!(found(|_, _| DVec3::X * 1e-4).is_empty(), "however little");
    }

    #[test]
    fn the_middle_of_a_sheet_may_move_along_its_view_rays() {
        let outer = |column: f64, row: f64| column.min(6.0 - column).min(row.min(5.0 - row)) == 0.0;
        assert!(
            found(|column, row| if outer(column, row) { DVec3::X * 0.05 } else { DVec3::ZERO }).is_empty()
        );
    }
}
