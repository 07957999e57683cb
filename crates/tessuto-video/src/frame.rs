//! A decoded frame.

use crate::refused::{Refused, damaged};

/// How many colour values there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chroma {
    /// One for two by two pixels.
    Yuv420,
    /// One for two pixels of a row.
    Yuv422,
    /// One for every pixel.
    Yuv444,
}

impl Chroma {
    /// Width and height of a plane of colour for frames of `size`.
    pub fn plane(self, size: [usize; 2]) -> [usize; 2] {
        let [width, height] = size;
        match self {
            Chroma::Yuv420 => [width.div_ceil(2), height.div_ceil(2)],
            Chroma::Yuv422 => [width.div_ceil(2), height],
            Chroma::Yuv444 => size,
        }
    }
}

/// Values of Y, U and V, each plane row by row without gaps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Planes {
    /// Of 8 bits.
    U8([Vec<u8>; 3]),
    /// Of more, in the low bits.
    U16([Vec<u16>; 3]),
}

/// A decoded frame, cropped, not turned.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Width and height `[px]`.
    pub size: [usize; 2],
    /// Sizes of the second and third plane.
    pub chroma: Chroma,
    /// Bits of one value.
    pub bits: u32,
    /// Values, [height, width] of Y, and U and V of the size [`Chroma::plane`] says.
    pub planes: Planes,
}

impl Frame {
    /// The planes as ffmpeg writes them with `-f rawvideo` in the pixel format of the film: values of more than 8
    /// bits as two bytes, the lower first.
    pub fn bytes(&self) -> Vec<u8> {
        match &self.planes {
            Planes::U8(planes) => planes.concat(),
            Planes::U16(planes) => planes.iter().flatten().flat_map(|v| v.to_le_bytes()).collect(),
        }
    }

    /// Refuses a frame whose planes are not of the sizes that it says.
    pub(crate) fn checked(self) -> Result<Frame, Refused> {
        let plane = self.chroma.plane(self.size);
        let wanted = [self.size[0] * self.size[1], plane[0] * plane[1], plane[0] * plane[1]];
        let found = match &self.planes {
            Planes::U8(planes) => planes.each_ref().map(Vec::len),
            Planes::U16(planes) => planes.each_ref().map(Vec::len),
        };
        if found != wanted { damaged("a frame is not complete") } else { Ok(self) }
    }
}
