//! The texture that the first frame shows.

use crate::camera::Camera;
use crate::error::{Error, Hint, Remedy, Result};
use crate::math::finite;
use crate::mesh::Positions;
use crate::optim::Adam;
use crate::raster::{Gradients, Rasterizer, Rendering, Texture};
use crate::session::{Epoch, Session, named};
use crate::settings::settings;
use crate::video::Frame;

use super::rollout::losses::{LossWeights, image_loss};

settings! {
    /// Settings of the texture phase.
    pub struct TextureSettings {
        /// Width and height of the texture.
        size: usize = 512, number(2.0..=8192.0, "texel");
        /// Steps of the optimisation.
        epochs: usize = 200, number(0.0..=1e6, "");
        /// Adam's learning rate.
        learning_rate: f64 = 0.05, number(0.0..=1.0, "sRGB");
        /// Weight of the mean absolute difference of neighbouring texels.
        smoothness: f64 = 1e-4, number(0.0..=1e3, "");
    }
}

/// Optimises a texture, from grey 0.5, until the mesh at `shape` looks like `frame`.
/// Source: \[SAFT\] §2.3 phase 1, §2.5.1.
///
/// # Errors
/// [`Error::Numerical`] if the loss is not finite; what the session's observer returns.
pub fn fit_texture(
    rasterizer: &Rasterizer,
    camera: &Camera,
    shape: &Positions,
    frame: &Frame,
    settings: &TextureSettings,
    session: &mut Session,
) -> Result<Texture> {
    let weights = LossWeights { colour: 1.0, silhouette: 0.0, ..LossWeights::default() };
    let mut texture = Texture::uniform(settings.size, settings.size, [0.5; 3]);
    let mut parameters = vec![0.5; 3 * settings.size * settings.size];
    let mut adam = Adam::new(parameters.len(), settings.learning_rate);
    let (mut rendering, mut grad_rgba) = (Rendering::new(), Vec::new());
    let mut gradients = Gradients::new(rasterizer).with_texture(&texture);
    for epoch in 0..settings.epochs {
        rasterizer.render(camera, shape, &texture, &mut rendering);
        let [colour, _] = image_loss(&rendering.rgba, frame, &weights, 1.0, &mut grad_rgba);
        if !colour.is_finite() {
            return Err(not_finite(epoch + 1, colour, frame));
        }
        gradients.clear();
        rasterizer.render_vjp(camera, shape, &texture, &rendering, &grad_rgba, None, &mut gradients);
        let mut gradient: Vec<f64> = gradients
            .texture
            .iter()
            .flatten()
            .flat_map(|t| [f64::from(t[0]), f64::from(t[1]), f64::from(t[2])])
            .collect();
        add_smoothness(&parameters, settings.size, settings.smoothness, &mut gradient);
        debug_assert!(finite(&gradient));
        adam.step(&mut parameters, &gradient, 1.0);
        for (texel, p) in texture.texels.iter_mut().zip(parameters.chunks_exact_mut(3)) {
            for c in 0..3 {
                p[c] = p[c].clamp(0.0, 1.0);
                texel[c] = p[c] as f32;
            }
        }
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

/// Adds the gradient of `weight`·(mean |∂_u T| + mean |∂_v T|), forward differences.
fn add_smoothness(texels: &[f64], size: usize, weight: f64, gradient: &mut [f64]) {
    let share = weight / texels.len() as f64;
    for (stride, skip) in [(3, true), (3 * size, false)] {
        for i in 0..texels.len() - stride {
            if skip && (i / 3) % size == size - 1 {
                continue;
            }
            let difference = texels[i + stride] - texels[i];
            let slope = if difference == 0.0 { 0.0 } else { share * difference.signum() };
            gradient[i + stride] += slope;
            gradient[i] -= slope;
        }
    }
}
