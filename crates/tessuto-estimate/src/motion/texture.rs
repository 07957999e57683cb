//! The texture that the first frame shows.

use std::slice::from_ref;

use glam::DVec2;
use rayon::prelude::*;

use crate::session::{Epoch, Session, named};
use tessuto_core::camera::Viewpoint;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::math::finite;
use tessuto_core::mesh::Positions;
use tessuto_core::optim::{Adam, GradientClip};
use tessuto_core::settings::settings;
use tessuto_core::video::Frame;
use tessuto_render::raster::{Gradients, Rasterizer, Rendering, Texture};

use super::image_loss::{LOSS_FLOOR, image_loss};

settings! {
    /// Settings of the texture phase.
    pub struct TextureSettings {
        /// Width and height of the texture, across the part of the texture map that the template uses.
        size: usize = 512, number(2.0..=8192.0, "texel");
        /// Steps of the optimisation; the published method takes 200.
        epochs: usize = 100, number(0.0..=1e6, "");
        /// Adam's learning rate.
        learning_rate: f64 = 0.05, number(0.0..=1.0, "sRGB");
        /// Weight of the mean absolute difference of neighbouring texels.
        smoothness: f64 = 1e-4, number(0.0..=1e3, "");
        /// Fixed limit of the gradient's norm.
        clip_limit: f64 = 1000.0, number(1e-9..=1e12, "");
        /// Quantile of the recent gradient norms that limits the next one.
        clip_quantile: f64 = 0.75, number(0.0..=1.0, "");
        /// How many gradient norms are recent.
        clip_history: usize = 11, number(1.0..=1e6, "");
    }
}

/// Fewest texels of a parallel task.
const TASK: usize = 1 << 13;
/// Largest width and height of the whole map of a [`Window`] `[texel]`.
const LARGEST_MAP: usize = 4096;

/// The part of the texture map that a template uses: on many a scan a tenth of it, and a texture spread over the
/// whole map would be too coarse there.
#[derive(Debug, Clone, PartialEq)]
pub struct Window {
    /// Width and height of the whole map `[texel]`.
    map: [usize; 2],
    /// First column and row of the window `[texel]`.
    first: [usize; 2],
    /// Width and height of the window `[texel]`.
    size: usize,
}

impl Window {
    /// `size`×`size` texels, whole ones of a larger map, around all texture coordinates; the whole map if some lie
    /// outside of it.
    pub fn around(uvs: &[DVec2], size: usize) -> Self {
        let low = uvs.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = uvs.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        if !(low.min_element() >= 0.0 && high.max_element() <= 1.0) {
            return Self { map: [size; 2], first: [0; 2], size };
        }
        let axis = |low: f64, high: f64| {
            let map = ((size - 1) as f64 / (high - low)).min(LARGEST_MAP as f64) as usize;
            let map = map.max(size);
            [map, ((low * map as f64) as usize).min(map - size)]
        };
        // Rows count from v = 1 downwards.
        let (columns, rows) = (axis(low.x, high.x), axis(1.0 - high.y, 1.0 - low.y));
        Self { map: [columns[0], rows[0]], first: [columns[1], rows[1]], size }
    }

    /// Texture coordinates within the window.
    pub fn uv(&self, uv: DVec2) -> DVec2 {
        let size = self.size as f64;
        let at = |k: usize, u: f64| (u * self.map[k] as f64 - self.first[k] as f64) / size;
        DVec2::new(at(0, uv.x), 1.0 - at(1, 1.0 - uv.y))
    }

    /// The whole map with `texture` in the window, its borders carried on outside.
    pub fn whole(&self, texture: &Texture) -> Texture {
        assert_eq!([texture.width, texture.height], [self.size; 2], "a texture of the window's size");
        let [width, height] = self.map;
        let within = |k: usize, i: usize| i.saturating_sub(self.first[k]).min(self.size - 1);
        let texel = |i: usize| texture.texels[within(1, i / width) * self.size + within(0, i % width)];
        Texture { width, height, texels: (0..width * height).map(texel).collect() }
    }
}

/// Optimises a texture, from grey 0.5, until the mesh at `shape`, as `view` sees it, looks like `frame`.
/// Source: \[SAFT\] §2.3 phase 1, §2.5.1.
///
/// # Errors
/// [`Error::Numerical`] if the loss is not finite; what the session's observer returns.
pub fn fit_texture(
    rasterizer: &Rasterizer,
    view: &Viewpoint,
    shape: &Positions,
    frame: &Frame,
    settings: &TextureSettings,
    session: &mut Session,
) -> Result<Texture> {
    let mut texture = Texture::uniform(settings.size, settings.size, [0.5; 3]);
    let mut parameters = vec![0.5; 3 * settings.size * settings.size];
    let all = 0..frame.mask.data.len();
    let mut clip = GradientClip::new(settings.clip_limit, settings.clip_quantile, settings.clip_history);
    let mut adam = Adam::new(parameters.len(), settings.learning_rate);
    let (mut rendering, mut grad_rgba) = (Rendering::new(), Vec::new());
    let mut gradients = Gradients::new(rasterizer).with_texture(&texture);
    let mut gradient = vec![0.0; parameters.len()];
    for epoch in 0..settings.epochs {
        rasterizer.render(view, shape, &texture, &mut rendering);
        let [colour, _] = image_loss(&rendering.rgba, frame, from_ref(&all), [1.0, 0.0], 1.0, &mut grad_rgba);
        if !colour.is_finite() {
            return Err(not_finite(epoch + 1, colour, frame));
        }
        gradients.clear();
        rasterizer.render_vjp(view, shape, &texture, &rendering, &grad_rgba, None, &mut gradients);
        let by_texel = gradients.texture.as_deref().expect("with the texture");
        let rows = gradient.par_chunks_mut(3).zip(by_texel).with_min_len(TASK);
        rows.for_each(|(g, t)| (0..3).for_each(|c| g[c] = f64::from(t[c])));
        let roughness = add_smoothness(&parameters, settings.size, settings.smoothness, &mut gradient);
        debug_assert!(finite(&gradient));
        // Lifts what smoothing asks of texels that no pixel sees above the floor in Adam's denominator.
        let scale = 1.0 / (colour + roughness + LOSS_FLOOR);
        gradient.par_iter_mut().with_min_len(3 * TASK).for_each(|g| *g *= scale);
        clip.clip(&mut gradient);
        adam.step(&mut parameters, &gradient, 1.0);
        let texels = texture.texels.par_iter_mut().zip(parameters.par_chunks_mut(3)).with_min_len(TASK);
        texels.for_each(|(texel, p)| {
            for c in 0..3 {
                p[c] = p[c].clamp(0.0, 1.0);
                texel[c] = p[c] as f32;
            }
        });
        session.tell(&Epoch {
            stage: "texture".into(),
            step: epoch + 1,
            of: settings.epochs,
            active_frames: 1,
            losses: named([("colour", colour)]),
            parameters: Vec::new(),
        })?;
    }
    Ok(texture)
}

