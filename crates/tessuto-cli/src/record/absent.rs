//! `--rerun` where the feature `rerun` is left out: refused before the work.

use std::path::Path;

use tessuto::session::Epoch;
use tessuto::{Config, Error, Image, Positions, Result, Scene};

/// There is none.
pub enum Recorder {}

impl Recorder {
    /// Refuses every file.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check(file: &Path, _out: &Path) -> Result<()> {
        Err(refusal(file))
    }

    /// As [`check`](Self::check).
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn start(file: &Path, _scene: &Scene, _settings: &Config, _history: &[Epoch]) -> Result<Self> {
        Err(refusal(file))
    }

    /// Cannot be called.
    pub fn step(&mut self, _epoch: &Epoch, _motion: &[Positions]) {
        match *self {}
    }

    /// Cannot be called.
    pub fn motion(&mut self, _motion: &[Positions], _texture: &Image) {
        match *self {}
    }

    /// Cannot be called.
    pub fn texture(&mut self, _texture: &Image) {
        match *self {}
    }

    /// Cannot be called.
    ///
    /// # Errors
    /// None.
    pub fn finish(self) -> Result<()> {
        match self {}
    }
}

fn refusal(file: &Path) -> Error {
    Error::left_out(format!("--rerun {}", file.display()), "rerun")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_refused_with_the_way_out() {
        let error = Recorder::check(Path::new("a.rrd"), Path::new("result")).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        let message = crate::remedy::error(&error);
        assert!(message.contains("--rerun a.rrd") && message.contains("--features full"), "{message}");
    }
}
