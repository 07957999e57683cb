//! Sheets that touch bodies and themselves: nothing passes through, energy does not grow, derivatives are right.

use glam::{DVec2, DVec3};
use tessuto::math::flat;
use tessuto::math::gradient_check::check;
use tessuto::math::rng::Rng;
use tessuto::math::vectors;
use tessuto::mesh::grid;
use tessuto::sim::contact::crossings::crossed_vertices;
use tessuto::sim::contact::{Body, ContactSettings, Shape};
use tessuto::sim::{
    Accelerations, Cloth, Fabric, Integrator, RolloutInputs, State, StepSettings, Stiffness, play, rollout,
    rollout_vjp,
};
use tessuto::{Mesh, Positions};

const G: f64 = 9.81;

const SETTINGS: StepSettings = StepSettings {
    integrator: Integrator::ImplicitEuler,
    step: 5e-3,
    damping: 1.0,
    tolerance: 1e-6,
    newton_limit: 200,
};

/// A grid that lies in the plane y = 0, y down.
fn lying(n: usize, size: f64) -> Mesh {
    let mut mesh = grid(n, n, DVec2::splat(size), 0.0);
    mesh.positions.iter_mut().for_each(|x| *x = DVec3::new(x.x, 0.0, x.y));
    mesh
}

fn play_all(
    cloth: &Cloth,
    k: &Stiffness,
    settings: &StepSettings,
    initial: &State,
    gravity: DVec3,
    steps: usize,
) -> Vec<Positions> {
    let mut accelerations = Accelerations::zeros(steps + 1, 1, initial.x.len());
    accelerations.constant = gravity;
    let inputs = RolloutInputs { initial, accelerations: &accelerations, stiffness: k };
    play(cloth, settings, 1, steps + 1, &inputs).unwrap()
}

fn at_rest(mesh: &Mesh) -> State {
    State { x: mesh.positions.clone(), v: vec![DVec3::ZERO; mesh.positions.len()] }
}

#[test]
fn a_sheet_dropped_on_a_sphere_never_passes_through_and_gains_no_energy() {
    let mesh = lying(26, 0.5);
    let (centre, radius) = (DVec3::new(0.02, 0.16, 0.01), 0.12);
    let ball = Body { shape: Shape::Sphere { centre, radius }, friction: 0.2 };
    let floor = Body { shape: Shape::Plane { normal: -DVec3::Y, height: -0.3 }, friction: 0.2 };
    let contact = ContactSettings { bodies: vec![ball, floor], ..ContactSettings::default() };
    let triangles = mesh.triangles();
    for is_continuum in [false, true] {
        let cloth = if is_continuum { Cloth::continuum(&mesh) } else { Cloth::new(&mesh) };
        let k = if is_continuum {
            Fabric { warp: 200.0, weft: 200.0, poisson: 0.2, shear: 20.0, bend: 1e-6 }.stiffness(&cloth)
        } else {
            Stiffness::uniform(&cloth, [200.0, 1e-4, 1e-4])
        };
        let cloth = cloth.with_contact(&mesh, &contact).unwrap();
        let frames = play_all(&cloth, &k, &SETTINGS, &at_rest(&mesh), DVec3::Y * G, 200);
        let (mut last, mut least, mut crossed, mut layers) = (f64::INFINITY, f64::INFINITY, 0, f64::INFINITY);
        for pair in frames.windows(2) {
            let (x, h) = (&pair[1], SETTINGS.step);
            let v = |i: usize| (pair[1][i] - pair[0][i]) / h;
            let kinetic = |i: usize| 0.5 * cloth.masses[i] * v(i).length_squared();
            let own = |i: usize| kinetic(i) - cloth.masses[i] * G * x[i].y;
            let energy = (0..x.len()).map(own).sum::<f64>() + cloth.energy(&k, x).total();
            // What a barrier takes up comes back when the sheet leaves it.
            assert!(energy < last + 1e-4, "{energy} J after {last} J");
            last = energy;
            for t in &triangles {
                let [a, b, c] = t.map(|k| x[k as usize]);
                for (s, t) in (0..=4).flat_map(|s| (0..=4 - s).map(move |t| (s, t))) {
                    let at = a + (b - a) * (f64::from(s) / 4.0) + (c - a) * (f64::from(t) / 4.0);
                    least = least.min(at.distance(centre) - radius).min(0.3 - at.y);
                }
            }
            crossed += crossed_vertices(&triangles, x).len();
        }
        for i in (0..676).step_by(7) {
            for j in (0..676).filter(|j| mesh.positions[*j].distance(mesh.positions[i]) > 0.1) {
                layers = layers.min(frames[200][i].distance(frames[200][j]));
            }
        }
        println!(
            "{least:.2e} m from the bodies at least, layers {layers:.3} m, {crossed} crossed, {last:.4} J at last"
        );
        assert!(least > 0.0 && least < 5e-3 && crossed == 0);
        let low = frames[200].iter().map(|x| x.y).fold(0.0, f64::max);
        assert!(low > 0.25 && low < 0.3, "its rim has come down: {low}");
    }
}

