//! `tessuto compare`: what is run, what is not run again, what fails alone, what is written.

use std::path::Path;
use std::process::{Command, Output};

const QUICK: [&str; 12] = [
    "--set",
    "texture.size=32",
    "--set",
    "texture.epochs=3",
    "--set",
    "spacetime.iterations=2",
    "--set",
    "rollout.last_epochs=1",
    "--set",
    "rollout.epochs_per_frame=1",
    "--out",
    "out",
];

fn tessuto(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessuto")).args(arguments).current_dir(folder).output().unwrap()
}

fn compare(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = tessuto(folder, &[&["compare"], &QUICK[..], arguments].concat());
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

fn synth(folder: &Path, name: &str) {
    let made =
        tessuto(folder, &["synth", name, "--frames", "4", "--size", "64", "--grid", "7x7", "--seed", "3"]);
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
}

#[test]
fn every_method_runs_once_and_what_fails_stops_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    synth(folder, "R1");
    synth(folder, "broken");
    std::fs::write(folder.join("broken/scene.json"), "{}").unwrap();

    let (status, out, said) = compare(folder, &["broken", "R1"]);
    assert_eq!(status, 4, "{said}");
    assert!(said.contains("4 of 4: R1, saft") && said.contains("2 of 4 runs"), "{said}");
    // Measured beside published, and what went wrong beneath.
    for expected in ["Chamfer distance, L1", "SAFT, published", "wall time [s]", "broken, saft: "] {
        assert!(out.contains(expected), "{expected} is missing in {out}");
    }
    let read = |name: &str| std::fs::read_to_string(folder.join("out").join(name)).unwrap();
    let csv = read("comparison/compare.csv");
    assert!(csv.contains("cd1,10⁻² m,\"SAFT, published\",published,R1,1.08"), "{csv}");
    assert!(csv.lines().any(|l| l.starts_with("cd1,10⁻² m,tessuto,measured,R1,")), "{csv}");
    assert!(out.starts_with(&read("comparison/compare.txt")));
    let page = read("comparison/compare.html");
    assert!(page.contains("<section data-first=\"0\"><h2>R1</h2>") && !page.contains("{{"));
    // Two methods, three ways to look.
    assert_eq!(page.matches("\"key\":\"saft\"").count(), 3);
    assert!(!page.contains("http://") && !page.contains("https://"), "the page needs something else");

    // Nothing is computed again but what failed.
    let record = read("R1/default.json");
    let (status, _, said) = compare(folder, &["broken", "R1"]);
    assert!(status == 4 && said.contains("2 of 2: broken, saft") && !said.contains("R1"), "{said}");
    assert_eq!(read("R1/default.json"), record);
    let (status, _, said) = compare(folder, &["R1"]);
    assert!(status == 0 && said.is_empty(), "{said}");

    // Results of other settings, and a stranger's file, are neither used nor replaced.
    let (status, _, said) = compare(folder, &["R1", "--set", "texture.epochs=4"]);
    assert!(status == 3 && said.contains("other settings"), "{said}");
    let (status, _, said) = compare(folder, &["R1", "--frames", "0..3"]);
    assert!(status == 3 && said.contains("other frames"), "{said}");
    std::fs::write(folder.join("out/comparison/compare.txt"), "mine").unwrap();
    let (status, _, said) = compare(folder, &["R1"]);
    assert!(status == 3 && read("comparison/compare.txt") == "mine", "{said}");
}

#[test]
fn wrong_names_are_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    synth(folder.path(), "a");
    synth(folder.path(), "other/a");
    for (arguments, status, expected) in [
        (&["a", "--methods", "soft"][..], 2, "the methods are: default, saft"),
        (&["nowhere"], 3, "no such folder"),
        (&["a", "other/a"], 2, "another name"),
        (&["a", "--set", "texture.sise=3"], 2, "texture.size"),
    ] {
        let (found, _, said) = compare(folder.path(), arguments);
        assert!(found == status && said.contains(expected), "{arguments:?}: {said}");
        assert!(!folder.path().join("out").exists());
    }
}
