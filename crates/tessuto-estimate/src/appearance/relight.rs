//! How good maps are for their purpose: the cloth relit with them, against the same with the true maps.

use std::path::Path;

use super::read_material;
use crate::metrics::maps::{self, MapMetrics};
use crate::metrics::similarity::{best_scale, psnr, scaled};
use tessuto_core::camera::Viewpoint;
use tessuto_core::error::Result;
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_core::scene::Scene;
use tessuto_render::pbr::{
    EnvironmentMap, EnvironmentSampler, Geometry, Material, RenderScene, render_frame,
};
use tessuto_render::raster::Rasterizer;

/// Frames that are compared, spread over the motion.
const FRAMES: usize = 3;
const SAMPLES_PER_PIXEL: usize = 32;

/// [`maps::evaluate`], and where the scene has true maps the PSNR of relit frames of `motion`, shape [N, V].
///
/// # Errors
/// [`Error::Input`](tessuto_core::Error::Input) naming the file.
pub fn evaluate(scene: &Scene, result: &Path, motion: &[Positions]) -> Result<Option<MapMetrics>> {
    let Some(mut metrics) = maps::evaluate(scene, result)? else { return Ok(None) };
    let (estimate, truth) = (result.join("material"), scene.folder.join("gt/material"));
    let complete = |folder: &Path| {
        ["diffuse.png", "roughness.png", "metallic.png"].iter().all(|file| folder.join(file).is_file())
    };
    if complete(&estimate) && complete(&truth) && !motion.is_empty() {
        let [as_is, scaled] = relit_psnr(
            &scene.template,
            (motion, &scene.viewpoints()),
            [&read_material(&estimate)?, &read_material(&truth)?],
        );
        (metrics.relit_psnr, metrics.relit_psnr_scaled) = (Some(as_is), Some(scaled));
    }
    Ok(Some(metrics))
}

/// PSNR `[dB]` over the cloth of frames with the two materials under [`studio`]: as they are, and after the best factor
/// per channel of the linear colours. Both are drawn with the same random numbers.
fn relit_psnr(
    template: &Mesh,
    (motion, views): (&[Positions], &[Viewpoint]),
    [estimate, truth]: [&Material; 2],
) -> [f64; 2] {
    let rasterizer = &Rasterizer::new(template);
    let count = FRAMES.min(motion.len());
    let chosen: Vec<usize> = (0..count).map(|k| (motion.len() - 1) * k / (count - 1).max(1)).collect();
    let views: Vec<Viewpoint> = chosen.iter().map(|n| views[*n]).collect();
    let chosen: Vec<Positions> = chosen.iter().map(|n| motion[*n].clone()).collect();
    let geometry = &Geometry::seen(template, &chosen, &views);
    let light = &EnvironmentSampler::new(&studio(), 0.1);
    let (mut a, mut b) = (Vec::new(), Vec::new());
    for (n, positions) in chosen.iter().enumerate() {
        let [drawn, expected] = [estimate, truth].map(|material| {
            render_frame(
                &RenderScene { rasterizer, geometry, material, light },
                views[n],
                (n, positions),
                SAMPLES_PER_PIXEL,
            )
        });
        let pixels = drawn.data.chunks_exact(3).zip(expected.data.chunks_exact(3));
        for (x, y) in pixels.filter(|(_, y)| y.iter().any(|v| *v > 0.0)) {
            a.extend_from_slice(x);
            b.extend_from_slice(y);
        }
    }
    [psnr(&a, &b), psnr(&scaled(&a, best_scale(&a, &b)), &b)]
}

/// A light that no scene was recorded in: a warm lamp at the upper left in front of the cloth, a cold one at the
/// right, and a dim room.
pub fn studio() -> EnvironmentMap {
    let mut light = EnvironmentMap::uniform(128, 64, [0.25; 3]);
    let lamps = [
        (glam::DVec3::new(-0.6, -0.6, -0.5).normalize(), 0.93, [7.0, 6.0, 4.5]),
        (glam::DVec3::new(0.9, 0.1, -0.3).normalize(), 0.9, [1.5, 2.0, 3.0]),
    ];
    for row in 0..light.height {
        for column in 0..light.width {
            let direction = light.direction(column, row);
            let lamp = lamps.iter().find(|(at, cosine, _)| at.dot(direction) > *cosine);
            if let Some((_, _, radiance)) = lamp {
                light.texels[row * light.width + column] = *radiance;
            }
        }
    }
    light
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::camera::Camera;
    use tessuto_core::mesh::grid;

    #[test]
    fn the_true_maps_are_perfect_and_a_factor_is_forgiven() {
        let template = grid(3, 3, glam::DVec2::splat(0.5), 1.0);
        let camera = Camera { fx: 40.0, fy: 40.0, cx: 15.5, cy: 15.5, width: 32, height: 32 };
        let motion = vec![template.positions.clone(); 2];
        let views = [Viewpoint::from(camera); 2];
        let compare = |estimate: &Material, truth: &Material| {
            relit_psnr(&template, (&motion, &views), [estimate, truth])
        };
        let truth = Material::uniform(4, 4, [0.5, 0.3, 0.4], 0.6, 0.0);
        let [same, _] = compare(&truth, &truth);
        assert_eq!(same, 120.0);
        let brighter = Material::uniform(4, 4, [0.6, 0.3, 0.4], 0.6, 0.0);
        let [as_is, scaled] = compare(&brighter, &truth);
        let rough = Material::uniform(4, 4, [0.5, 0.3, 0.4], 0.25, 0.0);
        let [_, other] = compare(&rough, &truth);
        assert!(as_is < 35.0 && scaled > as_is + 8.0 && other < scaled, "{as_is} {scaled} {other}");
    }
}
