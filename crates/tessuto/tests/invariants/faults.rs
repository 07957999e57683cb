//! NaN and infinite numbers, huge forces, cameras that see nothing: each is answered by an error that names
//! stage, place and a way out, or by finite numbers; never by a panic or by NaN in the answer.

use glam::DVec3;
use tessuto::appearance::{self, AppearanceSettings, MapPrior};
use tessuto::config::{Config, Preset};
use tessuto::math::factor::Scratch;
use tessuto::mesh::{Face, grid};
use tessuto::pbr::Geometry;
use tessuto::session::{Checkpoints, Epoch, Session};
use tessuto::sim::step::step;
use tessuto::sim::{
    Accelerations, Cloth, Integrator, RolloutInputs, State, StepSettings, Stiffness, rollout,
};
use tessuto::synth;
use tessuto::{Error, Reconstruction, Scene, reconstruct};

use super::crumpled;

const INTEGRATORS: [Integrator; 2] = [Integrator::ImplicitEuler, Integrator::LinearizedEuler];

fn settings(integrator: Integrator) -> StepSettings {
    StepSettings { integrator, step: 0.004, damping: 1.0, tolerance: 1e-8, newton_limit: 40 }
}

/// A numerical error with a place, a cause and a hint, all `fragments` among them.
fn names(error: &Error, fragments: &[&str]) {
    let text = error.to_string();
    assert_eq!(error.exit_code(), 4, "{text}");
    assert!(text.contains("hint: "), "{text}");
    for fragment in fragments {
        assert!(text.contains(fragment), "{fragment:?} is missing in: {text}");
    }
}

#[test]
fn a_step_from_a_position_that_is_not_finite_names_the_vertex() {
    let (mesh, x) = crumpled(1, 1e-3);
    let cloth = Cloth::new(&mesh);
    let stiffness = Stiffness::uniform(&cloth, [200.0, 1e-3, 5e-4]);
    let still = vec![DVec3::ZERO; x.len()];
    let broken = |field: &[DVec3], value: f64| {
        let mut field = field.to_vec();
        field[7].y = value;
        field[11].x = value;
        field
    };
    for integrator in INTEGRATORS {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let cases = [
                ("position", broken(&x, value), still.clone(), still.clone()),
                ("velocity", x.clone(), broken(&still, value), still.clone()),
                ("acceleration", x.clone(), still.clone(), broken(&still, value)),
            ];
            for (what, x, v, acceleration) in cases {
                let before = State { x, v };
                let settings = settings(integrator);
                let scratch = &mut Scratch::default();
                let error = step(&cloth, &settings, &stiffness, before, &acceleration, scratch).unwrap_err();
                names(&error, &["Euler step", "vertex 7", what]);
            }
        }
    }
}

#[test]
fn a_rollout_names_the_frame_in_which_a_force_is_none() {
    let (mesh, x) = crumpled(1, 1e-3);
    let cloth = Cloth::new(&mesh);
    let stiffness = Stiffness::uniform(&cloth, [200.0, 1e-3, 5e-4]);
    let initial = State { v: vec![DVec3::ZERO; x.len()], x };
    for integrator in INTEGRATORS {
        let mut accelerations = Accelerations::zeros(5, 1, mesh.positions.len());
        accelerations.dynamic[2][3].z = f64::NAN;
        let drive = RolloutInputs { initial: &initial, accelerations: &accelerations, stiffness: &stiffness };
        let error = rollout(&cloth, &settings(integrator), 4, 5, &drive).unwrap_err();
        names(&error, &["frame 3", "vertex 3"]);
    }
}

#[test]
fn huge_accelerations_give_finite_positions_or_an_error() {
    let (mesh, x) = crumpled(1, 1e-3);
    let cloth = Cloth::new(&mesh);
    for integrator in INTEGRATORS {
        for size in [1e6, 1e12, 1e100, 1e200, 1e300, f64::MAX] {
            for stiffness in [[200.0, 1e-3, 5e-4], [1e12, 1e12, 1e12], [0.0; 3], [f64::MAX; 3]] {
                let stiffness = Stiffness::uniform(&cloth, stiffness);
                let mut force = vec![DVec3::ZERO; x.len()];
                force[0] = DVec3::splat(size);
                let before = State { x: x.clone(), v: vec![DVec3::ZERO; x.len()] };
                let scratch = &mut Scratch::default();
                match step(&cloth, &settings(integrator), &stiffness, before, &force, scratch) {
                    Ok(tape) => {
                        let after = tape.after.x.iter().chain(&tape.after.v);
                        assert!(after.clone().all(|p| p.is_finite()), "{integrator:?} {size:e}");
                    }
                    Err(error) => names(&error, &["Euler step"]),
                }
            }
        }
    }
}

