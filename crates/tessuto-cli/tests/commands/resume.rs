//! Runs that are killed or interrupted, and go on to the same bytes.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tessuto"));
    command.args(arguments).stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A folder with a small scene in it.
fn scene() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("scene");
    let made =
        command(&["synth", text(&out), "--frames", "5", "--size", "80", "--grid", "7x7", "--seed", "4"]);
    assert!({ made }.status().unwrap().success());
    folder
}

/// The run that is interrupted; a checkpoint at every step.
fn start(folder: &Path, out: &Path, preset: &str, resume: bool) -> Child {
    let scene = folder.join("scene");
    let mut arguments = vec!["reconstruct", text(&scene), "--out", text(out), "--preset", preset];
    arguments.extend(["--checkpoint", "0", "--set", "texture.size=32", "--set", "texture.epochs=40"]);
    arguments.extend(["--set", "appearance.steps=60", "--set", "appearance.batch=500"]);
    arguments.extend(["--set", "appearance.map_size=32", "--set", "appearance.render_samples_per_pixel=8"]);
    if resume {
        arguments.push("--resume");
    }
    command(&arguments).spawn().unwrap()
}

fn finish(child: Child) -> String {
    let output = child.wait_with_output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{errors}");
    errors
}

/// What must not depend on interruptions.
fn assert_same(a: &Path, b: &Path) {
    for name in ["motion.npy", "forces.npy", "history.csv", "texture.png", "metrics.json", "export/scene.glb"]
    {
        let [a, b] = [a, b].map(|folder| std::fs::read(folder.join(name)).unwrap());
        assert!(a == b, "{name} differs");
    }
    let deviation = |folder: &Path| std::fs::read(folder.join("deviation.npy")).ok();
    assert!(deviation(a) == deviation(b), "deviation.npy differs");
    for name in ["material/diffuse.png", "material/environment.exr", "rerendered/rgb_004.png"] {
        let [a, b] = [a, b].map(|folder| std::fs::read(folder.join(name)).unwrap());
        assert!(a == b, "{name} differs");
    }
}

fn checkpoints(out: &Path) -> PathBuf {
    out.with_file_name(format!("{}.checkpoints", out.file_name().unwrap().to_str().unwrap()))
}

#[test]
fn killed_runs_go_on_to_the_same_bytes() {
    let folder = scene();
    let folder = folder.path();
    for preset in ["default", "saft"] {
        let whole = folder.join(format!("{preset}-whole"));
        let clock = Instant::now();
        finish(start(folder, &whole, preset, false));
        let seconds = clock.elapsed().as_secs_f64();
        assert!(!checkpoints(&whole).exists(), "a finished run needs no checkpoints");
        let out = folder.join(preset);
        // Killed three times, each time later; then it may finish.
        let mut went_on = false;
        for share in [0.3, 0.6, 0.8] {
            if out.exists() {
                break;
            }
            let mut child = start(folder, &out, preset, share > 0.3);
            std::thread::sleep(Duration::from_secs_f64(share * seconds));
            child.kill().unwrap();
            child.wait().unwrap();
            assert!(!out.exists() || out.join("config.json").is_file(), "half a result");
            went_on |= checkpoints(&out).exists();
        }
        assert!(went_on, "no checkpoint was ever written");
        // On an idle machine the last one may have come to its end.
        if !out.exists() {
            finish(start(folder, &out, preset, true));
        }
        assert_same(&whole, &out);
    }
}

#[cfg(unix)]
#[test]
fn interrupted_runs_say_how_to_go_on_and_refuse_other_settings() {
    let folder = scene();
    let folder = folder.path();
    let out = folder.join("result");
    let child = start(folder, &out, "saft", false);
    // The handler is there before the first checkpoint is.
    let clock = Instant::now();
    while !checkpoints(&out).exists() {
        assert!(clock.elapsed() < Duration::from_secs(60), "no checkpoint");
        std::thread::sleep(Duration::from_millis(2));
    }
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(75), "{errors}");
    assert!(errors.contains("--resume"), "{errors}");
    assert!(!out.exists(), "an unfinished result");

    let scene = folder.join("scene");
    let other = command(&["reconstruct", text(&scene), "--out", text(&out), "--resume"]).output().unwrap();
    let errors = String::from_utf8_lossy(&other.stderr);
    assert_eq!(other.status.code(), Some(3), "{errors}");
    assert!(errors.contains("other settings"), "{errors}");

    // The newest one damaged: the one before it serves.
    let mut files: Vec<_> =
        std::fs::read_dir(checkpoints(&out)).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    let newest = files.last().unwrap();
    let bytes = std::fs::read(newest).unwrap();
    std::fs::write(newest, &bytes[..bytes.len() / 2]).unwrap();
    let errors = finish(start(folder, &out, "saft", true));
    assert!(files.len() < 2 || errors.contains("damaged") && errors.contains("going on after"), "{errors}");
}
