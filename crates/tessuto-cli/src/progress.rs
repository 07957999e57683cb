//! What is shown of a run: one line that moves on a terminal, a line now and then elsewhere.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use tessuto::run::Stage;
use tessuto::session::Epoch;
use tessuto::{Error, Result};

use crate::say::aside;

/// Lines are at least this far apart within a stage.
const BETWEEN_LINES: Duration = Duration::from_secs(5);
/// Least part of the run, and of time, that a guess of the rest is made from.
const ENOUGH: (f64, Duration) = (0.02, Duration::from_secs(2));

/// Set by Ctrl-C and SIGTERM.
static STOP: AtomicBool = AtomicBool::new(false);

/// `-v`, of the commands that take long.
#[derive(Args)]
pub struct Verbosity {
    /// Show the losses and parameters of the steps.
    #[arg(short, long)]
    pub verbose: bool,
}

/// Asks the running step to be the last one when the user interrupts; a second interrupt ends at once.
pub fn stop_on_interrupt() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::SeqCst) {
            std::process::exit(75);
        }
    })?;
    Ok(())
}

/// Where a run is, and how long the rest will take.
pub struct Progress {
    bar: Option<ProgressBar>,
    verbose: bool,
    stages: Vec<Stage>,
    current: usize,
    /// Which part of the clip is at work, of how many, and the stages that each goes through.
    part: Option<(usize, usize, std::ops::Range<usize>)>,
    started: Instant,
    /// Part of the run that was done when this program began with it.
    before: Option<f64>,
    last_line: Option<Instant>,
    /// The shortest time that was shown within the stage [s].
    guessed: f64,
}

impl Progress {
    /// Nothing shown yet.
    pub fn new(verbose: bool) -> Self {
        let started = Instant::now();
        Self {
            bar: None,
            verbose,
            stages: Vec::new(),
            current: 0,
            part: None,
            started,
            before: None,
            last_line: None,
            guessed: f64::INFINITY,
        }
    }

    /// A run of these stages begins.
    pub fn begin(&mut self, stages: &[Stage]) {
        self.stages = stages.to_vec();
        self.started = Instant::now();
        let dumb = std::env::var_os("TERM").is_none_or(|term| term == "dumb" || term.is_empty());
        if std::io::stderr().is_terminal() && !dumb && !self.verbose {
            let style = ProgressStyle::with_template("{bar:14} {msg}").expect("a constant template");
            let bar = ProgressBar::new(1000).with_style(style);
            bar.enable_steady_tick(Duration::from_millis(250));
            self.bar = Some(bar);
        }
    }

    /// A stage begins; one that the run did not name counts as part of the one before.
    pub fn stage(&mut self, name: &str) {
        if let Some(k) = self.stages.iter().position(|stage| stage.name == name) {
            self.current = k;
            self.last_line = None;
            self.guessed = f64::INFINITY;
            self.show(0, 0, None);
        }
    }

    /// The stages named are gone through for this `part` of the clip now.
    pub fn part(&mut self, part: usize, of: usize, stages: &[&str]) {
        let named = |stage: &Stage| stages.contains(&stage.name);
        let first = self.stages.iter().position(named).unwrap_or(0);
        let last = self.stages.iter().rposition(named).map_or(first, |last| last + 1);
        self.part = Some((part, of, first..last));
    }

    /// Shows that `done` of `of` parts of the stage are finished, and what is known of the last.
    pub fn show(&mut self, done: usize, of: usize, epoch: Option<&Epoch>) {
        let fraction = self.fraction(done as f64 / of.max(1) as f64);
        let before = *self.before.get_or_insert(fraction);
        let left = time_left(fraction - before, 1.0 - fraction, self.started.elapsed());
        let left = self.words(left);
        let text = self.text(done, of, &left);
        if let Some(bar) = &self.bar {
            bar.set_position((1000.0 * fraction) as u64);
            bar.set_message(text);
            return;
        }
        if self.last_line.is_none_or(|t| t.elapsed() > BETWEEN_LINES) || done == of && of > 0 {
            self.last_line = Some(Instant::now());
            // A bar shows it on a terminal.
            let percent = (100.0 * fraction).floor();
            aside!("{text} ({percent} %){}", epoch.filter(|_| self.verbose).map_or_else(String::new, values));
        }
    }