fn not_finite(step: usize, loss: f64, frame: &Frame) -> Error {
    let first = frame.rgb.data.iter().position(|v| !v.is_finite());
    let cause = first.map_or(String::new(), |k| {
        let pixel = k / 3;
        let (x, y) = (pixel % frame.rgb.width, pixel / frame.rgb.width);
        format!("; its colour is not finite, first at column {x}, row {y}")
    });
    Error::numerical(
        format!("texture, step {step}, frame 0"),
        format!("colour loss {loss}{cause}"),
        Hint::from("look at frame 0 and its mask").with(Remedy::Check),
    )
}

/// `weight`·(mean |∂_u T| + mean |∂_v T|), forward differences; adds its gradient.
fn add_smoothness(texels: &[f64], size: usize, weight: f64, gradient: &mut [f64]) -> f64 {
    let (share, row) = (weight / texels.len() as f64, 3 * size);
    let slope = |from: usize, to: usize| match texels[to] - texels[from] {
        0.0 => 0.0,
        difference => share * difference.signum(),
    };
    let add = |(y, gradient): (usize, &mut [f64])| {
        for (k, g) in gradient.iter_mut().enumerate() {
            let i = y * row + k;
            if k >= 3 {
                *g += slope(i - 3, i);
            }
            if k + 3 < row {
                *g -= slope(i, i + 3);
            }
            if y > 0 {
                *g += slope(i - row, i);
            }
            if y + 1 < size {
                *g -= slope(i, i + row);
            }
        }
    };
    // To the right within every row, then downwards.
    let rightwards = (0..size).map(|y| (3, y * row..(y + 1) * row - 3));
    let pairs = rightwards.chain([(row, 0..texels.len() - row)]);
    let differences = pairs.flat_map(|(stride, from)| from.map(move |i| texels[i + stride] - texels[i]));
    let sum = || differences.map(|difference| share * difference.abs()).sum();
    rayon::join(|| gradient.par_chunks_mut(row).enumerate().for_each(add), sum).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::math::gradient_check::check;
    use tessuto_core::math::rng::Rng;

    #[test]
    fn a_lookup_in_the_window_is_one_in_the_whole_map() {
        let mut rng = Rng::new(1, 0);
        let uvs: Vec<DVec2> =
            (0..40).map(|_| DVec2::new(0.22 + 0.22 * rng.uniform(), 0.4 + 0.41 * rng.uniform())).collect();
        let window = Window::around(&uvs, 64);
        assert!(window.map[0] > 250 && window.map[1] > 140, "{window:?}");
        let mut texture = Texture::uniform(64, 64, [0.0; 3]);
        texture.texels.iter_mut().for_each(|t| t[0] = rng.uniform() as f32);
        let whole = window.whole(&texture);
        for uv in uvs {
            let lookup = |t: &Texture, uv: DVec2| {
                let at = t.texel_position(uv);
                t.sample(at.x, at.y)[0]
            };
            let (small, large) = (lookup(&texture, window.uv(uv)), lookup(&whole, uv));
            assert!((small - large).abs() < 1e-5, "{uv}: {small} {large}");
        }
    }

    #[test]
    fn coordinates_that_fill_the_map_keep_their_bits() {
        for uvs in [[DVec2::ZERO, DVec2::ONE], [DVec2::splat(-0.3), DVec2::splat(0.4)]] {
            let window = Window::around(&uvs, 512);
            assert_eq!(window, Window { map: [512; 2], first: [0; 2], size: 512 });
            assert_eq!(window.uv(DVec2::new(0.3, 0.75)), DVec2::new(0.3, 0.75));
        }
    }

    #[test]
    fn smoothness_has_its_gradient() {
        let mut rng = Rng::new(3, 0);
        let texels: Vec<f64> = (0..3 * 8 * 8).map(|_| rng.uniform()).collect();
        let mut gradient = vec![0.0; texels.len()];
        add_smoothness(&texels, 8, 0.7, &mut gradient);
        let worst =
            check(&texels, &gradient, 1e-7, 20, 1, |t| add_smoothness(t, 8, 0.7, &mut vec![0.0; t.len()]));
        println!("smoothness: {worst:?}");
        assert!(worst.relative_error < 1e-6, "{worst:?}");
    }
}
