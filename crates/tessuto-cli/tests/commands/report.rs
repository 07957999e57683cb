//! The report page of a result, and the page of a run that goes on.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Stdio};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tessuto");
const QUICK: [&str; 8] = [
    "--set",
    "texture.size=64",
    "--set",
    "appearance.steps=4",
    "--set",
    "appearance.map_size=32",
    "--set",
    "appearance.batch=500",
];

fn succeed(arguments: &[&str]) {
    let output = Command::new(PROGRAM).args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn make_scene(path: &Path) {
    succeed(&["synth", text(path), "--frames", "6", "--size", "96", "--grid", "9x9", "--seed", "4"]);
}

#[test]
fn page_is_made_from_the_result_alone_and_gains_the_maps() {
    let folder = tempfile::tempdir().unwrap();
    let [scene, result, moved] = ["scene", "it's a result", "moved"].map(|n| folder.path().join(n));
    make_scene(&scene);
    let mut arguments = vec!["reconstruct", text(&scene), "--out", text(&result), "--no-appearance"];
    arguments.extend(&QUICK[..2]);
    succeed(&arguments);
    let page = || std::fs::read_to_string(result.join("report.html")).unwrap();
    let first = page();
    assert!(first.contains(r#"id="map-texture""#) && !first.contains(r#"id="map-roughness""#));
    for part in [
        r#""key":"vertex_error""#,
        r#""key":"deviation""#,
        r#""key":"force""#,
        r#""key":"observed""#,
        "--no-appearance",
        "refine",
    ] {
        assert!(first.contains(part), "{part} is missing");
    }

    let mut arguments = vec!["appearance", text(&scene), text(&result)];
    arguments.extend(&QUICK[2..]);
    succeed(&arguments);
    let second = page();
    for part in [
        r#"id="map-roughness""#,
        r#""radiance":""#,
        r#""key":"rerendered""#,
        "Colours, PSNR",
        "colours re-rendered",
        "material and light",
    ] {
        assert!(second.contains(part), "{part} is missing");
    }
    let quoted = r"it&#39;\&#39;&#39;s a result&#39; --set appearance.steps=4";
    assert!(second.contains("tessuto appearance ") && second.contains(quoted));

    // Anew, byte for byte, without the scene and from another place, once what was lost is back.
    std::fs::remove_file(result.join("report.html")).unwrap();
    std::fs::rename(&result, &moved).unwrap();
    std::fs::rename(&scene, folder.path().join("gone")).unwrap();
    succeed(&["report", text(&moved)]);
    let third = std::fs::read_to_string(moved.join("report.html")).unwrap();
    assert!(third == second);
}

/// Body of the answer to a GET request with the cookie of the page; None for an answer without one.
fn get(address: &str, token: &str, target: &str) -> Option<String> {
    let mut stream = TcpStream::connect(address).ok()?;
    let port = address.rsplit(':').next()?;
    let cookie = format!("Cookie: tessuto-live-{port}={token}\r\n");
    write!(stream, "GET {target} HTTP/1.1\r\nHost: {address}\r\n{cookie}\r\n").ok()?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer).ok()?;
    let (head, body) = answer.split_once("\r\n\r\n")?;
    head.starts_with("HTTP/1.1 200").then(|| body.to_owned())
}

#[test]
fn watching_a_run_changes_none_of_its_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let [scene, watched, alone] = ["scene", "watched", "alone"].map(|n| folder.path().join(n));
    make_scene(&scene);
    let mut run = Command::new(PROGRAM)
        .args(["reconstruct", text(&scene), "--out", text(&watched), "--no-appearance", "--live"])
        .args(&QUICK[..2])
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(run.stderr.take().unwrap()).lines().map_while(Result::ok);
    let line = lines.find(|l| l.starts_with("live at ")).expect("the address");
    let (address, token) =
        line.trim_start_matches("live at http://").split_once("/?token=").expect("a token");
    let (address, token) = (address.to_owned(), token.trim().to_owned());
    let drain = std::thread::spawn(move || lines.count());
    // Who has no token, such as another user of the machine, sees nothing.
    for target in ["/", "/state?version=0&motion=0"] {
        assert!(get(&address, "0", target).is_none(), "{target}");
    }
    let get = |address: &str, target: &str| get(address, &token, target);
    let page = get(&address, "/").expect("the page");
    assert!(page.contains(r#""live":true"#) && page.contains("connect-src 'self'"));
    // Ask as the page does, until the report is there.
    let (mut motions, mut stages, mut report) = (0, std::collections::BTreeSet::new(), None);
    let mut known = (String::from("0"), String::from("0"));
    while run.try_wait().unwrap().is_none() {
        if let Some(news) = get(&address, &format!("/state?version={}&motion={}", known.0, known.1)) {
            let news: serde_json::Value = serde_json::from_str(&news).unwrap();
            known = (news["version"].to_string(), news["motion"].to_string());
            motions += usize::from(news["state"]["motion"].is_object());
            stages.extend(news["state"]["stage"].as_str().map(str::to_owned));
            if news["finished"] == true {
                report = get(&address, "/");
                break;
            }
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert!(run.wait().unwrap().success());
    drain.join().unwrap();
    assert!(motions > 0, "no motion was seen, stages {stages:?}");
    assert!(stages.contains("refine"), "{stages:?}");
    assert!(report.expect("the report") == std::fs::read_to_string(watched.join("report.html")).unwrap());

    let mut arguments = vec!["reconstruct", text(&scene), "--out", text(&alone), "--no-appearance"];
    arguments.extend(&QUICK[..2]);
    succeed(&arguments);
    for name in ["motion.npy", "forces.npy", "parameters.json", "texture.png", "history.csv"] {
        let bytes = |result: &Path| std::fs::read(result.join(name)).unwrap();
        assert!(bytes(&watched) == bytes(&alone), "{name}");
    }
}
