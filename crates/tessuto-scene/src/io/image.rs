//! PNG and JPEG files, distinguished by their content, to float images and back.
//!
//! Every bit depth and colour type is read: 16 bits keep their precision, grey becomes RGB, palettes
//! are resolved, alpha is dropped. Nothing is decoded before its size is known to be acceptable.

pub mod mask;

use std::io::Read as _;
use std::path::{Path, PathBuf};

use super::codec::{self, Format, Pixels, Refusal};
use super::rgb8::Rgb8;
use crate::io::{atomic_write, read_bounded};
use tessuto_core::camera::Rect;
use tessuto_core::error::{Error, Result};
use tessuto_core::image::Image;

pub use super::codec::MAX_SIDE;
pub use super::codec::Samples;

/// Largest file, and largest decoded image `[bytes]`.
pub(crate) const MAX_BYTES: u64 = 256 << 20;

/// A decoded image that has not been converted to floats yet.
#[derive(Clone)]
pub(crate) struct ImageFile {
    path: PathBuf,
    pixels: Pixels,
    /// Whether a reader that knows nothing of orientation and transparency sees the same image.
    pub plain: bool,
    /// What was unusual about the file, for a warning.
    pub notes: Vec<&'static str>,
    /// Whether it was compressed with losses.
    pub lossy: bool,
    /// Colour of every index, of a file that has a palette.
    pub palette: Option<Vec<[u8; 3]>>,
}

/// Of an image that has more than colours.
pub(crate) const ALPHA_IGNORED: &str = "transparency (alpha) is ignored";

/// sRGB-encoded colour in [0, 1], shape [height, width, 3].
pub fn read(path: &Path) -> Result<Image> {
    let file = open(path)?;
    Ok(file.rgb(file.full()))
}

/// sRGB-encoded colour as bytes.
pub fn read_bytes(path: &Path) -> Result<Rgb8> {
    let pixels = open(path)?.pixels;
    Ok(Rgb8::new([pixels.width, pixels.height], pixels.into_rgb8()))
}

/// A mask in [0, 1], shape [height, width, 1], and a warning where its values were unusual: [`mask::read`]
/// of the only object.
pub fn read_mask(path: &Path) -> Result<(Image, Option<String>)> {
    mask::read(path, None)
}

/// One channel in [0, 1], shape [height, width, 1], as the file has it: luminance of coloured images.
pub fn read_grey(path: &Path) -> Result<Image> {
    let file = open(path)?;
    Ok(grey(file.floats(file.full(), false)))
}

/// Bytes of an image of 3 channels; values are clamped to [0, 1] and rounded.
pub fn rgb8(image: &Image) -> Rgb8 {
    let values = image.data.iter().map(|v| (255.0 * v.clamp(0.0, 1.0)).round() as u8).collect();
    Rgb8::new([image.width, image.height], values)
}

/// Writes an image of 1 or 3 channels as 8-bit PNG; values are clamped to [0, 1] and rounded.
pub fn write_png(path: &Path, image: &Image) -> Result<()> {
    atomic_write(path, &encode_png(image))
}

/// Header of a PNG: signature and the chunk IHDR `[bytes]`.
const PNG_HEADER: usize = 33;
/// A chunk of text, with its checksum, that says which program wrote the image.
const PNG_MARK: &[u8] = b"\0\0\0\x16tEXtSoftware\0tessuto check\x14\x51\x9f\x42";

/// [`write_png`] of an image that [`is_marked_png`] recognises.
pub fn write_marked_png(path: &Path, image: &Image) -> Result<()> {
    let png = encode_png(image);
    atomic_write(path, &[&png[..PNG_HEADER], PNG_MARK, &png[PNG_HEADER..]].concat())
}

/// Whether [`write_marked_png`] wrote the file.
pub fn is_marked_png(path: &Path) -> bool {
    let mut start = [0; PNG_HEADER + PNG_MARK.len()];
    let read = std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok() && start.ends_with(PNG_MARK)
}

/// The bytes of an 8-bit PNG of an image of 1 or 3 channels; values are clamped to [0, 1] and rounded.
pub fn encode_png(image: &Image) -> Vec<u8> {
    let bytes: Vec<u8> = image.data.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect();
    encode_png_bytes(&bytes, [image.width, image.height], image.channels)
}

/// The bytes of an 8-bit PNG of `pixels`, shape [height, width, channels] with 1 or 3 channels.
#[doc(hidden)]
pub fn encode_png_bytes(pixels: &[u8], size: [usize; 2], channels: usize) -> Vec<u8> {
    codec::png::encode(pixels, size, channels)
}

