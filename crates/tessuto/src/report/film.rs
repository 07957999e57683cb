//! The video and the drawn frames as small JPEG images that fit into a number of bytes.

use rayon::prelude::*;
use serde::Serialize;
use tessuto_core::parallel;

use super::embed::base64;
use tessuto_core::camera::{Camera, Rect};
use tessuto_core::error::Result;
use tessuto_estimate::io::jpeg;
use tessuto_estimate::io::rgb8::Rgb8;

/// Largest side `[px]` and JPEG quality, best first.
const CHOICES: [(u32, u8); 11] = [
    (800, 74),
    (720, 72),
    (640, 72),
    (640, 64),
    (560, 68),
    (480, 68),
    (480, 56),
    (400, 58),
    (320, 60),
    (240, 55),
    (160, 50),
];
/// Frames looked at before the choice is made.
const SAMPLES: usize = 5;
/// Values up to this are background.
const BLACK: u8 = 8;

/// Gives the image of frame n (from 0), at the size of the others.
pub type Load<'a> = Box<dyn Fn(usize) -> Result<Rgb8> + Sync + 'a>;

/// One way to see the frames.
pub struct Source<'a> {
    /// Key, for the script.
    pub key: &'static str,
    /// What it is, for people.
    pub label: &'static str,
    /// Images.
    pub load: Load<'a>,
}

/// One way to see the frames, encoded.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Layer {
    /// As in [`Source`].
    pub key: &'static str,
    /// As in [`Source`].
    pub label: &'static str,
    /// JPEG of every frame, base64.
    pub frames: Vec<String>,
}

/// Images of all frames, cut to where there is something to see.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Film {
    /// Width `[px]`.
    pub width: u32,
    /// Height `[px]`.
    pub height: u32,
    /// JPEG quality.
    pub quality: u8,
    /// Camera of these images.
    pub camera: Option<Camera>,
    /// What there is to see.
    pub layers: Vec<Layer>,
}

impl Film {
    /// The images of `frame_count` frames that together take at most `budget` bytes of base64, as large and good as
    /// that allows; a budget below that of the smallest choice is exceeded.
    ///
    /// - `camera`: of the sources' images
    /// - `shown`: pixels that must stay in sight
    ///
    /// # Errors
    /// What a source returns.
    pub fn new(
        sources: &[Source],
        frame_count: usize,
        camera: &Camera,
        shown: Option<Rect>,
        budget: usize,
    ) -> Result<Self> {
        if sources.is_empty() || frame_count == 0 {
            return Ok(Self::default());
        }
        let count = frame_count.min(SAMPLES);
        let spread = |k: usize| k * (frame_count - 1) / (count - 1).max(1);
        let pairs: Vec<(usize, usize)> =
            (0..sources.len()).flat_map(|s| (0..count).map(move |k| (s, spread(k)))).collect();
        let samples: Vec<Rgb8> =
            pairs.par_iter().map(|(s, n)| (sources[*s].load)(*n)).collect::<Result<_>>()?;
        let region = region(&samples, camera, shown);
        let fits = |(side, quality): &(u32, u8)| {
            let bytes: usize =
                samples.par_iter().map(|p| jpeg::encode_part(p, region, *side, *quality).len()).sum();
            // Frames between the samples may be richer.
            bytes as f64 / samples.len() as f64 * 4.0 / 3.0 * 1.04 * (frame_count * sources.len()) as f64
                <= budget as f64
        };
        let mut choice = CHOICES.iter().position(fits).unwrap_or(CHOICES.len() - 1);
        loop {
            let (side, quality) = CHOICES[choice];
            let layers = encode(sources, frame_count, region, side, quality)?;
            let bytes: usize = layers.iter().flat_map(|l| &l.frames).map(String::len).sum();
            if bytes <= budget || choice + 1 == CHOICES.len() {
                let [width, height] = jpeg::fitted(region, side);
                let camera = Some(camera.cropped(region).resized([width, height]));
                return Ok(Self { width, height, quality, camera, layers });
            }
            choice += 1;
        }
    }
}

fn encode(
    sources: &[Source],
    frame_count: usize,
    region: Rect,
    side: u32,
    quality: u8,
) -> Result<Vec<Layer>> {
    let layer = |source: &Source| {
        let frame = |n| Ok(base64(&jpeg::encode_part(&(source.load)(n)?, region, side, quality)));
        let frames = parallel::try_map(frame_count, frame)?;
        Ok(Layer { key: source.key, label: source.label, frames })
    };
    sources.iter().map(layer).collect()
}

/// The part of the images that is not black in any of `samples`, with `shown` and a margin.
fn region(samples: &[Rgb8], camera: &Camera, shown: Option<Rect>) -> Rect {
    let (width, height) = (camera.width, camera.height);
    let bright = samples.iter().flat_map(|image| {
        let pixels = image.pixels().filter(|(_, _, colour)| colour.iter().any(|v| *v > BLACK));
        pixels.map(|(x, y, _)| (x, y))
    });
    match Rect::around(bright).into_iter().chain(shown).reduce(Rect::union) {
        Some(view) => view.padded(view.width().max(view.height()) / 16 + 4, [width, height]),
        None => Rect { x0: 0, y0: 0, x1: width, y1: height },
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// Noise in a square whose left border is at column `x`, black around it.
    fn frame(x: usize) -> Rgb8 {
        let mut rng = tessuto_core::math::rng::Rng::new(x as u64, 0);
        Rgb8::from_fn([400, 300], |i, j| {
            let inside = (x..x + 100).contains(&i) && (50..150).contains(&j);
            let bright =
                |v: DVec3| v.abs().to_array().map(|c| if inside { (c * 99.0) as u8 + 50 } else { 0 });
            bright(rng.vector())
        })
    }

    #[test]
    fn film_keeps_to_its_budget_and_to_the_fabric() {
        let camera = Camera { fx: 500.0, fy: 500.0, cx: 200.0, cy: 150.0, width: 400, height: 300 };
        let source = || Source { key: "a", label: "", load: Box::new(|n| Ok(frame(100 + 4 * n))) };
        let film = |budget| Film::new(&[source(), source()], 6, &camera, None, budget).unwrap();
        let bytes = |f: &Film| f.layers.iter().flat_map(|l| &l.frames).map(String::len).sum::<usize>();
        let (large, small) = (film(1 << 20), film(80_000));
        assert_eq!((large.width, large.quality), (142, 74));
        assert!(bytes(&small) <= 80_000 && bytes(&small) > 40_000, "{}", bytes(&small));
        assert!(small.quality < large.quality && small.layers.iter().all(|l| l.frames.len() == 6));
        // A point is seen at the same place of the fabric.
        let p = DVec3::new(0.0, -0.05, 1.0);
        let (whole, cut) = (camera.project(p), large.camera.unwrap().project(p));
        assert!((whole - cut - glam::DVec2::new(89.0, 39.0)).length() < 1e-9, "{whole} {cut}");
    }
}
