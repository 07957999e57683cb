//! What the fabric's other side looks like, where scene.json does not say it.
//!
//! A fabric that was dyed through shows the same colours from behind. Another one shows, where it turns over, colours
//! that the first frame has nowhere: pixels at which the density of the first frame's colours, each as bright as
//! folds and light may make it, is below that of colours drawn at random. Noise, borders and blur leave few of these,
//! and of all colours; a back leaves many of one.

use glam::Vec3;
use tessuto_core::parallel;

use super::Problem;
use crate::motion::observed::Observed;
use crate::motion::observed::outline_distance::{OutlineDistance, distance};
use crate::motion::observed::pyramid::Level;
use tessuto_core::image::srgb;
use tessuto_core::mesh::Side;
use tessuto_core::scene::Back;

/// Cells of the density along each channel.
const CELLS: usize = 32;
/// Spread of the logarithm of a colour's brightness, and at how many brightnesses within three of it the colours of
/// the first frame are taken.
const BRIGHTNESS: f32 = 0.35;
const BRIGHTNESSES: usize = 13;
/// Times that the density is averaged with its neighbours (1 2 1)/4 along each channel: by one cell's spread.
const SMOOTHED: usize = 2;
/// Pixels this near to the border of the fabric `[px]` do not count.
const MARGIN: usize = 2;
/// Colours of one back are within this distance of their mean `[sRGB]`.
const RADIUS: f32 = 0.15;
/// Steps in which that mean is found.
const STEPS: usize = 10;
/// A back of another colour fills this part of the fabric in some frame at least.
const SEEN: f64 = 0.05;

impl Problem<'_> {
    /// The front, where the sides differ.
    pub(super) fn front(&self) -> Option<Side> {
        (self.back != Back::Same).then_some(self.front)
    }

    /// What a point of the back would show in the first frame's light, sRGB; `None` where that is not known.
    pub(super) fn back_colour(&self) -> Option<[f32; 3]> {
        match self.back {
            Back::Plain(colour) => colour,
            Back::Same | Back::Other => None,
        }
    }
}

/// The back, given what is `known` of it and what a camera `observed`.
pub(super) fn back(known: Option<Back>, observed: &Observed) -> Back {
    match known {
        Some(Back::Plain(None)) => match unseen_in_first(observed) {
            Some((colour, _)) => Back::Plain(Some(colour)),
            None => Back::Other,
        },
        Some(back) => back,
        None => match unseen_in_first(observed) {
            Some((colour, part)) if part >= SEEN => Back::Plain(Some(colour)),
            _ => Back::Same,
        },
    }
}

/// Where a camera's frames show back beside front, given what the back looks like; empty where nothing is known of it.
pub(super) fn seams(back: Back, observed: &Observed) -> Vec<Option<OutlineDistance>> {
    let Back::Plain(Some(colour)) = back else { return Vec::new() };
    let colour = Vec3::from_array(colour);
    let finest = observed.range[0];
    let front = Density::of(&inside(&observed.first[finest]));
    // Whichever is likelier: one of the front's colours, or the back's about which its shades are spread.
    let spread = 0.5 * RADIUS;
    let peak = (std::f32::consts::TAU * spread * spread).powf(-1.5);
    let is_back = |seen: Vec3| {
        let off = seen.distance_squared(colour) / (spread * spread);
        front.at(seen) < peak * (-0.5 * off).exp()
    };
    let of = |levels: &Vec<Level>| seam(&levels[finest], 1 << finest, is_back);
    parallel::over(&observed.levels, of)
}

