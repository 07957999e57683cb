//! The page of a running reconstruction, served to browsers on this machine alone. The reconstruction only leaves
//! copies of its state here; making JSON of them is the work of the server, [`http`].

mod http;

use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tessuto::session::Epoch;
use tessuto::{Positions, Result};

use crate::http::{Gate, Listener, Seat};

/// Copies of the motion are at least this far apart.
const BETWEEN_MOTIONS: Duration = Duration::from_millis(500);
/// A page that asked no longer ago than this is open.
const OPEN: Duration = Duration::from_secs(3);

/// A port that is ours, and who gets in: other users of the machine can reach it, too.
pub struct Server(Listener, Gate);

/// What the running reconstruction reports, and what the server answers.
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
        let listener = Listener::bind(port, "--live")?;
        let gate = Gate::live(listener.port);
        Ok(Self(listener, gate))
    }

    /// Where a browser finds the page, with the token.
    pub fn address(&self) -> String {
        self.0.address() + &self.1.query()
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
        let (answers, Self(listener, gate)) = (shared.clone(), self);
        let serve = move |stream, seat: &Seat| http::serve(stream, seat, &gate, &answers);
        std::thread::spawn(move || listener.serve(serve));
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

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::net::TcpStream;

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
        let address = format!("127.0.0.1:{}", server.0.port);
        assert_eq!(Server::bind(server.0.port).err().unwrap().exit_code(), 2);
        let query = server.1.query();
        let cookie = server.1.cookie();
        let mut live = server.start("<page>".to_owned());
        let stranger =
            |target: &str| get(&address, &format!("GET {target} HTTP/1.1\r\nHost: {address}\r\n\r\n"));
        for target in ["/", "/state?version=0&motion=0", "/?token=0", &format!("/state{query}")] {
            assert!(stranger(target).starts_with("HTTP/1.1 403"), "{target}");
        }
        let first = stranger(&format!("/{query}"));
        assert!(
            first.ends_with("\r\n\r\n<page>") && first.contains(&format!("Set-Cookie: {cookie}")),
            "{first}"
        );
        let own = cookie.split(';').next().unwrap();
        let as_page = |line: &str| {
            get(&address, &format!("{line} HTTP/1.1\r\nHost: {address}\r\nCookie: {own}\r\n\r\n"))
        };
        let ask = |target: &str| as_page(&format!("GET {target}"));
        assert!(ask("/").ends_with("\r\n\r\n<page>"));
        let head = as_page("HEAD /");
        assert!(
            head.starts_with("HTTP/1.1 200")
                && head.contains("Content-Length: 6\r\n")
                && head.ends_with("\r\n\r\n")
        );
        assert!(ask("/state?version=0&motion=0").starts_with("HTTP/1.1 204"));
        assert!(ask("/etc/passwd").starts_with("HTTP/1.1 404"));
        assert!(get(&address, "GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n").starts_with("HTTP/1.1 403"));
        let post = format!(
            "POST / HTTP/1.1\r\nhost: {address}\r\ncookie: {own}\r\norigin: http://{address}\r\n\r\n"
        );
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
