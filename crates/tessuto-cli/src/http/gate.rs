//! Who gets in: pages of this server that carry its token, and nobody else. Other programs of the machine can reach the
//! port, and any site that the user visits can make the browser send requests to it.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher as _, Hasher as _};

use super::{Request, Response};

/// What a request is measured against.
pub struct Gate {
    /// What printed the address: `studio` or `live`.
    door: &'static str,
    port: u16,
    token: String,
    /// Whether a page on another port of this machine may show this one in a frame.
    framed: bool,
}

/// A new secret of 256 bits: a keyed hash whose keys the standard library takes from the system's source of randomness.
pub fn token() -> String {
    let word = |n: u64| {
        let mut hasher = RandomState::new().build_hasher();
        hasher.write_u64(n);
        format!("{:016x}", hasher.finish())
    };
    (0..4).map(word).collect()
}

impl Gate {
    /// The gate of the studio at `port`.
    pub fn studio(port: u16) -> Self {
        Self { door: "studio", port, token: token(), framed: false }
    }

    /// The gate of a running reconstruction at `port`, which the studio shows in a frame. It lets nothing be changed.
    pub fn live(port: u16) -> Self {
        Self { door: "live", port, token: token(), framed: true }
    }

    /// What opens it, for the end of the address that is printed.
    pub fn query(&self) -> String {
        format!("?token={}", self.token)
    }

    /// Name of the cookie: cookies do not distinguish ports.
    fn cookie_name(&self) -> String {
        format!("tessuto-{}-{}", self.door, self.port)
    }

    /// The header that gives a page the token for its own requests, and for no others.
    pub fn cookie(&self) -> String {
        format!("{}={}; Path=/; HttpOnly; SameSite=Strict", self.cookie_name(), self.token)
    }

    /// Lets a request pass.
    ///
    /// # Errors
    /// The refusal to answer with.
    pub fn check(&self, request: &Request) -> Result<(), Response> {
        let refuse = |text: &str| Err(Response::plain("403 Forbidden", format!("{text}\n")));
        let names = [format!("127.0.0.1:{}", self.port), format!("localhost:{}", self.port)];
        // Another name means that somebody's name server points here.
        let Some(host) = request.header("host").ok().flatten().filter(|h| names.iter().any(|n| n == h))
        else {
            return refuse("only as 127.0.0.1 or localhost");
        };
        // `none` is a typed address. Other ports of this machine are `same-site`, and strangers too.
        match request.header("sec-fetch-site") {
            Ok(None | Some("same-origin" | "none")) => {}
            // Without the token or the cookie it gets nothing either; and what it may show, it cannot read.
            Ok(Some("same-site")) if self.framed && is_safe(request) => {}
            _ => return refuse("a page of another site asked; open the address by typing or pasting it"),
        }
        match request.header("origin") {
            Ok(None) => {}
            Ok(Some(origin)) if origin.strip_prefix("http://") == Some(host) => {}
            _ => return refuse("a page of another origin asked"),
        }
        let first = request.path == "/" && request.query("token").is_some_and(|t| self.is_token(&t));
        if !first && !self.has_cookie(request) {
            return refuse("open the address that tessuto printed, with its token");
        }
        // Browsers send an origin with whatever changes something.
        if !is_safe(request) && (request.header("origin") == Ok(None) || !self.has_cookie(request)) {
            return refuse("only the page's own buttons may change something");
        }
        Ok(())
    }

    fn has_cookie(&self, request: &Request) -> bool {
        let (name, cookies) = (self.cookie_name(), request.header("cookie").ok().flatten());
        let pairs = cookies.unwrap_or_default().split(';').filter_map(|c| c.trim().split_once('='));
        pairs.filter(|(known, _)| *known == name).any(|(_, value)| self.is_token(value))
    }

    /// In a time that does not depend on where they differ.
    fn is_token(&self, text: &str) -> bool {
        let differences = self.token.bytes().zip(text.bytes()).fold(0, |d, (a, b)| d | (a ^ b));
        text.len() == self.token.len() && differences == 0
    }
}