/// The line between what `is_back` of the fabric in a frame and what is not, which has this `scale`, carried on beside
/// the fabric; `None` where one of both is not to be seen.
fn seam(level: &Level, scale: usize, is_back: impl Fn(Vec3) -> bool) -> Option<OutlineDistance> {
    let camera = level.view.camera;
    let (w, h) = (camera.width, camera.height);
    let side: Vec<Option<bool>> = (0..w * h)
        .map(|i| level.texel(i % w, i / w).map(|colour| is_back(Vec3::from_array(colour))))
        .collect();
    // What most of its neighbours are not is noise.
    let most = |i: usize| {
        let (x, y) = (i % w, i / w);
        let around = (y.saturating_sub(1)..=(y + 1).min(h - 1))
            .flat_map(|y| (x.saturating_sub(1)..=(x + 1).min(w - 1)).map(move |x| y * w + x));
        let votes = around.filter_map(|i| side[i]).fold(0, |sum, back| sum + if back { 1 } else { -1 });
        votes > 0
    };
    let settled: Vec<Option<bool>> = (0..w * h).map(|i| side[i].map(|_| most(i))).collect();
    if !settled.contains(&Some(true)) || !settled.contains(&Some(false)) {
        return None;
    }
    let nearest = [true, false].map(|of| {
        let is: Vec<bool> = settled.iter().map(|side| *side == Some(of)).collect();
        distance(&is, true, [w, h], (w + h) as f32)
    });
    let back: Vec<bool> = (0..w * h).map(|i| nearest[0][i] < nearest[1][i]).collect();
    Some(OutlineDistance::of(&back, [w, h], scale))
}

/// The most frequent of the colours that the first frame does not show, and which part of the fabric it fills in the
/// frame that shows it most.
fn unseen_in_first(observed: &Observed) -> Option<([f32; 3], f64)> {
    let finest = observed.range[0];
    let front = Density::of(&inside(&observed.first[finest]));
    // Of every frame, and how many pixels it has.
    let unseen: Vec<(Vec<Vec3>, usize)> = (observed.levels.iter())
        .map(|levels| {
            let mut colours = inside(&levels[finest]);
            let count = colours.len();
            colours.retain(|colour| front.at(*colour) < 1.0);
            (colours, count)
        })
        .collect();
    let all = || unseen.iter().flat_map(|(colours, _)| colours);
    let mut centre = Density::counting(all().copied().map(|colour| (colour, 1.0))).mode()?;
    let near = |colour: &&Vec3, centre: Vec3| colour.distance(centre) < RADIUS;
    for _ in 0..STEPS {
        let (sum, count) =
            all().filter(|c| near(c, centre)).fold((Vec3::ZERO, 0), |(sum, n), c| (sum + *c, n + 1));
        if count == 0 {
            return None;
        }
        centre = sum / count as f32;
    }
    let part = |(colours, count): &(Vec<Vec3>, usize)| {
        colours.iter().filter(|c| near(c, centre)).count() as f64 / (*count).max(1) as f64
    };
    Some((centre.to_array(), unseen.iter().map(part).fold(0.0, f64::max)))
}

/// The colours of the fabric, but for its border.
fn inside(level: &Level) -> Vec<Vec3> {
    let rect = level.rect();
    let mut colours = Vec::new();
    for y in rect.y0 + MARGIN..rect.y1.saturating_sub(MARGIN) {
        for x in rect.x0 + MARGIN..rect.x1.saturating_sub(MARGIN) {
            let around = [(x - MARGIN, y), (x + MARGIN, y), (x, y - MARGIN), (x, y + MARGIN)];
            if let Some(colour) = level.texel(x, y)
                && around.iter().all(|(x, y)| level.texel(*x, *y).is_some())
            {
                colours.push(Vec3::from_array(colour));
            }
        }
    }
    colours
}

/// Density of colours in the cube of sRGB, relative to the uniform one.
struct Density(Vec<f32>);

impl Density {
    /// Of these colours, each at several brightnesses.
    fn of(colours: &[Vec3]) -> Self {
        let steps: Vec<f32> =
            (0..BRIGHTNESSES).map(|k| 6.0 * k as f32 / (BRIGHTNESSES - 1) as f32 - 3.0).collect();
        let factors: Vec<(f32, f32)> =
            steps.iter().map(|s| ((BRIGHTNESS * s).exp(), (-0.5 * s * s).exp())).collect();
        let lit = colours.iter().flat_map(|colour| {
            let linear = colour.to_array().map(srgb::decode);
            factors.iter().map(move |(factor, weight)| {
                let brighter = linear.map(|v| srgb::encode((v * factor).clamp(0.0, 1.0)));
                (Vec3::from_array(brighter), *weight)
            })
        });
        Self::counting(lit)
    }

