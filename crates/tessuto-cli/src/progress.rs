//! Progress of a running reconstruction.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use tessuto::session::Epoch;
use tessuto::{Error, Positions, Result};

use crate::live::Live;
use crate::record::Recorder;
use crate::say::aside;

/// Set by Ctrl-C and SIGTERM.
static STOP: AtomicBool = AtomicBool::new(false);

/// Asks the running step to be the last one when the user interrupts; a second interrupt ends at once.
pub fn stop_on_interrupt() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::SeqCst) {
            std::process::exit(75);
        }
    })?;
    Ok(())
}

/// Progress of all stages: a bar with the time left on a terminal, a line now and then elsewhere.
pub struct Progress {
    bar: Option<ProgressBar>,
    stage: &'static str,
    started: Instant,
    last_line: Instant,
    /// A page that shows the same.
    pub live: Option<Live>,
    /// A recording of it.
    pub recorder: Option<Recorder>,
}

impl Progress {
    /// Nothing shown yet.
    pub fn new() -> Self {
        let now = Instant::now();
        Self { bar: None, stage: "", started: now, last_line: now, live: None, recorder: None }
    }

    /// Shows a finished step, and the motion so far where there is a page for it.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if the user asked to stop.
    pub fn step(&mut self, epoch: &Epoch, motion: &[Positions]) -> Result<()> {
        if STOP.load(Ordering::SeqCst) {
            self.finish();
            return Err(Error::Interrupted(format!(
                "stopped in stage {}, step {} of {}",
                epoch.stage, epoch.step, epoch.of
            )));
        }
        if let Some(live) = &mut self.live {
            live.step(epoch, motion);
        }
        if let Some(recorder) = &mut self.recorder {
            recorder.step(epoch, motion);
        }
        if self.stage != epoch.stage {
            self.begin(epoch);
        }
        let text = describe(epoch);
        match &self.bar {
            Some(bar) => {
                bar.set_position(epoch.step as u64);
                bar.set_message(text);
            }
            None => self.line(epoch, &text),
        }
        Ok(())
    }

    fn begin(&mut self, epoch: &Epoch) {
        self.finish();
        self.stage = epoch.stage;
        self.started = Instant::now();
        if std::io::stderr().is_terminal() {
            let style = ProgressStyle::with_template(
                "{prefix:>9} {bar:24} {pos:>4}/{len} {elapsed_precise} left {eta_precise} {wide_msg}",
            )
            .expect("a constant template");
            let bar = ProgressBar::new(epoch.of as u64).with_style(style).with_prefix(epoch.stage);
            bar.enable_steady_tick(Duration::from_millis(250));
            self.bar = Some(bar);
        }
    }

    /// A plain line at the first and last step and every five seconds.
    fn line(&mut self, epoch: &Epoch, text: &str) {
        let due = self.last_line.elapsed() > Duration::from_secs(5);
        if due || epoch.step == 1 || epoch.step == epoch.of {
            self.last_line = Instant::now();
            let left =
                self.started.elapsed().as_secs_f64() / epoch.step as f64 * (epoch.of - epoch.step) as f64;
            aside!("{:>9} {:>4}/{} left {left:.0} s  {text}", epoch.stage, epoch.step, epoch.of);
        }
    }

    /// Ends the present bar.
    pub fn finish(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish();
        }
    }
}

/// Losses and parameters in one line.
fn describe(epoch: &Epoch) -> String {
    let mut text = format!("frames {}", epoch.active_frames);
    for (name, value) in epoch.losses.iter().chain(&epoch.parameters) {
        text.push_str(&format!("  {name} {value:.3e}"));
    }
    text
}
