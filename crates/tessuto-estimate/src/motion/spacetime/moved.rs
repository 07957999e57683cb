//! A world that is moved and turned as a whole, with its camera, is searched in the same way.

use glam::DVec3;

use super::gain::Around;
use super::proof::{disturbed, gradient_error, lying, of_images, system_of};
use super::{LevelSearch, Positions, Problem, SpacetimeSettings};
use crate::motion::observed::Observed;
use crate::motion::terms::Term;
use crate::motion::terms::shading::HARMONICS;
use tessuto_core::camera::Pose;
use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::Mesh;
use tessuto_core::scene::{Known, Plane, Scene};
use tessuto_sim::Cloth;

/// Calls `test` with searches in a clip whose camera is at the origin and in the same one moved, which has that
/// pose, and with `frames` of both.
fn with_both(
    frames: impl FnOnce(&Scene) -> Vec<Positions>,
    test: impl FnOnce([(LevelSearch, Vec<Positions>); 2], Pose),
) {
    let scene = lying();
    let cloth = Cloth::new(&scene.template);
    let pose = Pose::random(&mut Rng::new(7, 0));
    let moved = |x: &Positions| -> Positions { x.iter().map(|p| pose.in_world(*p)).collect() };
    let template = Mesh { positions: moved(&scene.template.positions), ..scene.template.clone() };
    let turned = |plane: &Plane| {
        let normal = pose.rotation.transpose() * plane.normal;
        Plane { normal, height: normal.dot(pose.in_world(plane.normal * plane.height)) }
    };
    let planes = scene.known.planes.iter().map(turned).collect();
    let known = Known { planes, ..scene.known.clone() };
    let there = Scene { template, known, ..scene.clone() };
    let settings = SpacetimeSettings { resolution: 1e5, levels: 1, ..SpacetimeSettings::default() };
    let problem = Problem::new(&scene, &cloth, settings.clone()).unwrap();
    let mut posed = Problem::new(&scene, &cloth, settings).unwrap();
    posed.scene = &there;
    posed.start.known[0].clone_from(&there.template.positions);
    let Observed { views, levels, first, .. } = &mut posed.eyes[0].observed;
    let levels = levels.iter_mut().flatten().chain(first);
    let views = views.iter_mut().chain(levels.map(|level| &mut level.view));
    views.for_each(|view| view.camera_from_world = Some(pose));
    let frames = frames(&scene);
    let there = frames.iter().map(moved).collect();
    test([(problem.at_level(0), frames), (posed.at_level(0), there)], pose);
}

#[test]
fn every_term_has_the_same_value_and_the_same_slope_turned() {
    with_both(disturbed, |[(mut here, frames), (mut there, moved)], pose| {
        here.update_references(&frames);
        there.update_references(&moved);
        let cloth = here.problem.cloth;
        let (terms, terms_there) = (here.terms(2), there.terms(2));
        for (a, b) in terms.list().into_iter().zip(terms_there.list()) {
            let ((value, system), (value_there, system_there)) =
                (system_of(a, cloth, &frames[2]), system_of(b, cloth, &moved[2]));
            if value == 0.0 {
                continue;
            }
            let off = (value_there / value - 1.0).abs();
            let turned = system_there.gradient.iter().map(|g| pose.rotation * *g);
            let (mut error, mut size) = (0.0, 0.0);
            for (g, turned) in system.gradient.iter().zip(turned) {
                error += g.distance_squared(turned);
                size += g.length_squared();
            }
            let slopes = (error / size).sqrt();
            println!("{:<12} {value:.3e}, off by {off:.1e}; slopes by {slopes:.1e}", a.name());
            // Images are sampled with 32 bits.
            let bound = if of_images(a) { 1e-6 } else { 1e-9 };
            assert!(off < bound && slopes < 10.0 * bound, "{}: {off} {slopes}", a.name());
        }
    });
}

#[test]
fn every_term_agrees_with_central_differences_under_a_pose() {
    with_both(disturbed, |[_, (mut there, moved)], _| {
        there.update_references(&moved);
        let mut found = Vec::new();
        for term in there.terms(2).list().into_iter().filter(|term| term.value(&moved[2]) > 0.0) {
            let worst = gradient_error(term, there.problem.cloth, &moved[2]);
            println!("{:<12} {worst:?}", term.name());
            let bound = if of_images(term) { 1e-3 } else { 1e-6 };
            assert!(worst.relative_error <= bound, "{}: {worst:?}", term.name());
            found.push(term.name());
        }
        assert!(["colour", "outline", "shading"].iter().all(|name| found.contains(name)), "{found:?}");
    });
}

#[test]
fn light_falls_on_the_vertices_that_the_camera_sees() {
    // Turned so far that it is partly seen from its other side.
    let turned = |scene: &Scene| -> Vec<Positions> {
        let x = &scene.template.positions;
        let turn = glam::DQuat::from_rotation_y(1.5);
        let far = x.iter().map(|p| turn * (*p - DVec3::Z) + DVec3::new(0.05, 0.0, 1.0)).collect();
        vec![x.clone(), far]
    };
    with_both(turned, |[(mut here, frames), (mut there, moved)], pose| {
        let light = DVec3::new(0.4, -0.7, -0.5);
        let only = |l: DVec3| -> [f64; HARMONICS] { [l.x, l.y, l.z, 0.0, 0.0, 0.0, 0.0, 0.0] };
        (here.light, there.light) = (only(light), only(pose.rotation.transpose() * light));
        let mut rng = Rng::new(5, 0);
        let around: Vec<Around> = (0..frames[1].len())
            .map(|_| Around { products: [[(0.1 * rng.signed()).exp(), 1.0]; 3], area: 1e3 })
            .collect();
        here.update_brightness(0, (1, &frames[1]), &around);
        there.update_brightness(0, (1, &moved[1]), &around);
        let pairs = || here.looks[0].brightness[1].iter().zip(&there.looks[0].brightness[1]);
        assert!(pairs().all(|(a, b)| a.is_some() == b.is_some()));
        let seen = pairs().filter(|(a, _)| a.is_some()).count();
        let [value, value_there] =
            [(&here, &frames), (&there, &moved)].map(|(search, x)| search.terms(1).shading.value(&x[1]));
        println!("{seen} of {} vertices seen; {value} and {value_there}", frames[1].len());
        assert!(seen > 3 && seen < frames[1].len() - 3);
        assert!(value > 0.0 && (value_there / value - 1.0).abs() < 1e-9);
    });
}
