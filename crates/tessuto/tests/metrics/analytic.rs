//! The metrics against closed forms and against the plain loop over all pairs.

use glam::{DVec2, DVec3};
use tessuto::math::rng::Rng;
use tessuto::mesh::grid;
use tessuto::mesh::surface;
use tessuto::metrics::{FrameMetrics, Inputs, Metrics, chamfer, depth, evaluate, published};
use tessuto::{Camera, Error, Mesh, Motion, Truth};

const CAMERA: Camera = Camera { fx: 400.0, fy: 400.0, cx: 199.5, cy: 149.5, width: 400, height: 300 };

fn corners(mesh: &Mesh, t: [u32; 3]) -> [DVec3; 3] {
    t.map(|i| mesh.positions[i as usize])
}

/// Random points in a box around the optical axis.
fn cloud(count: usize, rng: &mut Rng) -> Vec<DVec3> {
    (0..count).map(|_| DVec3::new(0.0, 0.0, 1.0) + 0.3 * rng.vector()).collect()
}

/// A bumpy grid, and one triangle of each degenerate kind.
fn bumpy(rng: &mut Rng) -> Mesh {
    let mut mesh = grid(7, 6, DVec2::new(0.5, 0.4), 1.0);
    for p in &mut mesh.positions {
        *p += 0.05 * rng.vector();
    }
    mesh
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

fn motion(frames: &[Vec<DVec3>]) -> Motion {
    Motion::new(frames.to_vec()).unwrap()
}

fn one(template: &Mesh, points: Vec<DVec3>, shape: &[DVec3]) -> Metrics {
    let truth = Truth {
        points: Some(vec![points]),
        vertices: Some(motion(std::slice::from_ref(&template.positions))),
        tracks: None,
    };
    let inputs = Inputs { template, views: vec![CAMERA.into()], truth: &truth, first_frame: 0 };
    evaluate(&inputs, &motion(&[shape.to_vec()]), 0..1, 3).unwrap().mean
}

#[test]
fn a_shifted_plane_is_as_far_as_the_shift() {
    // The cloud covers the inner part of the plane, so every nearest point is a perpendicular foot,
    // except for the triangles at the border: they are as near to the cloud as its border is.
    let (template, t) = (grid(9, 9, DVec2::splat(0.4), 1.0), 0.03);
    let mut rng = Rng::new(1, 0);
    let points = chamfer::sample(&template.positions, &template.triangles(), 40_000, &mut rng);
    let shape: Vec<DVec3> = template.positions.iter().map(|p| *p + DVec3::Z * t).collect();
    let m = one(&template, points, &shape);
    let near = |found: Option<f64>, expected: f64, tolerance: f64| {
        assert!((found.unwrap() / expected - 1.0).abs() < tolerance, "{found:?} for {expected} in {m:?}");
    };
    near(m.p2s1, 2.0 * t, 1e-9);
    near(m.p2s2, 2.0 * t * t, 1e-9);
    near(m.p2s1_published, 2.0 * t, 1e-9);
    near(m.depth, t, 1e-12);
    near(m.vertex, t, 1e-12);
    // The nearest sample is 0.5 mm beside the foot on average (0.5/√density): adds 4e-4 of 30 mm.
    near(m.cd1, 2.0 * t, 2e-3);
    near(m.cd2, 2.0 * t * t, 4e-3);
}

#[test]
fn points_around_a_vertex_are_a_sphere_away() {
    let template = grid(2, 2, DVec2::splat(0.02), 1.0);
    let corner = template.positions[0];
    let mut rng = Rng::new(2, 0);
    // Directions away from the patch, within 45° of its diagonal, so that its corner is the nearest point.
    let sphere: Vec<DVec3> = (0..200)
        .map(|_| {
            corner
                + 0.1
                    * (DVec3::new(-1.0, -1.0, 0.0).normalize()
                        + 0.7 * rng.vector() * DVec3::new(1.0, 1.0, 1.0))
                    .normalize()
        })
        .filter(|p| p.x < corner.x && p.y < corner.y)
        .collect();
    let [of_points, _] = surface::distances_squared(&sphere, &template.positions, &template.triangles());
    assert!(sphere.len() > 100 && of_points.iter().all(|d| (d.sqrt() - 0.1).abs() < 1e-12));
}

#[test]
fn nearest_neighbours_equal_the_plain_loop() {
    let mut rng = Rng::new(3, 0);
    let (mut from, mut to) = (cloud(300, &mut rng), cloud(400, &mut rng));
    // Equal points and points in one plane.
    from.extend([to[0]; 20]);
    to.extend((0..50).map(|k| DVec3::new(0.01 * f64::from(k), 0.0, 1.0)).chain([to[7]; 30]));
    for (p, found) in from.iter().zip(chamfer::nearest_squared(&from, &to)) {
        let plain = to.iter().map(|q| p.distance_squared(*q)).fold(f64::INFINITY, f64::min);
        assert_eq!(found, plain);
    }
}

#[test]
fn exact_distances_equal_the_plain_loop() {
    let mut rng = Rng::new(4, 0);
    for round in 0..20 {
        let mesh = bumpy(&mut rng);
        let mut triangles = mesh.triangles();
        triangles.extend([[0, 0, 0], [1, 1, 5], [0, 1, 1]]);
        let points = cloud(1 + 37 * round, &mut rng);
        let [of_points, of_triangles] = surface::distances_squared(&points, &mesh.positions, &triangles);
        let pair = |p: &DVec3, t: &[u32; 3]| surface::point_triangle_squared(*p, corners(&mesh, *t));
        for (p, found) in points.iter().zip(of_points) {
            let plain = triangles.iter().map(|t| pair(p, t)).fold(f64::INFINITY, f64::min);
            assert!((found - plain).abs() < 1e-14, "{found} {plain}");
        }
        for (t, found) in triangles.iter().zip(of_triangles) {
            let plain = points.iter().map(|p| pair(p, t)).fold(f64::INFINITY, f64::min);
            assert!((found - plain).abs() < 1e-14, "{found} {plain}");
        }
    }
}

#[test]
fn point_triangle_distance_is_that_of_a_fine_sampling() {
    let mut rng = Rng::new(5, 0);
    for _ in 0..200 {
        let (p, t) = (rng.vector(), [rng.vector(), rng.vector(), rng.vector()]);
        let n = 150;
        let mut plain = f64::INFINITY;
        for i in 0..=n {
            for j in 0..=n - i {
                let (v, w) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                plain = plain.min(p.distance(t[0] * (1.0 - v - w) + t[1] * v + t[2] * w));
            }
        }
        let found = surface::point_triangle_squared(p, t).sqrt();
        assert!(found <= plain + 1e-12 && plain - found < 0.03, "{found} {plain}");
    }
}

/// The published formula for one pair, written as it is there.
fn published_pair(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let (v0, v1) = (b - a, c - a);
    let n = v0.cross(v1).normalize();
    let foot = p + n * (a - p).dot(n);
    let v2 = foot - a;
    let (d00, d01, d11, d20, d21) = (v0.dot(v0), v0.dot(v1), v1.dot(v1), v2.dot(v0), v2.dot(v1));
    let denominator = d00 * d11 - d01 * d01 + 1e-5;
    let v = (d11 * d20 - d01 * d21) / denominator;
    let w = (d00 * d21 - d01 * d20) / denominator;
    let u = 1.0 - v - w;
    if [u, v, w].iter().all(|x| (0.0..=1.0).contains(x)) {
        foot.distance_squared(p)
    } else {
        let edges = [(a, b), (b, c), (c, a)];
        edges.map(|(s, e)| surface::point_segment_squared(p, s, e)).into_iter().fold(f64::INFINITY, f64::min)
    }
}

#[test]
fn published_variant_equals_its_formula_over_all_pairs() {
    let mut rng = Rng::new(6, 0);
    for count in [1, 8, 77, 200] {
        let mesh = bumpy(&mut rng);
        let (triangles, points) = (mesh.triangles(), cloud(count, &mut rng));
        let exact = surface::distances_squared(&points, &mesh.positions, &triangles);
        let [of_points, of_triangles] =
            published::distances_squared(&points, &mesh.positions, &triangles, &exact);
        assert_eq!((of_points.len(), of_triangles.len()), (points.len(), triangles.len()));
        let near = |found: f64, plain: f64| (found - plain).abs() < 1e-12;
        for (p, found) in points.iter().zip(of_points) {
            let pairs = triangles.iter().map(|t| published_pair(*p, corners(&mesh, *t)));
            assert!(near(found, pairs.fold(f64::INFINITY, f64::min)));
        }
        for (t, found) in triangles.iter().zip(of_triangles) {
            let pairs = points.iter().map(|p| published_pair(*p, corners(&mesh, *t)));
            assert!(near(found, pairs.fold(f64::INFINITY, f64::min)));
        }
    }
}

#[test]
fn samples_are_uniform_in_area() {
    // A patch of three quarters and one of one quarter of the area.
    let positions =
        [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [4.0, 0.0]].map(|[x, y]| DVec3::new(x, y, 1.0)).to_vec();
    let n = 40_000;
    let samples = chamfer::sample(&positions, &[[0, 1, 2], [1, 3, 2]], n, &mut Rng::new(7, 0));
    let right = samples.iter().filter(|p| p.x > 3.0).count() as f64 / n as f64;
    assert!((right - 0.25).abs() < 4.0 * (0.25 * 0.75 / n as f64).sqrt(), "{right}");
    // Mean of a uniform triangle is its centroid: x = 2 in the left one, standard error 0.004.
    let left: Vec<f64> = samples.iter().filter(|p| p.x <= 3.0).map(|p| p.x).collect();
    assert!((mean(left.into_iter()) - 2.0).abs() < 0.02);
}

#[test]
fn depth_buffer_equals_the_plain_loop() {
    let mut rng = Rng::new(8, 0);
    let mesh = bumpy(&mut rng);
    let pixels: Vec<(i64, i64)> =
        (-5..305).flat_map(|y| (-5..405).map(move |x| (y, x))).filter(|_| rng.uniform() < 0.2).collect();
    let found = depth::depths(&pixels, &mesh.positions, &mesh.triangles(), &CAMERA.into());
    let hit = |(y, x): (i64, i64), [a, b, c]: [DVec3; 3]| {
        // Cut the pixel's ray with the triangle's plane.
        let ray = CAMERA.ray(DVec2::new(x as f64, y as f64));
        let n = (b - a).cross(c - a);
        let p = ray * (a.dot(n) / ray.dot(n));
        [(a, b), (b, c), (c, a)].iter().all(|(s, e)| (*e - *s).cross(p - *s).dot(n) >= 0.0).then_some(p.z)
    };
    let mut hits = 0;
    for (pixel, found) in pixels.iter().zip(found) {
        let depths = mesh.triangles().into_iter().filter_map(|t| hit(*pixel, corners(&mesh, t)));
        let plain = depths.fold(f64::INFINITY, f64::min);
        assert!(found == plain || (found - plain).abs() < 1e-12, "{pixel:?}: {found} {plain}");
        hits += usize::from(plain.is_finite());
    }
    assert!(hits > 5000);
}

#[test]
fn thread_count_and_range_do_not_change_the_result() {
    let template = grid(6, 6, DVec2::splat(0.4), 1.0);
    let mut rng = Rng::new(9, 0);
    let truth = Truth { points: Some((0..7).map(|_| cloud(500, &mut rng)).collect()), ..Truth::default() };
    let motion = motion(&crate::support::recordings::wave(&template.positions, 7));
    let inputs = Inputs { template: &template, views: vec![CAMERA.into()], truth: &truth, first_frame: 2 };
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| evaluate(&inputs, &motion, 0..7, 1).unwrap())
    };
    let all = run(1);
    assert_eq!(all, run(3));
    assert_eq!(all.frames.iter().map(|f| f.frame).collect::<Vec<_>>(), [2, 3, 4, 5, 6, 7, 8]);
    assert_eq!(evaluate(&inputs, &motion, 3..5, 1).unwrap().frames, all.frames[3..5]);
    assert_ne!(evaluate(&inputs, &motion, 0..7, 2).unwrap().mean.cd1, all.mean.cd1);
}

