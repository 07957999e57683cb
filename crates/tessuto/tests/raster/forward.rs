//! The image: coverage, agreement with the plain twin, antialiasing, determinism.

use crate::support::raster_scenes::{CAMERA, Scene, noise, plain};
use glam::{DMat3, DQuat, DVec2, DVec3, EulerRot};
use tessuto::math::rng::Rng;
use tessuto::mesh::{Side, grid};
use tessuto::raster::{Gradients, Rasterizer, Rendering, Texture, reference};
use tessuto::{Camera, Pose, Viewpoint};

fn render(scene: &Scene, camera: &Camera) -> Rendering {
    let mut out = Rendering::new();
    scene.rasterizer.render(camera, &scene.positions, &scene.texture, &mut out);
    out
}

/// A camera turned and moved, the point of the world at `p` in its frame, and that gradient in its frame.
fn moved() -> (Viewpoint, impl Fn(DVec3) -> DVec3, impl Fn(DVec3) -> DVec3) {
    let rotation = DMat3::from_quat(DQuat::from_euler(EulerRot::XYZ, 0.4, -1.1, 2.0));
    let pose = Pose { rotation, translation: DVec3::new(0.3, -0.2, 0.5) };
    let view = Viewpoint { camera: CAMERA, camera_from_world: Some(pose) };
    (view, move |p| rotation.transpose() * (p - pose.translation), move |g| rotation * g)
}

#[test]
fn a_moved_camera_draws_what_one_at_the_origin_draws_of_moved_points() {
    let (view, there, turned) = moved();
    let scene = Scene::cloth(3, 0.02, noise(3));
    let positions: Vec<DVec3> = scene.positions.iter().map(|p| there(*p)).collect();
    let r = &scene.rasterizer;
    let (here, mut out) = (render(&scene, &CAMERA), Rendering::new());
    r.render(view, &positions, &scene.texture, &mut out);
    assert_eq!(here.triangle, out.triangle);
    let off = here.rgba.iter().flatten().zip(out.rgba.iter().flatten()).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f32::max) < 1e-4);
    let twin = reference::render(r, view, &positions, &plain(&scene.texture));
    let drawn = out.triangle.iter().map(|t| (*t != Rendering::NO_TRIANGLE).then_some(*t as usize));
    assert!(drawn.eq(twin.triangle));
    // The adjoint adds to what is there.
    let mut rng = Rng::new(6, 0);
    let grad: Vec<[f32; 4]> = here.rgba.iter().map(|_| [0; 4].map(|_| rng.signed() as f32)).collect();
    let mut grads = [Gradients::new(r), Gradients::new(r)];
    grads[1].positions.fill(DVec3::X);
    r.render_vjp(CAMERA, &scene.positions, &scene.texture, &here, &grad, None, &mut grads[0]);
    r.render_vjp(view, &positions, &scene.texture, &out, &grad, None, &mut grads[1]);
    let (mut error, mut size) = (0.0, 0.0);
    for (a, b) in grads[0].positions.iter().zip(&grads[1].positions) {
        error += a.distance_squared(turned(*b - DVec3::X));
        size += a.length_squared();
    }
    println!("gradients differ by {:.1e}", (error / size).sqrt());
    assert!(size > 1.0 && (error / size).sqrt() < 1e-4);
}

