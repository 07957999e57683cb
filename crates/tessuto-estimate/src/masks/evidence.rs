//! How much each pixel near the outline looks like fabric rather than like what is around it: the logarithm of the
//! ratio of two densities of colour. Each density is a mixture: of the colour expected at this very pixel (fabric:
//! the frames before and after, moved along; background: the plate), of colours found nearby in the same frame,
//! and of anything.

use tessuto_core::parallel;

use super::frames::{Colours, squared};
use super::plate::Plate;
use super::region::Field;
use tessuto_core::camera::Rect;

/// Standard deviation `[grey levels]` of colours around a sample of their surface; the noise is added.
const KERNEL: f32 = 7.0;
/// That around a colour expected at this pixel.
const EXPECTED: [f32; 2] = [5.0, 2.5];
/// Weight of the colour expected at this pixel, where it is sure.
const SURE: [f32; 2] = [0.5, 0.8];
/// Density of any colour, in units of the peak of a sample's.
const ANYTHING: f32 = 2e-3;
/// How much less likely something unexpected is where the background is known.
const UNEXPECTED: f32 = 0.6;
/// A pixel counts for no more than this.
const MOST: f32 = 5.0;
/// A shadow leaves this much of the companded colour at least, and is so likely.
const SHADOW: (f32, f32) = (0.72, 0.1);
/// Colours kept of a cell, of either side.
const SAMPLES: usize = 3;
/// Colours kept of the whole fabric, and of the border of what was drawn.
pub(super) const PRINT: usize = 24;
/// Cells around a pixel's whose samples count.
const REACH: usize = 3;

/// The colour of fabric that is expected at a place, if any is, and whether that is at the border: the colour is then
/// that of the fabric beside it.
pub(super) type Expected<'a> = Box<dyn Fn(f32, f32) -> Option<([f32; 3], bool)> + Sync + 'a>;

/// What is known of a frame before it is segmented.
pub(super) struct Known<'a> {
    pub frame: &'a Colours,
    /// Signed distance `[px]` to the predicted outline, positive inside.
    pub prior: &'a Field,
    /// Farther from it than this `[px]`, inside and outside, the prediction is treated as true.
    pub band: [f32; 2],
    pub plate: &'a Plate,
    /// Colour of the fabric expected at pixels: frames before and after, moved along.
    pub expected: &'a [Expected<'a>],
    /// Standard deviation of a channel `[grey levels]`.
    pub noise: f32,
    /// Colours clicked as fabric, and as not fabric.
    pub clicked: &'a [Vec<[f32; 3]>; 2],
    /// Colours of fabric near the border of what was drawn.
    pub rim: &'a [[f32; 3]],
}

/// Samples of both sides near a cell.
struct Samples {
    fabric: Vec<[f32; 3]>,
    around: Vec<[f32; 3]>,
}

/// The evidence for fabric in the band, how well the plate explains each pixel, and how alike fabric and surroundings
/// are there if what was drawn binds; 0 outside of the band.
pub(super) struct Evidence {
    pub ratio: Field,
    pub background: Field,
    pub alike: Field,
}

/// Computes the evidence in the rectangle of the prior.
pub(super) fn evidence(known: &Known) -> Evidence {
    let rect = known.prior.rect;
    let cell = (known.band[0].max(known.band[1]) * 0.8).clamp(8.0, 40.0) as usize;
    let columns = rect.width().div_ceil(cell);
    let samples = samples(known, cell, columns);
    let kernel = (KERNEL * KERNEL + known.noise * known.noise).sqrt();
    let density = Density { scale: 1.0 / (8.0 * kernel * kernel) };
    let rows: Vec<Vec<[f32; 3]>> = parallel::map(rect.height(), |row| {
        (0..rect.width())
            .map(|column| {
                let distance = known.prior.data[row * rect.width() + column];
                if distance >= known.band[0] || distance <= -known.band[1] {
                    return [0.0; 3];
                }
                let near = &samples[(row / cell) * columns + column / cell];
                pixel(known, &density, kernel, near, column + rect.x0, row + rect.y0)
            })
            .collect()
    });
    let [ratio, background, alike] = [0; 3].map(|_| Field::new(rect, 0.0));
    let mut evidence = Evidence { ratio, background, alike };
    for (i, [ratio, background, alike]) in rows.into_iter().flatten().enumerate() {
        evidence.ratio.data[i] = ratio;
        evidence.background.data[i] = background;
        evidence.alike.data[i] = alike;
    }
    evidence
}

/// A kernel near a normal one, with heavier tails.
struct Density {
    scale: f32,
}

impl Density {
    fn kernel(&self, squared: f32) -> f32 {
        let t = 1.0 + squared * self.scale;
        let t = t * t;
        1.0 / (t * t)
    }

    /// Mean over samples.
    fn of(&self, colour: [f32; 3], samples: &[[f32; 3]]) -> f32 {
        let sum: f32 = samples.iter().map(|s| self.kernel(squared(colour, *s))).sum();
        sum / (samples.len().max(1)) as f32
    }
}

