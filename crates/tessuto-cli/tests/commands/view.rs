//! `tessuto view`: which page is shown, by whom, and what is refused.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn view(home: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tessuto"));
    command.arg("view").args(arguments).current_dir(home).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    command.output().unwrap()
}

/// Makes these files, with the folders around them.
fn put(home: &Path, names: &[&str]) {
    for name in names {
        let path = home.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "<!doctype html>").unwrap();
    }
}

#[test]
fn the_page_of_a_folder_is_found() {
    let home = tempfile::tempdir().unwrap();
    put(home.path(), &["a b/report.html", "scene/masks.html", "scene/scene.json", "beside/compare.html"]);
    // A scene that a result was written into has both.
    put(home.path(), &["both/masks.html", "both/report.html"]);
    for (given, page) in [
        ("a b", "a b/report.html"),
        ("a b/", "a b/report.html"),
        ("a b/report.html", "a b/report.html"),
        ("scene", "scene/masks.html"),
        ("beside", "beside/compare.html"),
        ("both", "both/report.html"),
    ] {
        let output = view(home.path(), &[given, "--no-browser"]);
        assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), page, "{given}");
        assert!(output.status.success() && output.stderr.is_empty(), "{given}");
    }
}

#[test]
fn what_is_no_result_is_refused_with_the_way_out() {
    let home = tempfile::tempdir().unwrap();
    put(
        home.path(),
        &["it's a scene/scene.json", "bare/motion.npy", "bare/parameters.json", "other/notes.html"],
    );
    fs::create_dir_all(home.path().join("run.partial")).unwrap();
    for (given, parts) in [
        ("it's a scene", [r"is a scene", r"tessuto reconstruct 'it'\''s a scene' --out RESULT"]),
        ("bare", ["is a result without its page", "tessuto report bare"]),
        ("other", ["other: is not a result", "tessuto reconstruct"]),
        ("other/notes.html", ["is not a page of tessuto", "report.html"]),
        ("run", ["is not finished", "--resume"]),
        ("nothing", ["nothing: there is no such folder or file", "tessuto reconstruct"]),
    ] {
        let output = view(home.path(), &[given]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{given}: {told}");
        assert!(parts.iter().all(|part| told.contains(part)), "{given}: {told}");
        assert!(output.stdout.is_empty());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn the_browser_gets_the_whole_path_and_its_lack_is_said() {
    use std::os::unix::fs::PermissionsExt as _;

    let home = tempfile::tempdir().unwrap();
    put(home.path(), &["-a b/report.html"]);
    let output = view(home.path(), &["--", "-a b"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && told.contains("there is no browser"), "{told}");

    let (opener, log) = (home.path().join("xdg-open"), home.path().join("opened"));
    fs::write(&opener, "#!/bin/sh\nprintf '%s|' \"$@\" > opened.part && mv opened.part opened\n").unwrap();
    fs::set_permissions(&opener, fs::Permissions::from_mode(0o755)).unwrap();
    let path = std::env::join_paths([home.path(), Path::new("/usr/bin"), Path::new("/bin")]).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_tessuto"));
    command.args(["view", "--", "-a b"]).current_dir(home.path()).env("DISPLAY", ":0").env("PATH", path);
    let output = command.output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty());
    let end = std::time::Instant::now() + std::time::Duration::from_secs(20);
    while !log.exists() {
        assert!(std::time::Instant::now() < end, "nothing was opened");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let page = home.path().canonicalize().unwrap().join("-a b/report.html");
    assert_eq!(fs::read_to_string(log).unwrap(), format!("{}|", page.display()));
}
