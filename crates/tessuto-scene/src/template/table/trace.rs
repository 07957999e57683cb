//! The borders of the fabric in a mask, to parts of a pixel: the outer one and those of its holes.

use glam::DVec2;

use tessuto_core::error::{Error, Result};
use tessuto_core::image::Image;

/// Pieces and holes of fewer pixels are specks of the mask.
const SPECK: usize = 16;
/// A further piece of more than this part of the largest is no crumb.
const CRUMB: f64 = 0.01;
/// Most pieces that a message names.
const NAMED: usize = 4;

/// Closed borders, points less than 1.5 px apart.
#[derive(Debug, Clone)]
pub(super) struct Traced {
    /// Around the fabric, clockwise as seen `[px]`.
    pub(super) outer: Vec<DVec2>,
    /// Around its holes, the other way round `[px]`.
    pub(super) holes: Vec<Vec<DVec2>>,
    /// Middle of the fabric `[px]`.
    pub(super) middle: DVec2,
    /// Pixels of fabric, holes not counted.
    pub(super) count: usize,
    /// What a user should know.
    pub(super) notes: Vec<String>,
    /// The mask without what is beside the fabric and its specks.
    clean: Image,
}

impl Traced {
    /// Traced once more, in the mask blurred by `sigma` `[px]`: ragged borders become smooth, slits and whiskers of
    /// pixels go. Half of a blurred straight border is where it was; one of radius r moves inwards by `sigma`²/(2 r).
    ///
    /// # Errors
    /// [`Error::Input`] at `place` if the fabric is so narrow in a place that it falls apart.
    pub(super) fn blurred(&self, sigma: f64, place: &str) -> Result<Self> {
        let again = trace(&blurred(&self.clean, sigma), place)?;
        Ok(Self { notes: self.notes.clone(), ..again })
    }
}

/// One of several connected sets of pixels.
#[derive(Debug, Clone, Copy, Default)]
struct Piece {
    count: usize,
    sum: DVec2,
    /// Pixels at the border of the image.
    outermost: usize,
}

impl Piece {
    fn middle(&self) -> DVec2 {
        self.sum / self.count.max(1) as f64
    }

    fn named(&self) -> String {
        format!("{} px around {:.0},{:.0}", self.count, self.middle().x, self.middle().y)
    }
}

