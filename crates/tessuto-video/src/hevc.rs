//! HEVC: its parameter sets, and its frames by the crate `rust_h265`.
//!
//! Source: ITU-T H.265 (08/2021), 7.3.2.2.1 (sequence parameter set), 7.3.3 (profile), 7.3.4 (scaling lists),
//! 7.3.7 (reference picture sets), E.2.1 (usability information).

use rust_h265::{DecodeError, Decoder, PixelData, parse_nal};

use crate::bits::{Bits, unescaped};
use crate::format::{Colour, Format, usability};
use crate::frame::{Chroma, Frame, Planes};
use crate::refused::{Refused, damaged, not_handled};

/// `nal_unit_type` of sequence and picture parameter sets.
pub(crate) const SEQUENCE: u8 = 33;
const PICTURE: u8 = 34;
/// Most pixels of a frame of the highest level (table A.8, MaxLumaPs of level 6.2).
const LARGEST: u64 = 35_651_584;
/// An access unit delimiter: what ends a frame.
const DELIMITER: [u8; 3] = [35 << 1, 1, 0x50];

/// `nal_unit_type`.
pub(crate) fn kind(unit: &[u8]) -> u8 {
    unit.first().map_or(0, |b| b >> 1 & 63)
}

/// Whether the unit belongs to the base layer; others hold a second view, or transparency.
pub(crate) fn is_base(unit: &[u8]) -> bool {
    unit.len() >= 2 && unit[0] & 0x81 == 0 && unit[1] >> 3 == 0 && unit[1] & 7 != 0
}

/// Whether the unit is part of a frame.
pub(crate) fn is_slice(kind: u8) -> bool {
    kind <= 9 || (16..=21).contains(&kind)
}

/// Whether the unit begins a frame (`first_slice_segment_in_pic_flag`).
pub(crate) fn begins_frame(unit: &[u8]) -> bool {
    is_base(unit) && is_slice(kind(unit)) && unit.get(2).is_some_and(|b| b & 0x80 != 0)
}

/// Whether a film may begin with a frame of this kind.
pub(crate) fn is_beginning(kind: u8) -> bool {
    (16..=21).contains(&kind)
}

/// Whether frames that follow may refer to others before this one, which a beginning here lacks.
pub(crate) fn is_open(kind: u8) -> bool {
    matches!(kind, 16 | 17 | 18 | 21)
}

/// Whether a frame may refer to such, so that it is left out behind a beginning.
pub(crate) fn is_skipped(kind: u8) -> bool {
    matches!(kind, 8 | 9)
}

/// Whether a frame is shown before the beginning that it follows in the file.
pub(crate) fn is_leading(kind: u8) -> bool {
    (6..=9).contains(&kind)
}

/// Reads a sequence parameter set with its two header bytes.
pub(crate) fn sequence(unit: &[u8]) -> Result<Format, Refused> {
    let payload = unescaped(unit.get(2..).unwrap_or_default());
    let mut bits = Bits::new(&payload);
    bits.bits(4)?;
    let layers = bits.bits(3)?.min(6);
    bits.bit()?;
    profile(&mut bits, layers)?;
    bits.up_to(15, "sps_seq_parameter_set_id")?;
    let chroma = bits.up_to(3, "chroma_format_idc")?;
    if chroma == 3 && bits.bit()? {
        return not_handled("HEVC with three separate colour planes");
    }
    if chroma == 2 {
        return not_handled("HEVC with 4:2:2 colours");
    }
    let coded = [bits.up_to(1 << 16, "width")? as usize, bits.up_to(1 << 16, "height")? as usize];
    let size = if bits.bit()? { cropped(&mut bits, coded, chroma)? } else { coded };
    let depth = 8 + bits.up_to(8, "bit_depth_luma_minus8")?;
    if 8 + bits.up_to(8, "bit_depth_chroma_minus8")? != depth {
        return not_handled("HEVC whose luma and chroma have different bits");
    }
    let order_bits = 4 + bits.up_to(12, "log2_max_pic_order_cnt_lsb_minus4")?;
    let mut references = 0;
    for _ in if bits.bit()? { 0 } else { layers }..=layers {
        references = references.max(bits.up_to(15, "sps_max_dec_pic_buffering_minus1")?);
        bits.unsigned()?;
        bits.unsigned()?;
    }
    let mut format = Format {
        coded,
        size,
        chroma,
        bits: depth,
        progressive: true,
        pixel_aspect: None,
        colour: Colour::default(),
        siting: 0,
        references,
    };
    check_kept(&format)?;
    coding(&mut bits)?;
    reference_sets(&mut bits)?;
    if bits.bit()? {
        for _ in 0..bits.up_to(32, "num_long_term_ref_pics_sps")? {
            bits.skip(order_bits as usize + 1)?;
        }
    }
    bits.skip(2)?;
    if bits.bit()? {
        usability(&mut bits, &mut format)?;
        bits.bit()?;
        format.progressive = !bits.bit()?;
    }
    Ok(format)
}

