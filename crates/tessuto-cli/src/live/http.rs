//! The server behind the page: `/` is the page, `/state` the news as JSON.

use std::net::TcpStream;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use tessuto::result;

use super::{End, Shared, lock};
use crate::http::{Gate, Request, Response, Seat};

/// Answers one request.
pub(super) fn serve(mut stream: TcpStream, seat: &Seat, gate: &Gate, shared: &Mutex<Shared>) {
    let Some(request) = Request::read(&mut stream) else { return };
    let (response, page) = match gate.check(&request) {
        Err(refusal) => (refusal, None),
        Ok(()) => {
            seat.keep();
            let (response, page) = answer(&request, shared);
            (response.with("Set-Cookie", gate.cookie()), page)
        }
    };
    let page = page.filter(|_| request.method == "GET");
    // The address holds the token, and other sites need nothing from here.
    let response =
        response.with("Referrer-Policy", "no-referrer").with("Cross-Origin-Resource-Policy", "same-origin");
    let response = response.to(&request);
    // A client that has gone away is no fault.
    let sent = response.send(&mut stream);
    let mut shared = lock(shared);
    let newest = page.is_some_and(|page| Arc::ptr_eq(&shared.page, &page));
    if sent.is_ok() && shared.end == Some(End::Finished) && newest {
        shared.end = Some(End::Fetched);
    }
}

/// The answer, and the page if it is that.
fn answer(request: &Request, shared: &Mutex<Shared>) -> (Response, Option<Arc<String>>) {
    if !["GET", "HEAD"].contains(&request.method.as_str()) {
        return (Response::plain("405 Method Not Allowed", "only GET\n"), None);
    }
    let response = match request.path.as_str() {
        "/" => {
            let mut shared = lock(shared);
            shared.last_request = Some(Instant::now());
            let page = shared.page.clone();
            return (Response::page(page.clone()), Some(page));
        }
        "/state" => match state(request, shared) {
            Some(json) => Response::json(json),
            None => Response::plain("204 No Content", ""),
        },
        _ => Response::plain("404 Not Found", "there is / and /state\n"),
    };
    (response, None)
}

/// What is new since the versions that the client names; None if nothing is.
fn state(request: &Request, shared: &Mutex<Shared>) -> Option<String> {
    let known = |key: &str| -> usize { request.query(key).and_then(|v| v.parse().ok()).unwrap_or(0) };
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