/// Traces the borders of the one piece of fabric in `mask`, where it is ½.
///
/// # Errors
/// [`Error::Input`] at `place` if the mask is empty, has several pieces, or touches the border of the image.
pub(super) fn trace(mask: &Image, place: &str) -> Result<Traced> {
    let size = [mask.width, mask.height];
    let value = |k: usize| f64::from(mask.data[k * mask.channels]);
    let (label, pieces) = label(size, false, |k| value(k) >= 0.5);
    let mut order: Vec<usize> = (0..pieces.len()).collect();
    order.sort_by_key(|k| std::cmp::Reverse(pieces[*k].count));
    let Some(&largest) = order.first() else {
        return Err(Error::input(
            place,
            "the mask is empty",
            "white is fabric; give the mask of the first frame",
        ));
    };
    let (piece, mut notes) = (pieces[largest], Vec::new());
    let least = SPECK.max((CRUMB * piece.count as f64) as usize);
    let large: Vec<&Piece> = order.iter().map(|k| &pieces[*k]).take_while(|p| p.count > least).collect();
    if large.len() > 1 {
        let named: Vec<String> = large.iter().take(NAMED).map(|p| p.named()).collect();
        let problem = format!("the mask has {} pieces: {}", large.len(), named.join("; "));
        let hint =
            "leave the garment alone in it: remove the other pieces, or join those that belong together";
        return Err(Error::input(place, problem, hint));
    }
    if piece.outermost > 0 {
        let problem = format!("the fabric touches the border of the image, in {} pixels", piece.outermost);
        let hint = "its outline is not seen whole there: begin with a frame that shows the whole garment, or film it \
                    from farther away";
        return Err(Error::input(place, problem, hint));
    }
    if pieces.len() > 1 {
        notes.push(format!("{place}: {} specks beside the fabric are left out", pieces.len() - 1));
    }
    // Fabric hangs together by sides of pixels, so what is around it does by corners, too.
    let mut inside: Vec<bool> = label.iter().map(|l| *l == largest as u32 + 1).collect();
    let (around, gaps) = self::label(size, true, |k| !inside[k]);
    let is_speck =
        |l: u32| l > 0 && gaps[l as usize - 1].outermost == 0 && gaps[l as usize - 1].count < SPECK;
    let closed = gaps.iter().filter(|g| g.outermost == 0 && g.count < SPECK).count();
    if closed > 0 {
        notes.push(format!("{place}: {closed} holes of fewer than {SPECK} pixels are closed"));
    }
    let filled: Vec<bool> = around.iter().map(|l| is_speck(*l)).collect();
    inside.iter_mut().zip(&filled).for_each(|(i, f)| *i |= f);
    let soft = |k: usize| match (inside[k], filled[k]) {
        (true, true) => 1.0,
        (true, false) => value(k).max(0.5),
        // Specks beside the fabric do not attract its border.
        (false, _) if value(k) >= 0.5 => 0.0,
        (false, _) => value(k),
    };
    let mut loops = loops(&inside, size, soft);
    loops.sort_by(|a, b| area(b).abs().total_cmp(&area(a).abs()));
    let outer = loops.remove(0);
    let count = inside.iter().filter(|i| **i).count();
    let clean = Image {
        width: mask.width,
        height: mask.height,
        channels: 1,
        data: (0..inside.len()).map(|k| soft(k) as f32).collect(),
    };
    Ok(Traced { outer, holes: loops, middle: piece.middle(), count, notes, clean })
}

/// A mask blurred by a Gaussian of this standard deviation `[px]`; black goes on around it.
fn blurred(mask: &Image, sigma: f64) -> Image {
    let reach = (3.0 * sigma).ceil() as i64;
    let weights: Vec<f32> =
        (-reach..=reach).map(|j| (-0.5 * (j as f64 / sigma).powi(2)).exp() as f32).collect();
    let sum: f32 = weights.iter().sum();
    let [w, h] = [mask.width as i64, mask.height as i64];
    let along = |data: &[f32], [dx, dy]: [i64; 2]| -> Vec<f32> {
        let value = |k: i64| {
            let (x, y) = (k % w, k / w);
            let at = |j: i64| {
                let (x, y) = (x + j * dx, y + j * dy);
                let inside = x >= 0 && y >= 0 && x < w && y < h;
                if inside { data[(y * w + x) as usize] } else { 0.0 }
            };
            (-reach..=reach).zip(&weights).map(|(j, weight)| weight * at(j)).sum::<f32>() / sum
        };
        (0..w * h).map(value).collect()
    };
    Image { data: along(&along(&mask.data, [1, 0]), [0, 1]), ..mask.clone() }
}

/// Twice the area of a closed polygon, above 0 if it goes clockwise as seen (rows go down).
pub(super) fn area(points: &[DVec2]) -> f64 {
    (0..points.len()).map(|k| points[k].perp_dot(points[(k + 1) % points.len()])).sum()
}