/// A sheet, flat at rest, that is folded over itself: its upper layer falls on the lower one.
fn fold(mesh: &Mesh) -> State {
    const R: f64 = 0.01;
    let of = |p: &DVec3| {
        let angle = (p.x / R).clamp(0.0, std::f64::consts::PI);
        let beyond = p.x - angle * R;
        let along = if p.x <= 0.0 { p.x } else { R * angle.sin() - beyond };
        DVec3::new(along, p.y - R * (1.0 - angle.cos()), p.z)
    };
    let x: Positions = mesh.positions.iter().map(of).collect();
    let v = mesh.positions.iter().map(|p| DVec3::new(0.2, 0.4, 0.1) * (10.0 * p.x.max(0.0)));
    State { v: v.collect(), x }
}

#[test]
fn the_adjoint_of_a_fold_is_that_of_differences() {
    let mut mesh = lying(9, 0.2);
    let mut rng = Rng::new(9, 0);
    mesh.positions.iter_mut().for_each(|x| *x += rng.vector() * 1e-3);
    let table = Body { shape: Shape::Plane { normal: -DVec3::Y, height: -0.006 }, friction: 0.4 };
    let contact = ContactSettings {
        bodies: vec![table],
        thickness: Some(5e-3),
        slip: 0.2,
        ..ContactSettings::default()
    };
    let cloth = Cloth::new(&mesh).with_contact(&mesh, &contact).unwrap();
    let settings = StepSettings { tolerance: 1e-12, damping: 0.98, ..SETTINGS };
    let k = Stiffness::uniform(&cloth, [60.0, 2e-5, 2e-5]);
    let initial = fold(&mesh);
    let mut accelerations = Accelerations::zeros(3, 1, 81);
    accelerations.constant = DVec3::new(0.3, G, -0.2);
    let weights: Vec<Positions> = (0..3).map(|_| (0..81).map(|_| rng.vector()).collect()).collect();
    let run = |cloth: &Cloth, initial: &State, constant: DVec3, k: &Stiffness| {
        let mut accelerations = accelerations.clone();
        accelerations.constant = constant;
        let inputs = RolloutInputs { initial, accelerations: &accelerations, stiffness: k };
        let rollout = rollout(cloth, &settings, 20, 3, &inputs).unwrap();
        let loss: f64 = rollout
            .frames
            .iter()
            .zip(&weights)
            .flat_map(|(x, w)| x.iter().zip(w).map(|(x, w)| x.dot(*w)))
            .sum();
        (rollout, loss)
    };
    let c = accelerations.constant;
    let (found, _) = run(&cloth, &initial, c, &k);
    let last = &found.frames[2];
    let touching = (0..81)
        .flat_map(|i| (0..i).map(move |j| (i, j)))
        .filter(|(i, j)| mesh.positions[*i].distance(mesh.positions[*j]) > 0.07)
        .filter(|(i, j)| last[*i].distance(last[*j]) < 0.02)
        .count();
    println!("{touching} pairs of far vertices are near each other");
    assert!(touching > 5, "it folds");
    let inputs = RolloutInputs { initial: &initial, accelerations: &accelerations, stiffness: &k };
    let g = rollout_vjp(&cloth, &settings, &inputs, &found, &weights);
    assert!(g.friction.iter().all(|g| g.abs() > 1e-6), "layers and the table rub: {:?}", g.friction);
    let n = 4;
    let by_start = check(flat(&initial.v), flat(&g.initial.v), 1e-5, n, 1, |v| {
        run(&cloth, &State { v: vectors(v), ..initial.clone() }, c, &k).1
    });
    let by_x = check(flat(&initial.x), flat(&g.initial.x), 1e-7, n, 2, |x| {
        run(&cloth, &State { x: vectors(x), ..initial.clone() }, c, &k).1
    });
    let by_constant = check(&c.to_array(), &g.constant.to_array(), 1e-4, 3, 3, |c| {
        run(&cloth, &initial, DVec3::from_slice(c), &k).1
    });
    let frictions = cloth.contact.as_ref().unwrap().frictions();
    let by_friction = check(&frictions, &g.friction, 1e-4, 2, 4, |f| {
        let mut other = cloth.clone();
        other.contact = Some(cloth.contact.as_ref().unwrap().with_frictions(f).into());
        run(&other, &initial, c, &k).1
    });
    let by_stretch = check(&k.stretch, &g.stiffness.stretch, 1e-2, 3, 5, |s| {
        run(&cloth, &initial, c, &Stiffness { stretch: s.to_vec(), ..k.clone() }).1
    });
    let all = [
        ("first velocities", by_start),
        ("first positions", by_x),
        ("constant acceleration", by_constant),
        ("friction", by_friction),
        ("stretch", by_stretch),
    ];
    for (name, worst) in all {
        println!("{name}: {worst:?}");
    }
    for (name, worst) in all {
        assert!(worst.relative_error < 1e-3, "{name}: {worst:?}");
    }
}