#[test]
fn fast_path_is_the_plain_twin() {
    let (mut worst_color, mut worst_depth, mut blends) = (0.0f64, 0.0f64, 0);
    for seed in 0..12 {
        let crumple = [0.004, 0.02, 0.08, 0.2][seed as usize % 4];
        let mut scene = Scene::cloth(seed, crumple, noise(seed));
        scene.rasterizer = scene.rasterizer.one_sided(seed % 3 == 2);
        if seed % 2 == 1 {
            scene = scene.two_sided([0.9, 0.1, 0.3]);
        }
        let fast = render(&scene, &CAMERA);
        let twin = reference::render(&scene.rasterizer, CAMERA, &scene.positions, &plain(&scene.texture));
        blends += fast.blend_count();
        for pixel in 0..fast.rgba.len() {
            let triangle = twin.triangle[pixel].map_or(Rendering::NO_TRIANGLE, |t| t as u32);
            assert_eq!(fast.triangle[pixel], triangle, "seed {seed}, pixel {pixel}");
            let depth = fast.depth(pixel % CAMERA.width, pixel / CAMERA.width).unwrap_or(0.0);
            worst_depth = worst_depth.max((depth - twin.depth[pixel]).abs());
            for c in 0..4 {
                worst_color = worst_color.max((f64::from(fast.rgba[pixel][c]) - twin.rgba[pixel][c]).abs());
            }
        }
    }
    println!("worst colour {worst_color:.1e}, worst depth {worst_depth:.1e} m, {blends} blends");
    assert!(
        blends > 1000 && worst_color < 1e-5 && worst_depth < 1e-12,
        "{blends} {worst_color} {worst_depth}"
    );
}

#[test]
fn flat_tessellation_covers_every_pixel_of_its_outline_once() {
    let camera = Camera { cx: 48.2, ..CAMERA };
    for seed in 0..10 {
        let mut rng = Rng::new(seed, 0);
        let mut mesh = grid(12, 11, DVec2::new(0.5, 0.5), 1.0);
        for p in &mut mesh.positions {
            let inner = p.x.abs() < 0.24 && p.y.abs() < 0.24;
            if inner {
                *p += rng.vector().with_z(0.0) * 0.01;
            }
            // Slant the plane, so that it is not parallel to the image.
            p.z += 0.2 * p.x;
        }
        let outline = [0, 11, 131, 120].map(|v: usize| camera.project(mesh.positions[v]));
        let inside =
            |p: DVec2| (0..4).all(|k| (outline[(k + 1) % 4] - outline[k]).perp_dot(p - outline[k]) > 0.0);
        let rasterizer = Rasterizer::new(&mesh);
        let texture = Texture::uniform(1, 1, [1.0; 3]);
        let twin = reference::render(&rasterizer, camera, &mesh.positions, &plain(&texture));
        for (pixel, &hits) in twin.hits.iter().enumerate() {
            let p = DVec2::new((pixel % camera.width) as f64, (pixel / camera.width) as f64);
            assert_eq!(hits, usize::from(inside(p)), "seed {seed}, pixel {p}");
        }
        assert!(twin.hits.iter().sum::<usize>() > 3000);
    }
}

#[test]
fn edges_and_vertices_on_pixel_centres_belong_to_one_triangle() {
    // Powers of two make every position and plane exact: rows, columns and diagonals of the 5×5 quads
    // pass through pixel centres.
    let camera = Camera { fx: 64.0, fy: 64.0, cx: 32.0, cy: 32.0, width: 64, height: 64 };
    let mut mesh = grid(6, 6, DVec2::ONE, 1.0);
    for (v, p) in mesh.positions.iter_mut().enumerate() {
        *p = DVec3::new((8 * (v % 6)) as f64 - 20.0, (8 * (v / 6)) as f64 - 20.0, 64.0) / 64.0;
    }
    let rasterizer = Rasterizer::new(&mesh);
    let texture = Texture::uniform(1, 1, [1.0; 3]);
    let twin = reference::render(&rasterizer, camera, &mesh.positions, &plain(&texture));
    assert_eq!(twin.hits.iter().sum::<usize>(), 40 * 40);
    assert!(twin.hits.iter().all(|&hits| hits <= 1));
    let scene = Scene { rasterizer, positions: mesh.positions, texture };
    let fast = render(&scene, &camera);
    assert_eq!(fast.triangle.iter().filter(|&&t| t != Rendering::NO_TRIANGLE).count(), 40 * 40);
}

