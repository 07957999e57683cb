//! What both containers come to: where the frames lie in the file, and when they are shown.

use crate::bytes::Bytes;
use crate::format::Colour;
use crate::refused::{Refused, damaged, not_handled};

/// Codecs that are decoded here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Codec {
    H264,
    Hevc,
}

impl Codec {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Codec::H264 => "h264",
            Codec::Hevc => "hevc",
        }
    }
}

/// How the units of a frame are separated, and the parameter sets beside them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Configuration {
    pub(crate) codec: Codec,
    /// Bytes of the length before each unit.
    pub(crate) length: usize,
    /// Units of parameter sets.
    pub(crate) sets: Vec<Vec<u8>>,
}

/// A frame as it lies in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    /// First byte.
    pub(crate) offset: u64,
    pub(crate) size: u32,
    /// Time `[s]` at which it is shown; `None` if it is decoded only.
    pub(crate) shown: Option<f64>,
    /// Whether decoding may begin here.
    pub(crate) sync: bool,
}

/// The film of a container.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    pub(crate) configuration: Configuration,
    /// In the order of decoding.
    pub(crate) samples: Vec<Sample>,
    /// Unit of the times `[s]`.
    pub(crate) tick: f64,
    /// Bytes that stand before the content of every sample, but not in the file (Matroska's header stripping).
    pub(crate) prefix: Vec<u8>,
    pub(crate) pixel_aspect: Option<[u32; 2]>,
    pub(crate) colour: Colour,
    /// Clockwise `[degrees]`.
    pub(crate) turn: u32,
    pub(crate) capture_rate: Option<f64>,
}

/// Reads an AVCDecoderConfigurationRecord (ISO/IEC 14496-15, 5.3.3).
pub(crate) fn avc(content: &[u8]) -> Result<Configuration, Refused> {
    let mut bytes = Bytes::new(content, "the configuration of H.264");
    if bytes.u8()? != 1 {
        return damaged("the configuration of H.264 is of an unknown version");
    }
    bytes.take(3)?;
    let length = usize::from(bytes.u8()? & 3) + 1;
    let mut sets = Vec::new();
    for mask in [31, 255] {
        for _ in 0..bytes.u8()? & mask {
            let length = bytes.u16()?;
            sets.push(bytes.take(length.into())?.to_vec());
        }
    }
    Ok(Configuration { codec: Codec::H264, length, sets })
}

/// Reads an HEVCDecoderConfigurationRecord (ISO/IEC 14496-15, 8.3.3).
pub(crate) fn hevc(content: &[u8]) -> Result<Configuration, Refused> {
    let mut bytes = Bytes::new(content, "the configuration of HEVC");
    bytes.take(21)?;
    let length = usize::from(bytes.u8()? & 3) + 1;
    let mut sets = Vec::new();
    for _ in 0..bytes.u8()? {
        bytes.u8()?;
        for _ in 0..bytes.u16()? {
            let length = bytes.u16()?;
            sets.push(bytes.take(length.into())?.to_vec());
        }
    }
    Ok(Configuration { codec: Codec::Hevc, length, sets })
}

/// The units of a sample, which have their lengths before them.
pub(crate) fn units(sample: &[u8], length: usize) -> Result<Vec<&[u8]>, Refused> {
    let mut bytes = Bytes::new(sample, "a frame's data");
    let mut units = Vec::new();
    while !bytes.rest.is_empty() {
        let size = bytes.number(length)?;
        units.push(bytes.take(usize::try_from(size).unwrap_or(usize::MAX))?);
    }
    Ok(units)
}

/// A matrix as containers store it, as the clockwise angle by which it turns `[degrees]`.
///
/// `a`, `b`, `c`, `d` map a column (x, y) of the frame to (a x + c y, b x + d y).
pub(crate) fn turn([a, b, c, d]: [i32; 4]) -> Result<u32, Refused> {
    let [a, b, c, d] = [a, b, c, d].map(i64::from);
    match (a.signum(), b.signum(), c.signum(), d.signum()) {
        (1, 0, 0, 1) => Ok(0),
        (0, 1, -1, 0) => Ok(90),
        (-1, 0, 0, -1) => Ok(180),
        (0, -1, 1, 0) => Ok(270),
        (0, 0, 0, 0) => Ok(0),
        _ => not_handled("a track that is mirrored, or turned by no multiple of 90°"),
    }
}
