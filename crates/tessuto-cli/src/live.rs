//! The page of a running reconstruction, served to browsers on this machine alone.
//!
//! A handful of GET requests need no HTTP library: `/` is the page, `/state` its latest state as JSON. The reconstruction only
//! leaves copies of its state here; making JSON of them is the server's work.

use std::io::{Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tessuto::session::Epoch;
use tessuto::{Error, Positions, Result, result};

/// Longest request head that is read [bytes].
const LONGEST_HEAD: usize = 16 << 10;
/// A client that says nothing for this long is left, and one that takes nothing; a page of megabytes may wait for a busy
/// browser.
const PATIENCE: [Duration; 2] = [Duration::from_secs(5), Duration::from_secs(120)];
/// Copies of the motion are at least this far apart.
const BETWEEN_MOTIONS: Duration = Duration::from_millis(500);
/// A page that asked no longer ago than this is open.
const OPEN: Duration = Duration::from_secs(3);

/// A port that is ours.
pub struct Server {
    listener: TcpListener,
    port: u16,
}

/// What the running reconstruction tells, and what the server answers.
pub struct Live {
    shared: Arc<Mutex<Shared>>,
    last_motion: Option<Instant>,
}

struct Shared {
    page: Arc<String>,
    epochs: Vec<Epoch>,
    motion: Option<Arc<Vec<Positions>>>,
    /// Counts the motions.
    motion_version: usize,
    end: Option<End>,
    last_request: Option<Instant>,
}

#[derive(Clone, Copy, PartialEq)]
enum End {
    /// `page` is the report.
    Finished,
    /// The report was fetched.
    Fetched,
    /// There is none.
    Failed,
}

impl Server {
    /// Takes `port` of 127.0.0.1; 0 is any free one.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is taken.
    pub fn bind(port: u16) -> Result<Self> {
        let bound = TcpListener::bind((Ipv4Addr::LOCALHOST, port))
            .and_then(|listener| Ok(Self { port: listener.local_addr()?.port(), listener }));
        bound.map_err(|e| {
            Error::usage(format!("--live {port}: {e}"), "choose another port, or leave it out for a free one")
        })
    }

    /// Where a browser finds the page.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// Serves `page` and the state that the reconstruction leaves, until the program ends.
    pub fn start(self, page: String) -> Live {
        let shared = Arc::new(Mutex::new(Shared {
            page: Arc::new(page),
            epochs: Vec::new(),
            motion: None,
            motion_version: 0,
            end: None,
            last_request: None,
        }));
        let answers = shared.clone();
        std::thread::spawn(move || {
            for stream in self.listener.incoming().flatten() {
                let (shared, port) = (answers.clone(), self.port);
                // Browsers open connections that they use later or never, so each waits on its own.
                std::thread::spawn(move || serve(stream, port, &shared));
            }
        });
        Live { shared, last_motion: None }
    }
}

fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Live {
    /// Records a finished step; the motion is copied now and then only, and at the end of a stage.
    pub fn step(&mut self, epoch: &Epoch, motion: &[Positions]) {
        let due = self.last_motion.is_none_or(|t| t.elapsed() > BETWEEN_MOTIONS) || epoch.step == epoch.of;
        let copy = (due && !motion.is_empty()).then(|| Arc::new(motion.to_vec()));
        let mut shared = lock(&self.shared);
        shared.epochs.push(epoch.clone());
        if copy.is_some() {
            self.last_motion = Some(Instant::now());
            shared.motion = copy;
            shared.motion_version += 1;
        }
    }

    /// The work is done: open pages get `report`, and a moment to fetch it.
    pub fn finish(self, report: &Path) {
        let text = std::fs::read_to_string(report);
        {
            let mut shared = lock(&self.shared);
            shared.end = Some(if text.is_ok() { End::Finished } else { End::Failed });
            shared.page = text.map_or_else(|_| shared.page.clone(), Arc::new);
        }
        self.wait_for_pages();
    }

    /// Until open pages know of the end.
    fn wait_for_pages(&self) {
        let started = Instant::now();
        while started.elapsed() < OPEN {
            let shared = lock(&self.shared);
            let open = shared.last_request.is_some_and(|t| t.elapsed() < OPEN);
            if !open || shared.end == Some(End::Fetched) {
                break;
            }
            drop(shared);
            std::thread::sleep(Duration::from_millis(50));
        }
        // The last answer is on its way.
        std::thread::sleep(Duration::from_millis(100));
    }
}

fn serve(mut stream: TcpStream, port: u16, shared: &Mutex<Shared>) {
    let _ = stream.set_read_timeout(Some(PATIENCE[0]));
    let _ = stream.set_write_timeout(Some(PATIENCE[1]));
    let Some(head) = read_head(&mut stream) else { return };
    let (status, kind, body) = answer(&head, port, shared);
    let header = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {}\r\n\
         Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n",
        body.len()
    );
    // A client that has gone away is not a fault.
    let sent = stream.write_all(header.as_bytes()).and_then(|()| stream.write_all(body.as_bytes()));
    let mut shared = lock(shared);
    if sent.is_ok() && shared.end == Some(End::Finished) && Arc::ptr_eq(&shared.page, &body) {
        shared.end = Some(End::Fetched);
    }
}

