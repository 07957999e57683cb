//! What a long computation talks to: an observer of its steps, checkpoints, and resuming from them.
//!
//! A stage asks [`Session::restore`] for the state that an interrupted run left, resumes from there or starts, and
//! reports every finished step with its present state. The state is written now and then, and when the caller asks to
//! stop. A resumed computation does the same operations on the same numbers, so that its result has the same bytes.

mod checkpoint;
mod epoch;
mod identity;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::time::Instant;

use serde::Serialize;
use serde::de::DeserializeOwned;

pub use checkpoint::{Checkpoints, Found};
pub use epoch::{Epoch, Name, named};
pub use identity::identity;

use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::mesh::Positions;

/// Name of the part of a checkpoint that holds the steps so far.
const HISTORY: &str = "history";

/// Hears of a computation's progress.
pub trait Observer {
    /// A stage begins.
    fn stage(&mut self, _name: &str) {}

    /// The `stages` that follow are those of one of so many parts of the clip, which are gone through one after the
    /// other, each with all of them; `part` counts from 0.
    fn part(&mut self, _part: usize, _of: usize, _stages: &[&str]) {}

    /// Progress of a stage without steps of its own.
    fn advance(&mut self, _done: usize, _of: usize) {}

    /// Something that the user may want to know.
    fn note(&mut self, _text: &str) {}

    /// A step is finished. `motion` is the motion so far of the first frames, empty from stages that do not change it.
    ///
    /// # Errors
    /// Ends the computation with this error.
    fn step(&mut self, epoch: &Epoch, motion: &[Positions]) -> Result<()>;
}

/// A closure that hears of steps only.
struct Steps<F>(F);

impl<F: FnMut(&Epoch, &[Positions]) -> Result<()>> Observer for Steps<F> {
    fn step(&mut self, epoch: &Epoch, motion: &[Positions]) -> Result<()> {
        self.0(epoch, motion)
    }
}

/// See the module.
pub struct Session<'a> {
    observer: Box<dyn Observer + 'a>,
    checkpoints: Option<Checkpoints>,
    /// The stages' latest states, as [`to_bytes`] writes them.
    states: BTreeMap<String, Vec<u8>>,
    history: Vec<Epoch>,
    timings: Vec<(String, f64)>,
    /// The present stage, and since when.
    stage: Option<(String, Instant)>,
    /// The observer's error, while a step is awaited that can be saved.
    stopping: Option<Error>,
    /// The part of the clip at work, of how many, and the motion before it.
    part: Option<(usize, usize, Vec<Positions>)>,
}

impl<'a> Session<'a> {
    /// A session whose steps `observer` hears of, as an [`Observer`] would.
    pub fn new(observer: impl FnMut(&Epoch, &[Positions]) -> Result<()> + 'a) -> Self {
        Self::observed(Steps(observer))
    }

    /// A session that `observer` hears of.
    pub fn observed(observer: impl Observer + 'a) -> Self {
        Self {
            observer: Box::new(observer),
            checkpoints: None,
            states: BTreeMap::new(),
            history: Vec::new(),
            timings: Vec::new(),
            stage: None,
            stopping: None,
            part: None,
        }
    }

    /// Nobody hears, nothing is kept.
    pub fn silent() -> Self {
        Self::new(|_, _| Ok(()))
    }

    /// Saves states to `checkpoints` from now on, and resumes from `found`.
    ///
    /// # Errors
    /// [`Error::Input`] if the history in `found` cannot be read.
    pub fn keep_in(&mut self, checkpoints: Checkpoints, found: Option<Found>) -> Result<()> {
        self.checkpoints = Some(checkpoints);
        self.states = found.map(|f| f.parts).unwrap_or_default();
        if let Some(bytes) = self.states.remove(HISTORY) {
            self.history = postcard::from_bytes(&bytes).map_err(|e| unreadable(HISTORY, &e))?;
        }
        Ok(())
    }

    /// The state that an interrupted run left of `stage`; `None` if it did not come to it.
    ///
    /// # Errors
    /// [`Error::Input`] if it cannot be read.
    pub fn restore<T: DeserializeOwned>(&self, stage: &str) -> Result<Option<T>> {
        let read = |bytes: &Vec<u8>| postcard::from_bytes(bytes).map_err(|e| unreadable(stage, &e));
        self.states.get(stage).map(read).transpose()
    }