    /// Of colours with these weights.
    fn counting(colours: impl Iterator<Item = (Vec3, f32)>) -> Self {
        let mut cells = vec![0.0; CELLS.pow(3)];
        let mut sum = 0.0;
        for (colour, weight) in colours {
            cells[cell(colour)] += f64::from(weight);
            sum += f64::from(weight);
        }
        let scale = CELLS.pow(3) as f64 / sum.max(f64::MIN_POSITIVE);
        let mut cells: Vec<f32> = cells.iter().map(|count| (count * scale) as f32).collect();
        for stride in [1, CELLS, CELLS * CELLS] {
            for _ in 0..SMOOTHED {
                cells = smoothed(&cells, stride);
            }
        }
        Self(cells)
    }

    fn at(&self, colour: Vec3) -> f32 {
        self.0[cell(colour)]
    }

    /// Middle of the densest cell; `None` where there are no colours.
    fn mode(&self) -> Option<Vec3> {
        let (k, most) = self.0.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
        let middle = |k: usize| ((k % CELLS) as f32 + 0.5) / CELLS as f32;
        (*most > 0.0).then(|| Vec3::new(middle(k), middle(k / CELLS), middle(k / (CELLS * CELLS))))
    }
}

fn cell(colour: Vec3) -> usize {
    let [r, g, b] = colour.to_array().map(|v| ((v * CELLS as f32) as usize).min(CELLS - 1));
    r + CELLS * (g + CELLS * b)
}

