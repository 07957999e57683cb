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

/// From one video of a piece of fabric: its motion in 3D, physics, texture, material and light.
#[derive(Parser)]
#[command(
    name = "tessuto",
    version,
    about,
    arg_required_else_help = true,
    after_help = "\
Start with:
  tessuto demo
  tessuto studio clip.mp4

Or by commands:
  tessuto import clip.mp4 scenes/towel --fov 63 \\
    --outline \"312,208 930,215 941,640 305,622\"
  tessuto template scenes/towel --flat 70x50cm \\
    --corners 312,208 930,215 941,640 305,622
  tessuto reconstruct scenes/towel --out results/towel

Estimates come with standard deviations. Parameters that the clip does not constrain \
keep their prior, and the result says so."
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
        aside!(
            "note: new files appeared in the earlier folder while it was being replaced; it is kept as {}",
            folder.display()
        );
    }
}

/// Runs the program with `arguments`, the first of which is its name; its exit status.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments = match Arguments::try_parse_from(points::joined(arguments)) {
        Ok(arguments) => arguments,
        Err(instead) => return answer(&instead),
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
fn answer(instead: &clap::Error) -> u8 {
    match instead.print() {
        // A full disk, not a reader that has gone.
        Err(error) if !instead.use_stderr() && error.kind() != ErrorKind::BrokenPipe => 5,
        _ => u8::try_from(instead.exit_code()).unwrap_or(2),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    /// Of the narrowest terminal that the help is written for.
    const COLUMNS: usize = 80;

    /// The program with all that clap adds to it.
    fn program() -> clap::Command {
        let mut program = Arguments::command();
        program.build();
        program
    }

    #[test]
    fn only_the_terminal_breaks_the_lines_of_the_help() {
        let program = program();
        let (mut seen, mut wrong) = (0, Vec::new());
        for command in std::iter::once(&program).chain(program.get_subcommands()) {
            let text = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            let lines: Vec<&str> = text.lines().collect();
            for (k, line) in lines.iter().enumerate() {
                // A paragraph is one line, however long. Commands and tables are indented, and fit.
                let ends = lines.get(k + 1).is_none_or(|next| next.is_empty());
                let listed = line.starts_with("  ") || line.ends_with(':') || line.is_empty();
                if !(listed && line.chars().count() <= COLUMNS || ends && !line.starts_with(' ')) {
                    wrong.push(format!("{}: {line}", command.get_name()));
                }
                seen += 1;
            }
        }
        assert!(seen > 100, "only {seen} lines");
        assert!(wrong.is_empty(), "{wrong:#?}");
    }

    #[test]
    fn commands_in_the_documents_exist() {
        let program = program();
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let mut seen = 0;
        for document in ["README.md", "llms.txt", "docs/tutorial.md", "docs/studio.md", "docs/gallery.md"] {
            let text = std::fs::read_to_string(root.join(document)).unwrap();
            for line in text.lines().filter_map(|line| line.strip_prefix("tessuto ")) {
                let mut words = line.split('#').next().unwrap_or_default().split_whitespace();
                let name = words.next().unwrap_or_default();
                let command = program.find_subcommand(name).unwrap_or_else(|| panic!("{document}: {line}"));
                for option in words.filter_map(|word| word.strip_prefix("--")) {
                    let option = option.split('=').next();
                    let known = command.get_arguments().any(|argument| argument.get_long() == option);
                    assert!(known, "{document}: {option:?} in: {line}");
                }
                seen += 1;
            }
        }
        assert!(seen > 20, "only {seen} commands");
    }
}
