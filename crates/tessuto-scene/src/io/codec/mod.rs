//! What the crates of the formats leave to whoever reads an image: which format it is, bounds before anything is
//! decoded, numbers of every depth, and which way up it is.

pub(super) mod exr;
pub(super) mod jpeg;
mod orientation;
mod pixels;
pub(super) mod png;
pub(super) mod radiance;

pub(crate) use pixels::Pixels;
pub use pixels::Samples;

/// Largest width and height `[px]`.
pub const MAX_SIDE: usize = 16_384;

/// Formats that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    Png,
    Jpeg,
    OpenExr,
    Radiance,
}

impl Format {
    /// The format of a file, by its first bytes.
    pub fn of(bytes: &[u8]) -> Option<Self> {
        const MAGIC: [(&[u8], Format); 4] = [
            (b"\x89PNG\r\n\x1a\n", Format::Png),
            (b"\xff\xd8\xff", Format::Jpeg),
            (b"\x76\x2f\x31\x01", Format::OpenExr),
            (b"#?RADIANCE", Format::Radiance),
        ];
        MAGIC.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|(_, format)| *format)
    }

    /// Whether files of the format have names that end so.
    pub fn has_ending(self, ending: &str) -> bool {
        let endings: &[&str] = match self {
            Self::Png => &["png", "apng"],
            Self::Jpeg => &["jpg", "jpeg", "jfif"],
            Self::OpenExr => &["exr"],
            Self::Radiance => &["hdr"],
        };
        endings.iter().any(|usual| usual.eq_ignore_ascii_case(ending))
    }
}

/// Why an image was not decoded.
#[derive(Debug, PartialEq)]
pub(crate) enum Refusal {
    /// What is wrong with the file.
    Broken(String),
    /// It would take more memory than asked for.
    Large {
        /// Width and height `[px]`.
        size: [usize; 2],
        /// Decoded `[bytes]`.
        bytes: u64,
    },
}

impl Refusal {
    fn broken(error: impl std::fmt::Display) -> Self {
        Self::Broken(error.to_string())
    }
}

/// Refuses sides above [`MAX_SIDE`] and more than `most` bytes of pixels that have `pixel` bytes each.
fn expect_size(size: [usize; 2], pixel: usize, most: u64) -> Result<(), Refusal> {
    if size.iter().any(|side| *side > MAX_SIDE) {
        let [width, height] = size;
        return Err(Refusal::Broken(format!("{width}×{height} pixels; at most {MAX_SIDE} a side are read")));
    }
    let bytes = (size[0] * size[1] * pixel) as u64;
    if bytes > most { Err(Refusal::Large { size, bytes }) } else { Ok(()) }
}

/// A decoded PNG or JPEG file.
pub(crate) struct Decoded {
    /// As stored, the right way up.
    pub pixels: Pixels,
    /// Whether it was turned or mirrored for that.
    pub turned: bool,
    /// Whether it was made of cyan, magenta, yellow and black.
    pub inks: bool,
}

/// Decodes a PNG or JPEG file of at most `most` bytes of pixels.
pub(crate) fn decode(bytes: &[u8], format: Format, most: u64) -> Result<Decoded, Refusal> {
    match format {
        Format::Png => png::decode(bytes, most),
        Format::Jpeg => jpeg::decode(bytes, most),
        Format::OpenExr | Format::Radiance => Err(Refusal::Broken("holds linear radiance".into())),
    }
}

#[cfg(test)]
mod tests;
