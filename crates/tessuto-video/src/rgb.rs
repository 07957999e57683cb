//! From luma and chroma to red, green and blue of 8 bits.
//!
//! With y, u and v brought to 0…1 and −½…½ by their range,
//!
//! ```text
//! r = y + 2 (1 − Kr) v
//! g = y − 2 Kb (1 − Kb) / Kg u − 2 Kr (1 − Kr) / Kg v,     Kg = 1 − Kr − Kb
//! b = y + 2 (1 − Kb) u
//! ```
//!
//! in 255ths, rounded and cut to 0…255. Limited range of b bits has black at 16 · 2^(b−8), white 219 · 2^(b−8)
//! above it, and colours 224 · 2^(b−8) wide; full range is 2^b − 1 wide. Colours lie between those of the four
//! nearest places, by straight lines in both directions, at the place that the stream says they are sited at (the
//! left pixel of two, between two rows, if it says nothing).
//!
//! Source: ITU-T H.273 (07/2021), 8.3 (matrix coefficients); H.264, figure E-1 (sites).

use crate::frame::{Chroma, Frame, Planes};
use crate::stream::Matrix;

/// Fractions of a fixed-point number, in bits.
const POINT: u32 = 16;
/// Weights of colours are products of two numbers of quarters.
const QUARTERS: i32 = 16;

/// How the frames of a film become red, green and blue.
#[derive(Clone, Debug)]
pub struct Colours {
    matrix: Matrix,
    full_range: bool,
    bits: u32,
    /// `chroma_sample_loc_type`.
    siting: u32,
}

/// Weights as 65,536ths of 1/255 per stored value.
struct Weights {
    luma: i32,
    red: i32,
    green: [i32; 2],
    blue: i32,
    /// Stored value of black.
    black: i32,
    /// Stored value of no colour.
    grey: i32,
}

/// A stored value.
trait Value: Copy {
    fn value(self) -> i32;
}

impl Value for u8 {
    fn value(self) -> i32 {
        self.into()
    }
}

impl Value for u16 {
    fn value(self) -> i32 {
        self.into()
    }
}

/// Kr and Kb; what is unspecified or unknown is BT.601, as ffmpeg has it.
fn coefficients(matrix: Matrix) -> [f64; 2] {
    match matrix {
        Matrix::Bt709 => [0.2126, 0.0722],
        Matrix::Bt2020 | Matrix::Other(10) => [0.2627, 0.0593],
        Matrix::Other(4) => [0.30, 0.11],
        Matrix::Other(7) => [0.212, 0.087],
        _ => [0.299, 0.114],
    }
}

/// Slope of luma and of colours in 1/255 per stored value, and the stored values of black and of no colour.
fn range(full: bool, bits: u32) -> [f64; 4] {
    let unit = f64::from(1u32 << (bits - 8));
    if full {
        let slope = 255.0 / (256.0 * unit - 1.0);
        [slope, slope, 0.0, 128.0 * unit]
    } else {
        [255.0 / (219.0 * unit), 255.0 / (224.0 * unit), 16.0 * unit, 128.0 * unit]
    }
}

impl Colours {
    pub(crate) fn new(matrix: Matrix, full_range: bool, bits: u32, siting: u32) -> Colours {
        Colours { matrix, full_range, bits, siting }
    }

    fn weights(&self) -> Weights {
        let [kr, kb] = coefficients(self.matrix);
        let kg = 1.0 - kr - kb;
        let [luma, colour, black, grey] = range(self.full_range, self.bits);
        let fixed = |w: f64| (w * f64::from(1u32 << POINT)).round() as i32;
        Weights {
            luma: fixed(luma),
            red: fixed(colour * 2.0 * (1.0 - kr)),
            green: [fixed(-colour * 2.0 * kb * (1.0 - kb) / kg), fixed(-colour * 2.0 * kr * (1.0 - kr) / kg)],
            blue: fixed(colour * 2.0 * (1.0 - kb)),
            black: black as i32,
            grey: grey as i32,
        }
    }

    /// How far colours lie behind the first pixel, to the right and downwards, in quarters of the distance between
    /// two of them.
    fn offset(&self) -> [i32; 2] {
        match self.siting {
            0 => [0, 1],
            1 => [1, 1],
            2 => [0, 0],
            3 => [1, 0],
            4 => [0, 2],
            _ => [1, 2],
        }
    }

    /// Red, green and blue of a frame, [height, width, 3].
    pub fn rgb(&self, frame: &Frame) -> Vec<u8> {
        match &frame.planes {
            Planes::U8(planes) => self.convert(frame, planes),
            Planes::U16(planes) => self.convert(frame, planes),
        }
    }

