//! Pixels of Radiance .hdr files.
//!
//! Source: G. Ward, *Real Pixels*, Graphics Gems II, 1991, and *File formats* of Radiance: a header of lines, an empty
//! one, the size, then rows of four bytes a pixel: three mantissas and the exponent that they share. Rows are packed by
//! channels, by pixels as of old, or not at all.

use super::{Refusal, expect_size};

/// Width, height, and linear colours, shape [height, width, 3]; of at most `most` bytes.
pub(in crate::io) fn decode(bytes: &[u8], most: u64) -> Result<([usize; 2], Vec<f32>), Refusal> {
    let mut file = File { bytes };
    file.line()?;
    loop {
        let line = file.line()?;
        if line.is_empty() {
            break;
        }
        let line = String::from_utf8_lossy(line);
        if let Some((key, value)) = line.split_once('=').filter(|_| !line.starts_with('#'))
            && key.trim() == "FORMAT"
            && value.trim() != "32-bit_rle_rgbe"
        {
            return Err(Refusal::Broken(format!("its format is {}, not 32-bit_rle_rgbe", value.trim())));
        }
    }
    let line = String::from_utf8_lossy(file.line()?).into_owned();
    let words: Vec<&str> = line.split_whitespace().collect();
    let ["-Y", height, "+X", width] = words[..] else {
        return Err(Refusal::Broken(format!("its rows are ordered as {line}, not -Y HEIGHT +X WIDTH")));
    };
    let side = |word: &str| word.parse().map_err(|e| Refusal::Broken(format!("its size is {word}: {e}")));
    let size: [usize; 2] = [side(width)?, side(height)?];
    expect_size(size, 3 * size_of::<f32>(), most)?;
    let mut out = Vec::with_capacity(3 * size[0] * size[1]);
    let mut row = vec![[0; 4]; size[0]];
    for _ in 0..size[1].min(size[0] * size[1]) {
        file.row(&mut row)?;
        out.extend(row.iter().flat_map(|pixel| linear(*pixel)));
    }
    Ok((size, out))
}

/// Mantissas over 256 times two to the power of the exponent less 128.
fn linear([r, g, b, exponent]: [u8; 4]) -> [f32; 3] {
    // The power of two by its bits; it is subnormal where the exponent is 1, and 0 means black.
    let bits = match exponent {
        0 => 0,
        1 => 1 << 22,
        e => u32::from(e - 1) << 23,
    };
    let scale = f32::from_bits(bits) / 256.0;
    [r, g, b].map(|v| scale * f32::from(v))
}

/// The rest of a file.
struct File<'a> {
    bytes: &'a [u8],
}

impl<'a> File<'a> {
    fn ended() -> Refusal {
        Refusal::Broken("it ends too early".into())
    }

    fn line(&mut self) -> Result<&'a [u8], Refusal> {
        if self.bytes.is_empty() {
            return Err(Self::ended());
        }
        let end = self.bytes.iter().position(|b| *b == b'\n');
        let line = &self.bytes[..end.unwrap_or(self.bytes.len())];
        self.bytes = end.map_or(&[], |end| &self.bytes[end + 1..]);
        Ok(line)
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], Refusal> {
        let (taken, left) = self.bytes.split_at_checked(count).ok_or_else(Self::ended)?;
        self.bytes = left;
        Ok(taken)
    }

    fn pixel(&mut self) -> Result<[u8; 4], Refusal> {
        let taken = self.take(4)?;
        Ok([taken[0], taken[1], taken[2], taken[3]])
    }

    fn row(&mut self, row: &mut [[u8; 4]]) -> Result<(), Refusal> {
        match self.pixel()? {
            [2, 2, high, _] if high < 128 => (0..4).try_for_each(|channel| self.channel(row, channel)),
            first => self.pixels(first, row),
        }
    }

    /// One channel of a row, in runs of one value and of several.
    fn channel(&mut self, row: &mut [[u8; 4]], channel: usize) -> Result<(), Refusal> {
        let (mut at, width) = (0, row.len());
        while at < width {
            let count = self.take(1)?[0];
            let run = usize::from(if count > 128 { count - 128 } else { count });
            let part = row.get_mut(at..at + run).ok_or_else(|| too_long(at + run, width))?;
            if count > 128 {
                let value = self.take(1)?[0];
                part.iter_mut().for_each(|pixel| pixel[channel] = value);
            } else {
                part.iter_mut().zip(self.take(run)?).for_each(|(pixel, value)| pixel[channel] = *value);
            }
            at += run;
        }
        Ok(())
    }

    /// A row of whole pixels, of which those with mantissas of 1 say how often the one before them is repeated.
    fn pixels(&mut self, first: [u8; 4], row: &mut [[u8; 4]]) -> Result<(), Refusal> {
        let repeated = |pixel: [u8; 4]| (pixel[..3] == [1; 3]).then_some(usize::from(pixel[3]));
        if repeated(first).is_some() {
            return Err(Refusal::Broken("a row begins with a repetition".into()));
        }
        row[0] = first;
        let (mut at, mut factor, width) = (1, 1usize, row.len());
        while at < width {
            let pixel = self.pixel()?;
            let Some(count) = repeated(pixel) else {
                row[at] = pixel;
                (at, factor) = (at + 1, 1);
                continue;
            };
            let end = at.saturating_add(count.saturating_mul(factor));
            let last = row[at - 1];
            row.get_mut(at..end).ok_or_else(|| too_long(end, width))?.fill(last);
            (at, factor) = (end, factor.saturating_mul(256));
        }
        Ok(())
    }
}

fn too_long(length: usize, width: usize) -> Refusal {
    Refusal::Broken(format!("a row has {length} pixels or more, expected {width}"))
}
