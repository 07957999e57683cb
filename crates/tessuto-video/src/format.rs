//! What a sequence parameter set says of its frames, whichever codec it is of.

use crate::limits::Limits;
use crate::refused::{Refused, not_handled};
use crate::stream::{Matrix, Transfer};

/// Colour as ITU-T H.273 numbers it; `None` where nothing is said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Colour {
    pub(crate) full_range: Option<bool>,
    pub(crate) transfer: Option<u32>,
    pub(crate) matrix: Option<u32>,
}

impl Colour {
    /// What is not said here, or said to be unspecified (2), from `other`.
    pub(crate) fn or(self, other: Colour) -> Colour {
        let said = |n: &u32| *n != 2;
        Colour {
            full_range: self.full_range.or(other.full_range),
            transfer: self.transfer.filter(said).or(other.transfer),
            matrix: self.matrix.filter(said).or(other.matrix),
        }
    }

    pub(crate) fn matrix(&self) -> Matrix {
        match self.matrix {
            None | Some(2) => Matrix::Unspecified,
            Some(0) => Matrix::Rgb,
            Some(1) => Matrix::Bt709,
            Some(5 | 6) => Matrix::Bt601,
            Some(9) => Matrix::Bt2020,
            Some(other) => Matrix::Other(other),
        }
    }

    pub(crate) fn transfer(&self) -> Transfer {
        match self.transfer {
            Some(16) => Transfer::Pq,
            Some(18) => Transfer::Hlg,
            _ => Transfer::Standard,
        }
    }
}

/// Geometry and colour of the frames of a sequence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Format {
    /// Coded width and height `[px]`, before cropping.
    pub(crate) coded: [usize; 2],
    /// Width and height `[px]` after cropping.
    pub(crate) size: [usize; 2],
    /// `chroma_format_idc`: 0 none, 1 4:2:0, 2 4:2:2, 3 4:4:4.
    pub(crate) chroma: u32,
    pub(crate) bits: u32,
    /// Whether every frame is one moment.
    pub(crate) progressive: bool,
    pub(crate) pixel_aspect: Option<[u32; 2]>,
    pub(crate) colour: Colour,
    /// `chroma_sample_loc_type`; 0 where nothing is said.
    pub(crate) siting: u32,
    /// Frames that are kept as references.
    pub(crate) references: u32,
}

impl Format {
    /// Stored values of one frame, its borders included.
    fn samples(&self) -> u64 {
        let luma = self.coded[0] as u64 * self.coded[1] as u64;
        match self.chroma {
            0 => luma,
            1 => luma + luma / 2,
            2 => luma * 2,
            _ => luma * 3,
        }
    }

    /// Memory of one frame, its borders included `[bytes]`.
    pub(crate) fn bytes(&self) -> u64 {
        self.samples() * if self.bits > 8 { 2 } else { 1 }
    }

    /// Refuses what is not decoded, and what is too large.
    pub(crate) fn check(&self, limits: &Limits) -> Result<(), Refused> {
        limits.check_frame(self.size, self.samples(), self.bits)?;
        limits.check_frame(self.coded, self.samples(), self.bits)?;
        if !self.progressive {
            return not_handled("interlaced coding");
        }
        if !matches!(self.bits, 8 | 10) {
            return not_handled(format!("{} bits per value", self.bits));
        }
        if !(1..=3).contains(&self.chroma) {
            return not_handled("frames without colour");
        }
        Ok(())
    }

    /// Whether frames of `other` can stand beside those of this.
    pub(crate) fn same_frames(&self, other: &Format) -> bool {
        let key = |p: &Format| (p.size, p.chroma, p.bits, p.colour, p.siting);
        key(self) == key(other)
    }
}

/// Pixel aspects by `aspect_ratio_idc` (ITU-T H.264, table E-1).
const ASPECTS: [[u32; 2]; 17] = [
    [0, 1],
    [1, 1],
    [12, 11],
    [10, 11],
    [16, 11],
    [40, 33],
    [24, 11],
    [20, 11],
    [32, 11],
    [80, 33],
    [18, 11],
    [15, 11],
    [64, 33],
    [160, 99],
    [4, 3],
    [3, 2],
    [2, 1],
];

/// The part of the usability information that both codecs begin with: pixel aspect, overscan, colour, siting.
pub(crate) fn usability(bits: &mut crate::bits::Bits, format: &mut Format) -> Result<(), Refused> {
    if bits.bit()? {
        let aspect = match bits.bits(8)? {
            255 => [bits.bits(16)?, bits.bits(16)?],
            index => *ASPECTS.get(index as usize).unwrap_or(&[0, 1]),
        };
        format.pixel_aspect = Some(aspect).filter(|a| a[0] > 0 && a[1] > 0);
    }
    if bits.bit()? {
        bits.bit()?;
    }
    if bits.bit()? {
        bits.bits(3)?;
        format.colour.full_range = Some(bits.bit()?);
        if bits.bit()? {
            bits.bits(8)?;
            format.colour.transfer = Some(bits.bits(8)?);
            format.colour.matrix = Some(bits.bits(8)?);
        }
    }
    if bits.bit()? {
        format.siting = bits.up_to(5, "chroma_sample_loc_type")?;
        bits.up_to(5, "chroma_sample_loc_type")?;
    }
    Ok(())
}