/// Width and height of an image as [`read`] gives it `[px]`.
pub fn size(path: &Path) -> Result<[usize; 2]> {
    let full = open(path)?.full();
    Ok([full.x1, full.y1])
}

/// The `region` of an image as [`read`] gives it, which must have `size` `[px]`.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read or has another size.
pub fn read_region(path: &Path, size: [usize; 2], region: Rect) -> Result<Image> {
    let file = open(path)?;
    file.expect_size(size)?;
    Ok(file.rgb(region))
}

/// Reads and decodes a PNG or JPEG file.
pub(crate) fn open(path: &Path) -> Result<ImageFile> {
    let bytes = read_bounded(path, MAX_BYTES)?;
    let broken = |problem: String| {
        Error::input(
            path.display().to_string(),
            format!("{problem} (file of {} bytes)", bytes.len()),
            "copy or extract this image again; PNG and JPEG are read",
        )
    };
    let mut notes = Vec::new();
    let Some(format @ (Format::Png | Format::Jpeg)) = Format::of(&bytes) else {
        return Err(broken("is neither PNG nor JPEG".into()));
    };
    if !path.extension().is_some_and(|ending| format.has_ending(&ending.to_string_lossy())) {
        notes.push("the file name's ending does not say what the file is");
    }
    let lossy = format == Format::Jpeg;
    if lossy && !jpeg_is_complete(&bytes) {
        return Err(broken("is a truncated JPEG: its end marker is missing".into()));
    }
    let decoded = codec::decode(&bytes, format, MAX_BYTES).map_err(|refusal| match refusal {
        Refusal::Broken(problem) => broken(format!("cannot be decoded: {problem}")),
        Refusal::Large { size: [width, height], bytes } => Error::input(
            path.display().to_string(),
            format!("{width}×{height} pixels take {bytes} bytes; at most {MAX_BYTES} are read"),
            "scale the images and the camera down",
        ),
    })?;
    let pixels = decoded.pixels;
    if decoded.inks {
        notes.push("CMYK was converted to RGB without a colour profile");
    }
    if pixels.has_alpha() {
        notes.push(ALPHA_IGNORED);
    }
    let plain = !decoded.turned && !pixels.has_alpha();
    let palette = if lossy { None } else { palette(&bytes) };
    Ok(ImageFile { path: path.to_path_buf(), pixels, plain, notes, lossy, palette })
}

/// The palette of a PNG file that has one; the pixels' own colours are the decoder's.
fn palette(bytes: &[u8]) -> Option<Vec<[u8; 3]>> {
    // Colour type 3, of the header; then chunks of length, name, content and checksum.
    if bytes.get(25) != Some(&3) {
        return None;
    }
    let mut at = PNG_HEADER;
    loop {
        let length = u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize;
        let content = bytes.get(at + 8..(at + 8).checked_add(length)?)?;
        if &bytes[at + 4..at + 8] == b"PLTE" {
            return Some(content.as_chunks::<3>().0.to_vec());
        }
        at += length + 12;
    }
}

impl ImageFile {
    /// The image of `samples`, shape [height, width, channels] with 1 or 3 channels, whose messages call it
    /// `place`; `None` if there are not that many samples.
    pub fn held(place: &str, [width, height]: [usize; 2], channels: usize, samples: Samples) -> Option<Self> {
        if !matches!(channels, 1 | 3) || samples.len() != width.checked_mul(height)?.checked_mul(channels)? {
            return None;
        }
        let pixels = Pixels { width, height, channels, samples };
        Some(Self { path: place.into(), pixels, plain: true, notes: Vec::new(), lossy: false, palette: None })
    }

    /// The file, or what stands for it in messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The whole image.
    pub fn full(&self) -> Rect {
        Rect { x0: 0, y0: 0, x1: self.pixels.width, y1: self.pixels.height }
    }

    /// Error unless the image has this size `[px]`.
    pub fn expect_size(&self, [width, height]: [usize; 2]) -> Result<()> {
        let full = self.full();
        if (full.x1, full.y1) == (width, height) {
            return Ok(());
        }
        Err(Error::input(
            self.path.display().to_string(),
            format!("is {}×{} pixels, but scene.json says {width}×{height}", full.x1, full.y1),
            "give every frame and mask the size of scene.json; a resized video needs fx, fy, cx, cy scaled alike",
        ))
    }

    /// Colour of `region`, shape [height, width, 3].
    pub fn rgb(&self, region: Rect) -> Image {
        self.floats(region, true)
    }

