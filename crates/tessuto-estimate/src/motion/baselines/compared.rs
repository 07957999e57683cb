//! Which pixels the rollout fit compares.
//!
//! The outline of a mesh is where it says least: hems and folds narrower than its cells open and turn in, masks
//! are ragged there, and cloth that hardly stretches has to leave its place for it. Half a cell of the published
//! meshes, 2 % of the fabric's size, is such a rim.

use std::ops::Range;

use crate::motion::observed::outline_distance::distance;
use tessuto_core::error::Result;
use tessuto_core::image::Image;
use tessuto_core::scene::Scene;

/// The pixels that are compared, as runs of their indices.
#[derive(Debug, Clone)]
pub struct Compared {
    /// Of the frames that have none of their own.
    everywhere: Range<usize>,
    frames: Vec<Vec<Range<usize>>>,
}

impl Compared {
    /// The pixels farther from the outlines of the masks, inside and outside, than `margin` times the fabric's
    /// size, the root of the area of its first mask; all pixels if `margin` is zero.
    ///
    /// # Errors
    /// Those of reading the frames.
    pub fn away_from_outlines(scene: &Scene, margin: f64) -> Result<Self> {
        let everywhere = 0..scene.camera.width * scene.camera.height;
        if margin == 0.0 {
            return Ok(Self { everywhere, frames: Vec::new() });
        }
        let area: f32 = scene.frames.frame(0)?.mask.data.iter().sum();
        let margin = (margin * f64::from(area).sqrt()) as f32;
        let runs = |_: &mut (), n| Ok(away_from_outline(&scene.frames.frame(n)?.mask, margin));
        Ok(Self { everywhere, frames: scene.frames.map(0..scene.frames.len(), || (), runs)? })
    }

    /// The runs of frame `n`.
    pub fn frame(&self, n: usize) -> &[Range<usize>] {
        self.frames.get(n).map_or(std::slice::from_ref(&self.everywhere), Vec::as_slice)
    }
}

/// Runs of the pixels of `mask` that are farther than `margin` `[px]` from every pixel of the other kind, fabric
/// or background.
fn away_from_outline(mask: &Image, margin: f32) -> Vec<Range<usize>> {
    let fabric: Vec<bool> = mask.data.iter().map(|&m| m >= 0.5).collect();
    let to = |inside| distance(&fabric, inside, [mask.width, mask.height], margin + 1.0);
    let (to_background, to_fabric) = (to(false), to(true));
    let mut runs: Vec<Range<usize>> = Vec::new();
    for k in (0..fabric.len()).filter(|&k| to_background[k].max(to_fabric[k]) > margin) {
        match runs.last_mut() {
            Some(run) if run.end == k => run.end += 1,
            _ => runs.push(k..k + 1),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rim_of_the_mask_is_left_out() {
        let mut mask = Image::new(16, 9, 1);
        let hole = 4 * 16 + 12;
        let pixels = mask.data.iter_mut().enumerate();
        pixels.for_each(|(k, fabric)| *fabric = f32::from(u8::from(k % 16 >= 6 && k != hole)));
        let runs = away_from_outline(&mask, 2.0);
        for k in 0..16 * 9 {
            let (x, y) = ((k % 16) as f32, (k / 16) as f32);
            // Away from the columns beside the outline and from the hole; the image's border is no outline.
            let expected = !(4.0..8.0).contains(&x) && (x - 12.0).hypot(y - 4.0) > 2.0;
            assert_eq!(runs.iter().any(|run| run.contains(&k)), expected, "pixel {x}, {y}");
        }
    }

    #[test]
    fn a_margin_may_be_wide() {
        let mut mask = Image::new(400, 1, 1);
        mask.data[1..].fill(1.0);
        assert!(away_from_outline(&mask, 150.0).into_iter().flatten().eq(151..400));
    }
}
