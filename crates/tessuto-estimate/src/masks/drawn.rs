//! An outline that somebody drew, or a mask of the first frame, binds: the mask of that frame is what was drawn, except
//! around a click in it that says otherwise. What is inside is fabric, also in the colours of the surroundings.

use glam::DVec2;

use super::evidence::{PRINT, spread};
use super::frames::Colours;
use super::region::{Field, Region, index};
use super::segment::{Mark, certain};
use tessuto_core::camera::Rect;

/// Rows of samples in a pixel of a drawn outline.
const ROWS: usize = 8;
/// Nearer to the drawn border than this `[px]` a colour may be that of the surroundings.
const DEEP: f32 = 3.0;
/// So near to a click's changes `[px]` coverage is that of what was found.
const NEAR: f32 = 3.0;

/// How far what is known of the first frame is true.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Drawn {
    /// Corners, or a template: between them the border bends.
    Corners,
    /// To a few pixels.
    Near,
    /// It is the mask.
    Binds,
}

/// Coverage of the pixels of an image of this size by a polygon (even-odd rule), shape [height · width]: exact along
/// rows, with eight rows a pixel.
pub(super) fn polygon_coverage(corners: &[DVec2], [width, height]: [usize; 2]) -> Vec<f32> {
    let mut coverage = vec![0.0_f32; width * height];
    for line in 0..height * ROWS {
        let y = (line as f64 + 0.5) / ROWS as f64 - 0.5;
        let mut crossings: Vec<f64> = Vec::new();
        for (k, a) in corners.iter().enumerate() {
            let b = corners[(k + 1) % corners.len()];
            if (a.y <= y) != (b.y <= y) {
                // From the left side of the first pixel.
                crossings.push(a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x) + 0.5);
            }
        }
        crossings.sort_by(f64::total_cmp);
        let row = &mut coverage[line / ROWS * width..][..width];
        for pair in crossings.chunks_exact(2) {
            let [from, to] = [pair[0], pair[1]].map(|x| x.clamp(0.0, width as f64));
            let pixels = row.iter_mut().enumerate().take(to.ceil() as usize).skip(from as usize);
            pixels.for_each(|(x, value)| {
                let covered = to.min(x as f64 + 1.0) - from.max(x as f64);
                *value += (covered / ROWS as f64) as f32;
            });
        }
    }
    coverage.iter_mut().for_each(|value| *value = value.min(1.0));
    coverage
}

/// What was drawn, with the parts of what was `found` in which a click contradicts it.
pub(super) fn bound(drawn: &Region, found: &Region, marks: &[Mark]) -> Region {
    let mut bound = drawn.clone();
    let (rect, w) = (drawn.rect, drawn.rect.width());
    let mut clicked: Vec<usize> = Vec::new();
    for mark in marks {
        clicked.extend(certain(rect, *mark).into_iter().filter(|i| drawn.inside[*i] != mark.inside));
    }
    if clicked.is_empty() {
        return bound;
    }
    let differs = |i: usize| {
        let (x, y) = (i % w + rect.x0, i / w + rect.y0);
        index(found.rect, x, y).map_or(drawn.inside[i], |j| found.inside[j]) != drawn.inside[i]
    };
    let mut other = Region { rect, inside: (0..drawn.inside.len()).map(differs).collect() };
    clicked.iter().for_each(|i| other.inside[*i] = true);
    let mut is_clicked = vec![false; drawn.inside.len()];
    clicked.iter().for_each(|i| is_clicked[*i] = true);
    for piece in other.pieces(true).iter().filter(|piece| piece.iter().any(|i| is_clicked[*i])) {
        piece.iter().for_each(|i| bound.inside[*i] = !drawn.inside[*i]);
    }
    bound
}

/// Colours of the first frame that are this near to the border of what was drawn `[px]`, but surely inside.
pub(super) fn rim(frame: &Colours, drawn: &Region, width: f32) -> Vec<[f32; 3]> {
    let Some(bounds) = drawn.bounds() else { return Vec::new() };
    // With some of what is outside: the border of a rectangle of pixels is none of the set's.
    let rect = bounds.padded(2, [drawn.rect.x1, drawn.rect.y1]);
    let distance = drawn.signed_distance(rect);
    let near =
        (0..distance.data.len()).filter(|i| (DEEP..width.max(2.0 * DEEP)).contains(&distance.data[*i]));
    let at = |i: usize| frame.at(i % rect.width() + rect.x0, i / rect.width() + rect.y0);
    spread(near.map(at).collect(), PRINT)
}

