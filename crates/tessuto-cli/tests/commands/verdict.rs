//! A clip of which two frames show another print: the run says so wherever a user looks.

use std::path::Path;
use std::process::{Command, Output};

fn tessuto(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessuto")).args(arguments).output().unwrap()
}

/// What a command that must succeed printed: results, and news.
fn succeed(arguments: &[&str]) -> [String; 2] {
    let output = tessuto(arguments);
    let [out, news] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(output.status.success(), "{arguments:?}: {news}");
    [out, news]
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn lost_frames_are_told_everywhere_and_can_be_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let [scene, other, result, exported] =
        ["scene", "other", "result", "exported"].map(|n| folder.path().join(n));
    for (path, seed) in [(&scene, "2"), (&other, "3")] {
        let size = ["--frames", "6", "--size", "96", "--grid", "9x9", "--wind", "2", "--seed", seed];
        succeed(&[&["synth", text(path)], &size[..]].concat());
    }
    for n in [3, 4] {
        let name = format!("rgbs/rgb_{n:03}.png");
        std::fs::copy(other.join(&name), scene.join(&name)).unwrap();
    }
    let settings = ["--no-appearance", "--set", "texture.size=64"];
    let [out, news] =
        succeed(&[&["reconstruct", text(&scene), "--out", text(&result)], &settings[..]].concat());
    assert!(news.contains("warning: verdict: lost in frames 3–4"), "{news}");
    let remedy = format!("tessuto export {} --to glb --without-lost --force", text(&result));
    assert!(news.contains("  hint: look at these frames") && news.contains(&remedy), "{news}");
    assert!(!out.contains("found: "), "{out}");

    let verdicts = json(&result.join("metrics.json"))["verdicts"].clone();
    assert_eq!(verdicts.as_array().unwrap().len(), 6);
    assert_eq!(verdicts[0], serde_json::json!({"frame": 0, "state": "found", "reason": ""}));
    assert_eq!((&verdicts[3]["state"], &verdicts[4]["state"]), (&"lost".into(), &"lost".into()));
    assert!(
        verdicts[3]["reason"].as_str().unwrap().starts_with("texture displaced, correlation "),
        "{verdicts}"
    );
    let verdict = json(&result.join("summary.json"))["verdict"].clone();
    assert_eq!((&verdict["lost"], &verdict["counts"]["lost"]), (&serde_json::json!([[3, 5]]), &2.into()));
    let page = std::fs::read_to_string(result.join("report.html")).unwrap();
    assert!(page.contains(r#"<span class="state lost">lost</span>"#) && page.contains("2 lost. What helps"));

    let [table, _] = succeed(&["evaluate", text(&scene), text(&result)]);
    let line = |n: &str| table.lines().find(|line| line.trim_start().starts_with(n)).unwrap().to_owned();
    assert!(line("frame ").ends_with("  verdict") && line("0 ").ends_with("  found"), "{table}");
    assert!(line("3 ").ends_with("  lost") && line("4 ").ends_with("  lost"), "{table}");
    let [_, news] = succeed(&["report", text(&result)]);
    assert!(news.contains("warning: verdict: lost in frames 3–4"), "{news}");

    let target = ["--to", "obj", "--out", text(&exported)];
    let [_, news] = succeed(&[&["export", text(&result)], &target[..]].concat());
    assert!(news.contains("2 of 6 frames are lost; --without-lost leaves them out"), "{news}");
    let [_, news] =
        succeed(&[&["export", text(&result)], &target[..], &["--without-lost", "--force"]].concat());
    assert!(news.contains("2 of 6 frames are lost and left out"), "{news}");
    let files = [2, 3, 4, 5].map(|n| exported.join(format!("scene_obj/scene_{n:04}.obj")).is_file());
    assert_eq!(files, [true, false, false, true]);
}