#[test]
fn both_sides_are_seen() {
    let mut scene = Scene::cloth(3, 0.0, noise(3));
    let front = render(&scene, &CAMERA).triangle.iter().filter(|&&t| t != Rendering::NO_TRIANGLE).count();
    for p in &mut scene.positions {
        p.x = -p.x;
    }
    let back = render(&scene, &CAMERA).triangle.iter().filter(|&&t| t != Rendering::NO_TRIANGLE).count();
    assert!(front > 1000 && back > 1000, "{front} {back}");
}

#[test]
fn the_other_side_is_plain() {
    let colour = [0.9, 0.1, 0.3];
    for (seed, crumple) in [(3, 0.0), (4, 0.08)] {
        let scene = Scene::cloth(seed, crumple, noise(seed));
        let printed = render(&scene, &CAMERA);
        let scene = scene.two_sided(colour);
        let front = Side::front(&grid(9, 8, DVec2::new(0.45, 0.35), 1.0), &CAMERA.into());
        let turned = |out: &Rendering, positions: &[DVec3], pixel: usize| {
            let corners = scene.rasterizer.triangles()[out.triangle[pixel] as usize];
            front.turned(&CAMERA.into(), corners.map(|v| positions[v as usize]))
        };
        let out = render(&scene, &CAMERA);
        assert!(out.triangle == printed.triangle && out.inverse_depth == printed.inverse_depth);
        let (mut plain, mut same) = (0, 0);
        // Where no neighbour shows another side, or none, nothing is blended in.
        for y in 1..CAMERA.height - 1 {
            for x in 1..CAMERA.width - 1 {
                let pixel = y * CAMERA.width + x;
                let around = [pixel, pixel - 1, pixel + 1, pixel - CAMERA.width, pixel + CAMERA.width];
                if around.iter().any(|p| out.triangle[*p] == Rendering::NO_TRIANGLE) {
                    continue;
                }
                let sides = around.map(|p| turned(&out, &scene.positions, p));
                if sides == [true; 5] {
                    plain += usize::from(out.rgba[pixel][..3] == colour);
                } else if sides == [false; 5] {
                    assert_eq!(out.rgba[pixel], printed.rgba[pixel]);
                    same += 1;
                }
            }
        }
        println!("{plain} pixels are plain, {same} as before");
        assert!(same > 1000 && (plain > 30) == (crumple > 0.0));
        // Turned over as a whole, nothing is left of the print.
        let mirrored: Vec<DVec3> = scene.positions.iter().map(|p| p.with_x(-p.x)).collect();
        let mut back = Rendering::new();
        scene.rasterizer.render(CAMERA, &mirrored, &scene.texture, &mut back);
        let seen = |p: &usize| back.triangle[*p] != Rendering::NO_TRIANGLE;
        let fronts = (0..back.rgba.len()).filter(seen).filter(|p| !turned(&back, &mirrored, *p)).count();
        assert!(crumple > 0.0 || fronts == 0, "{fronts}");
    }
}

#[test]
fn nothing_is_left_when_the_mesh_goes_behind_the_camera() {
    let mut scene = Scene::cloth(1, 0.05, noise(1));
    let mut out = Rendering::new();
    scene.rasterizer.render(CAMERA, &scene.positions, &scene.texture, &mut out);
    assert!(out.blend_count() > 0);
    for p in &mut scene.positions {
        p.z = -p.z;
    }
    scene.rasterizer.render(CAMERA, &scene.positions, &scene.texture, &mut out);
    assert!(out.triangle.iter().all(|&t| t == Rendering::NO_TRIANGLE));
    assert!(out.inverse_depth.iter().all(|&s| s == 0.0));
    assert!(out.rgba.iter().all(|&c| c == [0.0; 4]));
    assert_eq!(out.blend_count(), 0);
    // A corner behind the camera, or one that is not a number, only takes its triangles away.
    scene.positions = Scene::cloth(1, 0.05, noise(1)).positions;
    (scene.positions[0].z, scene.positions[30].x) = (-1.0, f64::NAN);
    scene.rasterizer.render(CAMERA, &scene.positions, &scene.texture, &mut out);
    assert!(out.rgba.iter().flatten().all(|c| c.is_finite()));
    assert!(out.rgba.iter().any(|c| c[3] > 0.0));
}