/// Passes over `profile_tier_level`.
fn profile(bits: &mut Bits, layers: u32) -> Result<(), Refused> {
    bits.skip(96)?;
    let mut present = Vec::new();
    for _ in 0..layers {
        present.push([bits.bit()?, bits.bit()?]);
    }
    if layers > 0 {
        bits.skip(2 * (8 - layers as usize))?;
    }
    for [profile, level] in present {
        bits.skip(if profile { 88 } else { 0 } + if level { 8 } else { 0 })?;
    }
    Ok(())
}

/// The frame without its borders.
fn cropped(bits: &mut Bits, coded: [usize; 2], chroma: u32) -> Result<[usize; 2], Refused> {
    let unit = [if matches!(chroma, 1 | 2) { 2 } else { 1 }, if chroma == 1 { 2 } else { 1 }];
    let mut edge = || Ok::<_, Refused>(bits.up_to(1 << 17, "conf_win_offset")? as usize);
    let [left, right, top, bottom] = [edge()?, edge()?, edge()?, edge()?];
    let cut = [(left + right) * unit[0], (top + bottom) * unit[1]];
    if cut[0] >= coded[0] || cut[1] >= coded[1] {
        return damaged("nothing is left of a cropped frame");
    }
    Ok([coded[0] - cut[0], coded[1] - cut[1]])
}

/// Refuses more kept frames than the highest level allows (A.4.2).
fn check_kept(format: &Format) -> Result<(), Refused> {
    let pixels = format.coded[0] as u64 * format.coded[1] as u64;
    let most = match 4 * pixels {
        n if n <= LARGEST => 16,
        n if n <= 2 * LARGEST => 12,
        n if n <= 3 * LARGEST => 8,
        _ => 6,
    };
    if pixels > LARGEST || format.references + 1 > most {
        let [width, height] = format.size;
        let kept = format.references + 1;
        return damaged(format!(
            "{kept} frames of {width}×{height} px to be kept, more than any level allows"
        ));
    }
    Ok(())
}

/// Passes over block sizes, scaling lists and tools, up to the reference picture sets.
fn coding(bits: &mut Bits) -> Result<(), Refused> {
    for _ in 0..6 {
        bits.unsigned()?;
    }
    if bits.bit()? && bits.bit()? {
        scaling_lists(bits)?;
    }
    bits.skip(2)?;
    if bits.bit()? {
        bits.skip(8)?;
        bits.unsigned()?;
        bits.unsigned()?;
        bits.bit()?;
    }
    Ok(())
}

fn scaling_lists(bits: &mut Bits) -> Result<(), Refused> {
    for size in 0..4 {
        for _ in 0..if size == 3 { 2 } else { 6 } {
            if !bits.bit()? {
                bits.unsigned()?;
                continue;
            }
            let coefficients = if size == 0 { 16 } else { 64 };
            for _ in 0..coefficients + if size > 1 { 1 } else { 0 } {
                bits.signed()?;
            }
        }
    }
    Ok(())
}

