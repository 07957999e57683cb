//! H.264: its parameter sets, and its frames by the crate `rust_h264`.
//!
//! Source: ITU-T H.264 (08/2021), 7.3.2.1.1 (sequence parameter set), E.1.1 (usability information).

use rust_h264::decoder::{Decoder, OrderedDecoder};
use rust_h264::error::DecodeError;
use rust_h264::nal::{NalUnit, NalUnitType};

use crate::bits::{Bits, unescaped};
use crate::format::{Colour, Format, usability};
use crate::frame::{Chroma, Frame, Planes};
use crate::refused::{Refused, damaged, not_handled};

/// `nal_unit_type` of a sequence parameter set.
pub(crate) const SEQUENCE: u8 = 7;
/// Most macroblocks in the frames that are kept, of the highest level (table A-1, MaxDpbMbs of level 6.2).
const KEPT: u64 = 696_320;

/// `nal_unit_type`.
pub(crate) fn kind(unit: &[u8]) -> u8 {
    unit.first().map_or(0, |b| b & 31)
}

/// Whether the unit is part of a frame.
pub(crate) fn is_slice(kind: u8) -> bool {
    (1..=5).contains(&kind)
}

/// How a frame of these units serves as a beginning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Beginning {
    /// Nothing behind it refers to frames before it.
    Clean,
    /// It refers to no other frame; frames that are shown before it may.
    Open,
    /// It refers to other frames.
    None,
}

/// How a frame serves as a beginning.
pub(crate) fn beginning(units: &[&[u8]]) -> Beginning {
    let mut slices = units.iter().filter(|unit| is_slice(kind(unit))).peekable();
    if slices.peek().is_none() {
        return Beginning::None;
    }
    let intra = |unit: &[u8]| {
        // The numbers in front of a slice are short.
        let payload = unescaped(&unit[1..unit.len().min(32)]);
        let mut bits = Bits::new(&payload);
        bits.unsigned().is_ok() && bits.unsigned().is_ok_and(|slice| slice % 5 == 2)
    };
    let mut found = Beginning::Clean;
    for slice in slices {
        match kind(slice) {
            5 => {}
            _ if intra(slice) => found = Beginning::Open,
            _ => return Beginning::None,
        }
    }
    found
}

/// Reads a sequence parameter set with its header byte.
pub(crate) fn sequence(unit: &[u8]) -> Result<Format, Refused> {
    let payload = unescaped(unit.get(1..).unwrap_or_default());
    let mut bits = Bits::new(&payload);
    let profile = bits.bits(8)?;
    bits.skip(16)?;
    bits.up_to(31, "seq_parameter_set_id")?;
    let (mut chroma, mut depth) = (1, 8);
    if matches!(profile, 100 | 110 | 122 | 244 | 44 | 83 | 86 | 118 | 128 | 138 | 139 | 134 | 135) {
        chroma = bits.up_to(3, "chroma_format_idc")?;
        if chroma == 3 && bits.bit()? {
            return not_handled("H.264 with three separate colour planes");
        }
        depth = 8 + bits.up_to(6, "bit_depth_luma_minus8")?;
        if 8 + bits.up_to(6, "bit_depth_chroma_minus8")? != depth {
            return not_handled("H.264 whose luma and chroma have different bits");
        }
        if bits.bit()? {
            return not_handled("lossless H.264");
        }
        if bits.bit()? {
            scaling_lists(&mut bits, if chroma == 3 { 12 } else { 8 })?;
        }
    }
    if chroma == 3 {
        return not_handled("H.264 with 4:4:4 colours");
    }
    bits.up_to(12, "log2_max_frame_num_minus4")?;
    match bits.up_to(2, "pic_order_cnt_type")? {
        0 => drop(bits.up_to(12, "log2_max_pic_order_cnt_lsb_minus4")?),
        1 => {
            bits.bit()?;
            bits.signed()?;
            bits.signed()?;
            for _ in 0..bits.up_to(255, "num_ref_frames_in_pic_order_cnt_cycle")? {
                bits.signed()?;
            }
        }
        _ => {}
    }
    let references = bits.up_to(16, "max_num_ref_frames")?;
    bits.bit()?;
    let columns = bits.up_to(1 << 16, "pic_width_in_mbs_minus1")? as usize + 1;
    let rows = bits.up_to(1 << 16, "pic_height_in_map_units_minus1")? as usize + 1;
    let progressive = bits.bit()?;
    if !progressive {
        bits.bit()?;
    }
    bits.bit()?;
    let coded = [columns * 16, rows * 16 * if progressive { 1 } else { 2 }];
    let size = if bits.bit()? { cropped(&mut bits, coded, chroma, progressive)? } else { coded };
    let mut format = Format {
        coded,
        size,
        chroma,
        bits: depth,
        progressive,
        pixel_aspect: None,
        colour: Colour::default(),
        siting: 0,
        references,
    };
    if bits.bit()? {
        usability(&mut bits, &mut format)?;
    }
    let kept = (columns * rows) as u64 * u64::from(references);
    if kept > KEPT {
        return damaged(format!(
            "{references} frames of {}×{} px to be kept, more than any level allows",
            size[0], size[1]
        ));
    }
    Ok(format)
}