#[test]
fn json_has_only_the_keys_that_were_measured() {
    let row = FrameMetrics { frame: 4, metrics: Metrics { vertex: Some(0.5), ..Metrics::default() } };
    let text = serde_json::to_string(&row).unwrap();
    assert_eq!(text, r#"{"frame":4,"vertex":0.5}"#);
    assert_eq!(serde_json::from_str::<FrameMetrics>(&text).unwrap(), row);
}

#[test]
fn wrong_input_is_refused_with_its_place() {
    let template = grid(3, 3, DVec2::splat(0.4), 1.0);
    let shape = template.positions.clone();
    let attempt = |truth: &Truth, frames: &[Vec<DVec3>], range| {
        let inputs = Inputs { template: &template, views: vec![CAMERA.into()], truth, first_frame: 0 };
        let error = evaluate(&inputs, &motion(frames), range, 0).unwrap_err();
        assert!(matches!(error, Error::Input { .. }) && error.exit_code() == 3);
        error.to_string()
    };
    let truth = Truth { vertices: Some(motion(&vec![shape.clone(); 2])), ..Truth::default() };
    let two = vec![shape.clone(); 2];
    assert!(attempt(&Truth::default(), &two, 0..2).contains("neither"));
    assert!(attempt(&truth, &two, 1..3).contains("1..3"));
    assert!(attempt(&truth, &two[..1], 0..1).contains("has 2"));
    assert!(attempt(&truth, &vec![shape[1..].to_vec(); 2], 0..2).contains("8 vertices"));
    let behind = Truth { points: Some(vec![vec![-DVec3::Z]]), ..Truth::default() };
    assert!(attempt(&behind, &two[..1], 0..1).contains("point 0"));
}
