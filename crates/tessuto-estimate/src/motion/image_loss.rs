//! How far a drawn frame is from the filmed one, and the gradient of that.

use std::ops::Range;

use tessuto_core::video::Frame;

/// Added to a loss before gradients are divided by it.
pub(crate) const LOSS_FLOOR: f64 = 1e-8;

/// Colour and mask loss of one frame: means over the crop's pixels (and channels) of the squared differences, which
/// count as none outside of the runs of pixels `compared`. `weights` are those of colour and mask; `grad_rgba` is set
/// to `scale`·∂(weighted sum)/∂rgba.
pub(crate) fn image_loss(
    rgba: &[[f32; 4]],
    frame: &Frame,
    compared: &[Range<usize>],
    weights: [f64; 2],
    scale: f64,
    grad_rgba: &mut Vec<[f32; 4]>,
) -> [f64; 2] {
    let pixels = rgba.len() as f64;
    let colour_scale = (2.0 * scale * weights[0] / (3.0 * pixels)) as f32;
    let mask_scale = (2.0 * scale * weights[1] / pixels) as f32;
    let (mut colour, mut silhouette) = (0.0, 0.0);
    grad_rgba.clear();
    grad_rgba.resize(rgba.len(), [0.0; 4]);
    for run in compared {
        let observed = frame.rgb.data[3 * run.start..3 * run.end].chunks_exact(3);
        let observed = observed.zip(&frame.mask.data[run.clone()]);
        let pixels = grad_rgba[run.clone()].iter_mut().zip(&rgba[run.clone()]).zip(observed);
        for ((gradient, rendered), (rgb, &mask)) in pixels {
            let d = [rendered[0] - rgb[0], rendered[1] - rgb[1], rendered[2] - rgb[2], rendered[3] - mask];
            colour += f64::from(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
            silhouette += f64::from(d[3] * d[3]);
            *gradient = [d[0] * colour_scale, d[1] * colour_scale, d[2] * colour_scale, d[3] * mask_scale];
        }
    }
    [colour / (3.0 * pixels), silhouette / pixels]
}
