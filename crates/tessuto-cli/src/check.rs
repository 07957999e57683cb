//! `tessuto check`: what is right and wrong with a scene, before anything is computed.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use tessuto::Error;
use tessuto::check::{CheckReport, Level, check_folder};
use tessuto::io::image::{is_marked_png, write_marked_png};
use tessuto::io::scene::LoadOptions;
use tessuto::text::quoted;

use crate::findings::table;
use crate::remedy::make_template;
use crate::say::{self, say};

/// Check a scene before reconstruction: prints findings, with exit status 3 if one is an error.
#[derive(clap::Args)]
pub struct Arguments {
    /// Scene folder (holds scene.json, template.obj, rgbs/, masks/).
    scene: PathBuf,
    /// Write first, middle and last frame with the masks' outlines (yellow), the first with the template's edges
    /// (cyan), to this PNG file. Only an earlier such image is replaced.
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
    match (picture, &report.image) {
        (Some(path), Some(image)) => {
            write_marked_png(path, image)?;
            let _ = writeln!(text, "image: {}", path.display());
        }
        (Some(_), None) => text.push_str("image: not written, frames cannot be read\n"),
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
    say!(
        "next: the template, the fabric in the first frame; a flat rectangle, a garment on a table, or any mesh:"
    );
    make_template(scene).iter().for_each(|command| say!("  {command}"));
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
