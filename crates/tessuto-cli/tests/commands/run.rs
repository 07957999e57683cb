//! The commands as a user runs them, on a small scene made by the program itself.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use tempfile::TempDir;
use tessuto::io::npy::read_field;

fn tessuto(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessuto")).args(arguments).output().unwrap()
}

/// Runs a command that must succeed; returns what it printed.
pub(super) fn succeed(arguments: &[&str]) -> String {
    let output = tessuto(arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// Runs a command that must end with `code`; returns its error message.
pub(super) fn fail(code: i32, arguments: &[&str]) -> String {
    let output = tessuto(arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {errors}");
    errors
}

pub(super) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The scene that all tests share, made once.
fn scene() -> PathBuf {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let make = || {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("scene");
        succeed(&["synth", text(&out), "--frames", "6", "--size", "96", "--grid", "9x9", "--seed", "2"]);
        folder
    };
    FOLDER.get_or_init(make).path().join("scene")
}

/// Reconstructs with 1 and with 2 threads and compares the bytes of the results.
fn same_bytes_for_any_threads(settings: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene();
    for threads in ["1", "2"] {
        let out = folder.path().join(threads);
        let mut arguments = vec!["reconstruct", text(&scene), "--out", text(&out), "--threads", threads];
        arguments.extend(["--set", "appearance.steps=4", "--set", "appearance.batch=500"]);
        arguments.extend([
            "--set",
            "appearance.map_size=32",
            "--set",
            "appearance.render_samples_per_pixel=8",
        ]);
        arguments.extend(settings);
        succeed(&arguments);
    }
    for name in [
        "motion.npy",
        "forces.npy",
        "parameters.json",
        "texture.png",
        "export/scene.glb",
        "export/scene.usda",
        "material/diffuse.png",
        "material/environment.exr",
        "rerendered/rgb_005.png",
    ] {
        let read = |threads| std::fs::read(folder.path().join(threads).join(name)).unwrap();
        assert!(read("1") == read("2"), "{name} depends on the number of threads ({settings:?})");
    }
    folder
}

#[test]
fn default_preset_repeats_for_any_threads_and_simulate_replays_it() {
    let folder = same_bytes_for_any_threads(&["--set", "texture.size=64"]);
    let result = folder.path().join("1");
    assert!(succeed(&["verify", text(&result)]).contains("all as they were written"));
    for name in ["mesh.obj", "config.json", "history.csv", "metrics.json", "report.html"] {
        assert!(result.join(name).is_file(), "{name}");
    }
    assert!(result.join("pictures/contact_sheet.png").is_file());

    let replay = folder.path().join("replay.npy");
    succeed(&["simulate", text(&result), "--out", text(&replay)]);
    let (a, b) = (read_field(&result.join("motion.npy")).unwrap(), read_field(&replay).unwrap());
    assert_eq!(a.len(), 6);
    assert_eq!(a.len(), b.len());
    let distances = a.iter().flatten().zip(b.iter().flatten()).map(|(p, q)| p.distance(*q));
    assert!(distances.fold(0.0, f64::max) <= 1e-5);

    let table = succeed(&["evaluate", text(&scene()), text(&result)]);
    assert!(table.contains("vertex"), "{table}");
}

#[test]
fn a_changed_simulation_is_a_result_like_any_other() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (result, changed) = (at("result"), at("changed"));
    let quick = ["--preset", "motion", "--frames", "0..3", "--set", "texture.size=32"];
    let less = ["appearance.steps=4", "appearance.batch=500", "appearance.map_size=32"];
    let less = less.map(|setting| ["--set", setting]).concat();
    succeed(&[&["reconstruct", text(&scene()), "--out", text(&result)], &quick[..], &less[..]].concat());
    let log = std::fs::read_to_string(result.join("log.json")).unwrap();
    let parameters = std::fs::read_to_string(result.join("parameters.json")).unwrap();
    // Whoever reads a stiffness at its bound is told so.
    assert_eq!(parameters.contains("\"at_bound\": true"), log.contains("bound"), "{log}");
    assert!(parameters.contains("not measurements") && parameters.contains("\"bounds\": ["), "{parameters}");

    succeed(&["simulate", text(&result), "--set", "bend=0.005", "--out", text(&changed)]);
    assert!(succeed(&["verify", text(&changed)]).contains("all as they were written"));
    let page = std::fs::read_to_string(changed.join("report.html")).unwrap();
    assert!(page.contains("--set bend=0.005") && page.contains("not found in a video"));
    succeed(&["report", text(&changed)]);
    for look in ["texture", "material"] {
        succeed(&["render", text(&changed), "--look", look, "--size", "48x48", "--frames", "2..3"]);
        assert!(changed.join(format!("views/{look}/frame_002.png")).is_file());
    }
    succeed(&["export", text(&changed), "--to", "glb"]);
    // Changed twice is changed as a whole, and nothing finished is replaced without being asked for.
    let again = at("again.npy");
    succeed(&["simulate", text(&changed), "--out", text(&again)]);
    let (a, b) = (read_field(&changed.join("motion.npy")).unwrap(), read_field(&again).unwrap());
    let distances = a.iter().flatten().zip(b.iter().flatten()).map(|(p, q)| p.distance(*q));
    assert!(distances.fold(0.0, f64::max) <= 1e-5);
    assert!(fail(3, &["simulate", text(&result), "--out", text(&changed)]).contains("--force"));
    assert!(
        fail(3, &["simulate", text(&result), "--air", "still", "--out", text(&at("no.npy"))])
            .contains("preset default")
    );
    // A result of some of the scene's frames is compared with the truth of these.
    assert!(succeed(&["evaluate", text(&scene()), text(&result)]).contains("mean"));
    assert!(fail(2, &["evaluate", text(&scene()), text(&result), "--frames", "2..5"]).contains("0..3"));
}

#[test]
fn causes_are_found_and_changed() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let result = at("result");
    let quick = ["--no-appearance", "--frames", "0..3", "--set", "texture.size=32"];
    succeed(&[&["reconstruct", text(&scene()), "--out", text(&result)], &quick[..]].concat());
    let parameters = std::fs::read_to_string(result.join("parameters.json")).unwrap();
    for word in ["\"informed\": ", "\"constraint\": ", "\"gravity\"", "\"friction\"", "\"wind\"", "\"held\""]
    {
        assert!(parameters.contains(word), "{word}: {parameters}");
    }
    assert!(result.join("forces.npz").is_file() && result.join("rest_lengths.npy").is_file());
    let again = at("again.npy");
    succeed(&["simulate", text(&result), "--out", text(&again)]);
    let (a, b) = (read_field(&result.join("motion.npy")).unwrap(), read_field(&again).unwrap());
    let distances = a.iter().flatten().zip(b.iter().flatten()).map(|(p, q)| p.distance(*q));
    assert!(distances.fold(0.0, f64::max) <= 1e-5);
    // What would have been otherwise, and what comes after the clip.
    let calm = at("calm.npy");
    let otherwise = ["--continue", "4", "--air", "still", "--hold", "still"];
    succeed(&[&["simulate", text(&result), "--out", text(&calm)], &otherwise[..]].concat());
    assert_eq!(read_field(&calm).unwrap().len(), 3 + 4);
    let loose = at("loose.npy");
    let falling = ["--hold", "release", "--continue", "4"];
    succeed(&[&["simulate", text(&result), "--out", text(&loose)], &falling[..]].concat());
    let upper_edge = |path: &Path| -> f64 {
        let last = read_field(path).unwrap().pop().unwrap();
        last.iter().map(|p| p.y).fold(f64::INFINITY, f64::min)
    };
    // A floor a little below it.
    let lowest = |path: &Path| -> f64 {
        read_field(path).unwrap().iter().flatten().map(|p| p.y).fold(f64::MIN, f64::max)
    };
    let floor = lowest(&result.join("motion.npy")) + 2e-3;
    let table = serde_json::json!({"plane": {"normal": [0, -1, 0], "height": -floor}});
    let contact = serde_json::json!({"bodies": [{"shape": table, "friction": 0.5}]});
    let file = at("floor.json");
    std::fs::write(&file, contact.to_string()).unwrap();
    let falling = ["--continue", "12", "--hold", "release", "--contact", text(&file)];
    succeed(&[&["simulate", text(&result), "--out", text(&at("fallen"))], &falling[..]].concat());
    succeed(&[&["simulate", text(&result), "--out", text(&at("through.npy"))], &falling[..4]].concat());
    let ends = [at("fallen/motion.npy"), at("through.npy")].map(|path| lowest(&path));
    assert!(ends[0] < floor && ends[1] > floor + 5e-3, "{ends:?}, the floor at {floor}");
    assert!(fail(3, &["simulate", text(&result), "--contact", text(&at("none.json"))]).contains("none.json"));
    let (loose, calm) = (upper_edge(&loose), upper_edge(&calm));
    assert!(loose > calm + 1e-3, "let go, it falls: {loose} {calm}");
    for (option, value) in [("--scale", "bend=0"), ("--scale", "bent=2"), ("--air", "windy")] {
        assert!(fail(2, &["simulate", text(&result), option, value]).contains(value));
    }
}

#[test]
fn export_writes_every_format_and_replaces_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("result");
    succeed(&[
        "reconstruct",
        text(&scene()),
        "--out",
        text(&out),
        "--frames",
        "0..2",
        "--no-appearance",
        "--set",
        "texture.size=32",
    ]);
    let said = fail(3, &["export", text(&out), "--to", "npz,usd"]);
    assert!(said.contains("scene.usda") && said.contains("--force"), "{said}");
    assert!(!out.join("export/scene.npz").exists());
    let listed = succeed(&["export", text(&out), "--to", "glb,usd,obj,ply,pc2,npz", "--force"]);
    for path in listed.lines() {
        assert!(Path::new(path).exists(), "{path}");
    }
    assert_eq!(listed.lines().count(), 8, "{listed}");
    fail(2, &["export", text(&out), "--to", "fbx"]);
    fail(3, &["export", text(&scene()), "--to", "glb"]);
}