    /// Its pixels.
    pub fn pixels(&self) -> &Pixels {
        &self.pixels
    }

    /// Luminance of `region` over the largest value of the format, as a mask, shape [height, width, 1].
    pub fn luminance(&mut self, region: Rect) -> Image {
        let mask = grey(self.floats(region, false));
        let (largest, full_scale) = self.pixels.largest();
        if largest > 0.0 && largest < full_scale / 2.0 {
            self.notes.push("the mask's brightest value is below half of white");
        }
        mask
    }

    /// The largest luminance in the file [of 255].
    pub fn brightest_luminance(&self) -> f32 {
        let (largest, full_scale) = self.pixels.largest();
        255.0 * largest / full_scale
    }

    /// 8-bit colour, shape [height, width, 3].
    pub fn into_rgb8(self) -> Vec<u8> {
        self.pixels.into_rgb8()
    }

    /// Opacity in [0, 1], shape [height, width, 1], where the image has any.
    pub fn alpha(&self) -> Option<Image> {
        let full = self.full();
        let data = self.pixels.alpha()?;
        Some(Image { width: full.x1, height: full.y1, channels: 1, data })
    }

    /// `region` in [0, 1]; grey images have 1 channel unless `spread` asks for 3.
    fn floats(&self, region: Rect, spread: bool) -> Image {
        let source = Layout { width: self.pixels.width, channels: self.pixels.channels, region, spread };
        match &self.pixels.samples {
            Samples::Bytes(values) => source.cut(values, |v| f32::from(v) / 255.0),
            Samples::Words(values) => source.cut(values, |v| f32::from(v) / 65_535.0),
        }
    }
}

/// Luminance of `image`, which may be grey already.
fn grey(mut image: Image) -> Image {
    if image.channels == 3 {
        let luminance = |p: &[f32]| {
            // Grey stays exactly what it is; the weights are those of sRGB's primaries.
            if p[0] == p[1] && p[1] == p[2] { p[0] } else { 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2] }
        };
        image.data = image.data.chunks_exact(3).map(luminance).collect();
        image.channels = 1;
    }
    image
}

/// How decoded values lie in memory, and what is wanted of them.
struct Layout {
    width: usize,
    channels: usize,
    region: Rect,
    spread: bool,
}

impl Layout {
    fn cut<T: Copy>(&self, values: &[T], float: impl Fn(T) -> f32) -> Image {
        let (n, region) = (self.channels, self.region);
        let grey = n < 3;
        let mut out = Image::new(region.width(), region.height(), if grey && !self.spread { 1 } else { 3 });
        let row_length = out.width * out.channels;
        for (y, out_row) in out.data.chunks_exact_mut(row_length).enumerate() {
            let start = ((region.y0 + y) * self.width + region.x0) * n;
            let row = &values[start..start + region.width() * n];
            match (grey, self.spread) {
                (true, false) => {
                    out_row.iter_mut().zip(row.chunks_exact(n)).for_each(|(o, p)| *o = float(p[0]))
                }
                (true, true) => {
                    out_row
                        .chunks_exact_mut(3)
                        .zip(row.chunks_exact(n))
                        .for_each(|(o, p)| o.fill(float(p[0])));
                }
                (false, _) => {
                    for (o, p) in out_row.chunks_exact_mut(3).zip(row.chunks_exact(n)) {
                        o.iter_mut().zip(p).for_each(|(o, p)| *o = float(*p));
                    }
                }
            }
        }
        out
    }
}

/// Whether the image's data ends with an end marker. The decoder fills what a truncated file lacks
/// with grey and says nothing. An embedded preview has an end marker of its own, so segments are walked.
fn jpeg_is_complete(bytes: &[u8]) -> bool {
    let mut at = 2;
    while let Some([0xFF, marker]) = bytes.get(at..at + 2) {
        match marker {
            0xD9 => return true,
            // Fill byte, or markers without content.
            0xFF => at += 1,
            0x01 | 0xD0..=0xD8 => at += 2,
            _ => {
                let Some([high, low]) = bytes.get(at + 2..at + 4) else { return false };
                at += 2 + usize::from(u16::from_be_bytes([*high, *low]));
                if *marker == 0xDA {
                    // Compressed data: FF is followed by 00 or a restart marker until the next segment.
                    let next = |p: &[u8]| p[0] == 0xFF && !matches!(p[1], 0x00 | 0xD0..=0xD7);
                    match bytes.get(at..).and_then(|rest| rest.windows(2).position(next)) {
                        Some(length) => at += length,
                        None => return false,
                    }
                }
            }
        }
    }
    false
}
