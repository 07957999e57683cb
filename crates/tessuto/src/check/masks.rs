//! What is wrong with masks: pieces, holes, greys, and sizes that jump.

use super::{Finding, Level};
use tessuto_core::error::Hint;
use tessuto_core::image::Image;
use tessuto_core::mesh::pieces;
use tessuto_core::scene::Scene;
use tessuto_estimate::masks::Record;
use tessuto_render::raster::coverage::template_coverage;

/// The largest piece of a mask holds less than this: error, and warning.
const LARGEST: [f64; 2] = [0.5, 0.998];
/// Fraction of a mask that is grey, neither black nor white: error, and warning. Soft edges of cloth of a hundred
/// pixels are a few percent, a sheet that is blurred by its own width is half grey, an image in place of a mask is
/// all of it.
const GREY: [f64; 2] = [0.8, 0.25];
/// Fraction of holes that is doubtful, beside those that the template itself has.
const HOLES: f64 = 0.01;
/// A hole of the template may look larger by this factor in another frame, as a fraction of the fabric.
const LARGER: f64 = 1.5;

/// Shape of one mask.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MaskShape {
    /// Pixels that are fabric, by at least one half.
    pixels: usize,
    /// Pieces that hang together, along sides or corners.
    pieces: usize,
    /// Fraction of the fabric's pixels that the largest piece has.
    largest: f64,
    /// Pixels of the holes, as a fraction of the fabric's.
    holes: f64,
    /// Pixels from 5 % to 95 %, as a fraction of those above 5 %.
    grey: f64,
}

impl MaskShape {
    pub(super) fn of(mask: &Image) -> Self {
        let fabric: Vec<bool> = mask.data.iter().map(|v| *v >= 0.5).collect();
        let background: Vec<bool> = fabric.iter().map(|f| !f).collect();
        let pixels = fabric.iter().filter(|f| **f).count();
        let regions = regions(&fabric, mask.width, true);
        let largest = regions.iter().map(|r| r.0).max().unwrap_or(0);
        // What is around the fabric, or cut off by the image's border, is no hole.
        let holes: usize =
            self::regions(&background, mask.width, false).iter().filter(|r| !r.1).map(|r| r.0).sum();
        let some = mask.data.iter().filter(|v| **v > 0.05).count();
        let grey = mask.data.iter().filter(|v| (0.05..0.95).contains(*v)).count();
        let share = |n: usize, of: usize| n as f64 / of.max(1) as f64;
        Self {
            pixels,
            pieces: regions.len(),
            largest: if pixels == 0 { 1.0 } else { share(largest, pixels) },
            holes: share(holes, pixels),
            grey: share(grey, some),
        }
    }
}

/// Pixels of each connected region of `inside`, and whether it touches the border. `corners`: whether pixels that
/// share only a corner hang together.
fn regions(inside: &[bool], width: usize, corners: bool) -> Vec<(usize, bool)> {
    let height = inside.len() / width.max(1);
    let mut left = inside.to_vec();
    let (mut out, mut open) = (Vec::new(), Vec::new());
    for start in 0..inside.len() {
        if !std::mem::take(&mut left[start]) {
            continue;
        }
        open.push(start);
        let (mut count, mut border) = (0, false);
        while let Some(i) = open.pop() {
            let (x, y) = (i % width, i / width);
            count += 1;
            border |= x == 0 || y == 0 || x + 1 == width || y + 1 == height;
            for ny in y.saturating_sub(1)..(y + 2).min(height) {
                for nx in x.saturating_sub(1)..(x + 2).min(width) {
                    let k = ny * width + nx;
                    if (corners || nx == x || ny == y) && std::mem::take(&mut left[k]) {
                        open.push(k);
                    }
                }
            }
        }
        out.push((count, border));
    }
    out
}

/// The findings about the masks of all frames: sizes, then whatever is wrong with their shapes.
pub(super) fn findings(scene: &Scene, shapes: &[MaskShape]) -> Vec<Finding> {
    let finding = |level, detail: String, hint: &str| Finding {
        level,
        what: "masks".into(),
        detail,
        hint: Some(hint.into()),
    };
    let mut out = vec![sizes(scene, shapes)];
    // The frame with the largest cost, if that is beyond the limits.
    let worst = |cost: &dyn Fn(&MaskShape) -> f64, [error, warning]: [f64; 2]| {
        let (n, shape) =
            shapes.iter().enumerate().reduce(|a, b| if cost(b.1) > cost(a.1) { b } else { a })?;
        let level = match cost(shape) {
            c if c > error => Level::Error,
            c if c > warning => Level::Warning,
            _ => return None,
        };
        Some((level, scene.first_frame + n, shape))
    };
    let grey = worst(&|s| s.grey, GREY);
    if let Some((level, frame, shape)) = grey {
        let detail =
            format!("{:.0} % of the mask of frame {frame} is neither black nor white", 100.0 * shape.grey);
        out.push(finding(
            level,
            detail,
            "give masks, not colours: white is fabric, black is everything else",
        ));
    }
    // Fabric of several pieces may look so. Pieces and holes of greys mean nothing.
    let comparable = pieces(&scene.template).len() <= 1 && grey.is_none_or(|g| g.0 != Level::Error);
    if let Some((level, frame, shape)) = worst(&|s| 1.0 - s.largest, LARGEST.map(|l| 1.0 - l))
        && comparable
    {
        let detail = format!(
            "the mask of frame {frame} is {} pieces, the largest holds {:.1} % of it",
            shape.pieces,
            100.0 * shape.largest
        );
        out.push(finding(
            level,
            detail,
            "leave only the fabric white, as import can (largest_piece): other pieces are treated as cloth",
        ));
    }
    out.extend(made(scene));
    let own = LARGER * own_holes(scene);
    if let Some((level, frame, shape)) = worst(&|s| s.holes - own, [f64::INFINITY, HOLES]) {
        let detail =
            format!("the mask of frame {frame} has holes, {:.1} % of the fabric", 100.0 * shape.holes);
        out.push(finding(
            level,
            detail,
            "fill the holes, unless something stands in front of the fabric there",
        ));
    }
    out
}

