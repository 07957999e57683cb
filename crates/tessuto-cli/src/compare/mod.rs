//! `tessuto compare`.

mod attempt;
mod choice;
mod meter;

use std::ops::Range;
use std::path::PathBuf;

use clap::Args;
use tessuto::Error;
use tessuto::compare::{Entry, Method, write_page};

use crate::progress::stop_on_interrupt;
use crate::say::{self, aside, say};
use attempt::{End, Run, attempt};

/// Run several methods on several scenes and print their errors, times and memory beside the published figures.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto compare scenes/curtain scenes/flag --out comparison
  tessuto compare scenes/R1 --methods saft --ablations --out table7
  tessuto compare scenes/R1 --methods default,saft --frames 0..16 --out quick

Writes the result folders, DIR/SCENE/METHOD, and DIR/comparison: compare.txt, \
compare.csv and compare.html, the page with all results side by side. The same command \
resumes where it was stopped and skips finished runs. A failed run does not stop the \
others.")]
pub struct Arguments {
    /// Scene folders.
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Methods, by the names of their presets.
    #[arg(long, value_delimiter = ',', default_value = "default,saft")]
    methods: Vec<String>,
    /// Also run the published ablations of saft: stiffnesses fixed, without one or both of its regularisers.
    #[arg(long)]
    ablations: bool,
    /// Folder of all results and tables.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Only frames A to B − 1; the template belongs to frame A.
    #[arg(long, value_name = "A..B", value_parser = crate::frames::parse)]
    frames: Option<Range<usize>>,
    /// Change one setting in all methods. May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Threads of every run [default: all cores].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let methods = choice::methods(&arguments.methods, arguments.ablations)?;
    let names = choice::names(&arguments.scenes)?;
    let mut missing = Vec::new();
    for (scene, name) in arguments.scenes.iter().zip(&names) {
        for method in &methods {
            let run = Run {
                scene,
                entry: Entry::at(&arguments.out, name, *method),
                frames: arguments.frames.clone(),
                changes: &arguments.set,
                threads: arguments.threads,
                config: method.config(&arguments.set)?,
            };
            missing.extend((!run.is_there()?).then_some(run));
        }
    }
    // A run that is asked to stop writes a checkpoint first.
    stop_on_interrupt()?;
    let count = missing.len();
    for (k, run) in missing.iter().enumerate() {
        aside!("{} of {count}: {}, {}", k + 1, run.entry.scene, run.entry.method.key);
        match attempt(run)? {
            End::Good => {}
            End::Failed(why) => aside!("failed: {why}"),
            End::Stopped => return Err(Error::Interrupted("stopped; the same command goes on".into()).into()),
        }
    }
    let entry = |name: &String, method: &Method| Entry::at(&arguments.out, name, *method);
    let entries: Vec<Entry> =
        names.iter().flat_map(|name| methods.iter().map(move |m| entry(name, m))).collect();
    let folder = arguments.out.join("comparison");
    let text = write_page(&folder, &entries)?;
    say::output(format_args!("{text}"));
    say!("{}", folder.join("compare.html").display());
    let failed = entries.iter().filter(|e| e.record.as_ref().is_some_and(|r| r.failure.is_some())).count();
    match failed {
        0 => Ok(()),
        _ => Err(Error::numerical(
            format!("{failed} of {} runs", entries.len()),
            "failed, see the last lines of the table",
            "mend what they name, then give the same command again: what is finished stays",
        )
        .into()),
    }
}
