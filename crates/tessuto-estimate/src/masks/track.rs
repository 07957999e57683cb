//! The outline through the clip: from the first frame forward, then every frame again with its neighbours on both sides
//! and with what lies behind the fabric known.

use tessuto_core::parallel;

use super::beyond::{FRAMES, behind};
use super::drawn::{self, Drawn};
use super::evidence::{Expected, Known};
use super::flow::{Flow, flow};
use super::frames::{Colours, Frames};
use super::plate::Plate;
use super::region::{Field, Region};
use super::segment::{Mark, impose, segment};
use tessuto_core::camera::Rect;

/// Half width of the band in which the outline is looked for, inside and outside, as fractions of the fabric's size: of
/// the outline that was drawn, once it has been found, from frame to frame, and each time all frames are gone through.
const DRAWN: [f32; 2] = [0.11, 0.06];
const FOUND: [f32; 2] = [0.06, 0.06];
const NEXT: [f32; 2] = [0.04, 0.04];
const AGAIN: [[f32; 2]; 2] = [[0.08, 0.08], [0.05, 0.05]];
/// The narrowest band `[px]`.
const NARROWEST: f32 = 6.0;
/// Nearer to the outline nothing is treated as background `[px]`.
const MARGIN: f32 = 3.0;
/// Pieces and holes smaller than these fractions of the fabric are none.
const CRUMBS: f64 = 0.02;
const PINHOLES: f64 = 0.002;
/// The border of the fabric reaches so far out `[px]`.
const BORDER: f32 = -0.5;
/// Around a click, in whatever frame it was made, everything is looked at anew within this fraction of the size.
const OPENED: f32 = 0.2;

/// What is given beside the frames.
pub(super) struct Given {
    /// The fabric in the first frame, as drawn.
    pub first: Region,
    /// How far it is true.
    pub drawn: Drawn,
    pub plate: Option<Plate>,
    /// Places that were clicked, per frame.
    pub marks: Vec<Vec<Mark>>,
    /// Keep the largest piece alone.
    pub largest_piece: bool,
    pub noise: f32,
}

/// The fabric in every frame.
pub(super) struct Tracked {
    pub regions: Vec<Region>,
    /// For fabric (positive) against its surroundings, in a band around each outline.
    pub evidence: Vec<Field>,
    /// From each frame to the next.
    pub flows: Vec<Flow>,
    pub plate: Plate,
}

struct Tracker<'a> {
    frames: &'a Frames,
    given: &'a Given,
    /// Square root of the fabric's area `[px]`.
    size: f32,
    /// Per frame: those given, and in the first frame those of what stays behind.
    marks: Vec<Vec<Mark>>,
    clicked: [Vec<[f32; 3]>; 2],
    /// Colours near the border of what was drawn, where that binds.
    rim: Vec<[f32; 3]>,
}