    fn convert<T: Value>(&self, frame: &Frame, planes: &[Vec<T>; 3]) -> Vec<u8> {
        let [width, height] = frame.size;
        let mut out = vec![0; width * height * 3];
        if self.matrix == Matrix::Rgb {
            self.identity(planes, &mut out);
            return out;
        }
        let weights = self.weights();
        let mut rows = [vec![0; width], vec![0; width]];
        let mut mixed = vec![0; frame.chroma.plane(frame.size)[0]];
        for (y, out) in out.chunks_exact_mut(width * 3).enumerate() {
            for (row, plane) in rows.iter_mut().zip(&planes[1..]) {
                self.row(frame, plane, y, &mut mixed, row);
            }
            let luma = &planes[0][y * width..(y + 1) * width];
            for (((out, &luma), &u), &v) in out.chunks_exact_mut(3).zip(luma).zip(&rows[0]).zip(&rows[1]) {
                let half = 1 << (POINT + QUARTERS.ilog2() - 1);
                let grey = (luma.value() - weights.black) * QUARTERS * weights.luma + half;
                let (u, v) = (u - weights.grey * QUARTERS, v - weights.grey * QUARTERS);
                let cut = |n: i32| (n >> (POINT + QUARTERS.ilog2())).clamp(0, 255) as u8;
                out[0] = cut(grey + weights.red * v);
                out[1] = cut(grey + weights.green[0] * u + weights.green[1] * v);
                out[2] = cut(grey + weights.blue * u);
            }
        }
        out
    }

    /// Values of a plane of colour at the pixels of row `y`, times 16.
    fn row<T: Value>(&self, frame: &Frame, plane: &[T], y: usize, mixed: &mut [i32], row: &mut [i32]) {
        let [width, height] = frame.chroma.plane(frame.size);
        let [right, down] = self.offset();
        let (above, below, weight) = match frame.chroma {
            Chroma::Yuv420 => place(y, down, height),
            _ => (y, y, 0),
        };
        let line = |y: usize| &plane[y * width..(y + 1) * width];
        for ((mixed, a), b) in mixed.iter_mut().zip(line(above)).zip(line(below)) {
            *mixed = a.value() * (4 - weight) + b.value() * weight;
        }
        if frame.chroma == Chroma::Yuv444 {
            for (row, mixed) in row.iter_mut().zip(mixed) {
                *row = *mixed * 4;
            }
            return;
        }
        for (x, row) in row.iter_mut().enumerate() {
            let (left, right, weight) = place(x, right, width);
            *row = mixed[left] * (4 - weight) + mixed[right] * weight;
        }
    }

    /// Planes of green, blue and red.
    fn identity<T: Value>(&self, planes: &[Vec<T>; 3], out: &mut [u8]) {
        let [slope, _, black, _] = range(self.full_range, self.bits);
        for (channel, plane) in [1, 2, 0].into_iter().zip(planes) {
            for (out, value) in out.chunks_exact_mut(3).zip(plane) {
                out[channel] = ((f64::from(value.value()) - black) * slope).round().clamp(0.0, 255.0) as u8;
            }
        }
    }
}

