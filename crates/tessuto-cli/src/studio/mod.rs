//! `tessuto studio`: the way from a clip to an export, in a browser. The server has no state but which command
//! runs now: everything else is in the project folder, and all work is done by the commands of this very program.

mod assets;
mod commands;
mod entries;
mod form;
mod job;
mod log;
mod place;
mod routes;
mod state;
mod upload;
mod work;

use std::io::Read as _;
use std::net::{Shutdown, TcpStream};
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;

use crate::browser;
use crate::http::{Gate, Listener, Request, Seat};
use crate::say::{aside, say};
use place::Project;
use routes::Studio;

/// Most bytes of an unread body that are taken off a client, so that it gets to read why they were refused.
const LEFT_OVER: u64 = 1 << 20;

/// From a clip to a moving mesh in a browser on this machine: masks, template, check, reconstruction, report, exports.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto studio clip.mp4
  tessuto studio scenes/curtain --port 8080 --no-browser
  tessuto studio --dir ~/films

Everything is kept in the project folder: closing the browser or ending the program \
loses nothing. Each step shows the command that does the same. Only this machine can \
reach the page, and only with the address that is printed.")]
pub struct Arguments {
    /// What to begin with, in the project folder: a video, a scene folder or a result folder.
    start: Option<PathBuf>,
    /// Port of 127.0.0.1 [default: a free one].
    #[arg(long, default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Only print the address.
    #[arg(long)]
    no_browser: bool,
    /// Project folder: nothing outside of it is read or written.
    #[arg(long, value_name = "DIR", default_value = ".")]
    dir: PathBuf,
}

/// Runs the command until it is interrupted.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let project = Project::open(&arguments.dir)?;
    let start = arguments.start.as_ref().map(|path| project.name_of(path)).transpose()?;
    let listener = Listener::bind(arguments.port, "--port")?;
    let gate = Gate::studio(listener.port);
    let address = listener.address() + &gate.query();
    let studio = Studio::new(project, gate, start);
    say!("studio of {}", studio.project.root().display());
    say!("  at {address}");
    aside!("  Ctrl-C ends it; what is done is kept in the folder");
    if !arguments.no_browser {
        // The address is printed: without a browser it is opened by hand.
        let _ = browser::open(&address);
    }
    listener.serve(move |stream, seat| serve(stream, seat, &studio));
    Ok(())
}

/// Answers one request.
fn serve(mut stream: TcpStream, seat: &Seat, studio: &Arc<Studio>) {
    let Some(mut request) = Request::read(&mut stream) else { return };
    let response = routes::answer(studio, &mut request, &mut stream, seat);
    // A client that has gone away is no fault.
    let sent = response.send(&mut stream);
    if sent.and_then(|()| stream.shutdown(Shutdown::Write)).is_ok() {
        let _ = std::io::copy(&mut stream.take(LEFT_OVER), &mut std::io::sink());
    }
}