fn pixel(known: &Known, density: &Density, kernel: f32, near: &Samples, x: usize, y: usize) -> [f32; 3] {
    let colour = known.frame.at(x, y);
    let peak = |sigma: f32| (kernel / sigma).powi(3).min(20.0);
    // Fabric.
    let mut fabric = density.of(colour, &near.fabric);
    let sigma = EXPECTED[0].hypot(known.noise);
    let own = Density { scale: 1.0 / (8.0 * sigma * sigma) };
    let (behind, sure, spread) = known.plate.at(x, y);
    let mut expected = 0.0_f32;
    let mut count = 0;
    // Where what was drawn binds: how much of the surroundings has the colour that is expected of the fabric.
    let mut alike = (0.0_f32, 0);
    for of_frame in known.expected {
        let Some((c, at_border)) = of_frame(x as f32, y as f32) else { continue };
        if !at_border {
            expected += own.kernel(squared(colour, c));
            count += 1;
        }
        if !known.rim.is_empty() {
            let behind = sure * own.kernel(squared(behind, c));
            alike = (alike.0 + behind.max(density.of(c, &near.around)), alike.1 + 1);
        }
    }
    if count > 0 {
        fabric += SURE[0] * (peak(sigma) * expected / count as f32 - fabric);
    }
    // Background.
    let mut around = density.of(colour, &near.around);
    let mut explained = 0.0;
    if sure > 0.0 {
        let sigma = EXPECTED[1].hypot(known.noise).hypot(spread);
        let own = Density { scale: 1.0 / (8.0 * sigma * sigma) };
        let lit = own.kernel(squared(colour, behind));
        let dark = own.kernel(squared(colour, shadowed(colour, behind)));
        explained = lit.max(SHADOW.1 * dark);
        around += SURE[1] * sure * (peak(sigma) * explained - around);
    }
    let anything = [ANYTHING, ANYTHING * (1.0 - UNEXPECTED * sure)];
    let ratio = ((fabric + anything[0]) / (around + anything[1])).ln().clamp(-MOST, MOST);
    // Colours then say nothing.
    let alike = (alike.0 / alike.1.max(1) as f32).min(1.0);
    [ratio * (1.0 - alike), explained * sure, alike]
}

/// The background as it would look in a shadow that makes it most like `colour`.
fn shadowed(colour: [f32; 3], behind: [f32; 3]) -> [f32; 3] {
    let (mut both, mut own) = (0.0, 1e-3);
    for c in 0..3 {
        both += colour[c] * behind[c];
        own += behind[c] * behind[c];
    }
    let gain = (both / own).clamp(SHADOW.0, 1.0);
    behind.map(|v| gain * v)
}

/// The samples that count in each cell.
fn samples(known: &Known, cell: usize, columns: usize) -> Vec<Samples> {
    let rect = known.prior.rect;
    let rows = rect.height().div_ceil(cell);
    let own: Vec<Samples> =
        parallel::map(columns * rows, |k| of_cell(known, rect, cell, [k % columns, k / columns]));
    let mut print: Vec<[f32; 3]> = spread(own.iter().flat_map(|s| &s.fabric).copied().collect(), PRINT);
    print.extend(known.rim);
    parallel::map(columns * rows, |k| {
        let (i, j) = (k % columns, k / columns);
        let mut near = Samples { fabric: print.clone(), around: Vec::new() };
        for row in j.saturating_sub(REACH)..(j + REACH + 1).min(rows) {
            for column in i.saturating_sub(REACH)..(i + REACH + 1).min(columns) {
                let of = &own[row * columns + column];
                near.fabric.extend(&of.fabric);
                near.around.extend(&of.around);
            }
        }
        // A click counts as much as all else of its side.
        for (side, clicked) in [&mut near.fabric, &mut near.around].into_iter().zip(known.clicked) {
            let wanted = side.len();
            side.extend(clicked.iter().cycle().take(if clicked.is_empty() { 0 } else { wanted }));
        }
        near
    })
}

/// At most `count` of the samples, evenly spaced in their order.
pub(super) fn spread(samples: Vec<[f32; 3]>, count: usize) -> Vec<[f32; 3]> {
    let step = samples.len().div_ceil(count).max(1);
    samples.into_iter().step_by(step).collect()
}

fn of_cell(known: &Known, rect: Rect, cell: usize, [i, j]: [usize; 2]) -> Samples {
    let (mut fabric, mut around) = (Vec::new(), Vec::new());
    for row in j * cell..((j + 1) * cell).min(rect.height()) {
        for column in i * cell..((i + 1) * cell).min(rect.width()) {
            let distance = known.prior.data[row * rect.width() + column];
            let side = match distance {
                d if d >= known.band[0] => &mut fabric,
                d if d <= -known.band[1] => &mut around,
                _ => continue,
            };
            side.push(known.frame.at(column + rect.x0, row + rect.y0));
        }
    }
    Samples { fabric: spread(fabric, SAMPLES), around: spread(around, SAMPLES) }
}
