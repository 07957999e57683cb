//! Contact sheet: a few frames side by side, one row per kind of image.

use super::colour::Colour;
use super::font;
use super::images::{FrameImages, Kind, Scales};
use super::legend::{self, Legend};
use tessuto_core::camera::Rect;
use tessuto_core::image::Image;

const INK: Colour = [0.13, 0.13, 0.13];
const PAPER: Colour = [1.0, 1.0, 1.0];
/// Width `[px]` of one small image.
const CELL: usize = 190;
const GAP: usize = 4;
/// Space `[px]` for the rows' and the columns' names.
const LEFT: usize = 134;
const TOP: usize = 26;
/// Most frames on a sheet.
const COLUMNS: usize = 9;

const ROWS: [Kind; 5] = [Kind::Render, Kind::Observed, Kind::Difference, Kind::Depth, Kind::DepthDifference];

/// Which of `count` frames a sheet shows: the first, the last, and evenly spread ones between them.
pub fn chosen_frames(count: usize) -> Vec<usize> {
    let columns = count.min(COLUMNS);
    (0..columns)
        .map(|k| if columns == 1 { 0 } else { (k * (count - 1) + (columns - 1) / 2) / (columns - 1) })
        .collect()
}

/// The sheet of `frames` (number and images), shape [height, width, 3]. Rows without data are left out.
///
/// Panics if there is no frame.
pub fn contact_sheet(frames: &[(usize, FrameImages)], scales: &Scales) -> Image {
    let first = &frames[0].1;
    let rows: Vec<Kind> = ROWS.into_iter().filter(|k| first.image(*k, scales).is_some()).collect();
    let view = fabric(frames);
    let cell_height = (view.height() * CELL).div_ceil(view.width()).max(1);
    let legends: Vec<Legend> = rows.iter().filter_map(|k| Legend::of(*k, scales)).collect();
    let mut sheet = Image::new(
        LEFT + frames.len().max(3) * (CELL + GAP) + GAP,
        TOP + rows.len() * (cell_height + GAP) + legends.len().div_ceil(3) * (2 * legend::STRIP) + GAP,
        3,
    );
    let size = [sheet.width, sheet.height];
    font::fill(&mut sheet, [0, 0], size, PAPER);
    for (column, (number, images)) in frames.iter().enumerate() {
        let x = LEFT + column * (CELL + GAP);
        font::draw(&mut sheet, [x, TOP - 5 - 2 * font::HEIGHT], &format!("FRAME {number}"), 2, INK);
        for (row, kind) in rows.iter().enumerate() {
            let y = TOP + row * (cell_height + GAP);
            if let Some(image) = images.image(*kind, scales) {
                paste(&mut sheet, [x, y], &shrunk(&image, view, [CELL, cell_height]));
            }
        }
    }
    for (row, kind) in rows.iter().enumerate() {
        for (line, word) in words(*kind).iter().enumerate() {
            let y = TOP + row * (cell_height + GAP) + cell_height / 2 + 20 * line;
            font::draw(&mut sheet, [6, y.saturating_sub(14)], word, 2, INK);
        }
    }
    let width = (sheet.width - LEFT) / 3;
    for (k, legend) in legends.iter().enumerate() {
        let y = TOP + rows.len() * (cell_height + GAP) + k / 3 * (2 * legend::STRIP);
        legend.draw(&mut sheet, [LEFT + k % 3 * width, y], width - 12, 2);
    }
    sheet
}

fn words(kind: Kind) -> &'static [&'static str] {
    match kind {
        Kind::Render => &["RENDERED"],
        Kind::Observed => &["OBSERVED"],
        Kind::Difference => &["COLOUR", "DIFFERENCE"],
        Kind::MaskDifference => &["MASK", "DIFFERENCE"],
        Kind::Depth => &["DEPTH"],
        Kind::DepthDifference => &["DEPTH -", "MEASURED", "DEPTH"],
    }
}

/// The part of the images that holds fabric, filmed or rendered, in any frame, with some margin;
/// the whole if there is none.
fn fabric(frames: &[(usize, FrameImages)]) -> Rect {
    const MARGIN: usize = 8;
    let (width, height) = (frames[0].1.rgb.width, frames[0].1.rgb.height);
    let masks = frames.iter().flat_map(|(_, f)| [f.mask, &f.observed.mask]);
    let covered = masks.flat_map(|mask| {
        let pixels = mask.data.iter().enumerate().filter(|(_, v)| **v > 0.5);
        pixels.map(|(i, _)| (i % width, i / width))
    });
    match Rect::around(covered) {
        Some(view) => view.padded(MARGIN, [width, height]),
        None => Rect { x0: 0, y0: 0, x1: width, y1: height },
    }
}

/// The part `view` of `image` at `width`×`height` `[px]`: means over the pixels that fall into each new one.
fn shrunk(image: &Image, view: Rect, [width, height]: [usize; 2]) -> Image {
    let mut out = Image::new(width, height, image.channels);
    // At least one source pixel each, also when enlarging.
    let span = |k: usize, n: usize, of: usize, from: usize| {
        let start = k * of / n;
        from + start..from + ((k + 1) * of / n).max(start + 1)
    };
    for y in 0..height {
        let ys = span(y, height, view.height(), view.y0);
        for x in 0..width {
            let xs = span(x, width, view.width(), view.x0);
            let weight = 1.0 / (xs.len() * ys.len()) as f32;
            for (sx, sy) in ys.clone().flat_map(|sy| xs.clone().map(move |sx| (sx, sy))) {
                for (o, v) in out.pixel_mut(x, y).iter_mut().zip(image.pixel(sx, sy)) {
                    *o += v * weight;
                }
            }
        }
    }
    out
}

fn paste(sheet: &mut Image, [x, y]: [usize; 2], image: &Image) {
    for row in 0..image.height {
        for column in 0..image.width {
            sheet.pixel_mut(x + column, y + row).copy_from_slice(image.pixel(column, row));
        }
    }
}
