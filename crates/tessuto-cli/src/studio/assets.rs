//! The page: readable files, embedded by the build.

use crate::http::Response;

const SCRIPT: &str = "text/javascript; charset=utf-8";

/// What the page may do: no script, style or address of anybody else's; the live page of a run is a frame of
/// another port.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; \
     connect-src 'self'; frame-src 'self' http://127.0.0.1:*; base-uri 'none'; form-action 'none'; \
     frame-ancestors 'none'";

macro_rules! asset {
    ($kind:expr, $name:literal) => {
        Some(Response::embedded($kind, include_str!(concat!("../../assets/studio/", $name))))
    };
}

/// The page itself.
pub fn page() -> Response {
    Response::embedded("text/html; charset=utf-8", include_str!("../../assets/studio/page.html"))
        .with("Content-Security-Policy", POLICY)
}

/// A file of the page.
pub fn find(path: &str) -> Option<Response> {
    match path {
        "/studio.css" => asset!("text/css; charset=utf-8", "studio.css"),
        "/icon.svg" => asset!("image/svg+xml", "icon.svg"),
        "/api.js" => asset!(SCRIPT, "api.js"),
        "/begin.js" => asset!(SCRIPT, "begin.js"),
        "/trim.js" => asset!(SCRIPT, "trim.js"),
        "/outline.js" => asset!(SCRIPT, "outline.js"),
        "/fabric.js" => asset!(SCRIPT, "fabric.js"),
        "/overlay.js" => asset!(SCRIPT, "overlay.js"),
        "/check.js" => asset!(SCRIPT, "check.js"),
        "/run.js" => asset!(SCRIPT, "run.js"),
        "/result.js" => asset!(SCRIPT, "result.js"),
        "/main.js" => asset!(SCRIPT, "main.js"),
        _ => None,
    }
}