/// The frame without its borders.
fn cropped(
    bits: &mut Bits,
    coded: [usize; 2],
    chroma: u32,
    progressive: bool,
) -> Result<[usize; 2], Refused> {
    let unit = [
        if matches!(chroma, 1 | 2) { 2 } else { 1 },
        (if chroma == 1 { 2 } else { 1 }) * if progressive { 1 } else { 2 },
    ];
    let mut edge = || Ok::<_, Refused>(bits.up_to(1 << 17, "frame_crop_offset")? as usize);
    let [left, right, top, bottom] = [edge()?, edge()?, edge()?, edge()?];
    let cut = [(left + right) * unit[0], (top + bottom) * unit[1]];
    if cut[0] >= coded[0] || cut[1] >= coded[1] {
        return damaged("nothing is left of a cropped frame");
    }
    Ok([coded[0] - cut[0], coded[1] - cut[1]])
}

/// Passes over scaling lists (7.3.2.1.1.1).
fn scaling_lists(bits: &mut Bits, lists: usize) -> Result<(), Refused> {
    for list in 0..lists {
        if !bits.bit()? {
            continue;
        }
        let (mut last, mut next) = (8, 8);
        for _ in 0..if list < 6 { 16 } else { 64 } {
            if next != 0 {
                next = (last + bits.signed()?).rem_euclid(256);
            }
            last = if next == 0 { last } else { next };
        }
    }
    Ok(())
}

/// A unit as the decoder takes it; `None` for those that it has no use for.
pub(crate) fn unit(unit: &[u8]) -> Result<Option<NalUnit<'_>>, Refused> {
    let kind = kind(unit);
    if (2..=4).contains(&kind) {
        return not_handled("H.264 with partitioned slices");
    }
    if unit.is_empty() || unit[0] & 0x80 != 0 || !matches!(kind, 1 | 5 | 7 | 8) {
        return Ok(None);
    }
    Ok(Some(NalUnit {
        nal_ref_idc: unit[0] >> 5 & 3,
        nal_unit_type: NalUnitType::from(kind),
        rbsp: unescaped(&unit[1..]),
    }))
}

fn error(error: DecodeError) -> Refused {
    match error {
        DecodeError::Unsupported(what) => Refused::NotHandled(format!("H.264: {what}")),
        error => Refused::Damaged(format!("H.264: {error}")),
    }
}

/// Takes the next unit of a stream without time stamps; returns frames in the order of display.
pub(crate) fn ordered(decoder: &mut OrderedDecoder, bytes: &[u8]) -> Result<Vec<Frame>, Refused> {
    let Some(unit) = unit(bytes)? else { return Ok(Vec::new()) };
    Ok(decoder.decode_nal(&unit).map_err(error)?.into_iter().map(ours).collect())
}

/// Decodes the units of one frame after the other.
pub(crate) struct Frames {
    decoder: Decoder,
}

impl Frames {
    pub(crate) fn new() -> Self {
        Frames { decoder: Decoder::new() }
    }

    /// Takes a unit that is no slice of a later frame than the one before it.
    pub(crate) fn unit(&mut self, bytes: &[u8]) -> Result<(), Refused> {
        let Some(unit) = unit(bytes)? else { return Ok(()) };
        match self.decoder.decode_nal(&unit).map_err(error)? {
            None => Ok(()),
            Some(_) => damaged("two frames where the container has one"),
        }
    }

    /// Ends the frame whose units were given.
    pub(crate) fn end(&mut self) -> Option<Frame> {
        self.decoder.flush().map(ours)
    }
}

/// The decoder's frame as ours.
pub(crate) fn ours(frame: rust_h264::decoder::Frame) -> Frame {
    let size = [frame.width as usize, frame.height as usize];
    let chroma = match frame.chroma_format {
        rust_h264::decoder::ChromaFormat::Yuv420 => Chroma::Yuv420,
        rust_h264::decoder::ChromaFormat::Yuv422 => Chroma::Yuv422,
    };
    let bits = u32::from(frame.bit_depth);
    let planes = [frame.y, frame.u, frame.v];
    let wide = |plane: Vec<u8>| plane.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
    let planes = if bits > 8 { Planes::U16(planes.map(wide)) } else { Planes::U8(planes) };
    Frame { size, chroma, bits, planes }
}