/// Whether a request changes nothing.
fn is_safe(request: &Request) -> bool {
    ["GET", "HEAD"].contains(&request.method.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(headers: &str, target: &str) -> &'static str {
        status_at(&Gate::studio(80), headers, target)
    }

    fn status_at(gate: &Gate, headers: &str, target: &str) -> &'static str {
        let (method, target) = target.split_once(' ').unwrap();
        let text = format!("{method} {target} HTTP/1.1\r\n{headers}\r\n\r\n");
        let request = Request::read(&mut text.replace("TOKEN", &gate.token).as_bytes()).unwrap();
        gate.check(&request).map_or_else(|refusal| refusal.status(), |()| "200")
    }

    const HOST: &str = "Host: 127.0.0.1:80";
    const OURS: &str = "Host: 127.0.0.1:80\r\nCookie: a=b; tessuto-studio-80=TOKEN";

    #[test]
    fn tokens_are_long_and_differ() {
        let [a, b] = [token(), token()];
        assert!(a.len() == 64 && a != b && a[..16] != a[16..32], "{a} {b}");
    }

    #[test]
    fn only_the_token_opens_the_door() {
        assert_eq!(status(HOST, "GET /?token=TOKEN"), "200");
        assert_eq!(status(OURS, "GET /api/state"), "200");
        for target in
            ["GET /", "GET /?token=", "GET /?token=TOKENa", "GET /?token=abab", "GET /api/state?token=TOKEN"]
        {
            assert_eq!(status(HOST, target), "403 Forbidden", "{target}");
        }
        for cookie in ["tessuto-studio-81=TOKEN", "tessuto-studio-80=TOKEN0", "tessuto-studio-80=", "TOKEN"] {
            assert_eq!(status(&format!("{HOST}\r\nCookie: {cookie}"), "GET /"), "403 Forbidden", "{cookie}");
        }
    }

    #[test]
    fn other_names_sites_and_origins_are_refused_even_with_the_token() {
        for host in ["evil.example", "127.0.0.1", "127.0.0.1:81", "0.0.0.0:80", "localhost:80.evil.example"] {
            let headers = OURS.replace("127.0.0.1:80", host);
            assert_eq!(status(&headers, "GET /api/state"), "403 Forbidden", "{host}");
        }
        assert_eq!(status(&OURS.replace(HOST, "A: b"), "GET /api/state"), "403 Forbidden");
        assert_eq!(status(&format!("{OURS}\r\n{HOST}"), "GET /api/state"), "403 Forbidden");
        for site in ["cross-site", "same-site", ""] {
            let headers = format!("{OURS}\r\nSec-Fetch-Site: {site}");
            assert_eq!(status(&headers, "GET /?token=TOKEN"), "403 Forbidden", "{site}");
        }
        for origin in [
            "http://evil.example",
            "null",
            "https://127.0.0.1:80",
            "http://127.0.0.1:81",
            "http://localhost:80",
        ] {
            let headers = format!("{OURS}\r\nOrigin: {origin}");
            assert_eq!(status(&headers, "POST /api/run"), "403 Forbidden", "{origin}");
        }
        let ours = format!("{OURS}\r\nOrigin: http://127.0.0.1:80\r\nSec-Fetch-Site: same-origin");
        assert_eq!(status(&ours, "POST /api/run"), "200");
        // Without an origin nothing is changed, and a token in an address changes nothing.
        assert_eq!(status(OURS, "POST /api/run"), "403 Forbidden");
        let uncooked = ours.replace("Cookie", "Cooky");
        assert_eq!(status(&uncooked, "POST /?token=TOKEN"), "403 Forbidden");
    }

    #[test]
    fn the_page_of_a_run_may_be_shown_by_the_studio_with_the_token_only() {
        let gate = Gate::live(81);
        let at =
            |headers: &str, target: &str| status_at(&gate, &format!("Host: 127.0.0.1:81{headers}"), target);
        let cookie = "\r\nCookie: tessuto-live-81=TOKEN";
        let frame = "\r\nSec-Fetch-Site: same-site";
        assert_eq!(at("", "GET /?token=TOKEN"), "200");
        assert_eq!(at(frame, "GET /?token=TOKEN"), "200");
        assert_eq!(at(&format!("{frame}{cookie}"), "GET /state"), "200");
        assert_eq!(at(frame, "GET /"), "403 Forbidden");
        assert_eq!(at("", "GET /state?token=TOKEN"), "403 Forbidden");
        assert_eq!(at("\r\nCookie: tessuto-studio-81=TOKEN", "GET /state"), "403 Forbidden");
        assert_eq!(at(&format!("\r\nSec-Fetch-Site: cross-site{cookie}"), "GET /state"), "403 Forbidden");
        assert_eq!(
            at(&format!("{frame}{cookie}\r\nOrigin: http://127.0.0.1:81"), "POST /state"),
            "403 Forbidden"
        );
    }
}
