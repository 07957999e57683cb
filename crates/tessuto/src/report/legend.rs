//! Colour bar with its numbers and unit, drawn below an image.

use super::colour::{Colour, diverging, heat, sequential};
use super::font;
use super::kind::{Kind, Scales};
use tessuto_core::image::Image;

/// Height `[px]` of the strip at scale 1.
pub const STRIP: usize = 30;
const INK: Colour = [0.13, 0.13, 0.13];
const PAPER: Colour = [1.0, 1.0, 1.0];

/// What a colour bar says.
#[derive(Debug, Clone)]
pub struct Legend {
    /// What is shown.
    pub title: String,
    /// Texts at the left end, in the middle and at the right end.
    pub ticks: [String; 3],
    /// Colour at a fraction in [0, 1] of the bar.
    pub colour: fn(f32) -> Colour,
}

impl Legend {
    /// None for photographs.
    pub fn of(kind: Kind, scales: &Scales) -> Option<Self> {
        let signed = |fraction: f32| diverging(2.0 * fraction - 1.0);
        match kind {
            Kind::Render | Kind::Observed => None,
            Kind::Difference => {
                let end = scales.colour_difference;
                let ticks = [0.0, end / 2.0, end].map(|v| format!("{v:.2}"));
                Some(Self { title: "COLOUR RMS".into(), ticks, colour: heat })
            }
            Kind::MaskDifference => {
                let ticks = ["OBSERVED", "BOTH", "RENDERED"].map(String::from);
                Some(Self { title: "MASK".into(), ticks, colour: signed })
            }
            Kind::Depth => {
                let [low, high] = scales.depth;
                let ticks = [low, 0.5 * (low + high), high].map(|v| format!("{v:.3}"));
                Some(Self { title: "DEPTH m".into(), ticks, colour: sequential })
            }
            Kind::DepthDifference => {
                let end = scales.depth_difference * 1e3;
                let ticks = [format!("-{end:.0}"), "0".into(), format!("+{end:.0}")];
                Some(Self { title: "DEPTH - MEASURED mm".into(), ticks, colour: signed })
            }
        }
    }

    /// Draw into the strip of `width` `[px]` whose upper left corner is at (column, row) `corner`:
    /// the title to the left, the bar with its ticks below to the right. `scale`: size of the letters.
    pub fn draw(&self, image: &mut Image, [x, y]: [usize; 2], width: usize, scale: usize) {
        font::draw(image, [x + 4, y + 6 * scale], &self.title, scale, INK);
        let start = x + 4 + font::width(&self.title, scale) + 10 * scale;
        let end = (x + width).saturating_sub(6).min(start + 420 * scale);
        if end < start + 40 * scale {
            return;
        }
        let length = end - start;
        for k in 0..length {
            let colour = (self.colour)(k as f32 / (length - 1) as f32);
            font::fill(image, [start + k, y + 5 * scale], [1, 10 * scale], colour);
        }
        for (tick, place) in self.ticks.iter().zip(0..) {
            // Left-aligned, centred, right-aligned.
            let x = start + (length.saturating_sub(font::width(tick, scale))) * place / 2;
            font::draw(image, [x, y + 19 * scale], tick, scale, INK);
        }
    }
}

/// `image` with the legend's strip below it.
pub fn below(image: &Image, legend: &Legend) -> Image {
    let scale = if image.width >= 420 { 2 } else { 1 };
    let mut out = Image::new(image.width, image.height + scale * STRIP, 3);
    out.data[..image.data.len()].copy_from_slice(&image.data);
    font::fill(&mut out, [0, image.height], [image.width, scale * STRIP], PAPER);
    legend.draw(&mut out, [0, image.height], image.width, scale);
    out
}
