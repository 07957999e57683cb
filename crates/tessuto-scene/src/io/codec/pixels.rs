//! The numbers of a decoded image, and their conversions.

/// The numbers of an image.
#[derive(Debug, Clone, PartialEq)]
pub enum Samples {
    /// 0 to 255.
    Bytes(Vec<u8>),
    /// 0 to 65535.
    Words(Vec<u16>),
}

impl Samples {
    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Bytes(data) => data.len(),
            Self::Words(data) => data.len(),
        }
    }
}

/// A decoded image as its file has it, shape [height, width, channels].
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pixels {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Grey, grey and opacity, colour, colour and opacity: 1 to 4.
    pub channels: usize,
    /// The numbers.
    pub samples: Samples,
}

impl Pixels {
    /// Whether the last channel is opacity.
    pub fn has_alpha(&self) -> bool {
        self.channels.is_multiple_of(2)
    }

    /// What the image is, in short: `L8`, `La8`, `Rgb8`, `Rgba8` or those of 16 bits.
    pub fn kind(&self) -> String {
        let bits = if matches!(self.samples, Samples::Bytes(_)) { 8 } else { 16 };
        format!("{}{bits}", ["L", "La", "Rgb", "Rgba"][self.channels - 1])
    }

    /// 8-bit colour, shape [height, width, 3]: opacity is dropped, 16 bits are rounded.
    pub fn into_rgb8(self) -> Vec<u8> {
        match (self.samples, self.channels) {
            (Samples::Bytes(data), 3) => data,
            (Samples::Bytes(data), channels) => spread(&data, channels, |v| v),
            (Samples::Words(data), channels) => spread(&data, channels, rounded),
        }
    }

    /// Opacity in [0, 1], shape [height, width], where the image has any.
    pub fn alpha(&self) -> Option<Vec<f32>> {
        if !self.has_alpha() {
            return None;
        }
        let last = self.channels - 1;
        Some(match &self.samples {
            // As of 65535: 257 v / 65535.
            Samples::Bytes(data) => {
                data.chunks_exact(self.channels).map(|p| 257.0 * f32::from(p[last]) / 65_535.0).collect()
            }
            Samples::Words(data) => {
                data.chunks_exact(self.channels).map(|p| f32::from(p[last]) / 65_535.0).collect()
            }
        })
    }

    /// The largest luminance, and the largest that a pixel can have. Of coloured images it is rounded.
    pub fn largest(&self) -> (f32, f32) {
        match &self.samples {
            Samples::Bytes(data) => (brightest(data, self.channels), 255.0),
            Samples::Words(data) => (brightest(data, self.channels), 65_535.0),
        }
    }
}

/// 16 bits to 8.
fn rounded(v: u16) -> u8 {
    ((u32::from(v) + 128) / 257) as u8
}

/// Three channels of `channels`, of which one or three are colours.
fn spread<T: Copy>(data: &[T], channels: usize, byte: impl Fn(T) -> u8) -> Vec<u8> {
    let colour = |p: &[T]| match channels {
        1 | 2 => [byte(p[0]); 3],
        _ => [p[0], p[1], p[2]].map(&byte),
    };
    data.chunks_exact(channels).flat_map(colour).collect()
}

fn brightest<T: Copy + Ord + Into<f32>>(data: &[T], channels: usize) -> f32 {
    if channels < 3 {
        return data.iter().step_by(channels).max().map_or(0.0, |v| (*v).into());
    }
    let luminance = |p: &[T]| {
        let [r, g, b] = [p[0], p[1], p[2]].map(Into::into);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    data.chunks_exact(channels).map(luminance).fold(0.0f32, f32::max).round()
}