#[test]
fn faces_without_area_give_finite_positions_or_an_error() {
    let mut mesh = grid(4, 4, glam::DVec2::new(0.2, 0.2), 1.0);
    // A vertex of its own that hangs on by two faces without area: it has no mass.
    let far = mesh.positions[0] * 1.2;
    mesh.positions.push(far);
    let corners = vec![0, 16, 0];
    mesh.faces.push(Face { vertices: corners.clone(), uvs: corners });
    // And a face whose corners are one place.
    mesh.positions[5] = mesh.positions[6];
    mesh.positions[9] = mesh.positions[6];
    let cloth = Cloth::new(&mesh);
    let stiffness = Stiffness::uniform(&cloth, [200.0, 1e-3, 5e-4]);
    for integrator in INTEGRATORS {
        let before = State { x: mesh.positions.clone(), v: vec![DVec3::ZERO; 17] };
        let force = vec![DVec3::new(0.0, 9.8, 0.0); 17];
        match step(&cloth, &settings(integrator), &stiffness, before, &force, &mut Scratch::default()) {
            Ok(tape) => assert!(tape.after.x.iter().all(|p| p.is_finite()), "{integrator:?}"),
            Err(error) => names(&error, &["Euler step"]),
        }
    }
}

#[test]
fn a_crushed_cloth_has_no_definite_matrix_and_still_a_finite_step() {
    let (mesh, _) = crumpled(1, 0.0);
    let cloth = Cloth::new(&mesh);
    // Stiff, and pressed to a third of its size: the exact second derivative is indefinite.
    let stiffness = Stiffness::uniform(&cloth, [1e5, 1e-3, 5e-4]);
    let x: Vec<DVec3> = mesh.positions.iter().map(|p| *p * 0.3).collect();
    let mut matrix = tessuto::math::block_matrix::BlockMatrix::zeros(&cloth.pattern);
    let mut scratch = Scratch::default();
    cloth.add_hessian(&stiffness, &x, tessuto::sim::HessianKind::Exact, 1.0, &mut matrix);
    matrix.add_masses(&cloth.pattern, &cloth.masses, 1.0 / 0.004f64.powi(2));
    assert!(cloth.analysis.definite(&cloth.pattern, &matrix, &mut scratch).is_none());
    for integrator in INTEGRATORS {
        let before = State { x: x.clone(), v: vec![DVec3::ZERO; x.len()] };
        let none = vec![DVec3::ZERO; x.len()];
        let tape = step(&cloth, &settings(integrator), &stiffness, before, &none, &mut scratch).unwrap();
        assert!(tape.after.x.iter().chain(&tape.after.v).all(|p| p.is_finite()));
    }
}

fn scene() -> Scene {
    small(3, [5, 5])
}

fn small(frames: usize, grid: [usize; 2]) -> Scene {
    let settings = synth::Settings::default().with(|s| (s.frames, s.grid, s.size) = (frames, grid, 48));
    synth::make(&settings).unwrap()
}

fn config() -> Config {
    let mut config = Config::preset(Preset::Default);
    for assignment in ["texture.epochs=5", "texture.size=16", "spacetime.iterations=3"] {
        config.set(assignment).unwrap();
    }
    config
}

fn run(scene: &Scene) -> tessuto::Result<Reconstruction> {
    reconstruct(scene, &config(), &mut Session::new(|_, _| Ok(())))
}

fn held(scene: &mut tessuto::Scene) -> &mut [tessuto::Frame] {
    scene.frames.held_mut().unwrap()
}

#[test]
fn a_scene_that_cannot_be_seen_is_refused_before_anything_is_computed() {
    assert!(run(&scene()).unwrap().failure.is_none());
    let refused = |change: &dyn Fn(&mut Scene), fragments: &[&str]| {
        let mut scene = scene();
        change(&mut scene);
        let error = run(&scene).unwrap_err();
        let text = error.to_string();
        assert_eq!(error.exit_code(), 3, "{text}");
        assert!(text.contains("hint: "), "{text}");
        fragments.iter().for_each(|f| assert!(text.contains(f), "{f:?} is missing in: {text}"));
    };
    refused(&|s| s.camera.fx = 0.0, &["camera", "fx", "0"]);
    refused(&|s| s.camera.fy = f64::NAN, &["camera", "fy", "NaN"]);
    refused(&|s| s.camera.cx = f64::INFINITY, &["camera", "cx", "inf"]);
    refused(&|s| s.fps = 0.0, &["fps", "0"]);
    refused(&|s| s.frames = Vec::new().into(), &["frames"]);
    refused(&|s| held(s)[1].rgb = tessuto::Image::new(9, 9, 3), &["frame 1", "9×9"]);
    refused(&|s| held(s)[2].mask = tessuto::Image::new(9, 9, 1), &["frame 2", "9×9"]);
    refused(&|s| s.template.positions.iter_mut().for_each(|p| p.z = -p.z), &["template", "vertex 0"]);
    refused(&|s| s.template.positions[4].x = f64::NAN, &["template", "vertex 4", "NaN"]);
    refused(&|s| s.template.faces.clear(), &["template", "face"]);
    refused(&|s| s.template.faces[3].vertices[1] = 99, &["template", "face 3", "99"]);
    refused(&|s| s.template.uvs[2].x = f64::NAN, &["template", "texture coordinate 2"]);
}

