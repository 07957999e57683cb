//! What may go wrong around a run: odd options, names and environments, a full disk, folders that vanish or that
//! two runs want at once, results that were tampered with. Each ends with its status and a message; earlier
//! results stay whole. Bad scenes are in check_bad_input.rs, bad videos and cameras in import.rs.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use crate::scene_maker::{TinyScene, contents};
use tempfile::TempDir;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tessuto");
/// Settings that make a run of a second.
const QUICK: [&str; 7] = [
    "--set",
    "texture.size=32",
    "--set",
    "texture.epochs=10",
    "--set",
    "spacetime.iterations=3",
    "--no-appearance",
];

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A scene of four frames that all tests share.
fn scene() -> PathBuf {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let make = || {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("scene");
        let made = Command::new(PROGRAM)
            .args(["synth", text(&out), "--frames", "4", "--size", "64", "--grid", "5x5", "--seed", "2"])
            .output()
            .unwrap();
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        folder
    };
    FOLDER.get_or_init(make).path().join("scene")
}

/// `tessuto reconstruct` of a second's length.
fn quick(scene: &Path, out: &Path) -> Command {
    let mut command = Command::new(PROGRAM);
    command.arg("reconstruct").arg(scene).arg("--out").arg(out).args(QUICK);
    command
}

fn finish(command: &mut Command) -> (Option<i32>, String) {
    let Output { status, stderr, .. } = command.output().unwrap();
    (status.code(), String::from_utf8_lossy(&stderr).into_owned())
}

fn succeed(command: &mut Command) {
    let (code, said) = finish(command);
    assert_eq!(code, Some(0), "{said}");
}

/// Asserts the status, all `fragments` in the message, a hint, and that it was no panic.
fn fail(code: i32, command: &mut Command, fragments: &[&str]) {
    let (found, said) = finish(command);
    assert_eq!(found, Some(code), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    for fragment in fragments {
        assert!(said.contains(fragment), "{fragment:?} is missing in:\n{said}");
    }
}

/// Names in `folder`.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// What a result holds that must repeat: all but times and what lists them.
fn lasting(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = contents(folder);
    for (path, _) in &mut files {
        *path = path.strip_prefix(folder).unwrap().to_path_buf();
    }
    files.retain(|(path, _)| {
        !["log.json", "summary.json", "report.html", "manifest.json"].iter().any(|n| path.ends_with(n))
    });
    files
}

#[test]
fn absurd_options_are_usage_errors() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for options in [
        &["--threads", "0"][..],
        &["--threads", "100000"],
        &["--threads", "-3"],
        &["--seed", "one"],
        &["--checkpoint", "nan"],
        &["--checkpoint", "-1"],
        &["--frames", "3..1"],
        &["--frames", "0..9"],
        &["--set", "spacetime.bend=nan"],
        &["--set", "spacetime.tail=0"],
        &["--set", "spacetime.strain=inf"],
        &["--set", "texture.size=0"],
        &["--set", "texture.size=1000000000"],
        &["--set", "appearance.batch=0"],
        &["--set", "dynamics.substeps=0"],
        &["--set", "dynamics.substeps=-1"],
        &["--set", "rollout.dynamic_rate=nan"],
        &["--set", "texture.learning_rate=nan"],
        &["--preset", "best"],
    ] {
        let (code, said) = finish(quick(&scene(), &out).args(options));
        assert_eq!(code, Some(2), "{options:?}: {said}");
        assert_eq!(names(folder.path()), [] as [&str; 0], "{options:?}");
    }
}

