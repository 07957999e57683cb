//! How often the video shows each place of the cloth, and what of the light it could see.

use glam::DVec3;
use tessuto_core::parallel;

use tessuto_render::pbr::EnvironmentMap;

/// Rows of the map of directions; it has twice as many columns.
pub const DIRECTION_ROWS: usize = 24;
/// A direction is seen by a surface above which it stands this high: sine of 6°.
const LEAST_COSINE: f64 = 0.1;

/// How often what was seen. Where it is 0, colours and light are filled in from around.
#[derive(Debug, Clone)]
pub struct Seen {
    /// Width and height of `texels`.
    pub size: usize,
    /// Pixels that show each texel, shape [size, size] on all of uv space, row 0 at v = 1. A pixel spreads over
    /// the texels around it.
    pub texels: Vec<f32>,
    /// Frames that show each vertex, shape `[V]`.
    pub vertices: Vec<f32>,
    /// Fraction of the pixels of all frames that face each direction, shape [[`DIRECTION_ROWS`],
    /// 2·[`DIRECTION_ROWS`]], as an [`EnvironmentMap`]; shadows are not looked at.
    pub directions: Vec<f32>,
}

/// `directions` of [`Seen`], from `normals` and the number of pixels that show each.
pub(super) fn directions(normals: &[(DVec3, f64)]) -> Vec<f32> {
    let grid = EnvironmentMap::uniform(2 * DIRECTION_ROWS, DIRECTION_ROWS, [0.0; 3]);
    let total: f64 = normals.iter().map(|(_, count)| count).sum();
    let share = |texel: usize| {
        let direction = grid.direction(texel % grid.width, texel / grid.width);
        let facing = normals.iter().filter(|(normal, _)| normal.dot(direction) > LEAST_COSINE);
        (facing.fold(0.0, |sum, (_, count)| sum + count) / total.max(1.0)) as f32
    };
    parallel::map(grid.texels.len(), share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_faces_the_camera_sees_the_light_behind_it() {
        let share = directions(&[(DVec3::NEG_Z, 30.0), (DVec3::NEG_X, 10.0)]);
        let row = &share[DIRECTION_ROWS / 2 * 2 * DIRECTION_ROWS..][..2 * DIRECTION_ROWS];
        // The middle is where the camera looks, the quarter left of it is −x, the borders are behind.
        assert_eq!((row[DIRECTION_ROWS], row[DIRECTION_ROWS / 2]), (0.0, 0.25));
        assert!((row[1] - 1.0).abs() < 1e-6 && (row[2 * DIRECTION_ROWS - 2] - 0.75).abs() < 1e-6, "{row:?}");
    }
}
