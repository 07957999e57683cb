//! `tessuto`: one subcommand, one file.

mod appearance;
mod check;
mod demo;
mod evaluate;
mod export;
mod frames;
mod import;
mod lens;
mod live;
mod progress;
mod reconstruct;
mod record;
mod render;
mod report;
mod simulate;
mod synth;
mod template;
mod threads;
mod verify;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Recover the motion, stiffness and forces of a fabric from one video.
#[derive(Parser)]
#[command(version, about, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Appearance(appearance::Arguments),
    /// Look at a scene before computing on it: a table of findings, exit status 3 if one is an error.
    Check(check::Arguments),
    Demo(demo::Arguments),
    /// Compare a result with the scene's ground truth: Chamfer and surface distances, depth, vertices, maps.
    Evaluate(evaluate::Arguments),
    Export(export::Arguments),
    Import(import::Arguments),
    Reconstruct(reconstruct::Arguments),
    Render(render::Arguments),
    Report(report::Arguments),
    Simulate(simulate::Arguments),
    Synth(synth::Arguments),
    Template(template::Arguments),
    Verify(verify::Arguments),
}

/// Says where an earlier folder was kept because somebody put files into it while it was being replaced.
fn say_kept(kept: Option<std::path::PathBuf>) {
    if let Some(folder) = kept {
        eprintln!("note: files came into the earlier folder meanwhile; it is kept as {}", folder.display());
    }
}

fn main() -> ExitCode {
    let result = match Arguments::parse().command {
        Command::Appearance(arguments) => appearance::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments),
        Command::Export(arguments) => export::run(&arguments),
        Command::Import(arguments) => import::run(&arguments),
        Command::Reconstruct(arguments) => reconstruct::run(&arguments),
        Command::Render(arguments) => render::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Synth(arguments) => synth::run(&arguments),
        Command::Template(arguments) => template::run(&arguments),
        Command::Verify(arguments) => verify::run(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            // An error that is not the library's own is a fault of this program: 101, like a panic.
            ExitCode::from(error.downcast_ref::<tessuto::Error>().map_or(101, tessuto::Error::exit_code))
        }
    }
}