#[test]
fn any_number_of_threads_and_any_repetition_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let run = |number: usize, threads: &str| {
        // The same name each time: it is in the command that the result tells.
        let home = folder.path().join(number.to_string());
        std::fs::create_dir(&home).unwrap();
        let out = home.join("result");
        let mut command = Command::new(PROGRAM);
        command.arg("reconstruct").arg(scene()).arg("--out").arg(&out).args(&QUICK[..6]);
        command.args(["--set", "appearance.steps=3", "--set", "appearance.batch=200"]);
        command.args(["--set", "appearance.map_size=16", "--set", "appearance.render_samples_per_pixel=8"]);
        succeed(command.args(["--threads", threads]));
        lasting(&out)
    };
    let first = run(0, "1");
    assert!(first.len() > 20, "{} files", first.len());
    for (number, threads) in ["1", "2", "3", "8", "8"].into_iter().enumerate() {
        let other = run(number + 1, threads);
        assert_eq!(first.len(), other.len());
        for ((path, a), (_, b)) in first.iter().zip(&other) {
            assert!(a == b, "{} differs with {threads} threads", path.display());
        }
    }
}

#[test]
fn a_video_of_one_frame_gives_a_result() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("still");
    succeed(quick(&scene(), &out).args(["--frames", "0..1"]));
    let motion = tessuto::io::npy::read_field(&out.join("motion.npy")).unwrap();
    assert_eq!((motion.len(), motion[0].len()), (1, 25));
}

/// What `tessuto check` says of a scene that it accepts.
fn doubts(scene: &TinyScene) -> String {
    let output = Command::new(PROGRAM).arg("check").arg(scene.folder()).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stdout));
    String::from_utf8_lossy(&output.stdout).split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn full_masks_and_mixed_winding_are_doubted() {
    let scene = TinyScene::new();
    for frame in 0..4 {
        let white = crate::scene_maker::paint(1, |_, _, _| 1.0);
        tessuto::io::image::write_png(&scene.path(&format!("masks/mask_00{frame}.png")), &white).unwrap();
    }
    let said = doubts(&scene);
    assert!(said.contains("warning masks") && said.contains("often inverted"), "{said}");
    let scene = TinyScene::new();
    let mut mesh = crate::scene_maker::template();
    mesh.faces[5].vertices.reverse();
    mesh.faces[5].uvs.reverse();
    tessuto::io::obj::write(&scene.path("template.obj"), &mesh, None).unwrap();
    let said = doubts(&scene);
    assert!(said.contains("warning winding 4 edges"), "{said}");
}

#[test]
fn frames_larger_than_memory_are_refused_before_any_is_read() {
    let scene = TinyScene::new();
    scene.edit("scene.json", "\"width\": 24", "\"width\": 16384");
    scene.edit("scene.json", "\"height\": 24", "\"height\": 16384");
    scene.edit("scene.json", "\"name\"", "\"crop\": {\"x0\":0,\"y0\":0,\"x1\":16384,\"y1\":16384}, \"name\"");
    let out = scene.path("out");
    fail(3, &mut quick(scene.folder(), &out), &["16384×16384", "GiB of memory", "--downscale", "hint: "]);
    assert!(!out.exists());
}

#[cfg(unix)]
#[test]
fn folders_of_any_name() {
    use std::os::unix::ffi::OsStrExt as _;
    let home = tempfile::tempdir().unwrap();
    let odd: [&[u8]; 4] =
        [b"with space\nand line", b"-x", b"=cmd()|<script>alert(1)</script>", b"latin-\xe9"];
    for name in odd {
        // A slash cannot be part of a name.
        let name: Vec<u8> = name.iter().copied().filter(|b| *b != b'/').collect();
        let folder = home.path().join(std::ffi::OsStr::from_bytes(&name));
        let made = folder.join("scene");
        std::fs::create_dir_all(&folder).unwrap();
        copy(&scene(), &made);
        let out = folder.join("result");
        succeed(&mut quick(&made, &out));
        succeed(Command::new(PROGRAM).arg("verify").arg(&out));
        succeed(Command::new(PROGRAM).arg("evaluate").arg(&made).arg(&out));
        let page = std::fs::read_to_string(out.join("report.html")).unwrap();
        assert!(!page.contains("<script>alert"), "{}", folder.display());
    }
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() { copy(&path, &target) } else { std::fs::copy(&path, &target).map(drop).unwrap() }
    }
}

