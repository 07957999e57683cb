//! `tessuto report`.

use std::path::PathBuf;

use clap::Args;
use tessuto::output::manifest;
use tessuto::result::{self, Folder};

use crate::say::say;
use crate::threads::Threads;

/// Rebuild the page of a result: report.html, one self-contained file that needs no network.
#[derive(Args)]
#[command(after_help = "\
Examples:
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
    result::write_page(&Folder::open(&arguments.result)?)?;
    manifest::record(&[&page])?;
    say!("{}", page.display());
    Ok(())
}
