//! `tessuto report`.

use std::path::PathBuf;

use clap::Args;
use tessuto::output::manifest;
use tessuto::result;

/// Write the page of a result anew: report.html, one file that needs no network and nothing beside it.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto report results/curtain")]
pub struct Arguments {
    /// Result folder of `tessuto reconstruct`.
    result: PathBuf,
    /// Threads [default: all cores]. The page does not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    crate::threads::use_threads(arguments.threads)?;
    let page = arguments.result.join("report.html");
    manifest::check_parts(&[&page], true)?;
    result::write_page(&arguments.result)?;
    manifest::record(&[&page])?;
    println!("{}", page.display());
    Ok(())
}