#[test]
fn a_bare_environment_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (usual, bare) = (folder.path().join("a/result"), folder.path().join("b/result"));
    succeed(&mut quick(&scene(), &usual));
    let mut command = quick(&scene(), &bare);
    command.env_clear().stdin(Stdio::null()).current_dir("/");
    command.env("TMPDIR", "/nonexistent").env("LC_ALL", "de_DE.UTF-8").env("TERM", "");
    succeed(&mut command);
    let (usual, bare) = (lasting(&usual), lasting(&bare));
    assert!(usual.len() > 10);
    assert!(usual == bare, "the result depends on the environment");
}

/// `command` under a limit on the size of files, in blocks of 512 bytes; writing beyond it fails as on a full disk.
#[cfg(unix)]
fn limited(command: &Command, blocks: u32) -> Command {
    let mut shell = Command::new("sh");
    // Without the trap the signal of the limit would end the program.
    shell.arg("-c").arg(format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"")).arg("sh");
    shell.arg(command.get_program()).args(command.get_args());
    shell
}

#[cfg(unix)]
#[test]
fn a_full_disk_leaves_the_earlier_result_and_no_rest() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("result");
    succeed(&mut quick(&scene(), &out));
    let before = contents(&out);
    // From no byte at all to all but the last large file.
    let mut full = 0;
    for blocks in [0, 1, 4, 16, 64, 256] {
        let (code, said) = finish(&mut limited(quick(&scene(), &out).arg("--force"), blocks));
        if code == Some(0) {
            continue;
        }
        full += 1;
        assert_eq!(code, Some(5), "{blocks} blocks: {said}");
        assert!(said.contains("cannot write") && said.contains("hint: check free space"), "{said}");
        assert_eq!(names(folder.path()), ["result"], "{blocks} blocks");
        assert!(contents(&out) == before, "{blocks} blocks");
    }
    assert!(full >= 4, "only {full} limits were met");
}

#[cfg(unix)]
#[test]
fn a_full_disk_leaves_the_earlier_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let (out, whole) = (folder.path().join("result"), folder.path().join("whole"));
    succeed(&mut quick(&scene(), &whole));
    // The texture's state of 16 KB comes first and fits; what follows does not, with a larger texture.
    let mut command = quick(&scene(), &out);
    command.args(["--checkpoint", "0"]);
    let mut met = 0;
    for blocks in [8, 40, 60, 80] {
        let (code, said) = finish(&mut limited(&command, blocks));
        if code == Some(0) {
            break;
        }
        met += 1;
        assert_eq!(code, Some(5), "{said}");
        let rest = folder.path().join("result.checkpoints");
        if rest.exists() {
            assert!(names(&rest).iter().all(|n| n.ends_with(".bin")), "{:?}", names(&rest));
        }
        command = quick(&scene(), &out);
        command.args(["--checkpoint", "0", "--resume"]);
    }
    assert!(met > 0);
    succeed(quick(&scene(), &out).arg("--resume"));
    assert!(lasting(&out) == lasting(&whole));
}