/// Finds the fabric in all frames. `progress` receives the fraction that is done. The number of the frame in which
/// nothing is left of it, where that happens.
pub(super) fn track(
    frames: &Frames,
    given: &Given,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Tracked, usize> {
    let mut tracker = Tracker {
        frames,
        given,
        size: (given.first.area() as f32).sqrt(),
        marks: given.marks.clone(),
        clicked: clicked(frames, &given.marks),
        rim: Vec::new(),
    };
    if given.drawn == Drawn::Binds {
        tracker.rim = drawn::rim(&frames.images[0], &given.first, tracker.band(AGAIN[0])[0]);
    }
    let count = frames.images.len() as f64;
    let (mut regions, mut flows) = tracker.forward(&|n| progress(0.2 * n as f64 / count))?;
    if given.drawn == Drawn::Corners {
        let early = &regions[..regions.len().min(FRAMES + 1)];
        let distances: Vec<Field> = parallel::over(early, |r| r.signed_distance(tracker.around(r)));
        let behind = behind(&given.first, &distances, &flows);
        if !behind.is_empty() {
            tracker.marks[0].extend(behind);
            tracker.clicked = clicked(frames, &tracker.marks);
            (regions, flows) = tracker.forward(&|n| progress(0.2 + 0.2 * n as f64 / count))?;
        }
    }
    let mut evidence = Vec::new();
    let mut plate = Plate::unknown(frames.size);
    for (pass, band) in AGAIN.iter().enumerate() {
        let distances: Vec<Field> = parallel::over(&regions, |r| r.signed_distance(tracker.around(r)));
        plate = match &given.plate {
            Some(given) => given.clone(),
            None => Plate::seen(frames, &distances, MARGIN),
        };
        let again: Vec<(Region, Field)> = parallel::map(frames.images.len(), |n| {
            let found = tracker.again(n, &distances, &flows, &plate, *band);
            progress(0.4 + 0.3 * (pass as f64 + n as f64 / count));
            found
        });
        (regions, evidence) = again.into_iter().unzip();
        if let Some(lost) = regions.iter().position(|r| r.area() == 0) {
            return Err(lost);
        }
    }
    Ok(Tracked { regions, evidence, flows, plate })
}

impl Tracker<'_> {
    fn band(&self, fractions: [f32; 2]) -> [f32; 2] {
        fractions.map(|f| (f * self.size).max(NARROWEST))
    }

    /// The part of the image that counts for the fabric in `region`.
    fn around(&self, region: &Region) -> Rect {
        let [width, height] = self.frames.size;
        let whole = Rect { x0: 0, y0: 0, x1: width, y1: height };
        let margin = (0.3 * self.size) as usize + 24;
        region.bounds().map_or(whole, |b| b.padded(margin, self.frames.size))
    }

    /// Frame `n` without crumbs and pinholes, except what was clicked.
    fn tidy(&self, region: Region, n: usize) -> Region {
        let mut tidy = region.tidied(if self.given.largest_piece { 1.0 } else { CRUMBS }, PINHOLES);
        impose(&mut tidy, &self.marks[n]);
        tidy
    }

    /// The first frame, from what was drawn.
    fn first(&self, plate: &Plate) -> Region {
        let mut region = self.given.first.clone();
        let bands: &[[f32; 2]] = match self.given.drawn {
            Drawn::Corners => &[DRAWN, FOUND, FOUND],
            Drawn::Near => &[NEXT],
            // A click in this frame asks what is there.
            Drawn::Binds if self.marks[0].is_empty() => &[],
            Drawn::Binds => &[FOUND],
        };
        for band in bands {
            let prior = self.opened(region.signed_distance(self.around(&region)), self.band(*band));
            let known = self.known(0, &prior, self.band(*band), plate, &[]);
            region = self.tidy(segment(&known, &self.marks[0]).region, 0);
        }
        self.bound(region, 0)
    }

    /// What was found in frame `n`; what was drawn there, where that binds.
    fn bound(&self, found: Region, n: usize) -> Region {
        if n > 0 || self.given.drawn != Drawn::Binds {
            return found;
        }
        let drawn = drawn::bound(&self.given.first, &found, &self.marks[0]);
        if self.given.largest_piece { drawn.tidied(1.0, 0.0) } else { drawn }
    }

    fn known<'a>(
        &'a self,
        n: usize,
        prior: &'a Field,
        band: [f32; 2],
        plate: &'a Plate,
        expected: &'a [Expected<'a>],
    ) -> Known<'a> {
        let frame = &self.frames.images[n];
        Known {
            frame,
            prior,
            band,
            plate,
            expected,
            noise: self.given.noise,
            clicked: &self.clicked,
            rim: &self.rim,
        }
    }

    /// The prediction, taken back where somebody clicked against it in any frame.
    fn opened(&self, mut prior: Field, band: [f32; 2]) -> Field {
        let rect = prior.rect;
        let radius = OPENED * self.size;
        for mark in self.given.marks.iter().flatten() {
            for (i, d) in prior.data.iter_mut().enumerate() {
                let (x, y) = ((i % rect.width() + rect.x0) as f32, (i / rect.width() + rect.y0) as f32);
                if (*d > 0.0) != mark.inside && (x - mark.at[0]).hypot(y - mark.at[1]) < radius {
                    *d = d.clamp(-0.3 * band[1], 0.3 * band[0]);
                }
            }
        }
        prior
    }

    /// All frames, each from the one before.
    fn forward(&self, progress: &dyn Fn(usize)) -> Result<(Vec<Region>, Vec<Flow>), usize> {
        let mut plate = self.given.plate.clone().unwrap_or_else(|| Plate::unknown(self.frames.size));
        let mut regions = vec![self.first(&plate)];
        let mut flows: Vec<Flow> = Vec::new();
        for n in 1..self.frames.images.len() {
            let before = &regions[n - 1];
            if before.area() == 0 {
                return Err(n - 1);
            }
            let rect = self.around(before);
            let distance = before.signed_distance(rect);
            let [from, to] = [&self.frames.images[n - 1], &self.frames.images[n]];
            if self.given.plate.is_none() {
                plate.add(from, &distance, MARGIN);
            }
            let flow = flow(from, to, before, rect);
            let moved = flow.forward(&distance, rect);
            let rect = self.around(&Region::positive(&moved));
            let prior = flow.forward(&distance, rect);
            let expected = [expected(from, &distance, |x, y| {
                let d = flow.to(x, y);
                [x - d[0], y - d[1]]
            })];
            // Where it moves fast, the prediction is worse.
            let mut band = self.band(NEXT);
            band.iter_mut().for_each(|b| *b = b.max(0.7 * flow.largest()).min(0.12 * self.size));
            let prior = self.opened(prior, band);
            let known = self.known(n, &prior, band, &plate, &expected);
            let region = self.tidy(segment(&known, &self.marks[n]).region, n);
            drop(expected);
            regions.push(region);
            flows.push(flow);
            progress(n);
        }
        Ok((regions, flows))
    }

    /// One frame again, from itself and both its neighbours.
    fn again(
        &self,
        n: usize,
        distances: &[Field],
        flows: &[Flow],
        plate: &Plate,
        band: [f32; 2],
    ) -> (Region, Field) {
        let own = &distances[n];
        let rect = own.rect;
        let mut prior = own.clone();
        let mut count = 1.0;
        let mut expected: Vec<Expected> = Vec::new();
        let mut carried = Vec::new();
        if n > 0 {
            let flow = &flows[n - 1];
            carried.push(flow.forward(&distances[n - 1], rect));
            expected.push(self::expected(&self.frames.images[n - 1], &distances[n - 1], move |x, y| {
                let d = flow.to(x, y);
                [x - d[0], y - d[1]]
            }));
        }
        if n + 1 < distances.len() {
            let flow = &flows[n];
            carried.push(flow.back(&distances[n + 1], rect));
            expected.push(self::expected(&self.frames.images[n + 1], &distances[n + 1], move |x, y| {
                let d = flow.at(x, y);
                [x + d[0], y + d[1]]
            }));
        }
        for field in &carried {
            prior.data.iter_mut().zip(&field.data).for_each(|(p, v)| *p += v);
            count += 1.0;
        }
        prior.data.iter_mut().for_each(|p| *p /= count);
        let prior = self.opened(prior, self.band(band));
        let known = self.known(n, &prior, self.band(band), plate, &expected);
        let found = segment(&known, &self.marks[n]);
        (self.bound(self.tidy(found.region, n), n), found.evidence)
    }
}