/// Averaged with both neighbours at this stride, the border repeated.
fn smoothed(cells: &[f32], stride: usize) -> Vec<f32> {
    let of = |(k, cell): (usize, &f32)| {
        let at = k / stride % CELLS;
        let before = if at > 0 { cells[k - stride] } else { *cell };
        let after = if at + 1 < CELLS { cells[k + stride] } else { *cell };
        0.25 * before + 0.5 * cell + 0.25 * after
    };
    cells.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::super::SpacetimeSettings;
    use super::super::parts::Search;
    use super::*;
    use crate::motion::observed::occlusion::turned;
    use crate::session::Session;
    use crate::synth::{Mover, Settings, make};
    use glam::DVec2;
    use tessuto_core::math::median::median;
    use tessuto_core::scene::Scene;
    use tessuto_render::raster::{Rendering, Texture};
    use tessuto_sim::Cloth;

    /// Of the back.
    const COLOUR: [f32; 3] = [0.1, 0.55, 0.25];

    /// A sheet of which a side is laid over the rest, with a back of this colour.
    fn folded(back: Option<[f32; 3]>) -> Scene {
        let settings = Settings::default().with(|s| {
            s.size = 128;
            s.grid = [9, 9];
            s.frames = 16;
            s.seed = 4;
            s.back = back;
        });
        make(&settings.with(|s| {
            s.mover = Mover::Table;
            s.fold = true;
            s.fps = 8.0;
        }))
        .unwrap()
    }

    fn quick() -> SpacetimeSettings {
        SpacetimeSettings { resolution: 60.0, levels: 1, track_levels: 2, ..SpacetimeSettings::default() }
    }

    /// What the search through `scene` knows of the back where scene.json says this of it.
    fn known(scene: &Scene, back: Option<Back>) -> Back {
        let mut scene = scene.clone();
        scene.known.back = back;
        let cloth = Cloth::new(&scene.template);
        Problem::new(&scene, &cloth, quick()).unwrap().back
    }

    #[test]
    fn a_colour_that_the_first_frame_lacks_is_the_backs() {
        let (two, one) = (folded(Some(COLOUR)), folded(None));
        for asked in [None, Some(Back::Plain(None))] {
            let Back::Plain(Some(found)) = known(&two, asked) else { panic!("it is not seen") };
            let off = Vec3::from_array(found).distance(Vec3::from_array(COLOUR));
            println!("{found:?}, {off} off");
            // It is darker where it turns away from the light.
            assert!(off < RADIUS, "{found:?}");
        }
        assert_eq!(known(&one, None), Back::Same);
        let told = Back::Plain(Some([0.2; 3]));
        assert_eq!(
            [Back::Same, Back::Other, told].map(|back| known(&two, Some(back))),
            [Back::Same, Back::Other, told]
        );
    }

    #[test]
    fn what_has_turned_over_shows_the_back_within_its_line() {
        let scene = folded(Some(COLOUR));
        let cloth = Cloth::new(&scene.template);
        let problem = Problem::new(&scene, &cloth, quick()).unwrap();
        let (truth, last) = (scene.truth.vertices.as_ref().unwrap(), scene.frames.len() - 1);
        let mut search = problem.at_level(0);
        let x = truth[last].clone();
        search.update_gain(last, &x);
        let (look, eye) = (&search.looks[0], &problem.eyes[0]);
        let view = &eye.observed.views[last];
        let is_turned = turned(problem.front, &look.samples.triangles, view, &x);
        let seam = eye.seams[last].as_ref().expect("both sides are seen");
        for (k, point) in look.samples.points.iter().enumerate() {
            let is_back = is_turned[point.triangle as usize];
            assert_eq!(
                look.expected(last)[k],
                if is_back { problem.back_colour() } else { look.reference[k] }
            );
        }
        let mut rendering = Rendering::new();
        let black = Texture::uniform(1, 1, [0.0; 3]);
        problem.rasterizer.render(view, &x, &black, &mut rendering);
        let (mut sides, mut right, mut backs) = (0, 0, 0);
        for (k, t) in rendering.triangle.iter().enumerate().filter(|(_, t)| **t != Rendering::NO_TRIANGLE) {
            let at = DVec2::new((k % rendering.width) as f64, (k / rendering.width) as f64);
            if let Some((distance, _)) = seam.sample(at).filter(|(d, _)| d.abs() > 1.5) {
                sides += 1;
                backs += usize::from(is_turned[*t as usize]);
                right += usize::from((distance > 0.0) == is_turned[*t as usize]);
            }
        }
        println!("{right} of {sides} pixels are on their side of the line, {backs} are of the back");
        assert!(backs * 10 > sides && (sides - right) * 50 < sides);
        // Border that lies over the other side is at the line, but where a sliver of this is all there is.
        let laid = eye.boundary.iter().zip(&look.occlusions[last].laid).filter(|(_, laid)| **laid);
        let distances: Vec<f64> = laid
            .filter_map(|(point, _)| seam.sample(view.project(point.position(&x))))
            .map(|(distance, _)| distance.abs())
            .collect();
        let count = distances.len();
        let half = median(distances).unwrap();
        println!("half of {count} points of the border over the other side are within {half} px of the line");
        assert!(count > 10 && half < 1.5);
    }

    #[test]
    fn a_part_that_turns_over_is_found_by_its_back() {
        let scene = folded(Some(COLOUR));
        let truth = scene.truth.vertices.as_ref().unwrap();
        let off = |back: Option<Back>| {
            let mut scene = scene.clone();
            scene.known.back = back;
            let (cloth, settings) = (Cloth::new(&scene.template), quick());
            let mut search = Search::new(&scene, &cloth, &settings);
            let found = search.find(0, &mut Session::silent()).unwrap().frames;
            let apart: Vec<f64> =
                found.iter().flatten().zip(truth.iter().flatten()).map(|(a, b)| a.distance(*b)).collect();
            (apart.iter().sum::<f64>() / apart.len() as f64, search.back())
        };
        let ((found, back), (same, _)) = (off(None), off(Some(Back::Same)));
        println!("{found} m off with its back, {same} m without");
        assert!(matches!(back, Back::Plain(Some(_))) && found < 0.75 * same);
    }
}