#[cfg(unix)]
#[test]
fn folders_that_cannot_be_written_are_found_before_the_work() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "mine").unwrap();
    for out in [file.join("result"), PathBuf::from("/dev/full/result"), PathBuf::from("/proc/tessuto/result")]
    {
        fail(5, &mut quick(&scene(), &out), &["cannot write", "hint: "]);
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
    // Only where the user is bound by permissions.
    let closed = folder.path().join("closed");
    std::fs::create_dir(&closed).unwrap();
    std::fs::set_permissions(&closed, std::fs::Permissions::from_mode(0o555)).unwrap();
    if std::fs::write(closed.join("probe"), "").is_err() {
        fail(5, &mut quick(&scene(), &closed.join("result")), &["cannot write", "closed"]);
        assert_eq!(names(&closed), [] as [&str; 0]);
    }
    std::fs::set_permissions(&closed, std::fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn a_folder_removed_during_the_work_is_an_output_error() {
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path().join("home");
    let out = home.join("result");
    std::fs::create_dir(&home).unwrap();
    let mut command = quick(&scene(), &out);
    command.args(["--checkpoint", "0", "--set", "spacetime.iterations=40"]).stderr(Stdio::piped());
    let child = command.spawn().unwrap();
    while !home.join("result.checkpoints").exists() {
        std::thread::yield_now();
    }
    // The run may be writing there this moment.
    while home.exists() {
        let _ = std::fs::remove_dir_all(&home);
    }
    let Output { status, stderr, .. } = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&stderr);
    assert_eq!(status.code(), Some(5), "{said}");
    assert!(said.contains("cannot write") && !said.contains("panicked"), "{said}");
}

#[cfg(unix)]
#[test]
fn two_runs_do_not_share_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("result");
    let partial = folder.path().join("result.partial");
    std::fs::create_dir(&partial).unwrap();
    for name in ["theirs", ".tessuto-unfinished"] {
        std::fs::write(partial.join(name), "theirs").unwrap();
    }
    let lock = std::fs::File::open(&partial).unwrap();
    lock.lock().unwrap();
    fail(2, &mut quick(&scene(), &out), &["another run is writing", "result.partial", "hint: "]);
    assert_eq!(std::fs::read_to_string(partial.join("theirs")).unwrap(), "theirs");
    // A run that ended, however it ended, holds no lock.
    drop(lock);
    succeed(&mut quick(&scene(), &out));
    assert_eq!(names(folder.path()), ["result"]);
}

#[test]
fn tampered_results_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("result");
    succeed(&mut quick(&scene(), &out));
    for (name, from, to, fragments) in [
        ("config.json", "\"substeps\": ", "\"substeps\": 9", &["config.json", "dynamics.substeps"][..]),
        ("config.json", "\"preset\"", "\"present\"", &["config.json", "present"]),
        ("config.json", "{", "", &["config.json"]),
        ("parameters.json", "\"dynamic_parts\": 8", "\"dynamic_parts\": 0", &["parts 0"]),
        ("parameters.json", "\"width\": ", "\"width\": 9999999", &["parameters.json", "camera"]),
        ("mesh.obj", "v ", "v nan ", &["mesh.obj:", "nan"]),
        ("forces.npy", "(", "(9", &["forces.npy"]),
    ] {
        let path = out.join(name);
        let whole = std::fs::read(&path).unwrap();
        let at =
            whole.windows(from.len()).position(|w| w == from.as_bytes()).unwrap_or_else(|| panic!("{from}"));
        let mut changed = whole[..at].to_vec();
        changed.extend(to.as_bytes());
        changed.extend(&whole[at + from.len()..]);
        std::fs::write(&path, changed).unwrap();
        for command in ["simulate", "render"] {
            let before = names(&out);
            fail(3, Command::new(PROGRAM).arg(command).arg(&out), &[fragments, &["hint: "]].concat());
            assert_eq!(names(&out), before, "{command} left something");
        }
        let (code, said) = finish(Command::new(PROGRAM).arg("verify").arg(&out));
        assert_eq!(code, Some(3), "{said}");
        std::fs::write(&path, whole).unwrap();
    }
    succeed(Command::new(PROGRAM).arg("verify").arg(&out));
}

#[test]
fn a_truth_in_another_unit_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (out, other) = (folder.path().join("result"), folder.path().join("scene"));
    succeed(&mut quick(&scene(), &out));
    copy(&scene(), &other);
    let path = other.join("gt/vertices.npy");
    let mut truth = tessuto::io::npy::read_field(&path).unwrap();
    truth.iter_mut().flatten().for_each(|p| *p *= 1000.0);
    tessuto::io::npy::write_field(&path, &truth).unwrap();
    let mut command = Command::new(PROGRAM);
    fail(3, command.arg("evaluate").arg(&other).arg(&out), &["gt/vertices.npy", "times as large", "hint: "]);
}
