//! Which way up a camera was held.

use super::{Pixels, Samples};

/// The number, 1 to 8, that an Exif block states; `None` if it states nothing that is understood.
///
/// Source: *Exchangeable image file format for digital still cameras*, 2.32: tag 0x112 of the first directory, one
/// number of 16 bits.
pub(super) fn of_exif(exif: &[u8]) -> Option<u8> {
    let little = match exif.get(..4)? {
        b"II*\0" => true,
        b"MM\0*" => false,
        _ => return None,
    };
    let word = |at: usize| {
        let bytes: [u8; 2] = exif.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if little { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
    };
    let long = |at: usize| {
        let bytes: [u8; 4] = exif.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    };
    let directory = long(4)? as usize;
    for entry in 0..usize::from(word(directory)?) {
        let at = directory + 2 + 12 * entry;
        // Tag, type, number of values, the value itself with two bytes to spare.
        let (tag, kind, count, value) = (word(at)?, word(at + 2)?, long(at + 4)?, word(at + 8)?);
        word(at + 10)?;
        if (tag, kind, count) == (0x112, 3, 1) {
            return u8::try_from(value).ok().filter(|number| (1..=8).contains(number));
        }
    }
    None
}

/// `pixels` the right way up, given the number that their file states.
pub(super) fn upright(pixels: Pixels, orientation: u8) -> Pixels {
    if !(2..=8).contains(&orientation) {
        return pixels;
    }
    let Pixels { width, height, channels, samples } = pixels;
    let (right, bottom) = (width - 1, height - 1);
    // Where the pixel of column x and row y was.
    let from = move |x: usize, y: usize| match orientation {
        2 => [right - x, y],
        3 => [right - x, bottom - y],
        4 => [x, bottom - y],
        5 => [y, x],
        6 => [y, bottom - x],
        7 => [right - y, bottom - x],
        _ => [right - y, x],
    };
    let size = if orientation < 5 { [width, height] } else { [height, width] };
    let at = |x, y| {
        let [x, y] = from(x, y);
        (y * width + x) * channels
    };
    let samples = match samples {
        Samples::Bytes(data) => Samples::Bytes(turned(&data, size, channels, at)),
        Samples::Words(data) => Samples::Words(turned(&data, size, channels, at)),
    };
    Pixels { width: size[0], height: size[1], channels, samples }
}

/// An image of the given size, whose pixels stand in `data` where `at` says.
fn turned<T: Copy>(
    data: &[T],
    [width, height]: [usize; 2],
    channels: usize,
    at: impl Fn(usize, usize) -> usize,
) -> Vec<T> {
    let mut out = Vec::with_capacity(data.len());
    for y in 0..height {
        for x in 0..width {
            out.extend_from_slice(&data[at(x, y)..][..channels]);
        }
    }
    out
}
