//! How far each mask can be trusted, and why not.

use tessuto_core::parallel;

use super::conserved::comes_and_goes;
use super::drawn::Drawn;
use super::findings::Fault;
use super::frames::Frames;
use super::region::{Field, Region};
use super::still::{Rest, standing_still};
use super::track::{Given, Tracked};

/// Below this confidence a frame is named.
pub(super) const DOUBTFUL: f64 = 0.6;
/// Evidence on either side of the outline that counts as clear: a factor of e in the ratio of densities.
const CLEAR: f32 = 1.0;
/// How far from the outline it is asked for `[px]`.
const STEP: f32 = 2.5;
/// Fraction of the outline that may lie at the border of the image.
const LEAVES: f64 = 0.02;

/// Fractions of the mask that may be wrong by what stands still, and by what comes and goes, and how much more
/// leaves no confidence. Both are less than what is wrong, so that frames are named below an overlap of about
/// 0.97.
const STILL: (f64, f64) = (0.004, 0.02);
const COMES: (f64, f64) = (0.015, 0.025);

/// What is said of one frame's mask.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Judgement {
    /// 0 … 1.
    pub confidence: f64,
    /// Why the mask is doubtful, where it is.
    pub fault: Option<Fault>,
}

/// Judges every frame.
pub(super) fn judge(frames: &Frames, tracked: &Tracked, given: &Given) -> Vec<Judgement> {
    let count = tracked.regions.len();
    let distances: Vec<Field> =
        parallel::map(count, |n| tracked.regions[n].signed_distance(tracked.evidence[n].rect));
    let drawn = given.first.signed_distance(tracked.evidence[0].rect);
    let rest = Rest { drawn: &drawn, found: &distances[0], noise: given.noise };
    let still = standing_still(frames, tracked, &distances, &rest);
    let comes = comes_and_goes(frames, tracked, &distances, given.noise);
    let one = |n| match n == 0 && given.drawn == Drawn::Binds {
        // Somebody drew it.
        true => Judgement { confidence: 1.0, fault: None },
        false => one(frames, tracked, &distances, [still[n], comes[n]], n),
    };
    parallel::map(count, one)
}

fn one(frames: &Frames, tracked: &Tracked, distances: &[Field], wrong: [f64; 2], n: usize) -> Judgement {
    let region = &tracked.regions[n];
    let clear = clearness(region, &tracked.evidence[n]);
    // What neighbours say where the fabric should be.
    let rect = region.bounds().unwrap_or(region.rect).padded(8, frames.size);
    let mut agreement: f64 = 1.0;
    if n > 0 {
        let before = tracked.flows[n - 1].forward(&distances[n - 1], rect);
        agreement = agreement.min(region.overlap(&Region::positive(&before)));
    }
    if n + 1 < tracked.regions.len() {
        let after = tracked.flows[n].back(&distances[n + 1], rect);
        agreement = agreement.min(region.overlap(&Region::positive(&after)));
    }
    let [at_border, outline] = border(region, frames.size);
    let leaves = at_border as f64 / outline.max(1) as f64;
    // Areas of a second before and after, in the middle.
    let mut areas: Vec<usize> = tracked.regions[n.saturating_sub(8)..(n + 9).min(tracked.regions.len())]
        .iter()
        .map(Region::area)
        .collect();
    areas.sort_unstable();
    let jump = region.area() as f64 / areas[areas.len() / 2].max(1) as f64;
    let steps = [
        // Outlines of which half is clear on both sides are usual; of S1, 0.9.
        ((clear - 0.2) / 0.5).clamp(0.0, 1.0),
        ((agreement - 0.85) / 0.1).clamp(0.0, 1.0),
        if leaves > LEAVES { 0.5 } else { 1.0 },
        1.0 - ((jump.max(1.0 / jump) - 1.1) / 0.4).clamp(0.0, 1.0),
        1.0 - ((wrong[0] - STILL.0) / STILL.1).clamp(0.0, 1.0),
        1.0 - ((wrong[1] - COMES.0) / COMES.1).clamp(0.0, 1.0),
    ];
    let confidence = steps.iter().product::<f64>();
    let faults = [
        Fault::Alike(1.0 - clear),
        Fault::Predicted(agreement),
        Fault::Leaves(leaves),
        Fault::Jumps(jump),
        Fault::Still(wrong[0]),
        Fault::Passes(wrong[1]),
    ];
    let worst = (0..steps.len()).min_by(|a, b| steps[*a].total_cmp(&steps[*b])).unwrap_or(0);
    let fault = (confidence < DOUBTFUL).then(|| faults[worst]);
    Judgement { confidence: (confidence * 1e3).round() / 1e3, fault }
}

/// Fraction of the outline with clear evidence on both sides.
pub(super) fn clearness(region: &Region, evidence: &Field) -> f64 {
    let rect = evidence.rect;
    let distance = region.signed_distance(rect);
    let (mut clear, mut all) = (0_usize, 0_usize);
    let (w, h) = (rect.width(), rect.height());
    for i in 0..w * h {
        // The pixels just inside.
        if !(0.0..1.0).contains(&distance.data[i]) {
            continue;
        }
        let (x, y) = ((i % w + rect.x0) as f32, (i / w + rect.y0) as f32);
        let slope = [
            distance.sample(x + 1.0, y) - distance.sample(x - 1.0, y),
            distance.sample(x, y + 1.0) - distance.sample(x, y - 1.0),
        ];
        let length = slope[0].hypot(slope[1]).max(1e-3);
        let at = |t: f32| evidence.sample(x + t * slope[0] / length, y + t * slope[1] / length);
        all += 1;
        clear += usize::from(at(STEP) > CLEAR && at(-STEP - 0.5) < -CLEAR);
    }
    clear as f64 / all.max(1) as f64
}

/// Pixels of the outline at the border of the image, and all of them.
fn border(region: &Region, [width, height]: [usize; 2]) -> [usize; 2] {
    let rect = region.rect;
    let (mut at_border, mut all) = (0, 0);
    for (i, _) in region.inside.iter().enumerate().filter(|(_, i)| **i) {
        let (x, y) = (i % rect.width() + rect.x0, i / rect.width() + rect.y0);
        let edge = x == 0 || y == 0 || x + 1 == width || y + 1 == height;
        let outline = edge
            || !region.at(x - 1, y)
            || !region.at(x + 1, y)
            || !region.at(x, y - 1)
            || !region.at(x, y + 1);
        at_border += usize::from(edge);
        all += usize::from(outline);
    }
    [at_border, all]
}
