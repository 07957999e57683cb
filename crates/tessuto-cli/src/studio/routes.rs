//! Which request does what.

use std::io::Read;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::json;

use super::commands::{self, Step};
use super::form::Form;
use super::job::Jobs;
use super::place::Project;
use super::work::Work;
use super::{assets, entries, state, upload};
use crate::http::{BodyError, Gate, Request, Response, Seat, decoded};

/// Longest JSON that is taken [bytes], and the time it may take.
const LONGEST: u64 = 256 << 10;
const WITHIN: Duration = Duration::from_secs(10);

/// The server.
pub struct Studio {
    pub project: Project,
    gate: Gate,
    /// Name of what to begin with.
    pub start: Option<String>,
    pub jobs: Jobs,
    /// Held while a form is compared and written.
    saving: Mutex<()>,
}

/// A refusal: status and a sentence for the user.
type Refused = (&'static str, String);
type Answer = Result<Response, Refused>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Open {
    name: String,
}

/// What says nothing but that it is JSON, which forms of other sites are not.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Nothing {}

impl Studio {
    /// Nothing runs yet.
    pub fn new(project: Project, gate: Gate, start: Option<String>) -> Arc<Self> {
        Arc::new(Self { project, gate, start, jobs: Jobs::default(), saving: Mutex::default() })
    }

    fn work(&self, request: &Request) -> Result<Work<'_>, Refused> {
        let name = request.query("work").ok_or_else(|| bad("the query names no work"))?;
        Work::new(&self.project, &name).ok_or_else(|| bad(&format!("{name} is not in the project")))
    }
}

fn bad(text: &str) -> Refused {
    ("400 Bad Request", text.to_owned())
}

/// The answer to `request`, whose body is still in `stream`; one that the gate lets pass keeps its `seat`.
pub fn answer(studio: &Studio, request: &mut Request, stream: &mut impl Read, seat: &Seat) -> Response {
    let response = match studio.gate.check(request) {
        Err(refusal) => refusal,
        Ok(()) => {
            seat.keep();
            route(studio, request, stream).unwrap_or_else(|(status, text)| {
                // Where the project is, is nobody's business who reads a message.
                let root = format!("{}{}", studio.project.root().display(), std::path::MAIN_SEPARATOR);
                Response::plain(status, text.replace(&root, ""))
            })
        }
    };
    let response = response.to(request);
    // The address holds the token, and other sites need nothing from here.
    response.with("Referrer-Policy", "no-referrer").with("Cross-Origin-Resource-Policy", "same-origin")
}

fn route(studio: &Studio, request: &mut Request, stream: &mut impl Read) -> Answer {
    let path = request.path.clone();
    // The head of an answer is made as the answer is.
    let method = if request.method == "HEAD" { "GET" } else { request.method.as_str() };
    match (method, path.as_str()) {
        ("GET", "/") => Ok(assets::page().with("Set-Cookie", studio.gate.cookie())),
        ("GET", "/api/state") => {
            let work = request.query("work").map(|_| studio.work(request)).transpose()?;
            Ok(Response::json(state::state(studio, work.as_ref()).to_string()))
        }
        ("GET", "/api/frames") => Ok(Response::json(state::frames(&studio.work(request)?).to_string())),
        ("GET", path) => match path.strip_prefix("/file/") {
            Some(name) => file(studio, name, request.query("download").is_some()),
            None => assets::find(path).ok_or_else(|| ("404 Not Found", format!("there is no {path}"))),
        },
        ("POST", "/api/open") => {
            let open: Open = body(request, stream)?;
            let work = entries::work(&studio.project, &open.name).map_err(|text| bad(&text))?;
            Ok(Response::json(json!({ "work": work.scene() }).to_string()))
        }
        ("POST", "/api/save") => {
            let form: Form = body(request, stream)?;
            save(studio, request, &form)
        }
        ("POST", "/api/run") => run(studio, request, stream),
        ("POST", "/api/stop") => {
            let Nothing {} = body(request, stream)?;
            studio.jobs.latest().iter().for_each(|job| job.stop());
            Ok(Response::json("{}".to_owned()))
        }
        ("PUT", "/api/upload") => {
            let name = request.query("name").unwrap_or_default();
            let name = upload::receive(&studio.project, request, stream, &name)?;
            Ok(Response::json(json!({ "name": name }).to_string()))
        }
        _ => Err(("405 Method Not Allowed", "this is not how the studio is asked".to_owned())),
    }
}

