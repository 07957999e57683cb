//! The program `tessuto` as one function: one subcommand, one file.

mod appearance;
mod browser;
mod check;
mod clip;
mod compare;
mod completions;
mod demo;
mod evaluate;
mod export;
mod fabric;
mod ffmpeg;
mod findings;
mod forecast;
mod frames;
mod http;
mod import;
mod lens;
mod live;
#[cfg(feature = "man")]
mod man;
mod masks;
mod points;
mod progress;
mod reconstruct;
#[cfg_attr(not(feature = "rerun"), path = "record/absent.rs")]
mod record;
mod remedy;
mod render;
mod repeat;
mod report;
mod say;
mod settings;
mod simulate;
mod stills;
mod studio;
mod synth;
mod template;
mod threads;
mod values;
mod verify;
mod video;
mod view;
mod watch;

use std::ffi::OsString;
use std::io::ErrorKind;

use clap::{Parser, Subcommand};

use crate::say::aside;

/// Recover the 3D motion of a fabric from one video, its stiffness and what moves it, its texture, material and light.
#[derive(Parser)]
#[command(
    name = "tessuto",
    version,
    about,
    arg_required_else_help = true,
    after_help = "\
Example:
  tessuto import clip.mp4 scenes/curtain --masks masks/ --fov 63 --template curtain.obj
  tessuto reconstruct scenes/curtain --out results/curtain

Every number comes with its standard deviation. What a clip does not show is assumed, and the result says so."
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

/// In the order of the work.
#[derive(Subcommand)]
enum Command {
    Studio(studio::Arguments),
    Frames(stills::Arguments),
    Import(import::Arguments),
    Masks(masks::Arguments),
    Template(template::Arguments),
    Check(check::Arguments),
    Reconstruct(reconstruct::Arguments),
    Appearance(appearance::Arguments),
    View(view::Arguments),
    Report(report::Arguments),
    Render(render::Arguments),
    Export(export::Arguments),
    Evaluate(evaluate::Arguments),
    Compare(compare::Arguments),
    Simulate(simulate::Arguments),
    Forecast(forecast::Arguments),
    Fabric(fabric::Arguments),
    Verify(verify::Arguments),
    Settings(settings::Arguments),
    Synth(synth::Arguments),
    Demo(demo::Arguments),
    Completions(completions::Arguments),
    #[cfg(feature = "man")]
    Man(man::Arguments),
}

/// Says where an earlier folder was kept because somebody put files into it while it was being replaced.
fn say_kept(kept: Option<std::path::PathBuf>) {
    if let Some(folder) = kept {
        aside!("note: files came into the earlier folder meanwhile; it is kept as {}", folder.display());
    }
}

/// Runs the program with `arguments`, the first of which is its name; its exit status.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments = match Arguments::try_parse_from(points::joined(arguments)) {
        Ok(arguments) => arguments,
        Err(told) => return tell(&told),
    };
    let result = match arguments.command {
        Command::Studio(arguments) => studio::run(&arguments),
        Command::Frames(arguments) => stills::run(&arguments),
        Command::Import(arguments) => import::run(&arguments),
        Command::Masks(arguments) => masks::run(&arguments),
        Command::Template(arguments) => template::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Reconstruct(arguments) => reconstruct::run(&arguments),
        Command::Appearance(arguments) => appearance::run(&arguments),
        Command::View(arguments) => view::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::Render(arguments) => render::run(&arguments),
        Command::Export(arguments) => export::run(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Forecast(arguments) => forecast::run(&arguments),
        Command::Fabric(arguments) => fabric::run(&arguments),
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Verify(arguments) => verify::run(&arguments),
        Command::Settings(arguments) => settings::run(&arguments),
        Command::Synth(arguments) => synth::run(&arguments),
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Completions(arguments) => completions::run(&arguments),
        #[cfg(feature = "man")]
        Command::Man(arguments) => man::run(&arguments),
    };
    match result.and_then(|()| Ok(say::end()?)) {
        Ok(()) => 0,
        Err(error) => {
            let told = error.downcast_ref::<tessuto::Error>();
            aside!("error: {}", told.map_or_else(|| format!("{error:#}"), remedy::error));
            // An error that is not the library's own is a fault of this program: 101, like a panic.
            told.map_or(101, tessuto::Error::exit_code)
        }
    }
}

/// Help, version, or what is wrong with the command line.
fn tell(told: &clap::Error) -> u8 {
    match told.print() {
        // A full disk, not a reader that has gone.
        Err(error) if !told.use_stderr() && error.kind() != ErrorKind::BrokenPipe => 5,
        _ => u8::try_from(told.exit_code()).unwrap_or(2),
    }
}