/// The request line and the headers.
fn read_head(stream: &mut TcpStream) -> Option<String> {
    let (mut head, mut buffer) = (Vec::new(), [0; 2048]);
    while !head.windows(4).any(|w| w == b"\r\n\r\n") {
        let count = stream.read(&mut buffer).ok().filter(|n| *n > 0)?;
        head.extend_from_slice(&buffer[..count]);
        if head.len() > LONGEST_HEAD {
            return None;
        }
    }
    String::from_utf8(head).ok()
}

/// Status, type and body for a request.
fn answer(head: &str, port: u16, shared: &Mutex<Shared>) -> (&'static str, &'static str, Arc<String>) {
    let plain = |status, text: &str| (status, "text/plain", Arc::new(text.to_owned()));
    let mut lines = head.lines();
    let mut words = lines.next().unwrap_or_default().split(' ');
    let (method, target) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    // Pages of other sites reach this server under names of their own; they get nothing.
    let host = lines.filter_map(|l| l.split_once(':')).find(|(name, _)| name.eq_ignore_ascii_case("host"));
    let ours = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    if !host.is_some_and(|(_, value)| ours.iter().any(|o| o == value.trim())) {
        return plain("403 Forbidden", "only as 127.0.0.1 or localhost\n");
    }
    if method != "GET" {
        return plain("405 Method Not Allowed", "only GET\n");
    }
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    match path {
        "/" => {
            let mut shared = lock(shared);
            shared.last_request = Some(Instant::now());
            ("200 OK", "text/html", shared.page.clone())
        }
        "/state" => match state(query, shared) {
            Some(json) => ("200 OK", "application/json", Arc::new(json)),
            None => plain("204 No Content", ""),
        },
        _ => plain("404 Not Found", "there is / and /state\n"),
    }
}

/// What is new since the versions that the client names; None if nothing is.
fn state(query: &str, shared: &Mutex<Shared>) -> Option<String> {
    let known = |key: &str| -> usize {
        let value = query.split('&').filter_map(|p| p.split_once('=')).find(|(k, _)| *k == key);
        value.and_then(|(_, v)| v.parse().ok()).unwrap_or(0)
    };
    let (epochs, motion, motion_version, end) = {
        let mut shared = lock(shared);
        shared.last_request = Some(Instant::now());
        if known("version") == shared.epochs.len() && shared.end.is_none() {
            return None;
        }
        (shared.epochs.clone(), shared.motion.clone(), shared.motion_version, shared.end)
    };
    let motion = motion.filter(|_| known("motion") != motion_version);
    Some(format!(
        r#"{{"version":{},"motion":{motion_version},"ended":{},"finished":{},"state":{}}}"#,
        epochs.len(),
        end.is_some(),
        matches!(end, Some(End::Finished | End::Fetched)),
        result::live_state(&epochs, motion.as_ref().map(|m| &m[..]))
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto::session::named;

    fn get(address: &str, request: &str) -> String {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn only_this_machine_gets_news_and_each_motion_once() {
        let server = Server::bind(0).unwrap();
        let address = format!("127.0.0.1:{}", server.port);
        assert_eq!(Server::bind(server.port).err().unwrap().exit_code(), 2);
        let mut live = server.start("<page>".to_owned());
        let ask = |target: &str| get(&address, &format!("GET {target} HTTP/1.1\r\nHost: {address}\r\n\r\n"));
        assert!(ask("/").ends_with("\r\n\r\n<page>"));
        assert!(ask("/state?version=0&motion=0").starts_with("HTTP/1.1 204"));
        assert!(ask("/etc/passwd").starts_with("HTTP/1.1 404"));
        assert!(get(&address, "GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n").starts_with("HTTP/1.1 403"));
        let post = format!("POST / HTTP/1.1\r\nhost: {address}\r\n\r\n");
        assert!(get(&address, &post).starts_with("HTTP/1.1 405"));

        let epoch = Epoch {
            stage: "track".into(),
            step: 1,
            of: 9,
            losses: named([("total", 0.5)]),
            ..Epoch::default()
        };
        live.step(&epoch, &[Positions::from([Default::default(); 4])]);
        let news = ask("/state?version=0&motion=0");
        assert!(news.contains(r#""version":1,"motion":1,"ended":false"#), "{news}");
        assert!(news.contains(r#""stage":"track""#) && news.contains(r#""steps":""#), "{news}");
        live.step(&Epoch { step: 2, ..epoch }, &[]);
        assert!(ask("/state?version=1&motion=1").contains(r#""motion":null"#));

        let folder = tempfile::tempdir().unwrap();
        let report = folder.path().join("report.html");
        std::fs::write(&report, "<report>").unwrap();
        let finishing = std::thread::spawn(move || live.finish(&report));
        while !ask("/state?version=2&motion=1").contains(r#""finished":true"#) {}
        assert!(ask("/").ends_with("<report>"));
        finishing.join().unwrap();
    }
}
