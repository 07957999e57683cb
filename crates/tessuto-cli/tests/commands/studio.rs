//! The server of `tessuto studio`, asked as strangers and as its own page ask it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tessuto");

/// A running studio; it ends with the value.
struct Studio {
    child: Child,
    port: u16,
    token: String,
}

impl Drop for Studio {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Studio {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        let mut child = Command::new(PROGRAM)
            .args(["studio", "--no-browser", "--dir"])
            .arg(folder)
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map_while(Result::ok);
        let line = lines.find(|l| l.contains("?token=")).expect("the address");
        let (address, token) =
            line.trim().trim_start_matches("at http://127.0.0.1:").split_once("/?token=").unwrap();
        Self { child, port: address.parse().unwrap(), token: token.to_owned() }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream
    }

    /// Head and body of the answer to a request with these headers; empty if the connection is closed without one.
    fn raw(&self, line: &str, headers: &str, body: &str) -> (String, String) {
        let mut stream = self.connect();
        let headers = headers.replace("PORT", &self.port.to_string()).replace("TOKEN", &self.token);
        let length =
            if body.is_empty() { String::new() } else { format!("Content-Length: {}\r\n", body.len()) };
        let _ = write!(stream, "{line} HTTP/1.1\r\n{headers}{length}\r\n{body}");
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8_lossy(&answer).into_owned();
        answer.split_once("\r\n\r\n").map(|(h, b)| (h.to_owned(), b.to_owned())).unwrap_or_default()
    }

    /// As the page asks: status and body.
    fn ask(&self, line: &str, body: &str) -> (u16, String) {
        let (head, body) = self.raw(line, OURS, body);
        (head.split(' ').nth(1).and_then(|s| s.parse().ok()).unwrap_or(0), body)
    }

    fn state(&self, work: &str) -> Value {
        let (status, body) = self.ask(&format!("GET /api/state?work={work}"), "");
        assert_eq!(status, 200, "{body}");
        serde_json::from_str(&body).unwrap()
    }
}

const HOST: &str = "Host: 127.0.0.1:PORT\r\n";
const OURS: &str = "Host: 127.0.0.1:PORT\r\nCookie: tessuto-studio-PORT=TOKEN\r\nOrigin: http://127.0.0.1:PORT\r\n\
                    Sec-Fetch-Site: same-origin\r\nContent-Type: application/json\r\n";

