//! `tessuto`: one subcommand, one file.

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Recover the motion, stiffness and forces of a fabric from one video.
#[derive(Parser)]
#[command(version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Print the version.
    Version,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let result: anyhow::Result<()> = match arguments.command {
        Command::Version => {
            println!("tessuto {}", env!("CARGO_PKG_VERSION"));
            Ok(())
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(error.downcast_ref::<tessuto::Error>().map_or(101, tessuto::Error::exit_code))
        }
    }
}
