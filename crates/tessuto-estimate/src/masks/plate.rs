//! What lies behind the fabric. The camera stands still: each place is seen sooner or later, unless the fabric always
//! hides it.

use tessuto_core::parallel;

use super::frames::{Colours, Frames};
use super::region::{Field, index};
use tessuto_core::camera::Rect;

/// Frames whose colours are looked at for one pixel.
const LOOKS: usize = 24;
/// From this many looks on a colour is sure.
const SURE: f32 = 3.0;

/// The background plate.
#[derive(Clone)]
pub(super) struct Plate {
    width: usize,
    /// Companded colours.
    colours: Vec<[f32; 3]>,
    /// How sure each colour is, 0 … 1; 0 where the background was never seen.
    sure: Vec<f32>,
    /// How much the colour changes `[grey levels]`: standard deviation of a channel.
    spread: Vec<f32>,
}

impl Plate {
    /// Nothing is known.
    pub fn unknown([width, height]: [usize; 2]) -> Self {
        let n = width * height;
        Self { width, colours: vec![[0.0; 3]; n], sure: vec![0.0; n], spread: vec![0.0; n] }
    }

    /// An image of the place without the fabric.
    pub fn given(image: &Colours) -> Self {
        let n = image.data.len() / 3;
        let colours = (0..n).map(|i| image.at(i % image.width, i / image.width)).collect();
        // Light may have changed since.
        Self { width: image.width, colours, sure: vec![1.0; n], spread: vec![2.0; n] }
    }

    /// The same from column and row `at` on of a larger image of this `size`; unknown around it.
    pub fn placed(&self, at: [usize; 2], size: [usize; 2]) -> Self {
        let mut out = Self::unknown(size);
        for i in 0..self.sure.len() {
            let (x, y) = (i % self.width + at[0], i / self.width + at[1]);
            if x < size[0] && y < size[1] {
                let k = y * size[0] + x;
                (out.colours[k], out.sure[k], out.spread[k]) =
                    (self.colours[i], self.sure[i], self.spread[i]);
            }
        }
        out
    }

    /// The median of what is seen where the fabric is not, farther than `margin` `[px]` from its outline.
    /// `distances`: to the outline, positive inside, of the frames that are known.
    pub fn seen(frames: &Frames, distances: &[Field], margin: f32) -> Self {
        let [width, height] = frames.size;
        let stride = distances.len().div_ceil(LOOKS).max(1);
        // Far from the fabric of all frames nobody asks.
        let asked = distances.iter().map(|d| d.rect).reduce(Rect::union);
        let rows: Vec<Vec<([f32; 3], f32, f32)>> = parallel::map(height, |y| {
            let mut looks: [Vec<u8>; 3] = Default::default();
            (0..width)
                .map(|x| {
                    looks.iter_mut().for_each(Vec::clear);
                    if asked.is_none_or(|asked| index(asked, x, y).is_none()) {
                        return ([0.0; 3], 0.0, 0.0);
                    }
                    for (n, distance) in distances.iter().enumerate() {
                        // All frames where the fabric comes near, of the others some are enough.
                        let near = index(distance.rect, x, y);
                        if near.is_some_and(|i| distance.data[i] > -margin) {
                            continue;
                        }
                        if n % stride == 0 || (looks[0].len() < 5 && near.is_some()) {
                            let i = 3 * (y * width + x);
                            let data = &frames.images[n].data;
                            (0..3).for_each(|c| looks[c].push(data[i + c]));
                        }
                    }
                    median(&mut looks)
                })
                .collect()
        });
        let mut plate = Self::unknown(frames.size);
        for (i, (colour, sure, spread)) in rows.into_iter().flatten().enumerate() {
            (plate.colours[i], plate.sure[i], plate.spread[i]) = (colour, sure, spread);
        }
        plate
    }

    /// Takes in one more frame, where the fabric is farther than `margin` `[px]`: running means, for the first
    /// time through the clip.
    pub fn add(&mut self, frame: &Colours, distance: &Field, margin: f32) {
        for i in 0..self.sure.len() {
            let (x, y) = (i % self.width, i / self.width);
            if index(distance.rect, x, y).is_some_and(|i| distance.data[i] > -margin) {
                continue;
            }
            // What is seen now counts a tenth at least: light changes, people go away.
            let looks = (self.sure[i] * SURE).round();
            let part = if looks < SURE { 1.0 / (looks + 1.0) } else { 0.1 };
            let (colour, own) = (frame.at(x, y), &mut self.colours[i]);
            let mut off: f32 = 0.0;
            for c in 0..3 {
                off = off.max((colour[c] - own[c]).abs());
                own[c] += part * (colour[c] - own[c]);
            }
            if looks > 0.0 {
                self.spread[i] += part * (1.25 * off - self.spread[i]);
            }
            self.sure[i] = ((looks + 1.0) / SURE).min(1.0);
        }
    }

    /// Colour, how sure it is, and how much it changes.
    pub fn at(&self, x: usize, y: usize) -> ([f32; 3], f32, f32) {
        let i = y * self.width + x;
        (self.colours[i], self.sure[i], self.spread[i])
    }
}

/// Median, how sure it is, and spread, of looks at each channel.
fn median(looks: &mut [Vec<u8>; 3]) -> ([f32; 3], f32, f32) {
    let count = looks[0].len();
    if count == 0 {
        return ([0.0; 3], 0.0, 0.0);
    }
    let mut colour = [0.0; 3];
    let mut spread: f32 = 0.0;
    for (c, looks) in looks.iter_mut().enumerate() {
        looks.sort_unstable();
        colour[c] = f32::from(looks[count / 2]);
        // Half of the looks lie between the quartiles, 1.35 deviations apart.
        let (low, high) = (looks[count / 4], looks[(3 * count / 4).min(count - 1)]);
        spread = spread.max(f32::from(high - low) / 1.35);
    }
    (colour, (count as f32 / SURE).min(1.0), spread)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::masks::region::Region;

    #[test]
    fn what_the_fabric_leaves_free_is_seen() {
        // A block of 4 columns of colour 200 moves over a wall of colour 50.
        let size = [12, 3];
        let rect = Rect { x0: 0, y0: 0, x1: 12, y1: 3 };
        let covered = |n: usize, x: usize| x >= n && x < n + 4;
        let image = |n: usize| Colours {
            width: 12,
            data: (0..36).flat_map(|i| [if covered(n, i % 12) { 200 } else { 50 }; 3]).collect(),
        };
        let frames = Frames { size, factor: 1, images: (2..5).map(image).collect() };
        let distances: Vec<Field> = (2..5)
            .map(|n| {
                Region { rect, inside: (0..36).map(|i| covered(n, i % 12)).collect() }.signed_distance(rect)
            })
            .collect();
        let plate = Plate::seen(&frames, &distances, 0.0);
        for x in 0..12 {
            let (colour, sure, spread) = plate.at(x, 1);
            let seen = (2..5).filter(|n| !covered(*n, x)).count();
            assert_eq!(sure, seen as f32 / 3.0, "column {x}");
            if seen > 0 {
                assert_eq!((colour, spread), ([50.0; 3], 0.0));
            }
        }
        assert_eq!(plate.at(4, 0).1, 0.0);
    }
}
