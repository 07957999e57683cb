//! `tessuto view`.

use std::path::{Path, PathBuf};

use clap::Args;
use tessuto::Error;
use tessuto::text::quoted;

use crate::browser;
use crate::say::{aside, say};

/// The pages that commands leave in their folders; of a folder with several the first is shown.
const PAGES: [&str; 3] = ["report.html", "compare.html", "masks.html"];

/// Open the page of a result in the browser.
///
/// The page needs neither a server nor the network. Its path is printed.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto view results/curtain
  tessuto view results/curtain/report.html
  tessuto view scenes/curtain               # its masks, made from the clip
  tessuto view results/curtain --no-browser")]
pub struct Arguments {
    /// Result folder, scene folder with masks of `tessuto masks`, folder of `tessuto compare`, or the page in one
    /// of them.
    result: PathBuf,
    /// Only print the path of the page.
    #[arg(long)]
    no_browser: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let page = page(&arguments.result)?;
    say!("{}", page.display());
    if arguments.no_browser {
        return Ok(());
    }
    // A browser gets the whole path: it starts in a folder of its own, and a name may begin like an option.
    let whole = std::path::absolute(&page).unwrap_or_else(|_| page.clone());
    if !browser::open(&whole) {
        aside!("note: there is no browser to open it with; open the file yourself");
    }
    Ok(())
}

/// The page that `path` is or holds.
fn page(path: &Path) -> tessuto::Result<PathBuf> {
    let refused = |problem: &str, hint: String| Err(Error::input(path.display().to_string(), problem, hint));
    let give = "give the folder that tessuto reconstruct wrote";
    if path.is_dir() {
        let found = PAGES.iter().map(|name| path.join(name)).find(|page| page.is_file());
        return found.map_or_else(|| refused(&lacking(path), way_out(path)), Ok);
    }
    let unfinished = beside(path, ".partial").is_dir() || beside(path, ".checkpoints").is_dir();
    if path.is_file() {
        let known = path.file_name().is_some_and(|name| PAGES.iter().any(|page| name == *page));
        match known {
            true => Ok(path.to_path_buf()),
            false => {
                refused("is not a page of tessuto", format!("the pages are {}; or {give}", PAGES.join(", ")))
            }
        }
    } else if unfinished {
        let hint = "wait for the command that writes it, or give that command again with --resume";
        refused("is not finished, and has no page yet", hint.into())
    } else {
        refused("there is no such folder or file", give.into())
    }
}

/// What a folder without a page is.
fn lacking(folder: &Path) -> String {
    let has = |name: &str| folder.join(name).exists();
    if has("motion.npy") && has("parameters.json") {
        "is a result without its page".into()
    } else if has("scene.json") {
        "is a scene, not a result, and has no page".into()
    } else {
        "is not a result: it holds none of the pages that tessuto writes".into()
    }
}

/// What makes the page of a folder without one.
fn way_out(folder: &Path) -> String {
    let has = |name: &str| folder.join(name).exists();
    let name = quoted(folder);
    if has("motion.npy") && has("parameters.json") {
        format!("make it: tessuto report {name}")
    } else if has("scene.json") {
        format!("reconstruct it: tessuto reconstruct {name} --out RESULT, then tessuto view RESULT")
    } else {
        "give the folder that tessuto reconstruct wrote".into()
    }
}

/// `path` with `end` at the end of its last name.
fn beside(path: &Path, end: &str) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(end);
    path.with_file_name(name)
}
