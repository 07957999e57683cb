//! Frames that show once more what the frame before shows.

use tessuto_core::video::Frame;

/// Fraction of a pixel from which on its colour is the fabric's alone.
const WHOLE: f32 = 0.999;
/// Colours that are so alike `[of 1]` show no pattern, which would distinguish a repeated frame from a moved one.
const ALIKE: f32 = 3.0 / 255.0;

/// A copy differs from the frame before by less than this part of what its neighbours do.
const QUIET: f64 = 0.25;
/// Longest distance from copy to copy: film of 24 frames a second at 30 has one in five.
const LONGEST: usize = 6;
/// This many of them are no chance.
const LEAST: usize = 4;

/// Colours of the pixels that are fabric alone in both frames, which have one size.
fn common<'a>(a: &'a Frame, b: &'a Frame) -> impl Iterator<Item = (&'a [f32], &'a [f32])> {
    let masks = a.mask.data.iter().zip(&b.mask.data);
    let pixels = masks.zip(a.rgb.data.chunks_exact(3).zip(b.rgb.data.chunks_exact(3)));
    pixels.filter(|((m, n), _)| **m >= WHOLE && **n >= WHOLE).map(|(_, colours)| colours)
}

/// Whether `count` pixels are more than half of the fabric in either frame.
fn is_most(count: usize, a: &Frame, b: &Frame) -> bool {
    let whole = |frame: &Frame| frame.mask.data.iter().filter(|m| **m >= WHOLE).count();
    2 * count > whole(a).max(whole(b))
}

/// Whether `b` shows what `a` shows. Their masks may differ, as a segmenter is not as sure each time: where both
/// are fabric alone the colours decide. Of a fabric without any pattern the borders count as well.
pub(super) fn is_repeated(a: &Frame, b: &Frame) -> bool {
    if a.rgb.data == b.rgb.data {
        return true;
    }
    if a.rgb.data.len() != b.rgb.data.len() {
        return false;
    }
    let (mut count, mut low, mut high) = (0, [f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (p, q) in common(a, b) {
        if p != q {
            return false;
        }
        count += 1;
        for (c, v) in p.iter().enumerate() {
            (low[c], high[c]) = (low[c].min(*v), high[c].max(*v));
        }
    }
    let has_pattern = low.iter().zip(high).any(|(low, high)| high - low > ALIKE);
    has_pattern && is_most(count, a, b)
}

/// Mean difference of colours where both frames are fabric alone `[of 1]`; `None` where that is less than half of
/// either.
pub(super) fn difference(a: &Frame, b: &Frame) -> Option<f64> {
    if a.rgb.data.len() != b.rgb.data.len() {
        return None;
    }
    let (mut sum, mut count) = (0.0, 0);
    for (p, q) in common(a, b) {
        sum += p.iter().zip(q).map(|(p, q)| f64::from((p - q).abs())).sum::<f64>();
        count += 1;
    }
    is_most(count, a, b).then(|| sum / (3 * count) as f64)
}

/// Copies at even distances, as film has whose rate was raised by a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Copies {
    /// Frames from one copy to the next.
    pub every: usize,
    /// The first of them.
    pub first: usize,
    /// How many there are.
    pub count: usize,
}

/// Copies that compression has made a little different: at even distances, each of them unlike the frame before by
/// far less than its neighbours are. `changes` holds the [`difference`] of every frame from the one before. A
/// fabric that turns back moves little for a frame as well, but not every second, or fifth, time.
pub(super) fn copies(changes: &[Option<f64>]) -> Option<Copies> {
    let at = |n: usize| changes.get(n).copied().flatten();
    let is_copy = |n: usize| {
        let beside = [n.checked_sub(1).and_then(at), at(n + 1)].into_iter().flatten().reduce(f64::min);
        at(n).zip(beside).is_some_and(|(own, beside)| own < QUIET * beside)
    };
    let spacings = (2..=LONGEST).flat_map(|every| (1..=every).map(move |first| (every, first)));
    spacings
        .map(|(every, first)| {
            let places = || (first..changes.len()).step_by(every);
            (Copies { every, first, count: places().filter(|n| is_copy(*n)).count() }, places().count())
        })
        .find(|(found, places)| found.count >= LEAST && 10 * found.count >= 9 * places)
        .map(|(found, _)| found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::image::Image;

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

    #[test]
    fn copies_at_even_distances_are_found_and_turning_back_is_none() {
        let film = |count: usize, change: &dyn Fn(usize) -> f64| -> Vec<Option<f64>> {
            (0..count).map(|n| (n > 0).then(|| change(n))).collect()
        };
        // Twice the rate; compressed, so that copies differ, too.
        let doubled = film(20, &|n| if n % 2 == 1 { 0.002 } else { 0.02 + 0.001 * n as f64 });
        assert_eq!(copies(&doubled), Some(Copies { every: 2, first: 1, count: 10 }));
        let pulled = film(40, &|n| if n % 5 == 3 { 0.003 } else { 0.02 });
        assert_eq!(copies(&pulled), Some(Copies { every: 5, first: 3, count: 8 }));
        // A swing turns back every ten frames; noise; a film too short to decide; one copy that is missing.
        assert_eq!(copies(&film(60, &|n| 0.001 + 0.03 * (n as f64 * 0.314).sin().abs())), None);
        assert_eq!(copies(&film(30, &|n| 0.01 + 0.003 * ((n * 7919) % 5) as f64)), None);
        assert_eq!(copies(&film(7, &|n| if n % 2 == 1 { 0.002 } else { 0.02 })), None);
        assert_eq!(copies(&film(20, &|n| if n % 2 == 1 && n < 9 { 0.002 } else { 0.02 })), None);
    }

    #[test]
    fn differences_are_means_where_both_are_fabric() {
        let (a, mut b) = (frame(0, 2, 0.2), frame(0, 3, 0.2));
        assert_eq!(difference(&a, &b), Some(0.0));
        b.rgb.data.iter_mut().for_each(|v| *v += 0.1);
        assert!((difference(&a, &b).unwrap() - 0.1).abs() < 1e-6);
        assert_eq!(difference(&frame(0, 1, 0.2), &frame(0, 8, 0.2)), None);
    }
}
