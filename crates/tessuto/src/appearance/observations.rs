//! What the pixels of all frames see, and their colours.

use rayon::prelude::*;

use super::Window;
use crate::math::rng::mix32;
use crate::pbr::{Geometry, Point, see};
use crate::raster::{Rasterizer, Rendering};
use crate::scene::{Scene, Shape};

/// Pixels of all frames that certainly show cloth.
pub(super) struct Observations {
    /// Their points on the cloth.
    pub points: Vec<Point>,
    /// Their sRGB colours.
    pub colours: Vec<[f32; 3]>,
}

/// The texture coordinates of their points are those within `window`. Draws about `most` of the pixels whose 3×3 neighbourhood is cloth both in the video and as rendered.
pub(super) fn observe(
    scene: &Scene,
    rasterizer: &Rasterizer,
    geometry: &Geometry,
    motion: &[Shape],
    window: Window,
    most: usize,
    seed: u32,
) -> Observations {
    let frames: Vec<Vec<(Point, [f32; 3])>> = (0..motion.len())
        .into_par_iter()
        .map_init(Rendering::new, |rendering, n| {
            let seen = see(rasterizer, &scene.camera, geometry, n, &motion[n], rendering);
            let frame = &scene.frames[n];
            let (width, height) = (scene.camera.width, scene.camera.height);
            let cloth = |x: usize, y: usize| {
                frame.mask.pixel(x, y)[0] > 0.5 && rendering.triangle[y * width + x] != Rendering::NO_TRIANGLE
            };
            let inside = |pixel: u32| {
                let (x, y) = (pixel as usize % width, pixel as usize / width);
                let border = x == 0 || y == 0 || x + 1 == width || y + 1 == height;
                !border && (y - 1..=y + 1).all(|y| (x - 1..=x + 1).all(|x| cloth(x, y)))
            };
            seen.into_iter()
                .filter(|(pixel, _)| inside(*pixel))
                .map(|(pixel, mut point)| {
                    point.uv = window.inside(point.uv);
                    let rgb = frame.rgb.pixel(pixel as usize % width, pixel as usize / width);
                    (point, [rgb[0], rgb[1], rgb[2]])
                })
                .collect()
        })
        .collect();
    let total: usize = frames.iter().map(Vec::len).sum();
    let share = (most as f64 / total.max(1) as f64).min(1.0);
    let limit = (share * f64::from(u32::MAX)) as u32;
    let kept = frames.into_iter().flatten().enumerate();
    let kept = kept.filter(|(i, _)| share >= 1.0 || mix32(mix32(seed).wrapping_add(*i as u32)) < limit);
    let (points, colours) = kept.map(|(_, pair)| pair).unzip();
    Observations { points, colours }
}
