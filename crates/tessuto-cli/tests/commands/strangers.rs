//! No file of a user is ever lost: every command that writes, on folders and files that are not tessuto's.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use tempfile::TempDir;

const QUICK: [&str; 7] = [
    "--set",
    "texture.size=32",
    "--set",
    "texture.epochs=3",
    "--set",
    "spacetime.iterations=2",
    "--no-appearance",
];

fn tessuto(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tessuto"));
    command.args(arguments).current_dir(folder).env("TESSUTO_FFMPEG", "no-such-program").output().unwrap()
}

fn succeed(folder: &Path, arguments: &[&str]) {
    let output = tessuto(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Asserts status 3, all `fragments` in the message, and that no file in `folder` is another than before.
fn refused(folder: &Path, arguments: &[&str], fragments: &[&str]) {
    let before = contents(folder);
    let output = tessuto(folder, arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{arguments:?}: {said}");
    for fragment in [fragments, &["hint: "]].concat() {
        assert!(said.contains(fragment), "{fragment:?} is missing in: {said}");
    }
    assert!(contents(folder) == before, "{arguments:?} changed something");
}

/// Paths below `folder`, links as such, with their bytes.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(next) = open.pop() {
        for entry in next.read_dir().unwrap().map(Result::unwrap) {
            let kind = entry.file_type().unwrap();
            match kind {
                _ if kind.is_dir() => open.push(entry.path()),
                _ if kind.is_file() => found.push((entry.path(), std::fs::read(entry.path()).unwrap())),
                _ => found.push((entry.path(), format!("{kind:?}").into_bytes())),
            }
        }
    }
    found.sort();
    found
}

fn put(path: &Path, text: &str) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, text).unwrap();
}

fn copy(from: &Path, to: &Path) {
    for (path, bytes) in contents(from) {
        let target = to.join(path.strip_prefix(from).unwrap());
        std::fs::create_dir_all(target.parent().unwrap()).unwrap();
        std::fs::write(target, bytes).unwrap();
    }
}

/// A folder with copies of a scene and its result, both made once.
fn home() -> TempDir {
    static MADE: OnceLock<TempDir> = OnceLock::new();
    let make = || {
        let folder = tempfile::tempdir().unwrap();
        let synth = ["synth", "scene", "--frames", "3", "--size", "64", "--grid", "5x5", "--seed", "2"];
        succeed(folder.path(), &synth);
        succeed(folder.path(), &[&["reconstruct", "scene", "--out", "result"], &QUICK[..]].concat());
        folder
    };
    let home = tempfile::tempdir().unwrap();
    copy(MADE.get_or_init(make).path(), home.path());
    home
}

fn reconstruct<'a>(out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["reconstruct", "scene", "--out", out], &QUICK[..], more].concat()
}

#[test]
fn a_folder_with_names_like_ours_is_not_ours() {
    let home = home();
    let at = |name: &str| home.path().join(name);
    // F1 and F3: files of other programs have these names too.
    put(&at("model/config.json"), "{}");
    put(&at("model/thesis/chapter1.tex"), "years");
    put(&at("comp/frame_000.png"), "a render");
    put(&at("comp/final.nk"), "a composition");
    put(&at("scenes/scene.json"), "{\"notes\":{\"generator\":\"tessuto synth\"}}");
    put(&at("web/manifest.json"), "{\"name\":\"app\"}");
    for force in [&[][..], &["--force"]] {
        refused(
            home.path(),
            &reconstruct("model", force),
            &["model/", "config.json", "not written by tessuto"],
        );
        refused(home.path(), &reconstruct("web", force), &["web/manifest.json", "not written by tessuto"]);
        let views = ["render", "result", "--out", "comp", "--look", "shaded"];
        refused(home.path(), &[&views[..], force].concat(), &["comp/", "not written by tessuto"]);
        refused(home.path(), &[&["synth", "scenes"], force].concat(), &["scenes/scene.json"]);
    }
    // Folders of another kind are finished work as well.
    refused(home.path(), &reconstruct("scene", &["--force"]), &["is a scene of tessuto, no result"]);
    refused(home.path(), &["synth", "result", "--force"], &["is a result of tessuto, no scene"]);
    refused(
        home.path(),
        &["render", "result", "--look", "shaded", "--out", ".", "--force"],
        &["would be lost"],
    );
    // A folder that happens to be called as ours while they are written.
    put(&at("new.partial/draft.txt"), "mine");
    refused(home.path(), &reconstruct("new", &[]), &["new.partial/draft.txt", "not written by tessuto"]);
    // The earlier folder's own name during the exchange, and checkpoints, belong to nobody.
    put(&at("result.old/keep.txt"), "mine");
    put(&at("result.replaced/keep.txt"), "mine");
    put(&at("result.checkpoints/keep.txt"), "mine");
    succeed(home.path(), &reconstruct("result", &["--force"]));
    for name in ["result.old/keep.txt", "result.replaced/keep.txt", "result.checkpoints/keep.txt"] {
        assert_eq!(std::fs::read_to_string(at(name)).unwrap(), "mine", "{name}");
    }
}

