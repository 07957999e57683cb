//! `tessuto settings`, its document, and `--config`.

use std::path::Path;
use std::process::{Command, Output};

fn tessuto(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessuto")).args(arguments).output().unwrap()
}

fn said(arguments: &[&str]) -> String {
    let output = tessuto(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_document_is_what_the_program_prints() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/settings.md");
    let document = std::fs::read_to_string(file).unwrap();
    let command = "cargo run --release -- settings --markdown > docs/settings.md";
    assert!(document == said(&["settings", "--markdown"]), "docs/settings.md is old: {command}");
    // A spread whose direction is not told is set the wrong way.
    let is_spread = |line: &str| line.contains("Spread") || line.contains("Noise");
    for line in document.lines().filter(|line| line.starts_with('|') && is_spread(line)) {
        assert!(line.contains("arger is weaker"), "{line}");
    }
}

#[test]
fn settings_are_listed_filtered_and_refused() {
    let table = said(&["settings", "signed_bend"]);
    assert!(table.starts_with("spacetime.signed_bend = 0.06 rad    [1e-6 to 1000]\n    Spread"), "{table}");
    let rows: serde_json::Value =
        serde_json::from_str(&said(&["settings", "--json", "--preset", "saft"])).unwrap();
    let row = |key: &str| rows.as_array().unwrap().iter().find(|r| r["key"] == key).unwrap();
    assert_eq!(row("method")["default"], "rollout");
    assert_eq!(row("texture.size")["range"], serde_json::json!([2.0, 8192.0]));
    assert_eq!(tessuto(&["settings", "viscosity"]).status.code(), Some(2));
}

#[test]
fn a_file_of_settings_is_the_start_and_options_apply_on_top() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (scene, first, second, file) = (at("scene"), at("first"), at("second"), at("mine.json"));
    said(&["synth", &scene, "--frames", "2", "--size", "48", "--grid", "5x5"]);
    std::fs::write(&file, r#"{"texture": {"size": 16, "epochs": 2}, "spacetime": {"iterations": 1}}"#)
        .unwrap();
    let run = |out: &str, config: &str, more: &[&str]| {
        let arguments = ["reconstruct", &scene, "--out", out, "--config", config, "--no-appearance"];
        said(&[&arguments[..], more].concat());
        let text = std::fs::read_to_string(Path::new(out).join("config.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()["settings"].clone()
    };
    let settings = run(&first, &file, &[]);
    assert_eq!((&settings["texture"]["size"], &settings["seed"]), (&16.into(), &0.into()));
    let config = Path::new(&first).join("config.json");
    let settings = run(&second, config.to_str().unwrap(), &["--set", "texture.size=8", "--seed", "5"]);
    assert_eq!((&settings["texture"]["size"], &settings["seed"]), (&8.into(), &5.into()));
    assert_eq!(
        (&settings["texture"]["epochs"], &settings["spacetime"]["iterations"]),
        (&2.into(), &1.into())
    );
    for refused in ["spacetime.signed_bend=0", "texture.learning_rate=-1", "dynamics.bend.start=30"] {
        let output = tessuto(&["reconstruct", &scene, "--out", &at("none"), "--set", refused]);
        assert_eq!(output.status.code(), Some(2), "{refused}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("between"), "{refused}");
    }
}
