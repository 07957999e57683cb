//! Every term of the objective against finite differences, and the joint system against its parts.

use std::sync::Arc;

use glam::DVec3;

use super::joint::JointSystem;
use super::look::Look;
use super::{LevelSearch, Problem, SpacetimeSettings, acceleration};
use crate::motion::observed::occlusion::Occlusion;
use crate::motion::observed::outline_distance::OutlineDistance;
use crate::motion::observed::samples::EdgePoint;
use crate::motion::observed::silhouette::{FoldPoint, InnerEdge};
use crate::motion::terms::outline::Outline;
use crate::motion::terms::{FrameSystem, FrameTerms, Function, Term};
use tessuto_core::camera::{Camera, Rect};
use tessuto_core::image::Image;
use tessuto_core::math::gradient_check::{Worst, check, check_coarse};
use tessuto_core::math::rng::Rng;
use tessuto_core::math::{dot, flat, vectors};
use tessuto_core::mesh::{Mesh, Positions, grid};
use tessuto_core::scene::{Depths, Known, Plane, Scene, Truth};
use tessuto_core::video::{Frame, Video};
use tessuto_sim::Cloth;

const SIZE: usize = 96;
const FRAMES: usize = 4;

/// Smooth colours that differ a little from frame to frame, in a round mask that is a few pixels larger than the cloth:
/// the objective has no jumps where a point comes into view.
fn frame(n: usize) -> Frame {
    let (mut rgb, mut mask) = (Image::new(SIZE, SIZE, 3), Image::new(SIZE, SIZE, 1));
    for y in 0..SIZE {
        for x in 0..SIZE {
            let (u, v) = (x as f32 + 0.6 * n as f32, y as f32 - 0.4 * n as f32);
            for c in 0..3 {
                let k = c as f32 + 1.0;
                let wave = (0.05 * k * u).sin() * (0.06 * v + k).cos() + 0.5 * (0.03 * (u + k * v)).sin();
                rgb.data[3 * (y * SIZE + x) + c] = 0.5 + 0.25 * wave;
            }
            let r = (x as f32 - 47.5).hypot(y as f32 - 47.5);
            mask.data[y * SIZE + x] = f32::from(r < 44.0);
        }
    }
    Frame { rgb, mask }
}

pub(super) fn scene() -> Scene {
    let camera = Camera { fx: 300.0, fy: 290.0, cx: 47.5, cy: 47.5, width: SIZE, height: SIZE };
    let flat = grid(7, 6, glam::DVec2::new(0.18, 0.15), 1.0);
    let positions = flat.positions.iter().map(|p| *p + DVec3::Z * (1.5 * p.x * p.x + 0.3 * p.y)).collect();
    // Off by up to 2 % of a sheet like the template.
    let depth_camera = Camera { fx: 75.0, fy: 72.5, cx: 11.5, cy: 11.5, width: SIZE / 4, height: SIZE / 4 };
    let measured = |n: usize, k: usize| {
        let (u, v) = ((k % (SIZE / 4)) as f64, (k / (SIZE / 4)) as f64);
        let ray = depth_camera.ray(glam::DVec2::new(u, v));
        let bent = 1.0 + 0.3 * ray.y + 1.5 * ray.x * ray.x;
        (bent * (1.0 + 0.02 * (0.9 * u + 0.7 * v * (n + 1) as f64).sin())) as f32
    };
    let maps = (0..FRAMES).map(|n| (0..SIZE * SIZE / 16).map(|k| measured(n, k)).collect()).collect();
    Scene {
        name: "proof".into(),
        folder: "proof".into(),
        fps: 50.0,
        camera,
        crop: Rect { x0: 0, y0: 0, x1: SIZE, y1: SIZE },
        poses: None,
        pose_unit: Default::default(),
        depths: Some(Arc::new(Depths { camera: depth_camera, maps, noise: 0.01, alike: 2.0 })),
        more: Vec::new(),
        full_size: [SIZE, SIZE],
        first_frame: 0,
        template: Mesh { positions, ..flat },
        frames: Video::from((0..FRAMES).map(frame).collect::<Vec<_>>()),
        known: Known::default(),
        truth: Truth::default(),
    }
}

/// The same over a plane that goes through it.
pub(super) fn lying() -> Scene {
    let planes = vec![Plane { normal: DVec3::new(0.0, 0.6, -0.8), height: -0.8 }];
    Scene { known: Known { planes, ..Known::default() }, ..scene() }
}

/// Positions of every frame, off by about a millimetre, so that every residual is there.
pub(super) fn disturbed(scene: &Scene) -> Vec<Positions> {
    let mut rng = Rng::new(4, 0);
    let mut near = |x: &Positions| x.iter().map(|p| *p + rng.vector() * 1.5e-3).collect();
    let mut frames = vec![scene.template.positions.clone()];
    (1..FRAMES).for_each(|_| frames.push(near(&scene.template.positions)));
    frames
}