#[test]
fn saft_preset_repeats_for_any_threads() {
    let settings =
        ["rollout.last_epochs=2", "rollout.epochs_per_frame=1", "texture.epochs=20", "texture.size=64"];
    let arguments: Vec<&str> =
        ["--preset", "saft"].into_iter().chain(settings.into_iter().flat_map(|s| ["--set", s])).collect();
    same_bytes_for_any_threads(&arguments);
}

#[test]
fn phi_sft_preset_replays_and_its_cloth_has_properties_of_its_own() {
    let settings = [
        "rollout.last_epochs=2",
        "rollout.epochs_per_frame=1",
        "texture.epochs=20",
        "texture.size=64",
        "irregular_vertices=60",
    ];
    let arguments: Vec<&str> =
        ["--preset", "phi-sft"].into_iter().chain(settings.into_iter().flat_map(|s| ["--set", s])).collect();
    let folder = same_bytes_for_any_threads(&arguments);
    let (result, at) = (folder.path().join("1"), |name: &str| folder.path().join(name));
    let motion = read_field(&result.join("motion.npy")).unwrap();
    assert_eq!((motion.len(), motion[0].len()), (6, 60));
    // True vertices are compared on the irregular mesh, too, the same later as at once.
    let metrics = succeed(&["evaluate", text(&scene()), text(&result)]);
    assert!(metrics.contains("vertex"), "{metrics}");
    succeed(&["simulate", text(&result), "--out", text(&at("same.npy"))]);
    assert_eq!(read_field(&at("same.npy")).unwrap(), motion);
    let parameters = std::fs::read_to_string(result.join("parameters.json")).unwrap();
    for key in ["\"model\": \"continuum\"", "\"warp\"", "\"weft\"", "\"poisson\"", "\"wind\""] {
        assert!(parameters.contains(key), "{key} is missing in {parameters}");
    }
    succeed(&["simulate", text(&result), "--set", "warp=20", "--out", text(&at("softer"))]);
    let softer = std::fs::read_to_string(at("softer/parameters.json")).unwrap();
    assert!(
        softer.contains("\"value\": 20.0") || softer.contains("\"value\": 20.000000000000004"),
        "{softer}"
    );
    assert_ne!(read_field(&at("softer/motion.npy")).unwrap(), motion);
    let refused = fail(2, &["simulate", text(&result), "--set", "stretch=20", "--out", text(&at("no.npy"))]);
    assert!(refused.contains("warp, weft, poisson, shear, bend"), "{refused}");
    let (scene, out) = (scene(), at("no"));
    let spacetime = ["--set", "dynamics.model=continuum", "--out", text(&out)];
    let refused = fail(2, &[&["reconstruct", text(&scene)], &spacetime[..]].concat());
    assert!(refused.contains("method=rollout"), "{refused}");
}

