//! How far the template's outline is from that of the fabric.

use glam::DVec2;

use super::{Finding, Level};
use tessuto_core::error::{Hint, Remedy};
use tessuto_core::image::Image;
use tessuto_core::scene::Scene;
use tessuto_core::video::COVERED;
use tessuto_estimate::motion::observed::outline_distance::OutlineDistance;

/// Outlines farther apart than this fraction of the fabric's size (the square root of its area in the image) are
/// doubtful. That of R1, a real recording with a measured template, is 0.5 %, those of rendered scenes are below
/// 0.1 %.
const FRACTION: f64 = 0.01;
/// The least distance that is doubtful `[px]`, for small images.
const LEAST: f64 = 1.0;

/// The finding about the template, which covers the pixels `covered`, and the mask of the first frame.
pub(super) fn finding(scene: &Scene, covered: &[bool], mask: &Image) -> Finding {
    let finding = |level, detail: String, hint| Finding { level, what: "outline".into(), detail, hint };
    let data = covered.iter().map(|c| f32::from(u8::from(*c))).collect();
    let template = Image { width: mask.width, height: mask.height, channels: 1, data };
    let Some(off) = mean_distance(&template, mask) else {
        let detail =
            "no outline of template and mask is inside the image: they cannot be compared".to_owned();
        return finding(Level::Ok, detail, None);
    };
    let size = (mask.data.iter().filter(|m| **m >= 0.5).count().max(1) as f64).sqrt();
    let detail = format!(
        "template and mask of frame {}: {off:.1} px apart in the mean, {:.1} % of the fabric's size",
        scene.first_frame,
        100.0 * off / size
    );
    if off <= LEAST.max(FRACTION * size) {
        return finding(Level::Ok, detail, None);
    }
    let hint = Hint::from(
        "look whether the template's size and place and the camera are right, and whether the mask holds the fabric, \
         all of it and nothing else",
    );
    finding(Level::Warning, detail, Some(hint.with(Remedy::Check)))
}

/// Mean distance `[px]` of the outline of either mask to that of the other; `None` if both outlines are at the
/// image's border, which is none of theirs. Outlines rather than the edges of a mesh: where fabric is folded, its
/// edges lie inside.
fn mean_distance(a: &Image, b: &Image) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0usize);
    for (from, to) in [(a, b), (b, a)] {
        let distance = OutlineDistance::new(to, 1);
        for_outline(from, |p| {
            if let Some((d, _)) = distance.sample(p) {
                sum += d.abs();
                count += 1;
            }
        });
    }
    (count > 0).then(|| sum / count as f64)
}

/// Visits the middle between each two neighbouring pixels of which one is fabric.
fn for_outline(mask: &Image, mut visit: impl FnMut(DVec2)) {
    let (w, h) = (mask.width, mask.height);
    let fabric = |x: usize, y: usize| mask.data[y * w + x] >= COVERED;
    for y in 0..h {
        for x in 0..w {
            let at = DVec2::new(x as f64, y as f64);
            if x + 1 < w && fabric(x, y) != fabric(x + 1, y) {
                visit(at + DVec2::new(0.5, 0.0));
            }
            if y + 1 < h && fabric(x, y) != fabric(x, y + 1) {
                visit(at + DVec2::new(0.0, 0.5));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rectangle of fabric: columns x0..x1, rows y0..y1 of 60×60.
    fn rectangle([x0, x1, y0, y1]: [usize; 4]) -> Image {
        let mut mask = Image::new(60, 60, 1);
        for y in y0..y1 {
            for x in x0..x1 {
                mask.pixel_mut(x, y)[0] = 1.0;
            }
        }
        mask
    }

    #[test]
    fn outlines_are_as_far_apart_as_they_were_moved() {
        let mask = rectangle([20, 40, 20, 40]);
        assert_eq!(mean_distance(&mask, &mask), Some(0.0));
        // Larger by 4 px on every side; from the corners of the larger one it is farther.
        let grown = mean_distance(&rectangle([16, 44, 16, 44]), &mask).unwrap();
        assert!((4.0..4.3).contains(&grown), "{grown}");
        // Neither a smaller one nor one with a strip that is not fabric passes for it.
        assert_eq!(mean_distance(&mask, &rectangle([16, 44, 16, 44])), Some(grown));
        let mut with_arm = mask.clone();
        (5..20).for_each(|y| (28..32).for_each(|x| with_arm.pixel_mut(x, y)[0] = 1.0));
        assert!(mean_distance(&mask, &with_arm).unwrap() > 1.5);
    }

    #[test]
    fn where_the_image_ends_is_no_outline() {
        let apart = mean_distance(&rectangle([0, 30, 0, 60]), &rectangle([0, 35, 0, 60])).unwrap();
        assert!((apart - 5.0).abs() < 1e-6, "{apart}");
        assert_eq!(mean_distance(&rectangle([0, 60, 0, 60]), &rectangle([0, 60, 0, 60])), None);
    }
}