    /// Whether the next step's state would be written; stages whose state is dear to copy ask first.
    pub fn wants_state(&self) -> bool {
        self.checkpoints.as_ref().is_some_and(|c| self.stopping.is_some() || c.is_due())
    }

    /// Keeps what `stage` ended with.
    pub fn finish(&mut self, stage: &str, state: &impl Serialize) {
        if self.checkpoints.is_some() {
            self.states.insert(stage.to_owned(), to_bytes(state));
        }
    }

    /// Reports a finished step. `state` is what the stage named in `epoch` resumes from, `None` where it could not.
    ///
    /// # Errors
    /// What the observer returned; [`Error::Output`] if a checkpoint cannot be written.
    pub fn step(
        &mut self,
        epoch: &Epoch,
        motion: &[Positions],
        state: Option<&impl Serialize>,
    ) -> Result<()> {
        let (epoch, motion) = self.of_clip(epoch, motion);
        let epoch = &*epoch;
        self.history.push(epoch.clone());
        if self.stopping.is_none() {
            self.stopping = self.observer.step(epoch, &motion).err();
        }
        let Some(checkpoints) = &self.checkpoints else { return self.stopping.take().map_or(Ok(()), Err) };
        // Stopping waits for a step that can be saved.
        let Some(state) = state else { return Ok(()) };
        if self.stopping.is_some() || checkpoints.is_due() {
            self.finish(&epoch.stage, state);
            self.save(epoch)?;
        }
        self.stopping.take().map_or(Ok(()), Err)
    }

    /// Reports a step of a stage that is too short to be gone on from: it would start anew.
    ///
    /// # Errors
    /// What the observer returned.
    pub fn tell(&mut self, epoch: &Epoch) -> Result<()> {
        self.history.push(epoch.clone());
        self.observer.step(epoch, &[])
    }

    /// The `stages` that follow are those of `part` of `of` of the clip: their steps count among those of all parts,
    /// and the motion so far begins with what was found `before`, shape [., V].
    pub fn begin_part(&mut self, part: usize, of: usize, stages: &[&str], before: &[Positions]) {
        self.part = Some((part, of, before.to_vec()));
        self.observer.part(part, of, stages);
    }

    /// The last part of the clip is done: of the `stages` nothing is kept.
    pub fn end_part(&mut self, stages: &[&str]) {
        self.part = None;
        stages.iter().for_each(|stage| drop(self.states.remove(*stage)));
    }

    /// A step of the present part, and its motion, as one of the whole clip.
    fn of_clip<'e, 'm>(
        &self,
        epoch: &'e Epoch,
        motion: &'m [Positions],
    ) -> (Cow<'e, Epoch>, Cow<'m, [Positions]>) {
        let Some((part, of, before)) = &self.part else {
            return (Cow::Borrowed(epoch), Cow::Borrowed(motion));
        };
        let mut epoch = epoch.clone();
        (epoch.step, epoch.of) = (part * epoch.of + epoch.step, of * epoch.of);
        epoch.active_frames += before.len();
        let motion = match motion.is_empty() {
            true => Cow::Borrowed(motion),
            false => Cow::Owned(before.iter().chain(motion).cloned().collect()),
        };
        (Cow::Owned(epoch), motion)
    }

    fn save(&mut self, epoch: &Epoch) -> Result<()> {
        let Some(checkpoints) = &mut self.checkpoints else { return Ok(()) };
        self.states.insert(HISTORY.to_owned(), to_bytes(&self.history));
        let saved = checkpoints.save(&format!("{} {}/{}", epoch.stage, epoch.step, epoch.of), &self.states);
        self.states.remove(HISTORY);
        saved
    }

    /// Steps so far, those of an interrupted run that is gone on from included.
    pub fn history(&self) -> &[Epoch] {
        &self.history
    }

    /// Steps so far of the `stages`.
    pub fn history_of(&self, stages: &[&str]) -> Vec<Epoch> {
        self.history.iter().filter(|e| stages.contains(&&*e.stage)).cloned().collect()
    }

    /// Begins `stage`: the time until the next one begins is its own.
    pub fn begin(&mut self, stage: &str) {
        self.end();
        self.observer.stage(stage);
        self.stage = Some((stage.to_owned(), Instant::now()));
    }