/// The two places of colour around pixel `at`, and the weight of the second in quarters.
fn place(at: usize, offset: i32, count: usize) -> (usize, usize, i32) {
    let quarters = 2 * at as i32 - offset;
    let cut = |n: i32| n.clamp(0, count as i32 - 1) as usize;
    (cut(quarters.div_euclid(4)), cut(quarters.div_euclid(4) + 1), quarters.rem_euclid(4))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The formula as it is written, pixel by pixel.
    fn plain(colours: &Colours, frame: &Frame) -> Vec<u8> {
        let value = |plane: usize, at: usize| match &frame.planes {
            Planes::U8(planes) => f64::from(planes[plane][at]),
            Planes::U16(planes) => f64::from(planes[plane][at]),
        };
        let [kr, kb] = coefficients(colours.matrix);
        let kg = 1.0 - kr - kb;
        let [luma, colour, black, grey] = range(colours.full_range, colours.bits);
        let [columns, rows] = frame.chroma.plane(frame.size);
        let site =
            [[0.0, 0.5], [0.5, 0.5], [0.0, 0.0], [0.5, 0.0], [0.0, 1.0], [0.5, 1.0]][colours.siting as usize];
        let chroma = |plane: usize, x: usize, y: usize| {
            let along = |at: usize, halved: bool, site: f64, count: usize| {
                let exact = if halved { (at as f64 - site) / 2.0 } else { at as f64 };
                let exact = exact.clamp(0.0, count as f64 - 1.0);
                (exact.floor() as usize, (exact.floor() as usize + 1).min(count - 1), exact.fract())
            };
            let (x0, x1, wx) = along(x, frame.chroma != Chroma::Yuv444, site[0], columns);
            let (y0, y1, wy) = along(y, frame.chroma == Chroma::Yuv420, site[1], rows);
            let line =
                |y: usize| value(plane, y * columns + x0) * (1.0 - wx) + value(plane, y * columns + x1) * wx;
            (line(y0) * (1.0 - wy) + line(y1) * wy - grey) * colour
        };
        let mut out = Vec::new();
        for y in 0..frame.size[1] {
            for x in 0..frame.size[0] {
                let l = (value(0, y * frame.size[0] + x) - black) * luma;
                let (u, v) = (chroma(1, x, y), chroma(2, x, y));
                let green = l - 2.0 * kb * (1.0 - kb) / kg * u - 2.0 * kr * (1.0 - kr) / kg * v;
                for n in [l + 2.0 * (1.0 - kr) * v, green, l + 2.0 * (1.0 - kb) * u] {
                    out.push(n.round().clamp(0.0, 255.0) as u8);
                }
            }
        }
        out
    }

    fn noise(size: [usize; 2], chroma: Chroma, bits: u32) -> Frame {
        let mut state = 88_172_645_463_325_252u64;
        let mut plane = |[width, height]: [usize; 2]| -> Vec<u16> {
            (0..width * height)
                .map(|_| {
                    state ^= state << 13;
                    state ^= state >> 7;
                    state ^= state << 17;
                    (state >> 20) as u16 & ((1 << bits) - 1)
                })
                .collect()
        };
        let planes = [plane(size), plane(chroma.plane(size)), plane(chroma.plane(size))];
        let narrow = |plane: Vec<u16>| plane.into_iter().map(|v| v as u8).collect();
        let planes = if bits > 8 { Planes::U16(planes) } else { Planes::U8(planes.map(narrow)) };
        Frame { size, chroma, bits, planes }
    }

    #[test]
    fn whole_numbers_agree_with_the_formula() {
        let mut different = 0;
        let mut count = 0;
        for matrix in [Matrix::Unspecified, Matrix::Bt709, Matrix::Bt2020, Matrix::Other(7)] {
            for (chroma, bits, full, siting) in [
                (Chroma::Yuv420, 8, false, 0),
                (Chroma::Yuv420, 8, true, 1),
                (Chroma::Yuv420, 10, false, 2),
                (Chroma::Yuv420, 10, true, 3),
                (Chroma::Yuv420, 8, false, 4),
                (Chroma::Yuv420, 8, false, 5),
                (Chroma::Yuv422, 10, false, 0),
                (Chroma::Yuv444, 8, false, 0),
            ] {
                let frame = noise([18, 14], chroma, bits);
                let colours = Colours::new(matrix, full, bits, siting);
                let (fast, plain) = (colours.rgb(&frame), plain(&colours, &frame));
                for (a, b) in fast.iter().zip(&plain) {
                    assert!(a.abs_diff(*b) <= 1, "{matrix:?} {chroma:?} {bits} {full} {siting}");
                    different += usize::from(a != b);
                }
                count += fast.len();
            }
        }
        // Rounding falls differently where the exact value lies next to a half.
        assert!(different * 50 < count, "{different} of {count}");
    }

    #[test]
    fn black_white_and_primaries_are_exact() {
        let colour = |matrix, full, bits, yuv: [u16; 3]| {
            let planes = yuv.map(|v| vec![v]);
            let frame = Frame { size: [1, 1], chroma: Chroma::Yuv444, bits, planes: Planes::U16(planes) };
            Colours::new(matrix, full, bits, 0).rgb(&frame)
        };
        assert_eq!(colour(Matrix::Bt709, false, 8, [16, 128, 128]), [0, 0, 0]);
        assert_eq!(colour(Matrix::Bt709, false, 8, [235, 128, 128]), [255, 255, 255]);
        assert_eq!(colour(Matrix::Bt2020, false, 10, [940, 512, 512]), [255, 255, 255]);
        assert_eq!(colour(Matrix::Bt601, true, 8, [255, 128, 128]), [255, 255, 255]);
        // Red of BT.709 in limited range; its stored values are rounded.
        assert_eq!(colour(Matrix::Bt709, false, 8, [63, 102, 240]), [255, 1, 0]);
        // Green, blue, red.
        assert_eq!(colour(Matrix::Rgb, true, 8, [1, 2, 3]), [3, 1, 2]);
    }
}
