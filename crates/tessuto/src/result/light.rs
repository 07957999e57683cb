//! The recovered light for the page, with a mark where it is a guess.

use std::path::Path;

use glam::DVec3;
use tessuto_core::parallel;

use crate::report::{LightData, chosen_frames, embed};
use tessuto_core::error::Result;
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_estimate::io::rgb8::Rgb8;
use tessuto_estimate::io::{self, jpeg};
use tessuto_render::pbr::EnvironmentMap;

/// JPEG quality of maps and of the light.
pub(super) const MAP_QUALITY: u8 = 86;
/// Most triangles of a frame whose normals are looked at.
const TRIANGLES: usize = 2000;
/// Rows of the coarse image of what was observed.
const ROWS: usize = 48;
/// A texel is observed if it stands at least this high above some triangle: sine of 6°. Light that grazes the
/// cloth is too weak to be found.
const LEAST_COSINE: f64 = 0.1;

/// The light, where it was estimated. Directions that the side of the cloth that is seen never faced in `motion`
/// are hatched: nothing shows the light from there. Shadows are not looked at.
pub(super) fn light(folder: &Path, mesh: &Mesh, motion: &[Positions]) -> Result<Option<LightData>> {
    let path = folder.join("material/environment.exr");
    if !path.is_file() {
        return Ok(None);
    }
    let environment = io::hdr::read_environment(&path)?;
    let shrunk = |most: usize| environment.downsampled((environment.height / most).max(1));
    let (data, shown) = (shrunk(64), shrunk(256));
    // The mean becomes middle grey; x / (1 + x) keeps the brightest parts from being cut off.
    let mean = shown.data.iter().map(|v| f64::from(*v)).sum::<f64>() / shown.data.len().max(1) as f64;
    let tone = |v: &f32| {
        let x = v / (2.0 * mean.max(1e-9)) as f32;
        (255.0 * tessuto_core::image::srgb::encode(x / (1.0 + x)).clamp(0.0, 1.0)).round() as u8
    };
    let bytes = shown.data.iter().map(tone).collect();
    let mut image = Rgb8::new([shown.width, shown.height], bytes);
    let seen = observed(mesh, motion);
    let (width, height) = (image.width, image.height);
    for (x, y, colour) in image.pixels_mut() {
        let (column, row) = (x * 2 * ROWS / width, y * ROWS / height);
        let stripe = (x + y) * 48 / height;
        if !seen[row * 2 * ROWS + column] && stripe.is_multiple_of(2) {
            *colour = colour.map(|v| (0.4 * f32::from(v) + 0.6 * 245.0) as u8);
        }
    }
    Ok(Some(LightData {
        width: data.width,
        height: data.height,
        radiance: embed::base64_of(&data.data),
        image: embed::base64(&jpeg::encode(&image, MAP_QUALITY)),
        unobserved: seen.iter().any(|s| !s),
    }))
}

/// Which directions of a lat-long image, shape `[ROWS, 2·ROWS]`, the side of the cloth that the camera sees faced
/// at a time.
fn observed(mesh: &Mesh, motion: &[Positions]) -> Vec<bool> {
    let triangles = mesh.triangles();
    let stride = triangles.len().div_ceil(TRIANGLES).max(1);
    let facing = |p: &Positions, t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| p[v as usize]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        if normal.dot(a + b + c) > 0.0 { -normal } else { normal }
    };
    let normals: Vec<DVec3> = chosen_frames(motion.len())
        .into_iter()
        .flat_map(|n| triangles.iter().step_by(stride).map(move |t| facing(&motion[n], t)))
        .collect();
    let grid = EnvironmentMap::uniform(2 * ROWS, ROWS, [0.0; 3]);
    let sees = |texel: usize| {
        let direction = grid.direction(texel % grid.width, texel / grid.width);
        normals.iter().any(|n| n.dot(direction) > LEAST_COSINE)
    };
    parallel::map(grid.texels.len(), sees)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::mesh::grid;

    #[test]
    fn a_flat_cloth_tells_of_the_light_behind_the_camera_alone() {
        let mesh = grid(4, 4, glam::DVec2::ONE, 1.0);
        let seen = observed(&mesh, std::slice::from_ref(&mesh.positions));
        let row = &seen[ROWS / 2 * 2 * ROWS..][..2 * ROWS];
        // The middle is where the camera looks, the borders are behind it.
        assert!(row[0] && row[2 * ROWS - 1] && !row[ROWS]);
        let share = row.iter().filter(|s| **s).count() as f64 / row.len() as f64;
        assert!((0.42..0.5).contains(&share), "{share}");
    }
}