#[test]
fn a_used_rendering_draws_like_a_new_one() {
    let mut out = Rendering::new();
    for (seed, x) in [(1, 0.0), (2, 0.4), (3, -0.5), (4, 2.0), (5, 0.1)] {
        let mut scene = Scene::cloth(seed, 0.1, noise(seed));
        for p in &mut scene.positions {
            p.x += x;
        }
        scene.rasterizer.render(CAMERA, &scene.positions, &scene.texture, &mut out);
        let fresh = render(&scene, &CAMERA);
        assert_eq!(out.rgba, fresh.rgba);
        assert_eq!(out.triangle, fresh.triangle);
        assert_eq!(out.inverse_depth, fresh.inverse_depth);
    }
}

#[test]
fn silhouettes_reach_into_the_background_and_sum_to_the_area() {
    for angle in [0.0, 0.2, 0.7, 0.9, 1.3] {
        let scene = Scene::rectangle(angle, DVec2::new(0.17, 0.14), DVec2::new(0.011, 0.007));
        let camera = Camera { fy: CAMERA.fx, ..CAMERA };
        let out = render(&scene, &camera);
        let outside = |p: usize| out.triangle[p] == Rendering::NO_TRIANGLE;
        let blended = (0..out.rgba.len()).filter(|&p| outside(p) && out.rgba[p][3] > 0.0).count();
        let coverage: f64 = out.rgba.iter().map(|c| f64::from(c[3])).sum();
        let area = 4.0 * 0.17 * 0.14 * camera.fx * camera.fx;
        println!("angle {angle}: coverage {coverage:.3}, area {area:.3}, {blended} blends outside");
        assert!(blended > 10, "{blended}");
        // What is left is at the four corners.
        assert!((coverage - area).abs() < 2.0, "{coverage} {area}");
        assert!(out.rgba.iter().all(|c| (0.0..=1.0).contains(&c[3])));
    }
}

#[test]
fn one_sided_antialiasing_leaves_the_background_black() {
    let mut scene = Scene::cloth(3, 0.02, noise(3));
    let both = render(&scene, &CAMERA);
    scene.rasterizer = scene.rasterizer.one_sided(true);
    let one = render(&scene, &CAMERA);
    let (mut changed, mut kept) = (0, 0);
    for ((one, both), triangle) in one.rgba.iter().zip(&both.rgba).zip(&one.triangle) {
        if *triangle == Rendering::NO_TRIANGLE {
            assert_eq!(one, &[0.0; 4]);
            changed += usize::from(one != both);
        } else {
            assert_eq!(one, both);
            kept += usize::from(one[3] < 1.0);
        }
    }
    assert!(changed > 50 && kept > 50, "{changed} {kept}");
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let scene = Scene::cloth(7, 0.06, noise(7));
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
        pool.install(|| {
            let out = render(&scene, &CAMERA);
            let mut rng = Rng::new(1, 0);
            let grad: Vec<_> = out.rgba.iter().map(|_| [0; 4].map(|_| rng.signed() as f32)).collect();
            let mut grads =
                Gradients::new(&scene.rasterizer).with_texture(&scene.texture).with_uvs(&scene.rasterizer);
            for _ in 0..2 {
                let (texture, r) = (&scene.texture, &scene.rasterizer);
                r.render_vjp(CAMERA, &scene.positions, texture, &out, &grad, None, &mut grads);
            }
            (out.rgba, out.inverse_depth, grads.positions, grads.texture, grads.uvs)
        })
    };
    let one = run(1);
    assert!(one.2.iter().any(|g| g.length() > 0.0));
    for threads in [2, 3] {
        assert!(one == run(threads), "{threads} threads");
    }
}