/// Numbers from 1 on of the connected sets of the pixels to `keep`, 0 elsewhere, and what they are.
fn label([w, h]: [usize; 2], by_corners: bool, keep: impl Fn(usize) -> bool) -> (Vec<u32>, Vec<Piece>) {
    let mut label = vec![0u32; w * h];
    let (mut pieces, mut stack) = (Vec::<Piece>::new(), Vec::new());
    for start in 0..w * h {
        if !keep(start) || label[start] != 0 {
            continue;
        }
        pieces.push(Piece::default());
        let number = pieces.len() as u32;
        label[start] = number;
        stack.push(start);
        while let Some(k) = stack.pop() {
            let (x, y) = (k % w, k / w);
            let piece = pieces.last_mut().expect("one was pushed");
            piece.count += 1;
            piece.sum += DVec2::new(x as f64, y as f64);
            piece.outermost += usize::from(x == 0 || y == 0 || x + 1 == w || y + 1 == h);
            for dy in 0..3 {
                for dx in 0..3 {
                    let (nx, ny) = ((x + dx).wrapping_sub(1), (y + dy).wrapping_sub(1));
                    let diagonal = dx != 1 && dy != 1;
                    if nx >= w || ny >= h || (diagonal && !by_corners) {
                        continue;
                    }
                    let n = ny * w + nx;
                    if keep(n) && label[n] == 0 {
                        label[n] = number;
                        stack.push(n);
                    }
                }
            }
        }
    }
    (label, pieces)
}

