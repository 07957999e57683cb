//! One method on one scene, as a child of this program: its memory is its own, and its failure costs nobody else's
//! work.

use std::io::{BufRead as _, BufReader};
use std::ops::Range;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use tessuto::compare::{Entry, Record};
use tessuto::config::Config;
use tessuto::text::quoted;
use tessuto::{Error, Result};

use super::meter::{held, joules};
use crate::say::aside;

/// How often the child's memory is looked at.
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);
/// Exit status of a run that was asked to stop.
const INTERRUPTED: i32 = 75;

/// What is to be run.
pub struct Run<'a> {
    /// The scene's folder.
    pub scene: &'a Path,
    /// Where the result goes.
    pub entry: Entry,
    /// Only these frames.
    pub frames: Option<Range<usize>>,
    /// Settings that differ from the method's.
    pub changes: &'a [String],
    /// Threads.
    pub threads: Option<u16>,
    /// All settings.
    pub config: Config,
}

/// How an attempt ended.
pub enum End {
    /// There is a result.
    Good,
    /// There is none, and why.
    Failed(String),
    /// The user asked to stop.
    Stopped,
}

impl Run<'_> {
    /// Whether its result is there already.
    ///
    /// # Errors
    /// [`Error::Input`] if a result of other settings, frames or another scene is there.
    pub fn is_there(&self) -> Result<bool> {
        let Some(result) = self.entry.result() else { return Ok(false) };
        let same = |path: &Path| path.canonicalize().ok();
        let frames = self.frames.as_ref().is_none_or(|f| result.run.frames == [f.start, f.end]);
        let differs = [
            ("settings", result.run.settings != self.config),
            ("frames", !frames),
            ("scene", same(&result.run.scene) != same(self.scene)),
        ];
        match differs.iter().find(|(_, differs)| *differs) {
            None => Ok(true),
            Some((what, _)) => Err(Error::input(
                self.entry.folder.display().to_string(),
                format!("is a result of other {what}"),
                "choose another output folder, or remove this one",
            )),
        }
    }

    fn arguments(&self) -> Vec<String> {
        let mut arguments = vec!["reconstruct".to_owned(), self.scene.display().to_string()];
        let mut option = |name: &str, value: String| arguments.extend([name.to_owned(), value]);
        option("--out", self.entry.folder.display().to_string());
        option("--preset", self.entry.method.preset.name().to_owned());
        let own = self.entry.method.changes.iter().map(|change| (*change).to_owned());
        own.chain(self.changes.iter().cloned()).for_each(|change| option("--set", change));
        if let Some(frames) = &self.frames {
            option("--frames", format!("{}..{}", frames.start, frames.end));
        }
        if let Some(threads) = self.threads {
            option("--threads", threads.to_string());
        }
        arguments.extend(["--no-appearance", "--resume"].map(str::to_owned));
        arguments
    }
}

/// Runs it, or goes on where it was stopped, and keeps its [`Record`].
///
/// # Errors
/// Those of writing the record.
pub fn attempt(run: &Run) -> Result<End> {
    let arguments = run.arguments();
    let shown: Vec<String> = arguments.iter().map(|a| quoted(Path::new(a))).collect();
    let path = run.entry.record_path();
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)
            .map_err(|source| Error::Output { path: folder.to_path_buf(), source })?;
    }
    let (started, energy) = (Instant::now(), joules());
    let (mut memory, mut last) = (None, String::new());
    let ended = watched(&arguments, &mut memory, &mut last);
    let status = ended.as_ref().ok().and_then(std::process::ExitStatus::code);
    let failure = match &ended {
        Ok(status) if status.success() => None,
        Ok(status) => Some(if last.is_empty() { status.to_string() } else { last }),
        Err(error) => Some(format!("the program cannot be run: {error}")),
    };
    let record = Record {
        command: format!("tessuto {}", shown.join(" ")),
        seconds: started.elapsed().as_secs_f64(),
        memory,
        energy: energy.zip(joules()).map(|(before, after)| after - before).filter(|joules| *joules >= 0.0),
        failure: failure.clone(),
    };
    record.after(run.entry.record.as_ref()).write(&path)?;
    Ok(match failure {
        None => End::Good,
        Some(_) if status == Some(INTERRUPTED) => End::Stopped,
        Some(why) => End::Failed(why),
    })
}

/// Runs this program with `arguments`; what it says is passed on. `memory` becomes the most it held `[bytes]`,
/// `last` its error.
fn watched(
    arguments: &[String],
    memory: &mut Option<u64>,
    last: &mut String,
) -> std::io::Result<std::process::ExitStatus> {
    let mut child = Command::new(std::env::current_exe()?)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()?;
    let said = child.stderr.take().expect("it was asked for");
    let listener = std::thread::spawn(move || {
        let mut error = String::new();
        for line in BufReader::new(said).lines().map_while(std::io::Result::ok) {
            if let Some(text) = line.strip_prefix("error: ") {
                error = text.to_owned();
            }
            aside!("  {line}");
        }
        error
    });
    let status = loop {
        *memory = held(child.id()).max(*memory);
        match child.try_wait()? {
            Some(status) => break status,
            None => std::thread::sleep(BETWEEN_LOOKS),
        }
    };
    *last = listener.join().unwrap_or_default();
    Ok(status)
}
