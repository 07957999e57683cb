//! The film of a container, before a frame of it is decoded.

/// What a container says of its film.
#[derive(Clone, Debug, PartialEq)]
pub struct Stream {
    /// Short name of the codec, as ffmpeg has it: `h264`, `hevc`, `vp9`.
    pub codec: String,
    /// Presentation times of the frames that a player shows `[s]`, in the order in which they are shown, the first
    /// at 0; edit lists are applied. Empty where the container holds no time stamps (elementary streams).
    pub times: Vec<f64>,
    /// Width and height of a decoded frame `[px]`, cropped, not turned yet.
    pub size: [usize; 2],
    /// Width over height of one pixel, as numerator and denominator; 1 and 1 where nothing is said.
    pub pixel_aspect: [u32; 2],
    /// Order of the fields.
    pub fields: Fields,
    /// Angle by which a player turns the frames clockwise `[degrees]`, 0 to 359.
    pub turn: u32,
    /// Whether 0 to 255 stand for black to white, instead of 16 to 235.
    pub full_range: bool,
    /// From luma and chroma to colours.
    pub matrix: Matrix,
    /// From stored values to light.
    pub transfer: Transfer,
    /// Bits of one stored value.
    pub bits: u32,
    /// Rate at which the frames were filmed, where the file says that it is another than that of the time stamps
    /// `[1/s]`.
    pub capture_rate: Option<f64>,
    /// Unit in which the container counts time `[s]`: [`times`](Self::times) are rounded to it. 0 where they are exact.
    pub tick: f64,
}

impl Stream {
    /// Times of the moments that are shown `[s]`: of interlaced film each frame is two, half an interval apart.
    pub fn moments(&self) -> Vec<f64> {
        if self.fields == Fields::Progressive {
            return self.times.clone();
        }
        let mut intervals: Vec<f64> = self.times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        intervals.sort_by(f64::total_cmp);
        let half = intervals.get(intervals.len() / 2).map_or(0.0, |interval| interval / 2.0);
        self.times.iter().flat_map(|time| [*time, time + half]).collect()
    }

    /// Moments of one stored frame: 2 of interlaced film.
    pub fn moments_per_frame(&self) -> usize {
        if self.fields == Fields::Progressive { 1 } else { 2 }
    }

    /// Width and height of a frame as a player shows it, turned upright `[px]`.
    pub fn upright_size(&self) -> [usize; 2] {
        let [width, height] = self.size;
        if self.lies_on_its_side() { [height, width] } else { [width, height] }
    }

    /// Width over height of one pixel of a frame that is turned upright.
    pub fn upright_aspect(&self) -> f64 {
        let [a, b] = self.pixel_aspect.map(f64::from);
        if self.lies_on_its_side() { b / a } else { a / b }
    }

    fn lies_on_its_side(&self) -> bool {
        matches!(self.turn, 45..135 | 225..315)
    }
}

/// Whether a frame is one moment or two, on alternate rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fields {
    /// One moment; also where nothing is said.
    #[default]
    Progressive,
    /// The even rows, counted from 0, are the earlier moment.
    TopFirst,
    /// The odd rows are the earlier moment.
    BottomFirst,
}

/// Coefficients from luma and chroma to colours (ITU-T H.273, matrix coefficients).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Matrix {
    /// Nothing is said.
    #[default]
    Unspecified,
    /// Values are colours already (0).
    Rgb,
    /// ITU-R BT.709 (1).
    Bt709,
    /// ITU-R BT.601 (5, 6).
    Bt601,
    /// ITU-R BT.2020, not constant luminance (9).
    Bt2020,
    /// Any other, by its number.
    Other(u32),
}

/// Transfer characteristics (ITU-T H.273), as far as they change what is to be said of a film.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transfer {
    /// Standard dynamic range, or nothing is said.
    #[default]
    Standard,
    /// SMPTE ST 2084 (16).
    Pq,
    /// ARIB STD-B67 (18).
    Hlg,
}