/// All closed borders between pixels `inside` and others, fabric on the right hand; every point lies between the
/// centres of two pixels, where `soft` is ½. Nothing inside touches the border of the image.
fn loops(inside: &[bool], [w, h]: [usize; 2], soft: impl Fn(usize) -> f64) -> Vec<Vec<DVec2>> {
    let mut seen = vec![false; w * h];
    let mut out = Vec::new();
    for start in w..w * h {
        // Every border has a side of a pixel with fabric below and none above.
        if !inside[start] || inside[start - w] || seen[start] {
            continue;
        }
        let first = (start % w, start / w, 0);
        let (mut at, mut points) = (first, Vec::new());
        loop {
            // Corner (x, y) is the upper left one of pixel (x, y); headings are right, down, left, up.
            let (x, y, heading) = at;
            let [right, left] = match heading {
                0 => [(x, y), (x, y - 1)],
                1 => [(x - 1, y), (x, y)],
                2 => [(x - 1, y - 1), (x - 1, y)],
                _ => [(x, y - 1), (x - 1, y - 1)],
            };
            if heading == 0 {
                seen[y * w + x] = true;
            }
            let values = [right, left].map(|(x, y)| soft(y * w + x));
            let [a, b] = [right, left].map(|(x, y)| DVec2::new(x as f64, y as f64));
            points.push(a.lerp(b, ((values[0] - 0.5) / (values[0] - values[1])).clamp(0.0, 1.0)));
            let (x, y) = match heading {
                0 => (x + 1, y),
                1 => (x, y + 1),
                2 => (x - 1, y),
                _ => (x, y - 1),
            };
            let pixel = |x: usize, y: usize| inside[y * w + x];
            let [nw, ne, se, sw] = [pixel(x - 1, y - 1), pixel(x, y - 1), pixel(x, y), pixel(x - 1, y)];
            let (left, right) = [(ne, se), (se, sw), (sw, nw), (nw, ne)][heading];
            let turn = if !right { 1 } else { 3 * usize::from(left) };
            at = (x, y, (heading + turn) % 4);
            if at == first {
                break;
            }
        }
        out.push(points);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(rows: &[&str]) -> Image {
        let mut mask = Image::new(rows[0].len(), rows.len(), 1);
        for (y, row) in rows.iter().enumerate() {
            for (x, c) in row.bytes().enumerate() {
                mask.pixel_mut(x, y)[0] = if c == b'#' { 1.0 } else { 0.0 };
            }
        }
        mask
    }

    /// A soft disc with a soft hole, each pixel the part that is covered.
    fn ring(outer: f64, inner: f64) -> Image {
        let mut mask = Image::new(120, 110, 1);
        for y in 0..110 {
            for x in 0..120 {
                let r = DVec2::new(x as f64 - 60.3, y as f64 - 54.6).length();
                let covered = (outer - r + 0.5).clamp(0.0, 1.0) * (r - inner + 0.5).clamp(0.0, 1.0);
                mask.pixel_mut(x, y)[0] = covered as f32;
            }
        }
        mask
    }

    #[test]
    fn soft_borders_are_found_to_a_twentieth_of_a_pixel() {
        let traced = trace(&ring(40.0, 15.0), "mask").unwrap();
        assert!(traced.holes.len() == 1 && traced.notes.is_empty());
        assert!(area(&traced.outer) > 0.0 && area(&traced.holes[0]) < 0.0);
        assert!(traced.middle.distance(DVec2::new(60.3, 54.6)) < 0.05);
        for (points, radius) in [(&traced.outer, 40.0), (&traced.holes[0], 15.0)] {
            let off: Vec<f64> = points.iter().map(|p| p.distance(DVec2::new(60.3, 54.6)) - radius).collect();
            let mean = off.iter().sum::<f64>() / off.len() as f64;
            let rms = (off.iter().map(|e| e * e).sum::<f64>() / off.len() as f64).sqrt();
            assert!(mean.abs() < 0.03 && rms < 0.06, "{radius}: {mean} {rms}");
            let steps = (0..points.len()).map(|k| points[k].distance(points[(k + 1) % points.len()]));
            assert!(steps.fold(0.0, f64::max) < 1.5);
        }
    }

    #[test]
    fn blurring_keeps_borders_and_closes_slits() {
        let mut mask = ring(40.0, 15.0);
        let traced = trace(&mask, "mask").unwrap();
        let again = traced.blurred(1.5, "mask").unwrap();
        let mean = |points: &[DVec2]| {
            points.iter().map(|p| p.distance(DVec2::new(60.3, 54.6))).sum::<f64>() / points.len() as f64
        };
        assert!((mean(&again.outer) - 40.0).abs() < 0.08 && (mean(&again.holes[0]) - 15.0).abs() < 0.12);
        // A slit of one pixel from the hole to the outside.
        (0..60).for_each(|x| mask.pixel_mut(x, 54)[0] = 0.0);
        let slit = trace(&mask, "mask").unwrap();
        assert_eq!(slit.holes.len(), 0);
        assert_eq!(slit.blurred(1.5, "mask").unwrap().holes.len(), 1);
    }

    #[test]
    fn pixels_that_meet_in_corners_are_gone_around_once() {
        let rows = [
            "..........",
            "..######..",
            "..#....#..",
            "..#....#..",
            "..#....#..",
            "..#....#..",
            "..#...##..",
            "..####.#..",
            "..######..",
            "..........",
        ];
        let traced = trace(&image(&rows), "mask").unwrap();
        // The single gap touches the large one in a corner: they are one hole.
        assert_eq!((traced.holes.len(), traced.count), (1, 48 - 20));
    }

    #[test]
    fn crumbs_are_left_out_and_pieces_named() {
        let mut mask = ring(40.0, 15.0);
        (3..6).for_each(|x| mask.pixel_mut(x, 4)[0] = 1.0);
        mask.pixel_mut(60, 25)[0] = 0.0;
        let traced = trace(&mask, "mask").unwrap();
        assert_eq!(traced.holes.len(), 1);
        assert!(
            traced.notes.len() == 2 && traced.notes[1].contains("1 holes of fewer"),
            "{:?}",
            traced.notes
        );
        (2..12).for_each(|x| (2..12).for_each(|y| mask.pixel_mut(x, y)[0] = 1.0));
        let text = trace(&mask, "mask_000.png").unwrap_err().to_string();
        assert!(text.starts_with("mask_000.png: the mask has 2 pieces"), "{text}");
        assert!(text.contains("px around 60,55") && text.contains("100 px around 6,6"), "{text}");
    }

    #[test]
    fn a_fabric_at_the_border_and_an_empty_mask_are_refused() {
        let text = trace(&image(&["....", ".###", ".###", "...."]), "mask").unwrap_err().to_string();
        assert!(text.contains("touches the border of the image, in 2 pixels"), "{text}");
        assert!(trace(&Image::new(5, 5, 1), "mask").unwrap_err().to_string().contains("empty"));
    }
}
