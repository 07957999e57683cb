//! What the pixels of all frames see, and their colours.

use super::Window;
use tessuto_core::error::Result;
use tessuto_core::image::Image;
use tessuto_core::math::rng::mix32;
use tessuto_core::mesh::{Positions, Side};
use tessuto_core::scene::{Back, Scene};
use tessuto_render::pbr::{Geometry, SurfacePoint, visible_points};
use tessuto_render::raster::{Rasterizer, Rendering, Texture};

/// Pixels of all frames that certainly show cloth.
pub(super) struct Observations {
    /// Their points on the cloth.
    pub points: Vec<SurfacePoint>,
    /// Their sRGB colours.
    pub colours: Vec<[f32; 3]>,
}

/// Which pixels are looked at.
#[derive(Clone, Copy)]
pub(super) struct Drawn {
    /// About so many.
    pub most: usize,
    /// Seed of the choice.
    pub seed: u32,
    /// Those that show the other side, if the rasteriser tells it apart; those of the front else.
    pub back: bool,
}

/// The rasteriser that tells the two sides apart where they differ; its colours mean nothing.
pub(super) fn telling_sides(scene: &Scene) -> Rasterizer {
    let rasterizer = Rasterizer::new(&scene.template);
    match scene.back() {
        Back::Same => rasterizer,
        _ => rasterizer.two_sided(Side::front(&scene.template, &scene.viewpoint(0)), [0.0; 3]),
    }
}

/// Draws some of the pixels of all cameras whose 3×3 neighbourhood is cloth both in the video and as rendered, all of
/// one side. The texture coordinates of their points are those within `window`.
///
/// # Errors
/// Those of reading the frames.
pub(super) fn observe(
    scene: &Scene,
    rasterizer: &Rasterizer,
    geometry: &Geometry,
    motion: &[Positions],
    window: Window,
    drawn: Drawn,
) -> Result<Observations> {
    // Of those that take their frames when the first one does: the light falls on the sheet as it is then.
    let at_once: Vec<usize> =
        (0..scene.view_count()).filter(|v| *v == 0 || scene.more[v - 1].late == 0.0).collect();
    let count = at_once.len();
    let mut all = Observations { points: Vec::new(), colours: Vec::new() };
    for v in at_once {
        let drawn = Drawn { most: drawn.most / count, seed: drawn.seed.wrapping_add(v as u32), ..drawn };
        let seen = by_one(&scene.seen_by(v), rasterizer, geometry, motion, window, drawn)?;
        all.points.extend(seen.points);
        all.colours.extend(seen.colours);
    }
    Ok(all)
}

/// As [`observe`], by the only camera of `scene`.
fn by_one(
    scene: &Scene,
    rasterizer: &Rasterizer,
    geometry: &Geometry,
    motion: &[Positions],
    window: Window,
    Drawn { most, seed, back }: Drawn,
) -> Result<Observations> {
    // Count first: the points of all pixels of a long video would not fit into memory.
    let blank = Texture::uniform(1, 1, [0.0; 3]);
    let counts = scene.frames.map(0..motion.len(), Rendering::new, |rendering, n| {
        let frame = scene.frames.frame(n)?;
        rasterizer.render(scene.viewpoint(n), &motion[n], &blank, rendering);
        Ok((0..rendering.triangle.len()).filter(|pixel| within(&frame.mask, rendering, *pixel, back)).count())
    })?;
    let total: usize = counts.iter().sum();
    let starts: Vec<usize> =
        counts.iter().scan(0, |sum, count| Some(std::mem::replace(sum, *sum + count))).collect();
    let probability = (most as f64 / total.max(1) as f64).min(1.0);
    let limit = (probability * f64::from(u32::MAX)) as u32;
    let drawn = |i: usize| probability >= 1.0 || mix32(mix32(seed).wrapping_add(i as u32)) < limit;
    let frames = scene.frames.map(0..motion.len(), Rendering::new, |rendering, n| {
        let frame = scene.frames.frame(n)?;
        let mut next = starts[n];
        let wanted = |rendering: &Rendering, pixel: usize| {
            let inside = within(&frame.mask, rendering, pixel, back);
            next += usize::from(inside);
            inside && drawn(next - 1)
        };
        let seen = visible_points(rasterizer, scene.viewpoint(n), geometry, n, &motion[n], rendering, wanted);
        let observation = |(pixel, mut point): (u32, SurfacePoint)| {
            point.uv = window.inside(point.uv);
            let width = scene.camera.width;
            let rgb = frame.rgb.pixel(pixel as usize % width, pixel as usize / width);
            (point, [rgb[0], rgb[1], rgb[2]])
        };
        Ok(seen.into_iter().map(observation).collect::<Vec<_>>())
    })?;
    let (points, colours) = frames.into_iter().flatten().unzip();
    Ok(Observations { points, colours })
}

/// Whether the 3×3 pixels around `pixel` are cloth both in `mask` and as rendered, and show its front if the two sides
/// differ.
pub(super) fn inside(mask: &Image, rendering: &Rendering, pixel: usize) -> bool {
    within(mask, rendering, pixel, false)
}

/// The same of the other side, if that is asked for.
fn within(mask: &Image, rendering: &Rendering, pixel: usize, back: bool) -> bool {
    let (width, height) = (mask.width, mask.height);
    let cloth = |x: usize, y: usize| {
        let i = y * width + x;
        let drawn = rendering.triangle[i] != Rendering::NO_TRIANGLE && rendering.shows_back(i) == back;
        drawn && mask.pixel(x, y)[0] > 0.5
    };
    let (x, y) = (pixel % width, pixel / width);
    let border = x == 0 || y == 0 || x + 1 == width || y + 1 == height;
    !border && (y - 1..=y + 1).all(|y| (x - 1..=x + 1).all(|x| cloth(x, y)))
}
