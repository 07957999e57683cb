//! JPEG of a part of an image, shrunk to a largest side.
//!
//! Source: ITU-T T.81 (1992), *Digital compression and coding of continuous-tone still images*: the baseline process
//! with the tables of its Annex K, all channels at full size; JFIF 1.02 for the colours.

use std::f64::consts::PI;
use std::sync::LazyLock;

use super::jpeg_tables::{BRIGHTNESS_STEPS, COLOUR_STEPS, Code, MEANS, ORDER, WAVES};
use super::rgb8::Rgb8;
use crate::camera::Rect;

/// Size `[px]` of `region` with sides of at most `side`, never enlarged.
pub fn fitted(region: Rect, side: u32) -> [u32; 2] {
    let (width, height) = (region.width() as f64, region.height() as f64);
    let scale = (f64::from(side) / width.max(height)).min(1.0);
    [width, height].map(|s| ((s * scale).round() as u32).max(1))
}

/// The part `region` of `image` as JPEG, with sides of at most `side` `[px]`.
pub(crate) fn encode_part(image: &Rgb8, region: Rect, side: u32, quality: u8) -> Vec<u8> {
    let size = fitted(region, side).map(|side| side as usize);
    let cut = image.cropped(region);
    let small = if [cut.width, cut.height] == size { cut } else { cut.shrunk(size) };
    encode(&small, quality)
}

/// `image` as JPEG; `quality` in percent, above 0.
///
/// # Panics
/// If a side is 0 or above 65535 pixels.
pub fn encode(image: &Rgb8, quality: u8) -> Vec<u8> {
    let side =
        |side: usize| u16::try_from(side).ok().filter(|side| *side > 0).expect("a side that JPEG can tell");
    let [width, height] = [image.width, image.height].map(side);
    let steps = [BRIGHTNESS_STEPS, COLOUR_STEPS].map(|steps| steps.map(|step| scaled(step, quality)));
    let mut out = header([width, height], &steps);
    let mut bits = Bits { out: &mut out, held: 0, count: 0 };
    // What was written of the last block's means.
    let mut last = [0; 3];
    for top in (0..image.height).step_by(8) {
        for left in (0..image.width).step_by(8) {
            for (channel, block) in blocks(image, left, top).iter().enumerate() {
                let kind = channel.min(1);
                let block = quantised(block, &steps[kind]);
                bits.block(&block, block[0] - last[channel], kind);
                last[channel] = block[0];
            }
        }
    }
    // The last byte is filled with ones.
    bits.put(0x7F, 7);
    out.extend([0xFF, 0xD9]);
    out
}

/// A step of quantisation at a quality in percent, as the library of the Independent JPEG Group scales them.
fn scaled(step: u8, quality: u8) -> u8 {
    let quality = u32::from(quality.clamp(1, 100));
    let percent = if quality < 50 { 5000 / quality } else { 200 - 2 * quality };
    ((u32::from(step) * percent + 50) / 100).clamp(1, 255) as u8
}

/// Everything before the blocks.
fn header([width, height]: [u16; 2], steps: &[[u8; 64]; 2]) -> Vec<u8> {
    let mut out = vec![0xFF, 0xD8];
    let mut segment = |marker: u8, content: &[u8]| {
        out.extend([0xFF, marker]);
        out.extend((content.len() as u16 + 2).to_be_bytes());
        out.extend(content);
    };
    // JFIF 1.02, square pixels, no preview.
    segment(0xE0, b"JFIF\0\x01\x02\0\0\x01\0\x01\0\0");
    let [w, h] = [width, height].map(u16::to_be_bytes);
    // 8 bits; three channels: number, sampling, table of steps.
    segment(0xC0, &[8, h[0], h[1], w[0], w[1], 3, 1, 0x11, 0, 2, 0x11, 1, 3, 0x11, 1]);
    for (kind, steps) in steps.iter().enumerate() {
        let mut content = vec![kind as u8];
        content.extend(ORDER.map(|k| steps[usize::from(k)]));
        segment(0xDB, &content);
    }
    for kind in 0..2 {
        for (class, code) in [(0, &MEANS[kind]), (0x10, &WAVES[kind])] {
            segment(0xC4, &[&[class | kind as u8], &code.lengths[..], code.values].concat());
        }
    }
    // Three channels, each with its codes; all waves at once.
    segment(0xDA, &[3, 1, 0, 2, 0x11, 3, 0x11, 0, 63, 0]);
    out
}