/// Calls `test` with a search whose gains and adjacent frames are known.
fn with_search(test: impl FnOnce(&LevelSearch, &[Positions])) {
    let scene = lying();
    let cloth = Cloth::new(&scene.template);
    // Many points: what 32 bits leave over evens out.
    let settings = SpacetimeSettings { resolution: 1e5, levels: 1, ..SpacetimeSettings::default() };
    let mut problem = Problem::new(&scene, &cloth, settings).unwrap();
    // And as if the left half of the image showed the back.
    let Camera { width, height, .. } = problem.eyes[0].observed.views[0].camera;
    let back: Vec<bool> = (0..width * height).map(|i| 2 * (i % width) < width).collect();
    problem.eyes[0].seams = vec![Some(OutlineDistance::of(&back, [width, height], 1)); FRAMES];
    let frames = disturbed(&scene);
    let mut search = problem.at_level(0);
    search.update_references(&frames);
    let mut rng = Rng::new(8, 0);
    let gains = search.looks[0].gains.iter_mut().flatten().flatten();
    gains.for_each(|g| *g *= 1.0 + 0.1 * rng.signed() as f32);
    search.still = vec![0, 3, 4];
    // And as if a motion were expected.
    let swing = |n: usize| {
        let way = DVec3::new(1e-3, -2e-3, 3e-3) * (n * n) as f64;
        scene.template.positions.iter().map(|x| *x + way * (1.0 + 5.0 * x.x)).collect()
    };
    search.expect(&frames, &(0..FRAMES).map(swing).collect::<Vec<_>>());
    // As if the sheet were in front of itself here and there.
    let every = |k: usize, count: usize| (0..count).map(|i| i % k == 0).collect();
    let fold = |edge: &InnerEdge| FoldPoint {
        point: EdgePoint {
            vertices: edge.vertices,
            opposite: edge.opposite[0],
            weights: [0.3, 0.7],
            length: 2.0,
        },
        pair: edge.pair,
    };
    let occlusion = Occlusion {
        hidden: every(7, search.looks[0].samples.points.len()),
        inner: every(5, problem.eyes[0].boundary.len()),
        folds: problem.inner_edges.iter().step_by(9).map(fold).collect(),
        shares: (0..search.looks[0].samples.triangles.len()).map(|t| 1.0 - 0.1 * (t % 5) as f64).collect(),
        uncovered: 0.0,
        turned: Vec::new(),
        laid: every(3, problem.eyes[0].boundary.len()),
    };
    search.looks[0].occlusions.fill(occlusion);
    test(&search, &frames);
}

pub(super) fn system_of(term: &dyn Term, cloth: &Cloth, x: &[DVec3]) -> (f64, FrameSystem) {
    let mut system = FrameSystem::zeros(cloth);
    (term.add_system(x, &mut system), system)
}

/// The function that a term's gradient at `x` belongs to.
fn differentiated<'t>(term: &'t dyn Term, x: &[DVec3]) -> Function<'t> {
    term.held(x).unwrap_or_else(|| Box::new(move |x| term.value(x)))
}

/// Terms of images are sums of numbers of 32 bits, sampled bilinearly.
pub(super) fn of_images(term: &dyn Term) -> bool {
    ["colour", "outline"].contains(&term.name())
}

pub(super) fn gradient_error(term: &dyn Term, cloth: &Cloth, x: &[DVec3]) -> Worst {
    let function = differentiated(term, x);
    let gradient = system_of(term, cloth, x).1.gradient;
    let function = |x: &[f64]| function(&vectors(x));
    match of_images(term) {
        true => check_coarse(flat(x), flat(&gradient), 1e-4, 20, 1, function),
        false => check(flat(x), flat(&gradient), 1e-7, 20, 1, function),
    }
}