#[test]
fn pg_sft_preset_replays_and_refuses_what_is_no_grid() {
    let settings =
        ["rollout.last_epochs=2", "rollout.epochs_per_frame=1", "texture.epochs=20", "texture.size=64"];
    let arguments: Vec<&str> =
        ["--preset", "pg-sft"].into_iter().chain(settings.into_iter().flat_map(|s| ["--set", s])).collect();
    let folder = same_bytes_for_any_threads(&arguments);
    let (result, at) = (folder.path().join("1"), |name: &str| folder.path().join(name));
    let motion = read_field(&result.join("motion.npy")).unwrap();
    // The forces of the result are rounded to 32 bits.
    let apart = |name: &str| {
        let other = read_field(&at(name)).unwrap();
        let pairs = other.iter().flatten().zip(motion.iter().flatten());
        pairs.fold(0.0, |most: f64, (a, b)| most.max(a.distance(*b)))
    };
    succeed(&["simulate", text(&result), "--out", text(&at("same.npy"))]);
    assert!(apart("same.npy") < 1e-6, "{}", apart("same.npy"));
    succeed(&["simulate", text(&result), "--set", "bend=0.01", "--out", text(&at("stiffer.npy"))]);
    assert!(apart("stiffer.npy") > 1e-5, "{}", apart("stiffer.npy"));
    // A mesh that it cannot take, and the command that makes one of it that it can.
    let scene = folder.path().join("scene");
    let small = ["--frames", "3", "--size", "64", "--grid", "6x6", "--mesh", "irregular"];
    succeed(&[&["synth", text(&scene)], &small[..]].concat());
    let out = at("no");
    let wanted = [&["reconstruct", text(&scene), "--out", text(&out)], &arguments[..]].concat();
    let refused = fail(3, &wanted);
    assert!(refused.contains("no regular grid") && refused.contains("--remesh 32 --force"), "{refused}");
    succeed(&["template", text(&scene), "--remesh", "6", "--force"]);
    succeed(&[&wanted[..], &["--no-appearance"]].concat());
    let refused = fail(2, &[&wanted[..], &["--set", "irregular_vertices=60"]].concat());
    assert!(refused.contains("irregular_vertices=0"), "{refused}");
}