/// Passes over the short-term reference picture sets; one may be given by the differences from the one before it,
/// so they are kept: differences of order, those before first, each half from the nearest outwards.
fn reference_sets(bits: &mut Bits) -> Result<(), Refused> {
    let mut last: Vec<i64> = Vec::new();
    for number in 0..bits.up_to(64, "num_short_term_ref_pic_sets")? {
        let set = if number > 0 && bits.bit()? {
            let sign = bits.bit()?;
            let size = i64::from(bits.up_to(1 << 15, "abs_delta_rps_minus1")?) + 1;
            let shift = if sign { -size } else { size };
            let mut kept = Vec::new();
            for &difference in last.iter().chain(&[0]) {
                if bits.bit()? || bits.bit()? {
                    kept.push(difference + shift);
                }
            }
            kept
        } else {
            let count = [bits.up_to(16, "num_negative_pics")?, bits.up_to(16, "num_positive_pics")?];
            let mut set = Vec::new();
            for (count, sign) in count.into_iter().zip([-1, 1]) {
                let mut at = 0;
                for _ in 0..count {
                    at += sign * (i64::from(bits.up_to(1 << 15, "delta_poc_minus1")?) + 1);
                    bits.bit()?;
                    set.push(at);
                }
            }
            set
        };
        let mut before: Vec<i64> = set.iter().copied().filter(|&d| d < 0).collect();
        let mut after: Vec<i64> = set.iter().copied().filter(|&d| d > 0).collect();
        before.sort_unstable_by(|a, b| b.cmp(a));
        after.sort_unstable();
        before.extend(after);
        if before.len() > 16 {
            return damaged("a reference picture set has more than 16 pictures");
        }
        last = before;
    }
    Ok(())
}

/// Decodes the units of one frame after the other.
pub(crate) struct Frames {
    decoder: Decoder,
    /// Whether the decoder gives the order of display, for streams without time stamps.
    ordered: bool,
    done: Vec<Frame>,
}

impl Frames {
    pub(crate) fn new(ordered: bool) -> Self {
        let decoder = if ordered { Decoder::new().with_display_order() } else { Decoder::new() };
        Frames { decoder, ordered, done: Vec::new() }
    }

    /// Takes a unit.
    pub(crate) fn unit(&mut self, unit: &[u8]) -> Result<(), Refused> {
        let kind = kind(unit);
        if !is_base(unit) || !(is_slice(kind) || (32..=37).contains(&kind)) {
            return Ok(());
        }
        if kind == PICTURE && !self.ordered {
            check_output(unit)?;
        }
        let Some(unit) = parse_nal(unit) else { return damaged("HEVC: a unit without header") };
        match self.decoder.decode_nal(&unit) {
            Ok(frame) => self.done.extend(frame.map(ours)),
            Err(DecodeError::Unsupported(what) | DecodeError::ResourceLimit(what)) => {
                return not_handled(format!("HEVC: {what}"));
            }
            Err(error) => return damaged(format!("HEVC: {error}")),
        }
        while self.ordered
            && let Some(frame) = self.decoder.next_output()
        {
            self.done.push(ours(frame));
        }
        Ok(())
    }

    /// Ends the frame whose units were given; `None` for a frame that is not to be shown.
    pub(crate) fn end(&mut self) -> Result<Option<Frame>, Refused> {
        self.unit(&DELIMITER)?;
        if self.done.len() > 1 {
            return damaged("two frames where the container has one");
        }
        Ok(self.done.pop())
    }

    /// What came out in the order of display.
    pub(crate) fn take(&mut self) -> Vec<Frame> {
        std::mem::take(&mut self.done)
    }

    /// Ends the film.
    pub(crate) fn finish(&mut self) -> Vec<Frame> {
        while let Some(frame) = self.decoder.flush() {
            self.done.push(ours(frame));
        }
        self.take()
    }
}

/// Refuses streams that hide frames: a frame a sample is what the container's time stamps stand on.
fn check_output(unit: &[u8]) -> Result<(), Refused> {
    let payload = unescaped(unit.get(2..).unwrap_or_default());
    let mut bits = Bits::new(&payload);
    bits.unsigned()?;
    bits.unsigned()?;
    bits.bit()?;
    if bits.bit()? { not_handled("HEVC with frames that are not shown") } else { Ok(()) }
}

fn ours(frame: rust_h265::Frame) -> Frame {
    let chroma = match frame.chroma_format_idc {
        3 => Chroma::Yuv444,
        2 => Chroma::Yuv422,
        _ => Chroma::Yuv420,
    };
    let size = [frame.width as usize, frame.height as usize];
    let planes = match (frame.y, frame.u, frame.v) {
        (PixelData::U8(y), PixelData::U8(u), PixelData::U8(v)) => Planes::U8([y, u, v]),
        (y, u, v) => Planes::U16([y, u, v].map(|plane| match plane {
            PixelData::U8(plane) => plane.into_iter().map(u16::from).collect(),
            PixelData::U16(plane) => plane,
        })),
    };
    Frame { size, chroma, bits: u32::from(frame.bit_depth), planes }
}