#[test]
fn magnifying_adds_no_weight() {
    let scene = scene();
    let cloth = Cloth::new(&scene.template);
    // The sheet measures about 50 px.
    let at = |resolution: f64| {
        let settings = SpacetimeSettings { resolution, ..SpacetimeSettings::default() };
        let problem = Problem::new(&scene, &cloth, settings).unwrap();
        let still = scene.camera.project(scene.template.positions[0])
            - scene.camera.project(scene.template.positions[1]);
        let [a, b] = [0, 1].map(|v| problem.eyes[0].observed.views[0].project(scene.template.positions[v]));
        let search = problem.at_level(0);
        let (look, terms) = (&search.looks[0], search.terms(1));
        let area: f64 = look.samples.points.iter().map(|point| point.area).sum();
        let length: f64 = problem.eyes[0].boundary.iter().map(|point| point.length).sum();
        let magnification = problem.eyes[0].observed.magnification as f64;
        let totals = [
            // The print itself is seen a little better.
            area * terms.colour.of[0].weight / look.eye.print[look.level],
            area * look.pixel_area(),
            length * terms.outline.of[0].weight,
            terms.outline.of[0].noise.sigma / magnification,
            (a - b).length() / look.eye.pixel() / still.length(),
        ];
        (magnification, totals)
    };
    let (video, large) = (at(30.0), at(1e5));
    println!("{video:?} {large:?}");
    assert_eq!([video.0, large.0], [1.0, 4.0]);
    for (a, b) in video.1.iter().zip(large.1) {
        assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
    }
}

/// Of a sheet twice as large pixels count twice as much, not four times, and outlines the same.
#[test]
fn pixels_of_larger_sheets_count_less() {
    let scene = scene();
    let cloth = Cloth::new(&scene.template);
    // The sheet measures about 50 px of the video.
    let [small, large] = [20.0, 40.0].map(|resolution| {
        let settings = SpacetimeSettings { resolution, ..SpacetimeSettings::default() };
        let problem = Problem::new(&scene, &cloth, settings).unwrap();
        let search = problem.at_level(0);
        let (look, terms) = (&search.looks[0], search.terms(1));
        let area: f64 = look.samples.points.iter().map(|point| point.area).sum();
        let length: f64 = problem.eyes[0].boundary.iter().map(|point| point.length).sum();
        [area * terms.colour.of[0].weight / look.eye.print[look.level], length * terms.outline.of[0].weight]
    });
    println!("{small:?} {large:?}");
    for ((small, large), times) in small.into_iter().zip(large).zip([2.0, 1.0]) {
        assert!((large / small / times - 1.0).abs() < 1e-9, "{small} {large}");
    }
}

#[test]
fn a_pixel_that_is_off_by_one_spread_costs_a_half() {
    let scene = scene();
    let cloth = Cloth::new(&scene.template);
    let problem = Problem::new(&scene, &cloth, SpacetimeSettings::default()).unwrap();
    let mut search = problem.at_level(0);
    let x = &scene.template.positions;
    let of_channel = (problem.settings.colour / 3f64.sqrt()) as f32;
    let off = |shown: Option<[f32; 3]>| shown.map(|colour| colour.map(|c| c + of_channel));
    search.looks[0].reference = search.looks[0].observe(1, x, false).into_iter().map(off).collect();
    let colour = search.looks[0].colour(1, &search.asked);
    let Look { eye, level, .. } = search.looks[0];
    let pixels = eye.independent * eye.print[level] * colour.area(x) * search.looks[0].pixel_area();
    let cost = colour.value(x) / pixels;
    let expected = 0.5 / (1.0 + problem.settings.colour_tail.powi(-2));
    println!("{cost} of {pixels:.0} pixels each, {expected} by the kernel");
    assert!(pixels > 500.0 && (cost / expected - 1.0).abs() < 1e-3);
}

#[test]
fn without_a_tail_shading_is_left_out() {
    let scene = scene();
    let cloth = Cloth::new(&scene.template);
    let shading = |settings: SpacetimeSettings| {
        let problem = Problem::new(&scene, &cloth, settings).unwrap();
        let terms = problem.objective(&disturbed(&scene));
        terms.into_iter().find(|(name, _)| *name == "shading").unwrap().1
    };
    let default = SpacetimeSettings::default();
    assert!(shading(default.clone()) > 0.0);
    assert_eq!(shading(SpacetimeSettings { shading_tail: 0.0, ..default }), 0.0);
}

#[test]
fn a_border_over_the_other_side_is_compared_with_the_line_between_both() {
    with_search(|search, frames| {
        let terms: FrameTerms = search.terms(2);
        let outline = &terms.outline.of[0];
        let [with, without] = [outline.seam, None].map(|seam| Outline { seam, ..*outline }.value(&frames[2]));
        println!("outline {with}, {without} without the line");
        assert!(with > without);
    });
}

#[test]
fn every_term_agrees_with_central_differences() {
    with_search(|search, frames| {
        let terms: FrameTerms = search.terms(2);
        for term in terms.list() {
            let worst = gradient_error(term, search.problem.cloth, &frames[2]);
            println!("{:<12} {worst:?}", term.name());
            let bound = if of_images(term) { 1e-3 } else { 1e-6 };
            assert!(worst.relative_error <= bound, "{}: {worst:?}", term.name());
        }
    });
}

