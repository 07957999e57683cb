//! `tessuto check`: what is right and wrong with a scene, before anything is computed.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use tessuto::Error;
use tessuto::check::{CheckReport, Finding, Level, check_folder};
use tessuto::io::image::{is_marked_png, write_marked_png};
use tessuto::io::scene::LoadOptions;
use tessuto::text::quoted;

use crate::say::{self, say};

/// Check a scene before computing on it: a table of findings, exit status 3 if one is an error.
#[derive(clap::Args)]
pub struct Arguments {
    /// Scene folder (holds scene.json, template.obj, rgbs/, masks/).
    scene: PathBuf,
    /// Write first, middle and last frame with the masks' outlines (yellow), the first with the template's edges (cyan),
    /// to this PNG file. An earlier such image is replaced, nothing else is.
    #[arg(long, value_name = "FILE.png")]
    picture: Option<PathBuf>,
}

/// Runs the command: prints the table, writes the image if asked, fails if there are errors.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    check(&arguments.scene, arguments.picture.as_deref())
}

/// Checks the scene in a folder.
pub fn check(scene: &Path, picture: Option<&Path>) -> anyhow::Result<()> {
    if let Some(path) = picture.filter(|path| path.symlink_metadata().is_ok() && !is_marked_png(path)) {
        return Err(Error::input(
            path.display().to_string(),
            "was not written by `tessuto check`, and would be lost",
            "choose another file for the image",
        )
        .into());
    }
    let report = check_folder(scene, &LoadOptions::default());
    let mut text = table(&report.findings);
    match (picture, &report.picture) {
        (Some(path), Some(picture)) => {
            write_marked_png(path, picture)?;
            let _ = writeln!(text, "picture: {}", path.display());
        }
        (Some(_), None) => text.push_str("picture: not written, frames cannot be read\n"),
        (None, _) => {}
    }
    say::output(format_args!("{text}"));
    verdict(scene, &report)
}

/// Checks a scene that lacks its template only, and says how to make one.
pub fn check_without_template(scene: &Path) -> anyhow::Result<()> {
    let mut report = check_folder(scene, &LoadOptions::default());
    report
        .findings
        .retain(|f| !(f.level == Level::Error && Path::new(&f.what) == scene.join("template.obj")));
    say::output(format_args!("{}", table(&report.findings)));
    say!("next: the template, the fabric in the first frame; a flat rectangle from its size, or any mesh:");
    for options in ["--flat WIDTHxHEIGHTm --from-mask", "--remesh 32 --from MESH.obj"] {
        say!("  tessuto template {} {options}", quoted(scene));
    }
    verdict(scene, &report)
}

fn verdict(scene: &Path, report: &CheckReport) -> anyhow::Result<()> {
    match report.count(Level::Error) {
        0 => {
            if report.iou.is_some() {
                say!("next: tessuto reconstruct {}", quoted(scene));
            }
            Ok(())
        }
        count => {
            let problem = format!("{count} {} found", if count == 1 { "error was" } else { "errors were" });
            let hint = "follow the hints of the table above, then check again";
            Err(Error::input(scene.display().to_string(), problem, hint).into())
        }
    }
}

/// Widest line [characters].
const WIDTH: usize = 100;
/// Widest topic that shares its line with what was found; places of errors are long paths.
const TOPIC: usize = 14;

/// Level and topic in columns, what was found and the way out beside them, wrapped.
fn table(findings: &[Finding]) -> String {
    let colour = say::coloured();
    let mut text = String::new();
    for finding in findings {
        let (level, code) = match finding.level {
            Level::Ok => ("ok", 32),
            Level::Warning => ("warning", 33),
            Level::Error => ("error", 31),
        };
        let level = if colour { format!("\x1b[{code}m{level:<7}\x1b[0m") } else { format!("{level:<7}") };
        let _ = write!(text, "{level}  ");
        if finding.what.chars().count() > TOPIC {
            let _ = write!(text, "{}\n{:9}", finding.what, "");
        }
        let topic = if finding.what.chars().count() > TOPIC { "" } else { &finding.what };
        let _ = write!(text, "{topic:<TOPIC$}  ");
        wrap(&mut text, &finding.detail);
        if !finding.hint.is_empty() {
            let _ = write!(text, "{:1$}hint: ", "", TOPIC + 11);
            wrap(&mut text, &finding.hint);
        }
    }
    let count = |level| findings.iter().filter(|f| f.level == level).count();
    let _ = writeln!(
        text,
        "{} ok, {} warnings, {} errors",
        count(Level::Ok),
        count(Level::Warning),
        count(Level::Error)
    );
    text
}

/// Adds `words` after what stands in the last line of `text`, in lines of at most [`WIDTH`] characters.
fn wrap(text: &mut String, words: &str) {
    let escapes = |line: &str| line.matches('\x1b').count() / 2 * 9;
    let last = text.rsplit('\n').next().unwrap_or_default();
    let mut column = last.chars().count() - escapes(last);
    let mut first = true;
    for word in words.split_whitespace() {
        let length = word.chars().count();
        if !first && column + 1 + length > WIDTH {
            let _ = write!(text, "\n{:1$}", "", TOPIC + 11);
            column = TOPIC + 11;
        } else if !first {
            text.push(' ');
            column += 1;
        }
        text.push_str(word);
        column += length;
        first = false;
    }
    text.push('\n');
}
