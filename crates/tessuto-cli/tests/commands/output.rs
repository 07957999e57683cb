//! What is said goes where it should: readers that have gone, full disks, and the help.

use std::io::pipe;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn tessuto(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tessuto"));
    command.args(arguments);
    command
}

/// Runs with a standard output that nobody reads any more.
fn unread(arguments: &[&str]) -> Output {
    let (reader, writer) = pipe().unwrap();
    drop(reader);
    tessuto(arguments).stdout(writer).output().unwrap()
}

/// Runs with a standard output on a full disk.
#[cfg(target_os = "linux")]
fn on_a_full_disk(arguments: &[&str]) -> Output {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    tessuto(arguments).stdout(full).output().unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A small scene, and a result of it.
fn scene_and_result(folder: &Path) -> (String, String) {
    let (scene, result) = (folder.join("scene"), folder.join("result"));
    let synth = unread(&["synth", text(&scene), "--frames", "3", "--size", "64", "--grid", "7x7"]);
    assert_eq!(synth.status.code(), Some(0), "{}", String::from_utf8_lossy(&synth.stderr));
    let settings = ["--no-appearance", "--set", "texture.size=32", "--set", "texture.epochs=20"];
    let run = unread(&[&["reconstruct", text(&scene), "--out", text(&result)], &settings[..]].concat());
    assert_eq!(run.status.code(), Some(0), "{}", String::from_utf8_lossy(&run.stderr));
    (text(&scene).to_owned(), text(&result).to_owned())
}

#[test]
fn a_reader_that_has_gone_is_no_fault_and_a_full_disk_is() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, result) = scene_and_result(folder.path());
    let npy = folder.path().join("simulated.npy");
    let commands: [&[&str]; 11] = [
        &["--help"],
        &["reconstruct", "--help"],
        &["--version"],
        &["check", &scene],
        &["report", &result],
        &["render", &result, "--look", "depth", "--size", "32x32", "--force"],
        &["export", &result, "--to", "npz", "--force"],
        &["evaluate", &scene, &result],
        &["simulate", &result, "--out", text(&npy), "--force"],
        &["verify", &result],
        &["settings"],
    ];
    for arguments in commands {
        let output = unread(arguments);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {errors}");
        #[cfg(target_os = "linux")]
        {
            let output = on_a_full_disk(arguments);
            let errors = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(5), "{arguments:?}: {errors}");
            let said = arguments[0].starts_with("--") || arguments.contains(&"--help");
            assert!(said || errors.contains("standard output"), "{arguments:?}: {errors}");
        }
    }
}

#[test]
fn an_unread_complaint_does_not_change_the_status() {
    let (reader, writer) = pipe().unwrap();
    drop(reader);
    let status = tessuto(&["check", "no/such/scene"]).stdout(Stdio::null()).stderr(writer).status().unwrap();
    assert_eq!(status.code(), Some(3));
}

#[test]
fn help_lists_the_commands_in_the_order_of_the_work() {
    let output = tessuto(&["--help"]).output().unwrap();
    let help = String::from_utf8(output.stdout).unwrap();
    let commands = help.split("Commands:\n").nth(1).unwrap().split("\n\n").next().unwrap();
    let names: Vec<&str> = commands
        .lines()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    let order = [
        "studio",
        "frames",
        "import",
        "masks",
        "template",
        "check",
        "reconstruct",
        "appearance",
        "view",
        "report",
        "render",
        "export",
        "evaluate",
        "compare",
        "simulate",
        "forecast",
        "fabric",
        "verify",
        "settings",
        "synth",
        "demo",
        "completions",
        #[cfg(feature = "man")]
        "man",
        "help",
    ];
    assert_eq!(names, order);
    let words: Vec<&str> = help.split_whitespace().collect();
    assert!(words.join(" ").ends_with("and the result says so."), "{help}");
}

/// `println!` panics where nobody reads.
#[test]
fn only_one_module_writes_to_the_terminal() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut folders = vec![folder];
    let mut files = 0;
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            files += 1;
            let source = std::fs::read_to_string(&path).unwrap();
            for word in ["print!(", "println!(", "dbg!(", "stdout()", "stderr().lock"] {
                let allowed = path.ends_with("say.rs");
                assert!(allowed || !source.contains(word), "{}: {word}, use say! or aside!", path.display());
            }
        }
    }
    assert!(files > 10, "only {files} files");
}