    /// Ends the present stage.
    pub fn end(&mut self) {
        if let Some((name, start)) = self.stage.take() {
            let seconds = start.elapsed().as_secs_f64();
            match self.timings.iter_mut().find(|(of, _)| *of == name) {
                Some((_, sum)) => *sum += seconds,
                None => self.timings.push((name, seconds)),
            }
        }
    }

    /// Reports how much of the present stage, which has no steps, is done.
    pub fn advance(&mut self, done: usize, of: usize) {
        self.observer.advance(done, of);
    }

    /// Passes a remark on to the observer.
    pub fn note(&mut self, text: &str) {
        self.observer.note(text);
    }

    /// Ended stages and their wall times `[s]`, of this run alone.
    pub fn timings(&self) -> &[(String, f64)] {
        &self.timings
    }
}

/// Postcard, without the names of fields: only the version that wrote a checkpoint reads it. What reads any order of
/// fields was a tenth of all there is to compile in this crate.
fn to_bytes(value: &impl Serialize) -> Vec<u8> {
    postcard::to_allocvec(value).expect("plain data in memory")
}

/// The error of a state of `stage` that is of another computation, whatever the checkpoint's header says.
pub(crate) fn foreign_state(stage: &str) -> Error {
    unreadable(stage, &"it has other frames, vertices or sizes than this computation")
}

fn unreadable(stage: &str, error: &dyn std::fmt::Display) -> Error {
    Error::input(
        format!("checkpoint, {stage}"),
        error.to_string(),
        Hint::from("start afresh; if this version wrote it, that is a fault of tessuto")
            .with(Remedy::NoResume),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums squares; the state is (next number, sum).
    fn compute(session: &mut Session) -> Result<u64> {
        let (mut k, mut sum) = session.restore("squares")?.unwrap_or((0u64, 0u64));
        while k < 10 {
            sum += k * k;
            k += 1;
            let epoch = Epoch { stage: "squares".into(), step: k as usize, of: 10, ..Epoch::default() };
            // Only even states can be gone on from.
            session.step(&epoch, &[], k.is_multiple_of(2).then_some(&(k, sum)))?;
        }
        Ok(sum)
    }

    #[test]
    fn steps_of_a_part_count_among_those_of_all_parts() {
        let mut heard = Vec::new();
        let mut session = Session::new(|epoch, motion| {
            heard.push((epoch.step, epoch.of, epoch.active_frames, motion.len()));
            Ok(())
        });
        let x = vec![glam::DVec3::ZERO; 2];
        let epoch =
            || Epoch { stage: "squares".into(), step: 3, of: 10, active_frames: 4, ..Epoch::default() };
        session.begin_part(1, 3, &["squares"], &[x.clone(), x.clone()]);
        session.begin("squares");
        session.step(&epoch(), std::slice::from_ref(&x), None::<&()>).unwrap();
        session.step(&epoch(), &[], None::<&()>).unwrap();
        session.end_part(&["squares"]);
        session.begin("squares");
        session.step(&epoch(), &[x], None::<&()>).unwrap();
        session.end();
        assert_eq!(session.timings().len(), 1, "the times of a stage add up");
        drop(session);
        assert_eq!(heard, [(13, 30, 6, 3), (13, 30, 6, 0), (3, 10, 4, 1)]);
    }

    #[test]
    fn a_stopped_computation_goes_on_where_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let open = || Checkpoints::open(folder.path(), "same".into(), std::time::Duration::MAX);
        for stop in 1..10 {
            let mut session = Session::new(|epoch, _| match epoch.step == stop {
                true => Err(Error::Interrupted("test".into())),
                false => Ok(()),
            });
            session.keep_in(open(), None).unwrap();
            let error = compute(&mut session).unwrap_err();
            assert_eq!(error.exit_code(), 75);
            let mut heard = Vec::new();
            let mut session = Session::new(|epoch, _| {
                heard.push(epoch.step);
                Ok(())
            });
            let found = open().newest(&mut |_| {}).unwrap();
            session.keep_in(open(), found).unwrap();
            assert_eq!(compute(&mut session).unwrap(), 285);
            let steps: Vec<usize> = session.history_of(&["squares"]).iter().map(|e| e.step).collect();
            assert_eq!(steps, (1..=10).collect::<Vec<_>>());
            drop(session);
            assert_eq!(heard.first().copied().unwrap_or(11), stop.next_multiple_of(2) + 1);
            open().remove().unwrap();
        }
    }
}
