//! `reconstruct --rerun`: the result does not depend on it, the recording is whole, and nothing else is replaced.

use std::path::Path;
use std::process::Command;

/// Runs a command; returns its exit status and messages.
fn tessuto(arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_tessuto")).args(arguments).output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn a_recording_changes_nothing_and_replaces_only_recordings() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (scene, recording) = (at("scene"), at("run.rrd"));
    let made =
        tessuto(&["synth", text(&scene), "--frames", "3", "--size", "64", "--grid", "6x6", "--seed", "2"]);
    assert_eq!(made.0, Some(0), "{}", made.1);
    let run = |out: &str, rerun: Option<&Path>| {
        let out = at(out);
        let mut arguments = vec!["reconstruct", text(&scene), "--out", text(&out), "--no-appearance"];
        arguments.extend(["--set", "texture.size=32"]);
        arguments.extend(rerun.iter().flat_map(|file| ["--rerun", text(file)]));
        tessuto(&arguments)
    };
    let read = |path: &Path| std::fs::read(path).unwrap();
    assert_eq!(run("alone", None).0, Some(0));
    let (code, said) = run("recorded", Some(&recording));
    assert_eq!(code, Some(0), "{said}");
    for name in ["motion.npy", "forces.npy", "parameters.json", "texture.png", "history.csv", "config.json"] {
        assert!(read(&at("alone").join(name)) == read(&at("recorded").join(name)), "{name}");
    }
    let first = read(&recording);
    assert!(first.starts_with(b"RRF2") && first.ends_with(b"RRF2FOOT\x01\0\0\0"), "not whole");
    let shapes = tessuto::io::npy::read_field(&at("alone").join("motion.npy")).unwrap();
    let last: Vec<u8> =
        shapes[2].iter().flat_map(|p| p.as_vec3().to_array()).flat_map(f32::to_le_bytes).collect();
    assert!(first.windows(last.len()).any(|w| w == last), "the last frame is not in the recording");

    // Another run into another folder: the same recording, which replaces the first one.
    assert_eq!(run("again", Some(&recording)).0, Some(0));
    assert!(read(&recording) == first, "same run, same bytes");

    let mine = at("mine.rrd");
    std::fs::write(&mine, b"mine").unwrap();
    for (file, code, reason) in [
        (mine.clone(), 3, "not written by tessuto"),
        (at("recorded").join("run.rrd"), 2, "replaced as a whole"),
        (at("no/such/run.rrd"), 5, "cannot write"),
    ] {
        let out = if code == 5 { "third" } else { "recorded" };
        let (found, said) = run(out, Some(&file));
        assert_eq!(found, Some(code), "{said}");
        assert!(said.contains(reason) && said.contains(text(&file)) && said.contains("hint:"), "{said}");
    }
    assert_eq!(read(&mine), b"mine");
    assert!(at("recorded/motion.npy").is_file(), "the older result is gone");
}
