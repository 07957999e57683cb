//! Images of 8-bit colour, as files and pages have them.

use tessuto_core::camera::Rect;

/// sRGB colour, 0 to 255, shape [height, width, 3].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rgb8 {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The numbers, row by row.
    pub data: Vec<u8>,
}

impl Rgb8 {
    /// The image of `data`.
    ///
    /// # Panics
    /// Unless there are three bytes for every pixel.
    pub fn new([width, height]: [usize; 2], data: Vec<u8>) -> Self {
        assert_eq!(data.len(), 3 * width * height, "an image of {width}×{height} pixels");
        Self { width, height, data }
    }

    /// The image whose pixel in column x and row y is `colour(x, y)`.
    pub fn from_fn([width, height]: [usize; 2], mut colour: impl FnMut(usize, usize) -> [u8; 3]) -> Self {
        let data = (0..width * height).flat_map(|k| colour(k % width, k / width)).collect();
        Self { width, height, data }
    }

    /// Colour of column x and row y.
    pub fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let at = 3 * (y * self.width + x);
        [self.data[at], self.data[at + 1], self.data[at + 2]]
    }

    /// All pixels, each with its column and row.
    pub fn pixels(&self) -> impl Iterator<Item = (usize, usize, [u8; 3])> {
        let width = self.width;
        self.data.as_chunks().0.iter().enumerate().map(move |(k, colour)| (k % width, k / width, *colour))
    }

    /// All pixels, each with its column and row, to be changed.
    pub fn pixels_mut(&mut self) -> impl Iterator<Item = (usize, usize, &mut [u8; 3])> {
        let width = self.width;
        self.data.as_chunks_mut().0.iter_mut().enumerate().map(move |(k, c)| (k % width, k / width, c))
    }

    /// The part `region`.
    pub fn cropped(&self, region: Rect) -> Self {
        let rows = (region.y0..region.y1).map(|y| &self.data[3 * (y * self.width + region.x0)..]);
        let data = rows.flat_map(|row| &row[..3 * region.width()]).copied().collect();
        Self { width: region.width(), height: region.height(), data }
    }

    /// The image at a `size` that is not larger: every pixel is the mean of those that begin within it.
    pub fn shrunk(&self, size: [usize; 2]) -> Self {
        let spans = |from: usize, to: usize| -> Vec<[usize; 2]> {
            let ratio = from as f32 / to as f32;
            let span = |k: usize| {
                let start = k as f32 * ratio;
                let first = (start.ceil() as usize).min(from - 1);
                [first, ((start + ratio).ceil() as usize).clamp(first + 1, from)]
            };
            (0..to).map(span).collect()
        };
        let (columns, rows) = (spans(self.width, size[0]), spans(self.height, size[1]));
        Self::from_fn(size, |x, y| {
            let ([left, right], [top, bottom]) = (columns[x], rows[y]);
            let mut sum = [0u32; 3];
            for row in top..bottom {
                for pixel in
                    self.data[3 * (row * self.width + left)..][..3 * (right - left)].as_chunks::<3>().0
                {
                    (0..3).for_each(|k| sum[k] += u32::from(pixel[k]));
                }
            }
            let count = ((right - left) * (bottom - top)) as u32;
            sum.map(|sum| ((sum + count / 2) / count) as u8)
        })
    }
}
