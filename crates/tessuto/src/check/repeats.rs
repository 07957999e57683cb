//! Frames that show once more what the frame before shows.

use crate::video::Frame;

/// Fraction of a pixel from which on its colour is the fabric's alone.
const WHOLE: f32 = 0.999;
/// Colours that are so alike `[of 1]` show no pattern, which would tell a repeated frame from a moved one.
const ALIKE: f32 = 3.0 / 255.0;

/// Whether `b` shows what `a` shows. Their masks may differ, as a segmenter is not as sure each time: where both are fabric alone the
/// colours decide. Of a fabric without any pattern the borders count as well.
pub(super) fn is_repeated(a: &Frame, b: &Frame) -> bool {
    if a.rgb.data == b.rgb.data {
        return true;
    }
    if a.rgb.data.len() != b.rgb.data.len() {
        return false;
    }
    let whole = |frame: &Frame| frame.mask.data.iter().filter(|m| **m >= WHOLE).count();
    let (mut common, mut low, mut high) = (0, [f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    let masks = a.mask.data.iter().zip(&b.mask.data);
    for ((m, n), (p, q)) in masks.zip(a.rgb.data.chunks_exact(3).zip(b.rgb.data.chunks_exact(3))) {
        if *m < WHOLE || *n < WHOLE {
            continue;
        }
        if p != q {
            return false;
        }
        common += 1;
        for (c, v) in p.iter().enumerate() {
            (low[c], high[c]) = (low[c].min(*v), high[c].max(*v));
        }
    }
    let has_pattern = low.iter().zip(high).any(|(low, high)| high - low > ALIKE);
    has_pattern && 2 * common > whole(a).max(whole(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;

    /// Stripes moved by `shift` columns, seen in the columns from `from` on.
    fn frame(shift: usize, from: usize, contrast: f32) -> Frame {
        let mask: Vec<f32> = (0..144).map(|k| if k % 12 < from { 0.0 } else { 1.0 }).collect();
        let colour = |k: usize| 0.3 + contrast * ((k % 12 + shift) % 3) as f32;
        let rgb = mask.iter().enumerate().flat_map(|(k, m)| [m * colour(k); 3]).collect();
        Frame {
            rgb: Image { width: 12, height: 12, channels: 3, data: rgb },
            mask: Image { width: 12, height: 12, channels: 1, data: mask },
        }
    }

    #[test]
    fn masks_of_repeated_frames_may_differ() {
        assert!(is_repeated(&frame(0, 2, 0.2), &frame(0, 2, 0.2)));
        assert!(is_repeated(&frame(0, 2, 0.2), &frame(0, 3, 0.2)));
        assert!(!is_repeated(&frame(0, 2, 0.2), &frame(1, 3, 0.2)), "moved");
        assert!(!is_repeated(&frame(0, 2, 0.0), &frame(0, 3, 0.0)), "only the border tells");
        assert!(!is_repeated(&frame(0, 1, 0.2), &frame(0, 8, 0.2)), "too little in common");
    }
}