    /// Part of the run that is done.
    fn fraction(&self, of_stage: f64) -> f64 {
        let weight = |stages: &[Stage]| stages.iter().map(|stage| stage.weight).sum::<f64>();
        let until = |k: usize| weight(&self.stages[..k.min(self.stages.len())]);
        let present = self.stages.get(self.current).map_or(0.0, |stage| stage.weight);
        let mut done = until(self.current) + of_stage * present;
        if let Some((part, of, stages)) = self.part.as_ref().filter(|(.., s)| s.contains(&self.current)) {
            let first = until(stages.start);
            let whole = until(stages.end) - first;
            // Steps count among those of all parts.
            let of_part = (of_stage * *of as f64 - *part as f64).clamp(0.0, 1.0);
            done =
                first + (*part as f64 * whole + until(self.current) - first + of_part * present) / *of as f64;
        }
        let total = weight(&self.stages);
        if total > 0.0 { done / total } else { 0.0 }
    }

    /// A guess in words. One that has grown within its stage was wrong before and may be now: it is shown as less
    /// sure, until it is less than ever again.
    fn words(&mut self, left: Option<f64>) -> String {
        let Some(left) = left else { return String::new() };
        let word = if left <= self.guessed { "about" } else { "maybe" };
        self.guessed = self.guessed.min(left);
        format!(", {word} {} left", duration(left))
    }

    fn text(&self, done: usize, of: usize, left: &str) -> String {
        let name = self.stages.get(self.current).map_or("", |stage| stage.name);
        let steps = if of > 0 { format!(" {done}/{of}") } else { String::new() };
        let part = match self.part.as_ref().filter(|(.., stages)| stages.contains(&self.current)) {
            Some((part, of, _)) => format!(", part {} of {of}", part + 1),
            None => String::new(),
        };
        format!("stage {} of {}, {name}{steps}{part}{left}", self.current + 1, self.stages.len())
    }

    /// Ends with the error of an interruption if the user asked to stop.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn check_stop(&mut self, epoch: &Epoch) -> Result<()> {
        if !STOP.load(Ordering::SeqCst) {
            return Ok(());
        }
        self.finish();
        let Epoch { stage, step, of, .. } = epoch;
        Err(Error::Interrupted(format!("stopped in stage {stage}, step {step} of {of}")))
    }

    /// Says a line above the bar.
    pub fn line(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| aside!("{text}")),
            None => aside!("{text}"),
        }
    }

    /// Removes the bar.
    pub fn finish(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }
}

/// Seconds that the `rest` of the run will take, if so much was `done` in `elapsed`.
fn time_left(done: f64, rest: f64, elapsed: Duration) -> Option<f64> {
    (done > ENOUGH.0 && elapsed > ENOUGH.1).then(|| elapsed.as_secs_f64() * rest / done)
}

/// A time as people say it.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 55.0 => format!("{:.0} s", 5.0 * (s / 5.0).ceil()),
        s if s < 3300.0 => format!("{:.0} min", (s / 60.0).ceil()),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// Losses and parameters of a step.
fn values(epoch: &Epoch) -> String {
    let pairs = epoch.losses.iter().chain(&epoch.parameters);
    pairs.map(|(name, value)| format!("  {name} {value:.3e}")).collect()
}

/// How far a short computation without stages is: a bar on a terminal, a line now and then elsewhere.
pub struct Fraction {
    name: &'static str,
    bar: Option<ProgressBar>,
    last: std::sync::Mutex<(f64, Instant)>,
}

impl Fraction {
    /// Lines are at least this far apart.
    const BETWEEN: Duration = Duration::from_millis(500);