#[test]
fn a_first_frame_that_is_not_finite_is_named() {
    let mut broken = scene();
    held(&mut broken)[0].rgb.pixel_mut(24, 24)[0] = f32::NAN;
    names(&run(&broken).unwrap_err(), &["texture", "frame 0"]);
}

#[test]
fn one_frame_has_a_shape_and_a_texture() {
    let mut still = scene();
    still.frames = held(&mut still)[..1].to_vec().into();
    for preset in [Preset::Default, Preset::Saft] {
        let mut config = Config::preset(preset);
        config.set("texture.epochs=5").unwrap();
        config.set("texture.size=16").unwrap();
        let result = reconstruct(&still, &config, &mut Session::new(|_, _| Ok(()))).unwrap();
        assert!(result.failure.is_none(), "{:?}", result.failure);
        assert_eq!(result.motion[..], [still.template.positions.clone()]);
    }
}

#[test]
fn states_of_another_cloth_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let open = || Checkpoints::open(folder.path(), "scene".into(), std::time::Duration::ZERO);
    let three = serde_json::json!([[[0.0, 0.0, 1.0], [0.1, 0.0, 1.0], [0.0, 0.1, 1.0]]]);
    let states = [
        ("texture", serde_json::json!({"width": 16, "height": 16, "texels": [[0.5, 0.5, 0.5, 1.0]]})),
        ("track", serde_json::json!({"frames": three, "gains": []})),
        ("track", serde_json::json!({"frames": [], "gains": []})),
        ("refine", serde_json::json!({"frames": three, "steps": 2, "damping": 1.0, "gains": []})),
    ];
    for (stage, state) in states {
        let mut session = Session::new(|_, _| Ok(()));
        session.keep_in(open(), None).unwrap();
        session.step(&Epoch { stage: stage.into(), ..Epoch::default() }, &[], Some(&state)).unwrap();
        let mut session = Session::new(|_, _| Ok(()));
        session.keep_in(open(), open().newest(&mut |_| panic!()).unwrap()).unwrap();
        let error = reconstruct(&scene(), &config(), &mut session).unwrap_err();
        let text = error.to_string();
        assert_eq!(error.exit_code(), 3, "{text}");
        assert!(text.contains(&format!("checkpoint, {stage}")) && text.contains("hint: "), "{text}");
    }
}

/// A session that goes on from what `begin` left behind.
fn after(folder: &std::path::Path, begin: impl FnOnce(&mut Session)) -> Session<'static> {
    let open = || Checkpoints::open(folder, "scene".into(), std::time::Duration::ZERO);
    let mut session = Session::new(|_, _| Ok(()));
    session.keep_in(open(), None).unwrap();
    begin(&mut session);
    let mut session = Session::new(|_, _| Ok(()));
    session.keep_in(open(), open().newest(&mut |_| panic!()).unwrap()).unwrap();
    session
}

#[test]
fn states_of_another_rollout_or_material_are_refused() {
    let scene = small(4, [5, 5]);
    let refused = |error: Error, stage: &str| {
        let text = error.to_string();
        assert_eq!(error.exit_code(), 3, "{text}");
        assert!(text.contains(&format!("checkpoint, {stage}")) && text.contains("hint: "), "{text}");
    };
    let mut config = Config::preset(Preset::Saft);
    for assignment in ["texture.epochs=2", "texture.size=16", "rollout.last_epochs=1"] {
        config.set(assignment).unwrap();
    }
    for other in [small(4, [5, 6]), small(5, [5, 5])] {
        let folder = tempfile::tempdir().unwrap();
        let mut session = after(folder.path(), |s| drop(reconstruct(&other, &config, s).unwrap()));
        refused(reconstruct(&scene, &config, &mut session).unwrap_err(), "rollout");
    }

    let settings = |map_size| {
        let mut settings = AppearanceSettings::default();
        (settings.map_size, settings.steps, settings.batch) = (map_size, 24, 32);
        settings.prior = MapPrior::Smooth;
        settings
    };
    let estimate = |scene: &Scene, map_size, session: &mut Session| {
        let motion = scene.truth.vertices.clone().unwrap();
        let geometry = Geometry::new(&scene.template, &motion);
        appearance::fit(scene, &motion, &geometry, &settings(map_size), 0, session)
    };
    for (other, map_size) in [(small(4, [5, 6]), 32), (small(5, [5, 5]), 32), (small(4, [5, 5]), 16)] {
        let folder = tempfile::tempdir().unwrap();
        let mut session = after(folder.path(), |session| drop(estimate(&other, map_size, session).unwrap()));
        refused(estimate(&scene, 32, &mut session).unwrap_err(), "appearance");
    }
}
