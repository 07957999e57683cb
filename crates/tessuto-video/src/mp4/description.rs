//! What a track says of its frames (`stsd`).
//!
//! Source: ISO/IEC 14496-12 (2022), 8.5.2 and 12.1; ISO/IEC 14496-15, 5.4 and 8.4.

use super::boxes::{Kind, boxes, name};
use crate::bytes::Bytes;
use crate::format::Colour;
use crate::refused::{Refused, damaged, not_handled};
use crate::track::{Configuration, avc, hevc};

/// Codecs of single images.
const STILL: [&Kind; 4] = [b"jpeg", b"png ", b"gif ", b"tiff"];

/// The first description of a track.
pub(crate) struct Description {
    /// How many there are.
    pub(crate) count: u32,
    /// Width and height `[px]`.
    pub(crate) size: [u16; 2],
    /// Whether it is of a codec of single images, which films have as well.
    pub(crate) still: bool,
    /// How to decode it, or why it is not decoded here.
    pub(crate) configuration: Result<Configuration, Refused>,
    pub(crate) pixel_aspect: Option<[u32; 2]>,
    pub(crate) colour: Colour,
}

/// Reads a box `stsd`.
pub(crate) fn description(stsd: &[u8]) -> Result<Description, Refused> {
    let mut bytes = Bytes::new(stsd, "box stsd");
    bytes.take(4)?;
    let count = bytes.u32()?;
    let Some(&(kind, content)) = boxes(bytes.rest)?.first() else { return damaged("box stsd is empty") };
    let mut bytes = Bytes::new(content, "box stsd");
    bytes.take(24)?;
    let size = [bytes.u16()?, bytes.u16()?];
    bytes.take(50)?;
    let mut found = Description {
        count,
        size,
        still: STILL.iter().any(|still| **still == kind),
        configuration: not_handled(match &kind {
            b"encv" => "encrypted frames".to_owned(),
            _ => format!("the codec {}", name(kind)),
        }),
        pixel_aspect: None,
        colour: Colour::default(),
    };
    let mut fields = 1;
    // Other codecs may put anything behind.
    if let Some(needed) = configured(kind) {
        found.configuration = damaged(format!("box {} is missing", name(*needed)));
        for (kind, content) in boxes(bytes.rest)? {
            match &kind {
                b"avcC" if needed == b"avcC" => found.configuration = avc(content),
                b"hvcC" if needed == b"hvcC" => found.configuration = hevc(content),
                b"pasp" => found.pixel_aspect = aspect(content)?,
                b"colr" => found.colour = colour(content)?,
                b"fiel" => fields = Bytes::new(content, "box fiel").u8()?,
                _ => {}
            }
        }
    }
    if fields == 2 && found.configuration.is_ok() {
        found.configuration = not_handled("interlaced frames (box fiel)");
    }
    Ok(found)
}

/// The box that configures the decoder of a codec.
fn configured(kind: Kind) -> Option<&'static Kind> {
    match &kind {
        b"avc1" | b"avc3" => Some(b"avcC"),
        b"hvc1" | b"hev1" => Some(b"hvcC"),
        _ => None,
    }
}

fn aspect(content: &[u8]) -> Result<Option<[u32; 2]>, Refused> {
    let mut bytes = Bytes::new(content, "box pasp");
    Ok(Some([bytes.u32()?, bytes.u32()?]).filter(|a| a[0] > 0 && a[1] > 0))
}

/// `nclx` of MP4, which states the range, and `nclc` of QuickTime, which does not.
fn colour(content: &[u8]) -> Result<Colour, Refused> {
    let mut bytes = Bytes::new(content, "box colr");
    let kind = bytes.take(4)?;
    if kind != b"nclx" && kind != b"nclc" {
        return Ok(Colour::default());
    }
    bytes.u16()?;
    let (transfer, matrix) = (bytes.u16()?, bytes.u16()?);
    let full_range = if kind == b"nclx" { Some(bytes.u8()? & 0x80 != 0) } else { None };
    Ok(Colour { full_range, transfer: Some(transfer.into()), matrix: Some(matrix.into()) })
}