/// Holes of the template as the camera sees it in the first frame, as a fraction of the fabric.
fn own_holes(scene: &Scene) -> f64 {
    let (mesh, camera) = (&scene.template, scene.camera);
    let covered = template_coverage(mesh, &mesh.positions, camera);
    let data = covered.iter().map(|c| f32::from(u8::from(*c))).collect();
    MaskShape::of(&Image { width: camera.width, height: camera.height, channels: 1, data }).holes
}

/// What was doubtful when the masks were made from the clip.
fn made(scene: &Scene) -> Option<Finding> {
    let finding = |detail, hint: Hint| Finding {
        level: Level::Warning,
        what: "masks".into(),
        detail,
        hint: Some(hint),
    };
    let record = match Record::read(&scene.folder) {
        Ok(record) => record?,
        Err(error) => return Some(finding(error.to_string(), "make the masks again".into())),
    };
    let first = record.findings.iter().find(|f| f.doubtful)?;
    let detail = format!(
        "{} of {} masks made from the clip look wrong, first {}: {}",
        record.doubtful().count(),
        record.frames.len(),
        first.frames(),
        first.text
    );
    Some(finding(
        detail,
        "look at masks.html, and say of places in these frames whether they are fabric".into(),
    ))
}

/// How much of the image is fabric.
fn sizes(scene: &Scene, shapes: &[MaskShape]) -> Finding {
    let full = (scene.full_size[0] * scene.full_size[1]) as f64;
    let shares: Vec<f64> = shapes.iter().map(|s| s.pixels as f64 / full).collect();
    let (mut low, mut high) = (0, 0);
    for (n, share) in shares.iter().enumerate() {
        low = if *share < shares[low] { n } else { low };
        high = if *share > shares[high] { n } else { high };
    }
    let detail = format!(
        "fabric is {:.1} % (frame {}) to {:.1} % (frame {}) of the image",
        100.0 * shares[low],
        scene.first_frame + low,
        100.0 * shares[high],
        scene.first_frame + high
    );
    let doubt = |detail, hint: &str| Finding {
        level: Level::Warning,
        what: "masks".into(),
        detail,
        hint: Some(hint.into()),
    };
    if shares[high] > 0.9 {
        return doubt(detail, "masks this full are often inverted; white must be fabric");
    }
    // Fabric does not appear or vanish between two frames.
    let ratio = |pair: &[f64]| pair[0].max(pair[1]) / pair[0].min(pair[1]);
    match shares.windows(2).position(|pair| ratio(pair) > 1.5) {
        Some(n) => {
            let frame = scene.first_frame + n;
            let jump = format!("{detail}; by over half in or out between frames {frame} and {}", frame + 1);
            doubt(jump, "look at these masks")
        }
        None => Finding { level: Level::Ok, what: "masks".into(), detail, hint: None },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mask from rows of characters: `#` is fabric, `+` grey, everything else is background.
    fn mask(rows: &[&str]) -> Image {
        let value = |c: char| match c {
            '#' => 1.0,
            '+' => 0.6,
            _ => 0.0,
        };
        let data = rows.iter().flat_map(|r| r.chars().map(value)).collect();
        Image { width: rows[0].len(), height: rows.len(), channels: 1, data }
    }

    #[test]
    fn pieces_holes_and_greys_are_counted() {
        let whole = MaskShape::of(&mask(&["......", ".####.", ".####.", "......"]));
        assert_eq!(whole, MaskShape { pixels: 8, pieces: 1, largest: 1.0, holes: 0.0, grey: 0.0 });
        // A bay of the background is no hole, nor is what the border cuts off.
        let bays = MaskShape::of(&mask(&["##.###", "##..##", "...###"]));
        assert_eq!((bays.pieces, bays.holes), (2, 0.0));
        let holed = MaskShape::of(&mask(&["#####.", "#.#.#.", "#####.", "......", ".#...#"]));
        assert_eq!((holed.pieces, holed.pixels), (3, 15));
        assert!((holed.largest - 13.0 / 15.0).abs() < 1e-12 && (holed.holes - 2.0 / 15.0).abs() < 1e-12);
        let soft = MaskShape::of(&mask(&["......", ".+##+.", "......"]));
        assert_eq!((soft.pieces, soft.grey), (1, 0.5));
        let nothing = MaskShape::of(&mask(&["..."]));
        assert_eq!((nothing.pixels, nothing.pieces, nothing.largest), (0, 0, 1.0));
    }
}