#[test]
fn only_its_own_page_gets_anything() {
    let folder = tempfile::tempdir().unwrap();
    let studio = Studio::start(folder.path(), &[]);
    // Loopback alone: the machine's other addresses are not served.
    let other =
        Command::new("hostname").arg("-I").output().ok().and_then(|o| String::from_utf8(o.stdout).ok());
    for address in other.unwrap_or_default().split_whitespace().filter(|a| a.contains('.')) {
        assert!(TcpStream::connect((address, studio.port)).is_err(), "{address}");
    }
    let (head, page) = studio.raw(&format!("GET /?token={}", studio.token), HOST, "");
    assert!(head.starts_with("HTTP/1.1 200") && page.contains("<title>"), "{head}");
    for part in [
        "HttpOnly; SameSite=Strict",
        "frame-ancestors 'none'",
        "no-referrer",
        "nosniff",
        "no-store",
        "same-origin",
    ] {
        assert!(head.contains(part), "{part}: {head}");
    }
    assert_eq!(studio.ask("GET /api/state", "").0, 200);
    let change = |from: &str, to: &str| OURS.replace(from, to);
    for headers in [
        HOST.to_owned(),
        change("TOKEN", "00"),
        change("Host: 127.0.0.1:PORT", "Host: evil.example"),
        change("http://127.0.0.1:PORT", "http://evil.example"),
        change("http://127.0.0.1:PORT", "null"),
        change("same-origin", "cross-site"),
        change("same-origin", "same-site"),
    ] {
        for line in [
            "GET /",
            "GET /api/state",
            "GET /main.js",
            "GET /file/a",
            "POST /api/stop",
            "PUT /api/upload?name=a.mp4",
        ] {
            let (head, _) = studio.raw(line, &headers, if line.starts_with("GET") { "" } else { "{}" });
            assert!(head.starts_with("HTTP/1.1 403"), "{line} {headers}: {head}");
        }
    }
    assert!(folder.path().read_dir().unwrap().next().is_none());
    // A form of another site has this type.
    let (head, _) =
        studio.raw("POST /api/open", &change("application/json", "text/plain"), r#"{"name":"a"}"#);
    assert!(head.starts_with("HTTP/1.1 415"), "{head}");
    // Nor is anything stopped by one.
    let (head, _) = studio.raw("POST /api/stop", &change("application/json", "text/plain"), "{}");
    assert!(head.starts_with("HTTP/1.1 415"), "{head}");
    assert_eq!(studio.ask("POST /api/stop", "{}").0, 200);
    assert_eq!(studio.ask("DELETE /api/state", "").0, 405);
    // The head alone, of what may be read.
    for target in ["/", "/api/state", "/main.js"] {
        let (head, body) = studio.raw(&format!("HEAD {target}"), OURS, "");
        assert!(head.starts_with("HTTP/1.1 200") && body.is_empty(), "{target}: {head} {body}");
        let length = head.split("Content-Length: ").nth(1).unwrap().split("\r\n").next().unwrap();
        assert_eq!(studio.ask(&format!("GET {target}"), "").1.len().to_string(), length, "{target}");
    }
    assert_eq!(studio.ask("HEAD /api/run", "").0, 404);
    assert!(studio.raw("HEAD /api/state", HOST, "").0.starts_with("HTTP/1.1 403"));
    assert_eq!(studio.ask("POST /api/open", &" ".repeat(300_000)).0, 413);
}

#[test]
fn nothing_outside_of_the_project_is_read_or_written() {
    let around = tempfile::tempdir().unwrap();
    let folder = around.path().join("project");
    std::fs::create_dir_all(folder.join("scenes")).unwrap();
    std::fs::write(around.path().join("secret.txt"), "secret").unwrap();
    std::fs::write(folder.join("mine.txt"), "mine").unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(around.path(), folder.join("link")).unwrap();
    let studio = Studio::start(&folder, &[]);
    assert_eq!(studio.ask("GET /file/mine.txt", ""), (200, "mine".to_owned()));
    let absolute = around.path().join("secret.txt").display().to_string();
    for name in [
        "../secret.txt",
        "%2e%2e/secret.txt",
        "scenes/..%2f..%2fsecret.txt",
        "link/secret.txt",
        &absolute,
        "%00",
    ] {
        let (status, body) = studio.ask(&format!("GET /file/{name}"), "");
        assert!(status == 404 && !body.contains("secret\n"), "{name}: {status} {body}");
    }
    for work in ["../x", "link/x", "/tmp/x", "a/../../x"] {
        let (status, body) = studio.ask(&format!("POST /api/save?work={work}"), "{}");
        assert_eq!(status, 400, "{work}: {body}");
        assert_eq!(studio.ask(&format!("GET /api/state?work={work}"), "").0, 400, "{work}");
    }
    for name in ["../a.mp4", "link%2fa.mp4", "a.sh"] {
        assert_eq!(studio.ask(&format!("PUT /api/upload?name={name}"), "abc").0, 400, "{name}");
    }
    // Names longer than files may have are the page's fault, and a message does not tell where the project is.
    let root = folder.canonicalize().unwrap().display().to_string();
    let long = "a".repeat(300);
    for (line, body) in [
        (format!("PUT /api/upload?name={long}.mp4"), "abc".to_owned()),
        (format!("POST /api/save?work=scenes/{long}"), "{}".to_owned()),
        (format!("POST /api/run?work={long}"), r#"{"step":"preview"}"#.to_owned()),
        ("POST /api/open".to_owned(), json!({ "name": format!("scenes/{long}") }).to_string()),
        (format!("PUT /api/upload?name={}.mp4", &long[..240]), "abc".to_owned()),
        (format!("POST /api/save?work=scenes/{}", &long[..250]), "{}".to_owned()),
    ] {
        let (status, said) = studio.ask(&line, &body);
        assert!(status == 400 && !said.contains(&root), "{line}: {status} {said}");
    }
    let form = json!({ "clip": "../secret.mp4" }).to_string();
    assert_eq!(studio.ask("POST /api/save?work=scenes/a", &form).0, 400);
    assert_eq!(around.path().read_dir().unwrap().count(), 2);
    // A page in the folder is a stranger to the studio.
    std::fs::write(folder.join("page.html"), "<script></script>").unwrap();
    let (head, _) = studio.raw("GET /file/page.html", OURS, "");
    assert!(head.contains("Content-Security-Policy: sandbox allow-scripts"), "{head}");
    // And a folder elsewhere is not begun with.
    let said = Command::new(PROGRAM)
        .args(["studio", "--no-browser", "--dir"])
        .arg(&folder)
        .arg(&absolute)
        .output()
        .unwrap();
    assert!(said.status.code() == Some(3) && String::from_utf8_lossy(&said.stderr).contains("--dir"));
}

#[test]
fn connections_that_say_nothing_keep_nobody_out() {
    let folder = tempfile::tempdir().unwrap();
    let studio = Studio::start(folder.path(), &[]);
    let mut silent = Vec::new();
    // Again and again: silent ones, such as have asked for what they do not get and stay, and heads that never end.
    for round in 0..5 {
        silent.extend((0..60).map(|_| studio.connect()));
        for line in ["GET / HTTP/1.1\r\nHost: a\r\n\r\n", "GET / HTTP/1.1\r\nHost: "] {
            let mut stream = studio.connect();
            write!(stream, "{line}").unwrap();
            silent.push(stream);
        }
        let started = Instant::now();
        assert_eq!(studio.ask("GET /api/state", "").0, 200, "round {round}");
        assert!(started.elapsed() < Duration::from_secs(3), "round {round}: {:?}", started.elapsed());
    }
    // One that the gate let pass is not closed for others.
    let mut own = studio.connect();
    let head = OURS.replace("PORT", &studio.port.to_string()).replace("TOKEN", &studio.token);
    let form = r#"{"name":"nothing.mp4"}"#;
    write!(own, "POST /api/open HTTP/1.1\r\n{head}Content-Length: {}\r\n\r\n", form.len()).unwrap();
    std::thread::sleep(Duration::from_millis(300));
    silent.extend((0..60).map(|_| studio.connect()));
    std::thread::sleep(Duration::from_millis(300));
    own.write_all(form.as_bytes()).unwrap();
    let mut said = String::new();
    own.read_to_string(&mut said).unwrap();
    assert!(said.contains("nothing.mp4 does not exist"), "{said}");
    drop(silent);
    // An upload that breaks off leaves nothing.
    let mut stream = studio.connect();
    let head = OURS.replace("PORT", &studio.port.to_string()).replace("TOKEN", &studio.token);
    write!(stream, "PUT /api/upload?name=a.mp4 HTTP/1.1\r\n{head}Content-Length: 1000\r\n\r\nabc").unwrap();
    let mut said = String::new();
    stream.read_to_string(&mut said).unwrap();
    assert!(said.starts_with("HTTP/1.1 408"), "{said}");
    assert_eq!(folder.path().join("clips").read_dir().unwrap().count(), 0);
}

#[test]
fn all_state_is_on_disk_and_commands_are_children_without_a_shell() {
    let folder = tempfile::tempdir().unwrap();
    let clip = "a; touch gone.mp4";
    let work = {
        let studio = Studio::start(folder.path(), &[]);
        let (status, said) = studio.ask("PUT /api/upload?name=a;%20touch%20gone.mp4", "no video");
        assert_eq!(status, 200, "{said}");
        let name = json!({ "name": format!("clips/{clip}") }).to_string();
        let (status, said) = studio.ask("POST /api/open", &name);
        assert_eq!(status, 200, "{said}");
        let said: Value = serde_json::from_str(&said).unwrap();
        let work = said["work"].as_str().unwrap().to_owned();
        let mut form = studio.state(&work)["work"]["form"].clone();
        form["size"] = json!([0.5, 0.25]);
        form["shape"] = json!("other");
        form["outline"] = json!([{ "x": 1.5, "y": 2.0, "corner": false, "measured": true }]);
        form["distance"] = json!(0.62);
        assert_eq!(studio.ask(&format!("POST /api/save?work={work}"), &form.to_string()).0, 200);
        assert_eq!(studio.ask(&format!("POST /api/run?work={work}"), r#"{"step":"preview"}"#).0, 200);
        let started = Instant::now();
        while studio.state(&work)["work"]["job"]["running"] == true {
            assert!(started.elapsed() < Duration::from_secs(20));
            std::thread::sleep(Duration::from_millis(50));
        }
        work
        // Killed here.
    };
    let studio = Studio::start(folder.path(), &[&work]);
    let state = studio.state(&work);
    assert_eq!(state["start"], work.as_str());
    let (work, job) = (&state["work"], &state["work"]["job"]);
    assert_eq!(work["form"]["size"], json!([0.5, 0.25]));
    let entered = ["shape", "distance"].map(|name| &work["form"][name]);
    assert_eq!(entered, [&json!("other"), &json!(0.62)]);
    assert_eq!(work["form"]["outline"][0]["measured"], true);
    assert_eq!((job["step"].as_str(), job["ended"].as_str()), (Some("preview"), Some("failed")));
    let quoted = "tessuto frames 'clips/a; touch gone.mp4'";
    assert!(job["command"].as_str().unwrap().starts_with(quoted), "{job}");
    assert!(job["error"].as_str().unwrap().contains("ffmpeg"), "{job}");
    assert!(!folder.path().join("gone.mp4").exists() && !folder.path().join("clips/gone.mp4").exists());
}