/// Distance `[px]` of every pixel of `rect` to where the region differs from what was drawn, negative outside of
/// that; `None` where the two are the same.
fn changed(drawn: &Region, region: &Region, rect: Rect) -> Option<Field> {
    let differs = |i: usize| {
        let (x, y) = (i % rect.width() + rect.x0, i / rect.width() + rect.y0);
        drawn.at(x, y) != region.at(x, y)
    };
    let inside: Vec<bool> = (0..rect.width() * rect.height()).map(differs).collect();
    inside.contains(&true).then(|| Region { rect, inside }.signed_distance(rect))
}

/// The mask of the first frame in the recording's pixels, shape [height · width]: the coverage that was `drawn`, and
/// what was `found` where clicks changed it. `regions`: what was drawn and what it became, on frames that may be
/// smaller by `factor`, and begin that many pixels `before` the recording's.
pub(super) fn mask(
    drawn: &[f32],
    found: Vec<f32>,
    regions: [&Region; 2],
    (factor, width, before): (usize, usize, [usize; 2]),
) -> Vec<f32> {
    let Some(changed) = changed(regions[0], regions[1], regions[0].rect) else { return drawn.to_vec() };
    let place = |v: usize, c: usize| (v as f32 + 0.5) / factor as f32 - 0.5 + before[c] as f32;
    let value = |(i, (drawn, found)): (usize, (&f32, f32))| {
        let far = -changed.sample(place(i % width, 0), place(i / width, 1));
        if far < NEAR { found } else { *drawn }
    };
    drawn.iter().zip(found).enumerate().map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [9, 7];

    #[test]
    fn coverage_is_the_area_of_the_polygon_in_each_pixel() {
        let corners = [(1.25, 0.5), (6.5, 0.5), (6.5, 4.75), (1.25, 4.75)].map(|(x, y)| DVec2::new(x, y));
        let coverage = polygon_coverage(&corners, SIZE);
        let at = |x: usize, y: usize| coverage[y * SIZE[0] + x];
        assert_eq!([at(0, 2), at(1, 2), at(2, 2), at(6, 2), at(7, 2)], [0.0, 0.25, 1.0, 1.0, 0.0]);
        assert_eq!([at(3, 0), at(3, 1), at(3, 4), at(3, 5), at(1, 5)], [0.0, 1.0, 1.0, 0.25, 0.0625]);
        let area: f32 = coverage.iter().sum();
        assert!((area - 5.25 * 4.25).abs() < 1e-4, "{area}");
        // Beyond the image, and with a slope.
        let corners = [(-5.0, -5.0), (4.5, -5.0), (4.5, 20.0)].map(|(x, y)| DVec2::new(x, y));
        let coverage = polygon_coverage(&corners, SIZE);
        assert!(coverage.iter().all(|v| (0.0..=1.0).contains(v)));
    }

    #[test]
    fn a_click_changes_what_was_found_around_it_alone() {
        let rect = Rect { x0: 0, y0: 0, x1: 30, y1: 20 };
        let region = |is_inside: &dyn Fn(usize, usize) -> bool| Region {
            rect,
            inside: (0..600).map(|i| is_inside(i % 30, i / 30)).collect(),
        };
        let drawn = region(&|x, y| (5..25).contains(&x) && (5..15).contains(&y));
        // Without two corners, of which one is clicked.
        let found = region(&|x, y| (9..21).contains(&x) && (5..15).contains(&y));
        assert_eq!(bound(&drawn, &found, &[]).inside, drawn.inside);
        let within = Mark { at: [12.0, 10.0], inside: true };
        assert_eq!(bound(&drawn, &found, &[within]).inside, drawn.inside);
        let beside = Mark { at: [5.0, 10.0], inside: false };
        let clicked = bound(&drawn, &found, &[within, beside]);
        let expected = region(&|x, y| (9..25).contains(&x) && (5..15).contains(&y));
        assert_eq!(clicked.inside, expected.inside);
        let values: Vec<f32> = drawn.inside.iter().map(|i| f32::from(u8::from(*i))).collect();
        let mask = mask(&values, vec![0.5; 600], [&drawn, &clicked], (1, 30, [0; 2]));
        assert_eq!(
            [mask[10 * 30 + 6], mask[10 * 30 + 10], mask[10 * 30 + 16], mask[0]],
            [0.5, 0.5, 1.0, 0.0]
        );
    }
}