/// Brightness, blue and red of the 8×8 pixels from (left, top) on, −128 to 127; beyond the image its border goes on.
fn blocks(image: &Rgb8, left: usize, top: usize) -> [[f32; 64]; 3] {
    let mut out = [[0.0; 64]; 3];
    for row in 0..8 {
        for column in 0..8 {
            let (x, y) = ((left + column).min(image.width - 1), (top + row).min(image.height - 1));
            let [r, g, b] = image.pixel(x, y).map(f32::from);
            let k = 8 * row + column;
            out[0][k] = 0.299 * r + 0.587 * g + 0.114 * b - 128.0;
            out[1][k] = -0.168_736 * r - 0.331_264 * g + 0.5 * b;
            out[2][k] = 0.5 * r - 0.418_688 * g - 0.081_312 * b;
        }
    }
    out
}

/// The waves of the discrete cosine transform: row k has the eight values of the k-th; then rows as columns.
static COSINES: LazyLock<[[[f32; 8]; 8]; 2]> = LazyLock::new(|| {
    let value = |k: usize, x: usize| {
        let size = if k == 0 { 8f64.recip().sqrt() } else { 0.5 };
        (size * (PI * k as f64 * (2 * x + 1) as f64 / 16.0).cos()) as f32
    };
    let square =
        |value: &dyn Fn(usize, usize) -> f32| std::array::from_fn(|a| std::array::from_fn(|b| value(a, b)));
    [square(&value), square(&|x, k| value(k, x))]
});

/// a · b.
fn product(a: &[[f32; 8]], b: &[[f32; 8]; 8]) -> [[f32; 8]; 8] {
    std::array::from_fn(|i| {
        let mut sum = [0.0; 8];
        for (factor, row) in a[i].iter().zip(b) {
            (0..8).for_each(|k| sum[k] += factor * row[k]);
        }
        sum
    })
}

/// How much of every wave is in `block`, in `steps`.
fn quantised(block: &[f32; 64], steps: &[u8; 64]) -> [i32; 64] {
    let [waves, turned] = &*COSINES;
    // Along the rows, then down the columns.
    let amounts = product(waves, &product(block.as_chunks().0, turned));
    let amounts = amounts.as_flattened().iter().zip(steps);
    let mut out = [0; 64];
    out.iter_mut().zip(amounts).for_each(|(out, (v, step))| *out = (v / f32::from(*step)).round() as i32);
    out
}

/// Number of bits and bits of the word for every value of a code.
type Words = [(u8, u16); 256];

fn words(code: &Code) -> Words {
    let mut words = [(0, 0); 256];
    let (mut word, mut values) = (0, code.values.iter());
    for (length, count) in (1..).zip(code.lengths) {
        for value in values.by_ref().take(usize::from(count)) {
            words[usize::from(*value)] = (length, word);
            word += 1;
        }
        word <<= 1;
    }
    words
}

/// Words of means and of waves, each of brightness and of colour.
static WORDS: LazyLock<[[Words; 2]; 2]> =
    LazyLock::new(|| [&MEANS, &WAVES].map(|codes| [words(&codes[0]), words(&codes[1])]));

/// A stream of bits, the first one the highest.
struct Bits<'a> {
    out: &'a mut Vec<u8>,
    held: u32,
    count: u8,
}

impl Bits<'_> {
    fn put(&mut self, bits: u16, count: u8) {
        self.held = self.held << count | u32::from(bits);
        self.count += count;
        while self.count >= 8 {
            self.count -= 8;
            let byte = (self.held >> self.count) as u8;
            self.out.push(byte);
            // A marker is told from data by what follows.
            if byte == 0xFF {
                self.out.push(0);
            }
        }
    }

    /// A number that is not 0, with the word of its length and of the zeros before it.
    fn number(&mut self, value: i32, zeros: u8, words: &Words) {
        let length = (32 - value.unsigned_abs().leading_zeros()) as u8;
        let (count, word) = words[usize::from(zeros << 4 | length)];
        self.put(word, count);
        // Negative ones as what is left to the largest of their length.
        let bits = if value < 0 { value - 1 } else { value };
        self.put(bits as u16 & ((1 << length) - 1), length);
    }

    fn block(&mut self, block: &[i32; 64], mean: i32, kind: usize) {
        let [means, waves] = [&WORDS[0][kind], &WORDS[1][kind]];
        self.number(mean, 0, means);
        let mut zeros = 0;
        for k in &ORDER[1..] {
            let value = block[usize::from(*k)];
            if value == 0 {
                zeros += 1;
                continue;
            }
            while zeros > 15 {
                let (count, word) = waves[0xF0];
                self.put(word, count);
                zeros -= 16;
            }
            self.number(value, zeros, waves);
            zeros = 0;
        }
        if zeros > 0 {
            let (count, word) = waves[0];
            self.put(word, count);
        }
    }
}