#[test]
fn a_finished_result_is_replaced_on_demand_and_only_if_it_is_all_ours() {
    let home = home();
    let at = |name: &str| home.path().join(name);
    refused(home.path(), &reconstruct("result", &[]), &["a finished result already exists", "--force"]);
    // F2: additions and changes of the user's, at any depth.
    for name in ["notes.txt", "blends/shot010.blend", "pictures/observed/mine.png", "export/scene.fbx"] {
        put(&at("result").join(name), "mine");
        refused(home.path(), &reconstruct("result", &["--force"]), &[name, "would be lost"]);
        std::fs::remove_file(at("result").join(name)).unwrap();
    }
    let page = std::fs::read(at("result/report.html")).unwrap();
    std::fs::write(at("result/report.html"), "annotated").unwrap();
    refused(home.path(), &reconstruct("result", &["--force"]), &["report.html", "has changed"]);
    refused(home.path(), &["report", "result"], &["report.html", "has changed"]);
    std::fs::write(at("result/report.html"), page).unwrap();
    // What tessuto itself adds later is its own.
    succeed(home.path(), &["render", "result", "--look", "shaded", "--frames", "0..1"]);
    refused(home.path(), &["render", "result", "--look", "shaded"], &["folder of views", "--force"]);
    succeed(home.path(), &["render", "result", "--look", "shaded", "--frames", "0..2", "--force"]);
    succeed(home.path(), &["export", "result", "--to", "obj,npz"]);
    succeed(home.path(), &["simulate", "result"]);
    succeed(home.path(), &["simulate", "result"]);
    succeed(home.path(), &["report", "result"]);
    succeed(home.path(), &["verify", "result"]);
    succeed(home.path(), &reconstruct("result", &["--force", "--frames", "0..2"]));
    assert!(!at("result/views").exists());
    succeed(home.path(), &["verify", "result"]);
}

#[test]
fn links_are_never_replaced() {
    #[cfg(unix)]
    {
        use std::os::unix::fs::symlink;
        let home = home();
        let at = |name: &str| home.path().join(name);
        put(&at("archive/thesis.tex"), "years");
        symlink("archive", at("link")).unwrap();
        refused(home.path(), &reconstruct("link", &["--force"]), &["link/thesis.tex", "would be lost"]);
        symlink("nowhere", at("dangling")).unwrap();
        refused(home.path(), &reconstruct("dangling", &["--force"]), &["leads nowhere"]);
        // A link to an empty folder or to a result: that is filled, the link stays.
        std::fs::create_dir(at("disk")).unwrap();
        symlink("disk", at("short")).unwrap();
        succeed(home.path(), &reconstruct("short", &[]));
        succeed(home.path(), &reconstruct("short", &["--force"]));
        assert!(at("short").symlink_metadata().unwrap().is_symlink());
        assert!(at("disk/manifest.json").is_file() && !at("disk").symlink_metadata().unwrap().is_symlink());
        // Links inside: to a file, and to a folder in place of one of ours.
        symlink(at("archive/thesis.tex"), at("result/thesis")).unwrap();
        refused(home.path(), &reconstruct("result", &["--force"]), &["result/thesis"]);
        std::fs::remove_file(at("result/thesis")).unwrap();
        std::fs::rename(at("result/export"), at("moved")).unwrap();
        symlink("../moved", at("result/export")).unwrap();
        refused(home.path(), &reconstruct("result", &["--force"]), &["result/export"]);
        assert_eq!(std::fs::read_to_string(at("archive/thesis.tex")).unwrap(), "years");
    }
}