/// The colour of the fabric that comes from a place of another frame; none where it was not fabric there. At the border
/// that of the fabric beside it.
fn expected<'a>(
    frame: &'a Colours,
    distance: &'a Field,
    origin: impl Fn(f32, f32) -> [f32; 2] + Sync + 'a,
) -> Expected<'a> {
    Box::new(move |x, y| {
        let [x, y] = origin(x, y);
        let d = distance.sample(x, y);
        if d > 1.0 {
            return Some((frame.sample(x, y), false));
        }
        if d < BORDER {
            return None;
        }
        let slope = [
            distance.sample(x + 1.0, y) - distance.sample(x - 1.0, y),
            distance.sample(x, y + 1.0) - distance.sample(x, y - 1.0),
        ];
        let inward = (2.0 - d) / slope[0].hypot(slope[1]).max(1e-3);
        Some((frame.sample(x + inward * slope[0], y + inward * slope[1]), true))
    })
}

/// Colours around the clicks of each side.
fn clicked(frames: &Frames, marks: &[Vec<Mark>]) -> [Vec<[f32; 3]>; 2] {
    let mut colours = [Vec::new(), Vec::new()];
    for (frame, marks) in frames.images.iter().zip(marks) {
        for mark in marks {
            let side = &mut colours[usize::from(!mark.inside)];
            for (dx, dy) in [(0.0, 0.0), (2.0, 0.0), (-2.0, 0.0), (0.0, 2.0), (0.0, -2.0)] {
                side.push(frame.sample(mark.at[0] + dx, mark.at[1] + dy));
            }
        }
    }
    colours
}