#[test]
fn a_made_up_scene_has_no_findings() {
    let table = succeed(&["check", text(&scene())]);
    assert!(table.contains("0 warnings, 0 errors"), "{table}");
}

#[test]
fn synth_makes_every_kind_of_scene_and_refuses_what_does_not_go_together() {
    let folder = tempfile::tempdir().unwrap();
    let small = ["--frames", "2", "--size", "64", "--grid", "5x5", "--fps", "10"];
    let synth = |name: &str, options: &[&str]| {
        let out = folder.path().join(name);
        succeed(&[&["synth", text(&out)], &small[..], options].concat());
        std::fs::read_to_string(out.join("scene.json")).unwrap()
    };
    let notes = synth("hands", &["--hands", "--blur"]);
    assert!(notes.contains("\"mover\": \"hands\"") && notes.contains("\"blur\": 0.5"), "{notes}");
    assert!(notes.contains("\"wind\": 2.0") && notes.contains("\"fps\": 10.0"), "{notes}");
    assert!(folder.path().join("hands/gt/physics.json").is_file());
    let notes = synth("paper", &["--paper", "--occluders=2", "--amodal"]);
    assert!(notes.contains("\"occluders\": 2") && notes.contains("\"amodal\": true"), "{notes}");
    assert!(!folder.path().join("paper/gt/physics.json").exists());
    let notes = synth("lined", &["--paper", "--two-sided=#20ff00"]);
    let scene: serde_json::Value = serde_json::from_str(&notes).unwrap();
    assert!(scene.get("back").is_none(), "the clip has to tell: {notes}");
    let truth = std::fs::read_to_string(folder.path().join("lined/gt/back.json")).unwrap();
    assert_eq!(truth, "{\n  \"back\": \"#20ff00\"\n}\n");
    assert!(!folder.path().join("paper/gt/back.json").exists());
    let out = folder.path().join("none");
    for wrong in [
        &["--paper", "--hands"][..],
        &["--paper", "--wind", "3"],
        &["--amodal"],
        &["--blur=2"],
        &["--two-sided=red"],
        &["--two-sided=plain"],
    ] {
        fail(2, &[&["synth", text(&out)], wrong].concat());
        assert!(!out.exists(), "{wrong:?}");
    }
}