#[test]
fn folders_that_cannot_be_renamed_are_filled() {
    let home = home();
    let at = |name: &str| home.path().join(name);
    // F4: the working directory is the one that the user's shell stands in; it must stay the same folder.
    let work = at("work");
    std::fs::create_dir(&work).unwrap();
    let scene = at("scene");
    let scene = scene.to_str().unwrap();
    let run = |more: &[&'static str]| [&["reconstruct", scene, "--out", "."], &QUICK[..], more].concat();
    #[cfg(unix)]
    let number = |folder: &Path| std::os::unix::fs::MetadataExt::ino(&folder.metadata().unwrap());
    #[cfg(unix)]
    let before = number(&work);
    succeed(&work, &run(&[]));
    succeed(&work, &["verify", "."]);
    refused(&work, &run(&[]), &["a finished result already exists"]);
    succeed(&work, &run(&["--force", "--frames", "0..2"]));
    succeed(&work, &["verify", "."]);
    #[cfg(unix)]
    assert_eq!(number(&work), before);
    let names = work.read_dir().unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    assert!(!names.into_iter().any(|name| name.contains("tessuto")), "something was left");
    put(&work.join("notes.txt"), "mine");
    refused(&work, &run(&["--force"]), &["notes.txt", "would be lost"]);
    assert!(!at("work.partial").exists());
}

/// Where the system lets us mount something in a name space of our own.
#[cfg(target_os = "linux")]
#[test]
fn a_mount_point_is_filled() {
    let home = home();
    std::fs::create_dir(home.path().join("volume")).unwrap();
    let in_own_space = |script: &str| {
        Command::new("unshare")
            .args(["--mount", "--map-root-user", "sh", "-c", script, env!("CARGO_BIN_EXE_tessuto")])
            .args(QUICK)
            .current_dir(home.path())
            .output()
    };
    let mount = "mount -t tmpfs tmpfs volume";
    if !in_own_space(mount).is_ok_and(|output| output.status.success()) {
        eprintln!("not tried: nothing can be mounted here");
        return;
    }
    let run = r#""$0" reconstruct scene --out volume "$@""#;
    let script = format!("{mount} && {run} && {run} --force && \"$0\" verify volume && ! {run} 2>/dev/null");
    let output = in_own_space(&script).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn appearance_replaces_what_the_result_lists() {
    let home = home();
    let at = |name: &str| home.path().join(name);
    let quick = ["steps=2", "batch=100", "map_size=16", "render_samples_per_pixel=8"]
        .map(|s| format!("appearance.{s}"));
    let sets = quick.iter().flat_map(|s| ["--set", s]);
    let appearance: Vec<&str> = ["appearance", "scene", "result"].into_iter().chain(sets).collect();
    put(&at("result/material/environment.exr"), "my light");
    refused(home.path(), &appearance, &["result/material/environment.exr", "would be lost"]);
    std::fs::remove_dir_all(at("result/material")).unwrap();
    succeed(home.path(), &appearance);
    succeed(home.path(), &appearance);
    succeed(home.path(), &["verify", "result"]);
    put(&at("result/rerendered/notes.txt"), "mine");
    refused(home.path(), &appearance, &["rerendered/notes.txt", "would be lost"]);
    // In a folder of other things, with its own manifest.
    put(&at("own/manifest.json"), "{}");
    let with_truth: Vec<&str> = appearance.iter().map(|a| if *a == "result" { "own" } else { a }).collect();
    let with_truth = [&with_truth[..], &["--motion", "gt"]].concat();
    refused(home.path(), &with_truth, &["own/manifest.json"]);
    std::fs::remove_file(at("own/manifest.json")).unwrap();
    put(&at("own/notes.txt"), "mine");
    succeed(home.path(), &with_truth);
    succeed(home.path(), &with_truth);
    assert_eq!(std::fs::read_to_string(at("own/notes.txt")).unwrap(), "mine");
    refused(home.path(), &reconstruct("own", &["--force"]), &["own/notes.txt"]);
}

#[test]
fn single_files_are_replaced_only_if_tessuto_wrote_them() {
    let home = home();
    let at = |name: &str| home.path().join(name);
    // check --picture: again and again, but no other image.
    succeed(home.path(), &["check", "scene", "--picture", "check.png"]);
    succeed(home.path(), &["check", "scene", "--picture", "check.png"]);
    std::fs::copy(at("scene/rgbs/rgb_000.png"), at("photo.png")).unwrap();
    refused(home.path(), &["check", "scene", "--picture", "photo.png"], &["photo.png", "would be lost"]);
    // simulate --out.
    put(&at("notes.npy"), "mine");
    refused(home.path(), &["simulate", "result", "--out", "notes.npy"], &["notes.npy"]);
    refused(home.path(), &["simulate", "result", "--out", "notes.npy", "--force"], &["notes.npy"]);
    refused(home.path(), &["simulate", "result", "--out", "result/motion.npy"], &["motion.npy", "already"]);
    succeed(home.path(), &["simulate", "result", "--out", "windy.npy"]);
    refused(home.path(), &["simulate", "result", "--out", "windy.npy"], &["windy.npy", "--force"]);
    succeed(home.path(), &["simulate", "result", "--out", "windy.npy", "--force"]);
    // export, beside files of the user's.
    put(&at("shot/notes.txt"), "mine");
    put(&at("shot/scene.glb"), "mine");
    let export = |to: &'static str| ["export", "result", "--to", to, "--out", "shot", "--force"];
    refused(home.path(), &export("glb"), &["shot/scene.glb", "not written by tessuto"]);
    succeed(home.path(), &export("obj"));
    succeed(home.path(), &export("obj"));
    put(&at("shot/scene_obj/notes.txt"), "mine");
    refused(home.path(), &export("obj"), &["scene_obj/notes.txt", "not written by tessuto"]);
    // template: the mesh before is kept.
    put(&at("own.obj"), &std::fs::read_to_string(at("scene/template.obj")).unwrap());
    std::fs::write(at("scene/template.obj"), std::fs::read_to_string(at("own.obj")).unwrap() + "# mine\n")
        .unwrap();
    succeed(home.path(), &["template", "scene", "--scale", "1.01", "--force"]);
    let kept = std::fs::read_to_string(at("scene/template.before1.obj")).unwrap();
    assert!(kept.ends_with("# mine\n"));
    succeed(home.path(), &["template", "scene", "--scale", "1.01", "--force"]);
    assert!(!at("scene/template.before2.obj").exists(), "its own one is replaced");
}

#[test]
#[cfg(feature = "rerun")]
fn recordings_of_other_programs_are_not_replaced() {
    let home = home();
    let at = |name: &str| home.path().join(name);
    put(&at("other.rrd"), "RRF2 of another program");
    let output = tessuto(home.path(), &reconstruct("new", &["--rerun", "other.rrd"]));
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(std::fs::read_to_string(at("other.rrd")).unwrap(), "RRF2 of another program");
}

#[test]
fn scenes_are_replaced_only_if_they_are_all_ours() {
    let home = home();
    let at = |name: &str| home.path().join(name);
    let synth = ["synth", "scene", "--frames", "2", "--size", "64", "--grid", "5x5"];
    let forced = [&synth[..], &["--force"]].concat();
    refused(home.path(), &synth, &["a finished scene already exists", "--force"]);
    put(&at("scene/gt/notes.txt"), "mine");
    refused(home.path(), &forced, &["scene/gt/notes.txt", "would be lost"]);
    std::fs::remove_file(at("scene/gt/notes.txt")).unwrap();
    put(&at("demo/scene/notes.txt"), "mine");
    refused(home.path(), &["demo", "--out", "demo", "--force"], &["demo/scene/notes.txt", "would be lost"]);
    // A result inside of the scene is nothing that a new scene may cost.
    succeed(home.path(), &reconstruct("scene/result", &[]));
    refused(home.path(), &forced, &["scene/result/", "would be lost"]);
    std::fs::remove_dir_all(at("scene/result")).unwrap();
    succeed(home.path(), &forced);
    succeed(home.path(), &["verify", "scene"]);
}

#[test]
fn an_earlier_demonstration_is_replaced_only_if_that_is_asked_for() {
    let home = tempfile::tempdir().unwrap();
    succeed(home.path(), &["synth", "demo/scene", "--frames", "2", "--size", "64", "--grid", "5x5"]);
    let again = ["demo", "--out", "demo"];
    refused(home.path(), &again, &["demo/scene", "a finished scene already exists", "--force"]);
    succeed(home.path(), &[&again[..], &["--force"]].concat());
    succeed(home.path(), &["verify", "demo/result"]);
    refused(home.path(), &again, &["demo/scene", "a finished scene already exists", "--force"]);
}
