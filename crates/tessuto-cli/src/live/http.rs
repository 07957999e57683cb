//! The server behind the page. A handful of GET requests need no HTTP library: `/` is the page, `/state` the news as JSON.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tessuto::result;

use super::{End, Shared, lock};

/// Longest request head that is read [bytes].
const LONGEST_HEAD: usize = 16 << 10;
/// A client that says nothing for this long is left, and one that takes nothing; a page of megabytes may wait for a busy
/// browser.
const PATIENCE: [Duration; 2] = [Duration::from_secs(5), Duration::from_secs(120)];
/// Answers one request.
pub(super) fn serve(mut stream: TcpStream, port: u16, shared: &Mutex<Shared>) {
    let _ = stream.set_read_timeout(Some(PATIENCE[0]));
    let _ = stream.set_write_timeout(Some(PATIENCE[1]));
    let Some(head) = read_head(&mut stream) else { return };
    let (status, kind, body) = answer(&head, port, shared);
    let header = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {}\r\n\
         Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n",
        body.len()
    );
    // A client that has gone away is no fault.
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
