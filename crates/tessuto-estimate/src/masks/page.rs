//! masks.html: every frame with the outline of its mask, the doubtful ones first named. The frames are shown from the
//! scene's own files, so the page is small and belongs beside them.

use std::fmt::Write as _;

use askama::Template;

use super::findings::Finding;
use super::record::Record;
use super::region::Field;
use crate::io::scene::ColourFiles;
use tessuto_core::error::{Error, Result};

/// Name of the file.
pub(super) const NAME: &str = "masks.html";

#[derive(Template)]
#[template(path = "masks.html")]
struct Page<'a> {
    frames: Vec<Shown<'a>>,
    width: usize,
    height: usize,
    notes: &'a [String],
    doubtful: Vec<&'a Finding>,
    others: Vec<&'a Finding>,
    mean: String,
}

struct Shown<'a> {
    number: usize,
    file: String,
    path: &'a str,
    confidence: String,
    reason: Option<&'a str>,
}

/// The page.
pub(super) fn page(
    clip: &ColourFiles,
    record: &Record,
    [width, height]: [usize; 2],
    outlines: &[String],
) -> Result<String> {
    let name = |k: usize| clip.paths[k].file_name().unwrap_or_default().to_string_lossy().into_owned();
    let shown = record.frames.iter().zip(outlines).enumerate().map(|(k, (frame, path))| Shown {
        number: frame.frame,
        file: name(k),
        path,
        confidence: format!("{:.0} %", 100.0 * frame.confidence),
        reason: frame.reason.as_deref(),
    });
    let mean = record.frames.iter().map(|f| f.confidence).sum::<f64>() / record.frames.len().max(1) as f64;
    let page = Page {
        frames: shown.collect(),
        width,
        height,
        notes: &record.notes,
        doubtful: record.findings.iter().filter(|f| f.doubtful).collect(),
        others: record.findings.iter().filter(|f| !f.doubtful).collect(),
        mean: format!("{:.0} %", 100.0 * mean),
    };
    page.render().map_err(|e| Error::Numerical {
        place: NAME.into(),
        problem: e.to_string(),
        hint: "report this as a fault of the program".into(),
    })
}

/// The outline of a coverage at one half as an SVG path, in pixels of the recording: marching squares, segment by
/// segment.
pub(super) fn outline(coverage: &Field, factor: usize) -> String {
    let rect = coverage.rect;
    let (w, h) = (rect.width() as isize, rect.height() as isize);
    let value = |x: isize, y: isize| {
        let inside = x >= 0 && y >= 0 && x < w && y < h;
        if inside { coverage.data[(y * w + x) as usize] } else { 0.0 }
    };
    let mut path = String::new();
    let scale = factor as f32;
    let recorded = |v: f32| (v + 0.5) * scale - 0.5;
    for y in -1..h {
        for x in -1..w {
            // Corners clockwise from the upper left, and where the outline crosses the sides between them.
            let corners = [value(x, y), value(x + 1, y), value(x + 1, y + 1), value(x, y + 1)];
            let mut crossings = Vec::new();
            for (k, from) in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].into_iter().enumerate() {
                let (a, b) = (corners[k], corners[(k + 1) % 4]);
                if (a >= 0.5) != (b >= 0.5) {
                    let t = (0.5 - a) / (b - a);
                    let step = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][k];
                    let at = [x as f32 + rect.x0 as f32, y as f32 + rect.y0 as f32];
                    crossings.push([at[0] + from[0] + t * step[0], at[1] + from[1] + t * step[1]]);
                }
            }
            for pair in crossings.chunks_exact(2) {
                let [a, b] = [pair[0], pair[1]].map(|p| p.map(recorded));
                let _ = write!(path, "M{:.1} {:.1}L{:.1} {:.1}", a[0], a[1], b[0], b[1]);
            }
        }
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::camera::Rect;

    #[test]
    fn the_outline_of_one_pixel_is_a_diamond_around_it() {
        let mut coverage = Field::new(Rect { x0: 4, y0: 2, x1: 7, y1: 5 }, 0.0);
        coverage.data[4] = 1.0;
        let path = outline(&coverage, 1);
        assert_eq!(path.matches('M').count(), 4);
        for point in ["5.0 2.5", "5.5 3.0", "5.0 3.5", "4.5 3.0"] {
            assert_eq!(path.matches(point).count(), 2, "{point} in {path}");
        }
    }
}
