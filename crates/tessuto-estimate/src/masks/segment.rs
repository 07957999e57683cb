//! Fabric or not, for every pixel near the predicted outline at once: the minimum cut of evidence, smoothness and
//! prediction. What is smooth is judged by contrast without that of the background ("Background cut", J. Sun et al.,
//! ECCV 2006).

use super::cut::Graph;
use super::evidence::{Evidence, Known, evidence};
use super::frames::squared;
use super::region::{Field, Region};

/// What it costs to part two neighbours that look alike, and what remains where they do not.
const SMOOTH: (f32, f32) = (3.0, 0.08);
/// What it costs to leave the prediction by the whole band.
const PREDICTION: f32 = 1.2;
/// By how much that grows where fabric and background have one colour.
const ALIKE: f32 = 12.0;
/// Capacities are whole numbers: this many to one.
const UNIT: f32 = 256.0;
/// Radius around a click that is certain `[px]`.
pub(super) const CERTAIN: f32 = 3.0;

/// A place that somebody clicked, in the coordinates of the frames.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mark {
    pub at: [f32; 2],
    pub inside: bool,
}

/// A frame's fabric, and the evidence for it.
pub(super) struct Segmented {
    pub region: Region,
    pub evidence: Field,
}

/// Segments a frame; what lies beyond the band is as predicted.
pub(super) fn segment(known: &Known, marks: &[Mark]) -> Segmented {
    let Evidence { ratio, background, alike } = evidence(known);
    let rect = known.prior.rect;
    let (w, h) = (rect.width(), rect.height());
    // Numbers of the unknown pixels.
    const FIXED: u32 = u32::MAX;
    let mut numbers = vec![FIXED; w * h];
    let mut unknown = Vec::new();
    for (i, distance) in known.prior.data.iter().enumerate() {
        if *distance < known.band[0] && *distance > -known.band[1] {
            numbers[i] = unknown.len() as u32;
            unknown.push(i);
        }
    }
    let colour = |i: usize| known.frame.at(i % w + rect.x0, i / w + rect.y0);
    let behind = |i: usize| known.plate.at(i % w + rect.x0, i / w + rect.y0).0;
    // Squared contrast of two pixels, without what the background has of it where both pixels look like background.
    let contrast = |i: usize, j: usize| {
        let (a, b) = (colour(i), colour(j));
        let alike = background.data[i].min(background.data[j]).min(1.0);
        if alike < 0.05 {
            return squared(a, b);
        }
        let (p, q) = (behind(i), behind(j));
        let left = std::array::from_fn(|c| (a[c] - b[c]) - alike * (p[c] - q[c]));
        squared(left, [0.0; 3])
    };
    // Right, down, and both diagonals.
    let links: [(isize, usize, f32); 4] = [(1, 0, 1.0), (0, 1, 1.0), (1, 1, 0.707), (-1, 1, 0.707)];
    let neighbour = |i: usize, dx: isize, dy: usize| {
        let x = (i % w).checked_add_signed(dx).filter(|x| *x < w)?;
        let y = i / w + dy;
        (y < h).then_some(y * w + x)
    };
    let mut mean = (0.0_f64, 0_usize);
    for &i in unknown.iter().step_by(3) {
        for (dx, dy, _) in &links[..2] {
            if let Some(j) = neighbour(i, *dx, *dy) {
                mean = (mean.0 + f64::from(contrast(i, j)), mean.1 + 1);
            }
        }
    }
    let scale =
        1.0 / (2.0 * (mean.0 / mean.1.max(1) as f64) as f32).max(2.0 * known.noise * known.noise).max(1.0);
    let mut graph = Graph::new(unknown.len(), 4 * unknown.len());
    for (k, &i) in unknown.iter().enumerate() {
        let distance = known.prior.data[i];
        let half = if distance > 0.0 { known.band[0] } else { known.band[1] };
        let prediction = PREDICTION * (1.0 + ALIKE * alike.data[i]);
        let own = ratio.data[i] + prediction * (distance / half);
        graph.add_terminal(k, (UNIT * own) as i32);
    }
    // All pixels of the rectangle: links to fixed ones go by either end.
    let strength = |i: usize, j: usize, nearness: f32| {
        let alike = (-contrast(i, j) * scale).exp();
        (UNIT * SMOOTH.0 * nearness * (SMOOTH.1 + (1.0 - SMOOTH.1) * alike)) as i32
    };
    for i in 0..w * h {
        for (dx, dy, nearness) in links {
            let Some(j) = neighbour(i, dx, dy) else { continue };
            match (numbers[i], numbers[j]) {
                (FIXED, FIXED) => {}
                (FIXED, k) => {
                    graph.add_terminal(k as usize, signed(strength(i, j, nearness), known.prior.data[i]))
                }
                (k, FIXED) => {
                    graph.add_terminal(k as usize, signed(strength(i, j, nearness), known.prior.data[j]))
                }
                (k, l) => graph.add_arcs(k as usize, l as usize, strength(i, j, nearness)),
            }
        }
    }
    let mut region = Region::positive(known.prior);
    for (mark, i) in marks.iter().flat_map(|m| certain(rect, *m).into_iter().map(move |i| (m, i))) {
        match numbers[i] {
            FIXED => {}
            k => graph.add_terminal(k as usize, if mark.inside { 1 << 24 } else { -(1 << 24) }),
        }
    }
    let source = graph.cut();
    unknown.iter().zip(source).for_each(|(i, fabric)| region.inside[*i] = fabric);
    impose(&mut region, marks);
    Segmented { region, evidence: ratio }
}

/// What was clicked holds, whatever was found.
pub(super) fn impose(region: &mut Region, marks: &[Mark]) {
    for mark in marks {
        certain(region.rect, *mark).into_iter().for_each(|i| region.inside[i] = mark.inside);
    }
}

fn signed(strength: i32, distance: f32) -> i32 {
    if distance > 0.0 { strength } else { -strength }
}

/// Pixels of the rectangle around a click.
pub(super) fn certain(rect: tessuto_core::camera::Rect, mark: Mark) -> Vec<usize> {
    let mut pixels = Vec::new();
    for y in rect.y0..rect.y1 {
        if (y as f32 - mark.at[1]).abs() > CERTAIN {
            continue;
        }
        for x in rect.x0..rect.x1 {
            if (x as f32 - mark.at[0]).hypot(y as f32 - mark.at[1]) <= CERTAIN {
                pixels.push((y - rect.y0) * rect.width() + x - rect.x0);
            }
        }
    }
    pixels
}
