//! Several cameras: every image counts by itself, in one world.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::proof::{disturbed, gradient_error, of_images, scene, system_of};
use super::{LevelSearch, Positions, Problem, SpacetimeSettings};
use crate::motion::terms::{FrameTerms, Term};
use tessuto_core::camera::Pose;
use tessuto_core::scene::{Scene, View};
use tessuto_sim::Cloth;

/// The clip as another camera sees it too, that stands where `pose` says.
fn with_another(pose: Pose) -> Scene {
    let alone = scene();
    let view = View {
        name: "other".into(),
        camera: alone.camera,
        poses: vec![pose; alone.frames.len()],
        crop: alone.crop,
        full_size: alone.full_size,
        frames: alone.frames.clone(),
        depths: alone.depths.as_ref().map(Arc::clone),
        late: 0.0,
    };
    Scene { more: vec![view], ..alone }
}

/// Calls `test` with a search of the clip that every camera of `scene` sees, at disturbed positions.
fn with_search(scene: &Scene, test: impl FnOnce(&LevelSearch, &[Positions])) {
    let cloth = Cloth::new(&scene.template);
    let settings = SpacetimeSettings { resolution: 1e5, levels: 1, ..SpacetimeSettings::default() };
    let problem = Problem::new(scene, &cloth, settings).unwrap();
    let frames = disturbed(scene);
    let mut search = problem.at_level(0);
    search.update_references(&frames);
    test(&search, &frames);
}

/// Value, and size of the slope, of every term of images but that of shading, whose light all cameras have in common.
fn of_pictures(terms: &FrameTerms, search: &LevelSearch, x: &Positions) -> [(f64, f64); 3] {
    let pictures: [&dyn Term; 3] = [&terms.colour, &terms.outline, &terms.depth];
    pictures.map(|term| {
        let (value, system) = system_of(term, search.problem.cloth, x);
        (value, system.gradient.iter().map(|g| g.length_squared()).sum::<f64>().sqrt())
    })
}

#[test]
fn two_equal_views_weigh_as_one_with_twice_the_pixels() {
    let mut single = Vec::new();
    with_search(&scene(), |search, frames| {
        single = of_pictures(&search.terms(2), search, &frames[2]).to_vec();
    });
    with_search(&with_another(Pose::IDENTITY), |search, frames| {
        let twice = of_pictures(&search.terms(2), search, &frames[2]);
        println!("{single:?} {twice:?}");
        for ((value, slope), (value_of_two, slope_of_two)) in single.iter().zip(twice) {
            assert!(*value > 0.0 && (value_of_two / value - 2.0).abs() < 1e-9);
            assert!((slope_of_two / slope - 2.0).abs() < 1e-9);
        }
    });
}

#[test]
fn every_term_agrees_with_central_differences_from_two_sides() {
    // About the sheet, which is a metre away.
    let turn = DMat3::from_rotation_y(0.25) * DMat3::from_rotation_x(-0.1);
    let pose = Pose { rotation: turn, translation: DVec3::Z - turn * DVec3::Z };
    let mut scene = with_another(pose);
    // A third of a frame.
    scene.more[0].late = 0.33 / scene.fps;
    with_search(&scene, |search, frames| {
        let terms = search.terms(2);
        let colours = &terms.colour.of;
        let [a, b] = [0, 1].map(|v| colours[v].value(&frames[2]));
        assert!(a > 0.0 && b > 0.0 && a != b, "{a} {b}");
        let (later, on_its_way) = terms.colour.at(&frames[2]).nth(1).unwrap();
        assert!(later.value(&on_its_way) != b, "the sheet goes on");
        for term in terms.list().into_iter().filter(|term| term.value(&frames[2]) > 0.0) {
            let worst = gradient_error(term, search.problem.cloth, &frames[2]);
            println!("{:<12} {worst:?}", term.name());
            let bound = if of_images(term) { 1e-3 } else { 1e-6 };
            assert!(worst.relative_error <= bound, "{}: {worst:?}", term.name());
        }
    });
}
