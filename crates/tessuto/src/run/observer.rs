//! The observer of a run.

use std::cell::RefCell;
use std::path::Path;

use crate::result::Run;
use tessuto_core::error::{Result, Warning};
use tessuto_core::image::Image;
use tessuto_core::mesh::Positions;
use tessuto_core::scene::Scene;
use tessuto_estimate::session::{self, Epoch};

/// A part of the run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stage {
    /// What [`stage`](session::Observer::stage) announces.
    pub name: &'static str,
    /// Usual part of the run's time, relative to the other stages.
    pub weight: f64,
}

/// Hears of a run, beyond the [steps](session::Observer) of its stages. Nothing of it changes the result.
pub trait Observer: session::Observer {
    /// Something about the input is doubtful.
    fn warning(&mut self, _warning: &Warning) {}

    /// The scene is loaded and the work begins, with these stages. `history` are the steps of an interrupted run
    /// that is gone on from.
    ///
    /// # Errors
    /// Ends the run.
    fn begin(&mut self, _scene: &Scene, _run: &Run, _stages: &[Stage], _history: &[Epoch]) -> Result<()> {
        Ok(())
    }

    /// The motion is found, shape [N, V], and so is the fabric's texture.
    fn motion(&mut self, _motion: &[Positions], _texture: &Image) {}
}

/// Hears and says nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl session::Observer for Silent {
    fn step(&mut self, _epoch: &Epoch, _motion: &[Positions]) -> Result<()> {
        Ok(())
    }
}

impl Observer for Silent {}

/// Lets a session speak to an observer that the run speaks to as well.
pub(super) struct Shared<'a, 'b>(pub &'a RefCell<&'b mut dyn Observer>);

impl session::Observer for Shared<'_, '_> {
    fn stage(&mut self, name: &str) {
        self.0.borrow_mut().stage(name);
    }

    fn part(&mut self, part: usize, of: usize, stages: &[&str]) {
        self.0.borrow_mut().part(part, of, stages);
    }

    fn advance(&mut self, done: usize, of: usize) {
        self.0.borrow_mut().advance(done, of);
    }

    fn note(&mut self, text: &str) {
        self.0.borrow_mut().note(text);
    }

    fn step(&mut self, epoch: &Epoch, motion: &[Positions]) -> Result<()> {
        self.0.borrow_mut().step(epoch, motion)
    }
}

/// The note on an earlier folder that was not removed.
pub(super) fn kept_aside(folder: &Path) -> String {
    format!(
        "new files appeared in the earlier folder while it was being replaced; it is kept as {}",
        folder.display()
    )
}
