//! `tessuto check`: what is right and wrong with a scene, before anything is computed.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use tessuto::Error;
use tessuto::check::{CheckReport, Finding, Level, check_folder};
use tessuto::io::image::write_png;
use tessuto::io::scene::LoadOptions;

/// Arguments of `tessuto check`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Scene folder (holds scene.json, template.obj, rgbs/, masks/).
    scene: PathBuf,
    /// Write the first frame with the template's edges (cyan) and the mask's outline (yellow) to this PNG file.
    #[arg(long, value_name = "FILE.png")]
    picture: Option<PathBuf>,
}

/// Runs the command: prints the table, writes the picture if asked, fails if there are errors.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    check(&arguments.scene, arguments.picture.as_deref())
}

/// Checks the scene in a folder.
pub fn check(scene: &Path, picture: Option<&Path>) -> anyhow::Result<()> {
    let report = check_folder(scene, &LoadOptions::default());
    let mut text = table(&report.findings);
    match (picture, &report.picture) {
        (Some(path), Some(picture)) => {
            write_png(path, picture)?;
            let _ = writeln!(text, "picture: {}", path.display());
        }
        (Some(_), None) => text.push_str("picture: not written, template or frames cannot be read\n"),
        (None, _) => {}
    }
    print(&text)?;
    verdict(scene, &report)
}

/// Checks a scene that lacks its template only, and says how to make one.
pub fn check_without_template(scene: &Path) -> anyhow::Result<()> {
    let mut report = check_folder(scene, &LoadOptions::default());
    report.findings.retain(|f| !(f.level == Level::Error && Path::new(&f.what) == scene.join("template.obj")));
    print(&table(&report.findings))?;
    print("next: the template, the fabric in the first frame; a flat rectangle from its size, or any mesh:\n")?;
    for options in ["--flat WIDTHxHEIGHTm --from-mask", "--remesh 32 --from MESH.obj"] {
        print(&format!("  tessuto template {} {options}\n", scene.display()))?;
    }
    verdict(scene, &report)
}

fn verdict(scene: &Path, report: &CheckReport) -> anyhow::Result<()> {
    match report.count(Level::Error) {
        0 => Ok(()),
        count => {
            let problem = format!("{count} {} found", if count == 1 { "error was" } else { "errors were" });
            let hint = "follow the hints of the table above, then check again";
            Err(Error::input(scene.display().to_string(), problem, hint).into())
        }
    }
}

/// One line a finding, topics in a column; hints below what they answer.
fn table(findings: &[Finding]) -> String {
    // Places of errors are long paths; they must not push all figures to the right.
    let width = findings.iter().map(|f| f.what.chars().count()).filter(|w| *w <= 16).max().unwrap_or(0);
    let mut text = String::new();
    for finding in findings {
        let level = match finding.level {
            Level::Ok => "ok",
            Level::Warning => "warning",
            Level::Error => "error",
        };
        let _ = writeln!(text, "{level:<7}  {:<width$}  {}", finding.what, finding.detail);
        if !finding.hint.is_empty() {
            let _ = writeln!(text, "{:<7}  {:<width$}  hint: {}", "", "", finding.hint);
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

/// Prints to standard output; that its reader has gone (`| head`) is no error.
fn print(text: &str) -> anyhow::Result<()> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}