/// Keeps what was entered, unless another window has changed what it was entered into: its `base`.
fn save(studio: &Studio, request: &Request, form: &Form) -> Answer {
    let work = studio.work(request)?;
    let _one_at_a_time = studio.saving.lock().unwrap_or_else(PoisonError::into_inner);
    if request.query("base").is_some_and(|base| base != work.form_version()) {
        let told = "changed in another window: this one shows it now; enter the last change again if it is \
                    still missing";
        return Err(("409 Conflict", told.to_owned()));
    }
    work.save(form).map_err(|text| bad(&text))?;
    Ok(Response::json(json!({ "form_version": work.form_version() }).to_string()))
}

fn run(studio: &Studio, request: &mut Request, stream: &mut impl Read) -> Answer {
    let step: Step = body(request, stream)?;
    let work = studio.work(request)?;
    let commands = commands::of(&work, &work.form(), &step).map_err(|text| bad(&text))?;
    let log = work.folder("logs").and_then(|logs| {
        std::fs::create_dir_all(&logs).map_err(|e| format!("cannot write {}: {e}", logs.display()))?;
        Ok(logs.join(format!("{}.txt", step.name())))
    });
    let log = log.map_err(|text| ("500 Internal Server Error", text))?;
    let shown: Vec<_> = commands.iter().map(commands::shown).collect();
    let root = studio.project.root().to_path_buf();
    let started = studio.jobs.start((work.scene(), step.name()), commands, root, &log);
    started.map_err(|text| ("409 Conflict", text))?;
    Ok(Response::json(json!({ "commands": shown }).to_string()))
}

/// JSON from the page.
fn body<T: DeserializeOwned>(request: &mut Request, stream: &mut impl Read) -> Result<T, Refused> {
    // What a form of another site can send has another type.
    let kind = request.header("content-type").ok().flatten().unwrap_or_default();
    if !kind.starts_with("application/json") {
        return Err(("415 Unsupported Media Type", "only JSON".to_owned()));
    }
    let mut bytes = Vec::new();
    let took = request.body(stream, LONGEST, WITHIN, |piece| {
        bytes.extend_from_slice(piece);
        Ok(())
    });
    took.map_err(|e| match e {
        BodyError::NoLength => ("411 Length Required", "the request has no length".to_owned()),
        BodyError::TooLong => ("413 Content Too Large", "that is too long".to_owned()),
        BodyError::Stalled => ("408 Request Timeout", "the request broke off".to_owned()),
    })?
    .map_err(|e| bad(&e.to_string()))?;
    serde_json::from_slice(&bytes).map_err(|e| bad(&format!("not understood: {e}")))
}

/// A file of the project.
fn file(studio: &Studio, name: &str, download: bool) -> Answer {
    let missing = || ("404 Not Found", "there is no such file in the project".to_owned());
    let name = decoded(name).ok_or_else(missing)?;
    let (file, path) = studio.project.open_file(&name).ok_or_else(missing)?;
    let response = Response::file(kind(&path), file).map_err(|_| missing())?;
    // A page of a folder may come from anybody: it runs as a stranger, without the studio's cookie.
    let response = response
        .with("Content-Security-Policy", "sandbox allow-scripts allow-downloads; frame-ancestors 'self'");
    Ok(if download { response.with("Content-Disposition", "attachment") } else { response })
}

fn kind(path: &Path) -> &'static str {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    match ending.as_str() {
        "png" => "image/png",
        "jpg" | "jpeg" => "image/jpeg",
        "html" => "text/html; charset=utf-8",
        "json" => "application/json",
        "obj" | "txt" | "csv" | "py" | "usda" => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}
