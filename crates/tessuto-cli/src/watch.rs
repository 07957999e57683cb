//! The observer of a run: progress on the terminal, the page of `--live`, the recording of `--rerun`.

use std::path::{Path, PathBuf};

use tessuto::Warning;
use tessuto::metrics::QUANTITIES;
use tessuto::metrics::names::LIT;
use tessuto::result::{self, Run, Summary};
use tessuto::run::{Observer, Outcome, Stage};
use tessuto::session::{self, Epoch};
use tessuto::text::quoted;
use tessuto::{Image, Positions, Result, Scene, io};

use crate::findings::wrapped;
use crate::live::{Live, Server};
use crate::progress::Progress;
use crate::record::Recorder;
use crate::remedy;
use crate::say::{aside, say};

/// What a user sees of a run.
pub struct Watch {
    progress: Progress,
    /// The command that repeats the run, for the page.
    command: String,
    server: Option<Server>,
    live: Option<Live>,
    file: Option<PathBuf>,
    recorder: Option<Recorder>,
}

impl Watch {
    /// Progress on the terminal only.
    pub fn new(verbose: bool) -> Self {
        let progress = Progress::new(verbose);
        Self { progress, command: String::new(), server: None, live: None, file: None, recorder: None }
    }

    /// A page at `port` and a recording in `file` besides, of a run into `out` that `command` repeats.
    ///
    /// # Errors
    /// [`tessuto::Error::Usage`] if the port is taken; [`tessuto::Error::Input`] if the file is not ours.
    pub fn with(
        mut self,
        (port, file): (Option<u16>, Option<&Path>),
        out: &Path,
        command: &str,
    ) -> Result<Self> {
        file.map_or(Ok(()), |file| Recorder::check(file, out))?;
        self.server = port.map(Server::bind).transpose()?;
        self.file = file.map(Path::to_path_buf);
        command.clone_into(&mut self.command);
        Ok(self)
    }

    /// The run has ended: removes the bar.
    pub fn stop(&mut self) {
        self.progress.finish();
    }

    /// The result is at `out`: the page becomes its report, the recording gets its material.
    ///
    /// # Errors
    /// [`tessuto::Error::Output`] if the recording could not be written.
    pub fn finish(mut self, out: &Path) -> Result<()> {
        let mut recorded = Ok(());
        if let Some(mut recorder) = self.recorder.take() {
            let diffuse = out.join("material/diffuse.png");
            if diffuse.is_file() {
                recorder.texture(&io::image::read(&diffuse)?);
            }
            recorded = recorder.finish();
        }
        if let Some(live) = self.live.take() {
            live.finish(&out.join("report.html"));
        }
        recorded
    }
}

impl session::Observer for Watch {
    fn stage(&mut self, name: &str) {
        self.progress.stage(name);
    }

    fn part(&mut self, part: usize, of: usize, stages: &[&str]) {
        self.progress.part(part, of, stages);
    }

    fn advance(&mut self, done: usize, of: usize) {
        self.progress.show(done, of, None);
    }

    fn note(&mut self, text: &str) {
        self.progress.line(&format!("note: {text}"));
    }

    fn step(&mut self, epoch: &Epoch, motion: &[Positions]) -> Result<()> {
        self.progress.check_stop(epoch)?;
        if let Some(live) = &mut self.live {
            live.step(epoch, motion);
        }
        if let Some(recorder) = &mut self.recorder {
            recorder.step(epoch, motion);
        }
        self.progress.show(epoch.step, epoch.of, Some(epoch));
        Ok(())
    }
}

impl Observer for Watch {
    fn warning(&mut self, warning: &Warning) {
        self.progress.line(&format!("warning: {}", remedy::warning(warning)));
    }

    fn begin(&mut self, scene: &Scene, run: &Run, stages: &[Stage], history: &[Epoch]) -> Result<()> {
        let [width, height] = [scene.camera.width, scene.camera.height];
        let [frames, vertices] = [scene.frames.len(), scene.template.positions.len()];
        aside!("{}: {frames} frames of {width}×{height} px, {vertices} vertices", scene.name);
        if let Some(server) = self.server.take() {
            aside!("live at {}", server.address());
            self.live = Some(server.start(result::live_page(scene, run, &self.command)?));
        }
        if let Some(file) = &self.file {
            self.recorder = Some(Recorder::start(file, scene, &run.settings, history)?);
        }
        self.progress.begin(stages);
        Ok(())
    }

    fn motion(&mut self, motion: &[Positions], texture: &Image) {
        if let Some(recorder) = &mut self.recorder {
            recorder.motion(motion, texture);
        }
    }
}

/// Says what a run found, and where it is.
pub fn report(outcome: &Outcome, out: &Path) {
    if let Some(evaluation) = &outcome.evaluation {
        for (quantity, value) in QUANTITIES.iter().zip(evaluation.mean.values()) {
            if let Some(value) = value {
                say!("{:<16} {value:.4e} {}", quantity.key, quantity.unit);
            }
        }
        if let Some(part) = evaluation.partial_truth() {
            say!("{part}");
        }
    }
    if let Some(psnr) = outcome.rerendered_psnr {
        report_appearance(psnr, &outcome.timings);
    }
    report_verdict(&outcome.summary, out);
    say!("{}", out.display());
    say!("  look at {}", out.join("report.html").display());
    say!("  and at  {}", out.join("pictures/contact_sheet.png").display());
}

/// Says whether the frames of the result at `out` are found, and what to do about lost ones.
pub fn report_verdict(summary: &Summary, out: &Path) {
    match (summary.warning(), &summary.verdict) {
        (Some(warning), _) => {
            let text = remedy::warning(&warning).replace("RESULT", &quoted(out));
            let (found, hint) = text.split_once("\n  ").unwrap_or((&text, ""));
            aside!("{}", wrapped(&format!("warning: {found}")));
            if !hint.is_empty() {
                aside!("  {}", wrapped(hint));
            }
        }
        (None, Some(verdict)) => say!("{}", wrapped(&verdict.sentence)),
        (None, None) => {}
    }
}

/// Says how well material and light explain the video, and how long that took.
pub fn report_appearance(psnr: f64, timings: &[(String, f64)]) {
    say!("{LIT:<16} {psnr:.2} dB");
    for (stage, seconds) in timings.iter().rev().take(2).rev() {
        say!("{stage:<18} {seconds:.0} s");
    }
}
