//! `tessuto report`.

use std::path::PathBuf;

use clap::Args;
use tessuto::output::manifest;
use tessuto::result::{self, Folder, Summary};

use crate::say::say;
use crate::threads::Threads;
use crate::watch::report_verdict;

/// Rebuild the page of a result: report.html, one self-contained file that needs no network.
#[derive(Args)]
#[command(after_help = "\
Example:
  tessuto report results/curtain")]
pub struct Arguments {
    /// Result folder of `tessuto reconstruct`.
    result: PathBuf,
    #[command(flatten)]
    threads: Threads,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.threads.start()?;
    let page = arguments.result.join("report.html");
    manifest::check_parts(&[&page], true)?;
    let folder = Folder::open(&arguments.result)?;
    result::write_page(&folder)?;
    manifest::record(&[&page])?;
    report_verdict(&Summary::of(&folder)?, &arguments.result);
    say!("{}", page.display());
    Ok(())
}