#[test]
fn every_term_has_one_value_and_a_system_without_negative_curvature() {
    with_search(|search, frames| {
        let cloth = search.problem.cloth;
        let mut rng = Rng::new(12, 0);
        for term in search.terms(1).list() {
            let x = &frames[1];
            let (value, system) = system_of(term, cloth, x);
            assert!(value > 0.0 && (value / term.value(x) - 1.0).abs() < 1e-12, "{}", term.name());
            assert!((differentiated(term, x)(x) / value - 1.0).abs() < 1e-12, "{}", term.name());
            for _ in 0..50 {
                let d: Positions = x.iter().map(|_| rng.vector()).collect();
                let curvature = dot(&d, &system.multiply(cloth, &d));
                assert!(curvature > 0.0, "{}: {curvature}", term.name());
            }
        }
    });
}

#[test]
fn vertices_bear_all_that_pictures_cost() {
    with_search(|search, frames| {
        let (terms, x) = (search.terms(1), &frames[1]);
        let shares = terms.shares_of_pictures(x);
        let (sum, value) = (shares.iter().sum::<f64>(), terms.of_pictures(x));
        println!("{sum} of {value}");
        assert!(value > 0.0 && (sum / value - 1.0).abs() < 1e-12 && shares.iter().all(|share| *share >= 0.0));
    });
}

#[test]
fn the_joint_system_is_the_sum_of_its_parts() {
    with_search(|search, frames| {
        let (cloth, kappa, lambda) = (search.problem.cloth, search.acceleration_weight, 0.3);
        let systems: Vec<FrameSystem> =
            (1..FRAMES).map(|n| search.terms(n).linearise(cloth, &frames[n]).1).collect();
        let joint = JointSystem { cloth, systems: &systems, kappa, lambda };
        // Its gradient is that of all frames' terms and of the acceleration, each term with what it holds fixed.
        let terms: Vec<FrameTerms> = (1..FRAMES).map(|n| search.terms(n)).collect();
        let functions: Vec<Vec<_>> = terms
            .iter()
            .zip(&frames[1..])
            .map(|(terms, x)| terms.list().map(|term| differentiated(term, x)).into_iter().collect())
            .collect();
        let objective = |numbers: &[f64]| -> f64 {
            let mut moved = vec![frames[0].clone()];
            moved.extend(numbers.chunks_exact(3 * frames[0].len()).map(vectors));
            let of_frames: f64 =
                functions.iter().zip(&moved[1..]).map(|(f, x)| f.iter().map(|f| f(x)).sum::<f64>()).sum();
            of_frames + acceleration::value(&search.departure(&moved), kappa)
        };
        let numbers =
            |frames: &[Positions]| frames.iter().flat_map(|x| flat(x)).copied().collect::<Vec<f64>>();
        let gradient = joint.gradient(&search.departure(frames));
        let worst = check_coarse(&numbers(&frames[1..]), &numbers(&gradient), 1e-4, 10, 1, objective);
        println!("joint gradient {worst:?}");
        assert!(worst.relative_error < 1e-3, "{worst:?}");
        // Its product with a direction is that of H, DᵀD and the damping.
        let mut rng = Rng::new(9, 0);
        let mut random = || -> Vec<Positions> {
            gradient.iter().map(|g| g.iter().map(|_| rng.vector()).collect()).collect()
        };
        let (a, b) = (random(), random());
        let product = |a: &[Positions], b: &[Positions]| a.iter().zip(b).map(|(a, b)| dot(a, b)).sum::<f64>();
        let with_first = |a: &[Positions]| -> Vec<Positions> {
            std::iter::once(vec![DVec3::ZERO; a[0].len()]).chain(a.iter().cloned()).collect()
        };
        let [bent_a, bent_b] = [&a, &b].map(|v| acceleration::second_differences(&with_first(v)));
        let frames_own: f64 =
            (0..systems.len()).map(|n| dot(&a[n], &systems[n].multiply(cloth, &b[n]))).sum();
        let expected = frames_own + kappa * product(&bent_a, &bent_b) + kappa * lambda * product(&a, &b);
        let found = product(&a, &joint.multiply(&b));
        assert!((found / expected - 1.0).abs() < 1e-10, "{found} {expected}");
        // Its solution, more exact than steps need, leaves nothing over that a hundredth of the gradient could show.
        let solution = joint.solve_with(&joint.factors(), &gradient, 1e-4, 200);
        let left: Vec<Positions> = joint
            .multiply(&solution)
            .iter()
            .zip(&gradient)
            .map(|(a, g)| a.iter().zip(g).map(|(a, g)| *a - *g).collect())
            .collect();
        let ratio = (product(&left, &left) / product(&gradient, &gradient)).sqrt();
        assert!(ratio < 0.01, "{ratio}");
    });
}