#[test]
fn wrong_setting_is_a_usage_error_that_names_the_nearest() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("result");
    let message = fail(2, &["reconstruct", text(&scene()), "--out", text(&out), "--set", "texture.epoch=3"]);
    assert!(message.contains("did you mean texture.epochs?"), "{message}");
    assert!(!out.exists());
    assert!(fail(2, &["synth", text(&out), "--frames", "1"]).contains("frames = 1"));
    assert!(!out.exists());
}

#[test]
fn folders_of_other_origin_are_never_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let precious = folder.path().join("precious.txt");
    std::fs::write(&precious, "mine").unwrap();
    let out = text(folder.path());
    assert!(fail(3, &["reconstruct", text(&scene()), "--out", out]).contains("precious.txt"));
    assert!(fail(3, &["synth", out]).contains("precious.txt"));
    assert!(fail(3, &["synth", out, "--force"]).contains("precious.txt"));
    assert_eq!(std::fs::read_to_string(precious).unwrap(), "mine");
    assert_eq!(folder.path().read_dir().unwrap().count(), 1);
}

#[test]
fn a_template_that_is_not_finite_is_an_input_error_and_leaves_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    let bad = folder.path().join("bad");
    succeed(&["synth", text(&bad), "--frames", "2", "--size", "64", "--grid", "5x5"]);
    let template = bad.join("template.obj");
    let obj = std::fs::read_to_string(&template).unwrap();
    let first = obj.lines().find(|line| line.starts_with("v ")).unwrap();
    std::fs::write(&template, obj.replacen(first, "v nan 0 1", 1)).unwrap();
    let out = folder.path().join("result");
    let message = fail(3, &["reconstruct", text(&bad), "--out", text(&out)]);
    assert!(message.contains("template.obj"), "{message}");
    let left: Vec<_> = folder.path().read_dir().unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["bad"], "no output folder, not even a partial one");
}

#[test]
fn appearance_refuses_what_is_no_result_and_leaves_it_alone() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene();
    let message = fail(3, &["appearance", text(&scene), text(folder.path())]);
    assert!(message.contains("config.json"), "{message}");
    // A folder of the user's own is not replaced.
    let own = folder.path().join("material");
    std::fs::create_dir(&own).unwrap();
    std::fs::write(own.join("notes.txt"), "mine").unwrap();
    let message = fail(3, &["appearance", text(&scene), text(folder.path()), "--motion", "gt"]);
    assert!(message.contains("notes.txt"), "{message}");
    assert_eq!(std::fs::read_to_string(own.join("notes.txt")).unwrap(), "mine");
    assert!(!folder.path().join("rerendered").exists());
}