#[test]
fn a_sheet_sticks_on_a_slope_below_the_angle_of_friction_and_slides_above() {
    let mesh = lying(6, 0.1);
    let k = |cloth: &Cloth| Stiffness::uniform(cloth, [200.0, 1e-3, 1e-3]);
    // 20 degrees; tan = 0.364.
    let angle = 20f64.to_radians();
    let gravity = DVec3::new(angle.sin(), angle.cos(), 0.0) * G;
    let settings = StepSettings { tolerance: 1e-9, ..SETTINGS };
    for (friction, sticks) in [(0.45, true), (0.2, false)] {
        let table = Body { shape: Shape::Plane { normal: -DVec3::Y, height: -0.003 }, friction };
        let contact = ContactSettings { bodies: vec![table], ..ContactSettings::default() };
        let cloth = Cloth::new(&mesh).with_contact(&mesh, &contact).unwrap();
        let frames = play_all(&cloth, &k(&cloth), &settings, &at_rest(&mesh), gravity, 200);
        let middle = |f: usize| frames[f].iter().map(|x| x.x).sum::<f64>() / 36.0;
        let (speed, way) = ((middle(200) - middle(100)) / 0.5, middle(200) - middle(0));
        println!("friction {friction}: {way:.4} m, lately {speed:.4} m/s");
        if sticks {
            assert!(speed < 0.01, "it creeps by less than the slip: {speed}");
        } else {
            // From rest, but for the time in which it came down onto the table.
            let due = G * (angle.sin() - friction * angle.cos()) * 0.75;
            assert!((speed / due - 1.0).abs() < 0.08, "{speed} m/s of {due}");
        }
    }
}

#[test]
fn a_body_of_triangles_holds_a_sheet_as_a_plane_does_and_threads_change_nothing() {
    let mesh = lying(9, 0.2);
    let slab = {
        let top = lying(3, 0.6);
        let positions = top.positions.iter().map(|x| *x + DVec3::new(0.013, 0.03, 0.007)).collect();
        Shape::Mesh { positions, triangles: top.triangles() }
    };
    let plane = Shape::Plane { normal: -DVec3::Y, height: -0.03 };
    let mut ends: Vec<Vec<Positions>> = Vec::new();
    for shape in [slab, plane] {
        let contact =
            ContactSettings { bodies: vec![Body { shape, friction: 0.3 }], ..ContactSettings::default() };
        let cloth = Cloth::new(&mesh).with_contact(&mesh, &contact).unwrap();
        let k = Stiffness::uniform(&cloth, [200.0, 1e-4, 1e-4]);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| play_all(&cloth, &k, &SETTINGS, &at_rest(&mesh), DVec3::Y * G, 80))
        };
        let (one, three) = (run(1), run(3));
        assert!(one == three, "the same bits for any number of threads");
        ends.push(one);
    }
    let height = |frames: &[Positions]| frames[80].iter().map(|x| x.y).sum::<f64>() / 81.0;
    let (on_mesh, on_plane) = (height(&ends[0]), height(&ends[1]));
    println!("{:.2} mm above the mesh, {:.2} above the plane", 30.0 - 1e3 * on_mesh, 30.0 - 1e3 * on_plane);
    assert!(on_mesh < 0.03 && on_plane < 0.03 && (on_mesh - on_plane).abs() < 2e-3);
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let mesh = lying(4, 0.1);
    let with = |shape: Shape, friction: f64| {
        let bodies = vec![Body { shape, friction }];
        Cloth::new(&mesh).with_contact(&mesh, &ContactSettings { bodies, ..ContactSettings::default() })
    };
    let sphere = |radius: f64| Shape::Sphere { centre: DVec3::ZERO, radius };
    for (cloth, part) in [
        (with(sphere(-1.0), 0.0), "radius -1"),
        (with(sphere(1.0), -0.5), "friction of body 0 is -0.5"),
        (with(Shape::Plane { normal: DVec3::ZERO, height: 0.0 }, 0.0), "normal"),
        (with(Shape::Mesh { positions: vec![DVec3::ZERO], triangles: vec![[0, 0, 3]] }, 0.0), "1 vertices"),
    ] {
        let message = cloth.unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
    // A sheet that begins within the ball.
    let cloth = with(sphere(0.2), 0.0).unwrap();
    let k = Stiffness::uniform(&cloth, [200.0, 1e-4, 1e-4]);
    let accelerations = Accelerations::zeros(2, 1, 16);
    let initial = at_rest(&mesh);
    let inputs = RolloutInputs { initial: &initial, accelerations: &accelerations, stiffness: &k };
    let message = play(&cloth, &SETTINGS, 1, 2, &inputs).unwrap_err().to_string();
    assert!(message.contains("within body 0, a sphere"), "{message}");
}