    /// Nothing is done yet.
    pub fn new(name: &'static str) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let style =
                ProgressStyle::with_template("{msg} {wide_bar} {percent} %").expect("a valid template");
            ProgressBar::new(100).with_style(style).with_message(name)
        });
        Self { name, bar, last: std::sync::Mutex::new((0.0, Instant::now())) }
    }

    /// The fraction `part` is done; it never goes back.
    pub fn show(&self, part: f64) {
        let mut last = self.last.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if part <= last.0 {
            return;
        }
        last.0 = part;
        match &self.bar {
            Some(bar) => bar.set_position((100.0 * part) as u64),
            None if last.1.elapsed() >= Self::BETWEEN => {
                last.1 = Instant::now();
                aside!("{}: {:.0} %", self.name, 100.0 * part);
            }
            None => {}
        }
    }

    /// It is over.
    pub fn end(&self) {
        self.bar.iter().for_each(ProgressBar::finish_and_clear);
    }
}

/// A line that counts on a terminal, nothing elsewhere.
pub fn spinner() -> ProgressBar {
    let style = ProgressStyle::with_template("{spinner} {msg}").expect("a valid template");
    ProgressBar::new_spinner().with_style(style)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(name: &'static str, weight: f64) -> Stage {
        Stage { name, weight }
    }

    #[test]
    fn the_line_tells_stage_and_time_and_fits_80_columns() {
        let mut progress = Progress::new(false);
        // The longest names of stages with steps, and of those without.
        progress.stages = vec![stage("material and light", 1.0), stage("forces and stiffnesses", 3.0)];
        progress.guessed = 60.0;
        let left = progress.words(Some(3000.0));
        let text = progress.text(99_999, 99_999, &left);
        assert_eq!(text, "stage 1 of 2, material and light 99999/99999, maybe 50 min left");
        // The bar and a space come before.
        assert!(15 + text.chars().count() < 80, "{}", text.len());
        progress.current = 1;
        assert!((progress.fraction(0.5) - 2.5 / 4.0).abs() < 1e-12);
        let text = progress.text(0, 0, &left);
        assert_eq!(text, "stage 2 of 2, forces and stiffnesses, maybe 50 min left");
        assert!(15 + text.chars().count() < 80);
    }

    #[test]
    fn parts_of_a_clip_follow_each_other() {
        let mut progress = Progress::new(false);
        let weights = [("texture", 1.0), ("track", 2.0), ("refine", 4.0), ("forces and stiffnesses", 3.0)];
        progress.stages = weights.map(|(name, weight)| stage(name, weight)).to_vec();
        let mut seen = vec![progress.fraction(1.0)];
        for part in 0..3 {
            progress.part(part, 3, &["track", "refine"]);
            for current in [1, 2] {
                progress.current = current;
                seen.extend([0.0, 0.5, 1.0].map(|done| progress.fraction((part as f64 + done) / 3.0)));
            }
        }
        progress.current = 3;
        seen.push(progress.fraction(0.0));
        assert!((seen[0] - 0.1).abs() < 1e-12 && (seen[seen.len() - 1] - 0.7).abs() < 1e-12);
        assert!((seen[7] - 0.3).abs() < 1e-12, "the first of three parts");
        assert!(seen.windows(2).all(|two| two[0] <= two[1] + 1e-12), "{seen:?}");
        progress.current = 2;
        let text = progress.text(9_999, 9_999, ", maybe 50 min left");
        assert_eq!(text, "stage 3 of 4, refine 9999/9999, part 3 of 3, maybe 50 min left");
        assert!(15 + text.chars().count() < 80);
    }

    #[test]
    fn a_time_left_that_grows_is_told_as_less_sure() {
        let mut progress = Progress::new(false);
        let told = [None, Some(50.0), Some(90.0), Some(51.0), Some(40.0)].map(|left| progress.words(left));
        let words = ["", ", about 50 s left", ", maybe 2 min left", ", maybe 55 s left", ", about 40 s left"];
        assert_eq!(told, words);
    }

    #[test]
    fn the_time_left_is_guessed_from_what_this_program_did() {
        assert_eq!(time_left(0.01, 0.5, Duration::from_secs(60)), None);
        assert_eq!(time_left(0.25, 0.5, Duration::from_secs(1)), None);
        let left = time_left(0.25, 0.5, Duration::from_secs(60)).unwrap();
        assert!((left - 120.0).abs() < 1e-9);
        let said = [3.0, 54.0, 61.0, 7200.0].map(duration);
        assert_eq!(said, ["5 s", "55 s", "2 min", "2.0 h"]);
    }
}
