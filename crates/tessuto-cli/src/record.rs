//! `--rerun`: a recording for the rerun viewer, written while a reconstruction runs.

use std::fs::{File, OpenOptions};
use std::io::Read;
use std::path::{Path, PathBuf};

use tessuto::export::rrd::{Recording, Subject, is_ours};
use tessuto::session::{Epoch, identity};
use tessuto::{Config, Error, Image, Positions, Result, Scene};

use crate::remedy;
use crate::say::aside;

/// As much of a file as says what it is.
const START: u64 = 512;

/// The recording of a run. What goes wrong with it later costs nothing but the recording.
pub struct Recorder {
    recording: Option<Recording<File>>,
    failure: Option<Error>,
}

impl Recorder {
    /// Refuses a `file` that must not be written: something else than a recording of this program, or a place in the
    /// result folder `out`, which appears as a whole.
    ///
    /// # Errors
    /// [`Error::Input`], [`Error::Usage`].
    pub fn check(file: &Path, out: &Path) -> Result<()> {
        let place = || file.display().to_string();
        let mut start = Vec::new();
        let opened = File::open(file).and_then(|f| f.take(START).read_to_end(&mut start));
        // An empty file is what a run leaves that was killed at once.
        if file.exists() && !(opened.is_ok() && (start.is_empty() || is_ours(&start))) {
            let problem = "was not written by tessuto, and would be lost";
            return Err(Error::input(place(), problem, "choose another file for --rerun, or move it away"));
        }
        let whole = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
        let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| whole(path));
        let folder = whole(file).parent().map_or_else(PathBuf::new, real);
        if folder.starts_with(real(out)) {
            return Err(Error::usage(
                format!("--rerun {}: lies in the result folder, which is replaced as a whole", place()),
                "choose a file outside of it",
            ));
        }
        Ok(())
    }

    /// Starts `file` with what is known of `scene`, and with the steps of `history` if the run goes on from there.
    ///
    /// # Errors
    /// [`Error::Output`]; those of reading the frames.
    pub fn start(file: &Path, scene: &Scene, settings: &Config, history: &[Epoch]) -> Result<Self> {
        let opened = OpenOptions::new().write(true).create(true).truncate(true).open(file);
        let out = opened.map_err(|source| Error::Output { path: file.to_path_buf(), source })?;
        // The same run is the same recording.
        let settings = serde_json::to_string(settings).expect("plain data");
        let id = identity(scene, &format!("{} {settings}", env!("CARGO_PKG_VERSION")))?;
        let mut recording = Recording::begin(out, file, &id, &Subject::of_scene(scene))?;
        history.iter().try_for_each(|epoch| recording.step(epoch, &[]))?;
        Ok(Self { recording: Some(recording), failure: None })
    }

    /// Records a finished step.
    pub fn step(&mut self, epoch: &Epoch, motion: &[Positions]) {
        self.attempt(|recording| recording.step(epoch, motion));
    }

    /// Writes the recovered motion, and its texture.
    pub fn motion(&mut self, motion: &[Positions], texture: &Image) {
        self.attempt(|recording| recording.motion(motion).and_then(|()| recording.texture(texture)));
    }

    /// Writes a better texture.
    pub fn texture(&mut self, texture: &Image) {
        self.attempt(|recording| recording.texture(texture));
    }

    /// The work is done.
    ///
    /// # Errors
    /// [`Error::Output`] if anything could not be written.
    pub fn finish(mut self) -> Result<()> {
        match (self.failure.take(), self.recording.take()) {
            (Some(failure), _) => Err(failure),
            (None, recording) => recording.map_or(Ok(()), Recording::end),
        }
    }

    fn attempt(&mut self, write: impl FnOnce(&mut Recording<File>) -> Result<()>) {
        let Some(recording) = &mut self.recording else { return };
        if let Err(error) = write(recording) {
            aside!("warning: the recording ends here: {}", remedy::error(&error));
            self.failure = Some(error);
            self.recording = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_recordings_outside_of_the_result_are_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let out = at("result");
        std::fs::create_dir(&out).unwrap();
        std::fs::write(at("empty.rrd"), b"").unwrap();
        std::fs::write(at("other.rrd"), b"RRF2 of another program").unwrap();
        for name in ["new.rrd", "empty.rrd", "result.rrd", "no/such/folder.rrd"] {
            Recorder::check(&at(name), &out).unwrap();
        }
        for (name, reason, status) in [
            ("other.rrd", "not written by", 3),
            ("result", "not written by", 3),
            ("result/a.rrd", "as a whole", 2),
        ] {
            let error = Recorder::check(&at(name), &out).unwrap_err();
            assert_eq!(error.exit_code(), status);
            assert!(error.to_string().contains(reason) && error.to_string().contains(name), "{error}");
        }
        // A result that is not there yet.
        assert!(Recorder::check(&at("later/a.rrd"), &at("later")).is_err());
    }
}
