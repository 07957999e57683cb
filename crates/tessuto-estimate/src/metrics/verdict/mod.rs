//! Whether a result can be trusted, without truth: a state for every frame with its reason, and a sentence on them all.
//!
//! A frame is judged by its worst quantity: see [`criteria`]. metrics.json holds the [`FrameVerdict`] of every frame,
//! summary.json the [`Verdict`].

pub mod criteria;
mod words;

use std::fmt;

use serde::{Deserialize, Serialize};

use self::criteria::CRITERIA;
use super::agreement::FrameAgreement;
use tessuto_core::error::{Hint, Remedy, Warning};
use tessuto_core::mesh::Mesh;

/// How far a frame is to be trusted; the later, the worse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// It agrees with the video, and cloth can be so.
    Found,
    /// Somewhat wrong, or wrong in a place.
    Doubtful,
    /// Another cloth or another motion.
    Lost,
}

impl State {
    /// All of them, the best first.
    pub const ALL: [Self; 3] = [Self::Found, Self::Doubtful, Self::Lost];

    /// As a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Found => "found",
            Self::Doubtful => "doubtful",
            Self::Lost => "lost",
        }
    }
}

/// The verdict on one frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameVerdict {
    /// Number of the frame in the scene folder.
    pub frame: usize,
    /// How far it is to be trusted.
    pub state: State,
    /// The quantities that decided, in words, the worst ones only; empty for a frame that is found.
    pub reason: String,
}

/// A quantity over the frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OverFrames {
    /// Mean over the frames that have it.
    pub mean: f64,
    /// Worst value.
    pub worst: f64,
    /// Number of the frame of the worst value, the first of them.
    pub frame: usize,
}

/// Numbers of frames by state.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// [`State::Found`].
    pub found: usize,
    /// [`State::Doubtful`].
    pub doubtful: usize,
    /// [`State::Lost`].
    pub lost: usize,
}

impl fmt::Display for Counts {
    /// All of them, such as `60 frames found, 12 doubtful, 8 lost`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { found, doubtful, lost } = self;
        write!(
            f,
            "{found} frame{} found, {doubtful} doubtful, {lost} lost",
            if *found == 1 { "" } else { "s" }
        )
    }
}

/// What the frames say together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// State of the worst frame.
    pub state: State,
    /// The same in words, with the frames and the numbers that decided.
    pub sentence: String,
    /// How many frames are in which state.
    pub counts: Counts,
    /// Where frames are doubtful: [first, one past the last] of each stretch, ascending.
    pub doubtful: Vec<[usize; 2]>,
    /// Where frames are lost, likewise.
    pub lost: Vec<[usize; 2]>,
    /// See [`FrameAgreement::silhouette`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub silhouette: Option<OverFrames>,
    /// See [`FrameAgreement::uncovered`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncovered: Option<OverFrames>,
    /// PSNR `[dB]`, see [`FrameAgreement::psnr`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psnr: Option<OverFrames>,
    /// See [`FrameAgreement::correlation`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correlation: Option<OverFrames>,
    /// See [`FrameAgreement::strain_mean`].
    pub strain_mean: OverFrames,
    /// See [`FrameAgreement::strain_p99`].
    pub strain_p99: OverFrames,
    /// See [`FrameAgreement::strain_max`].
    pub strain_max: OverFrames,
    /// See [`FrameAgreement::creased`].
    pub creased: OverFrames,
    /// See [`FrameAgreement::flipped`].
    pub flipped: OverFrames,
    /// `[m]`, see [`FrameAgreement::deviation`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deviation: Option<OverFrames>,
}

/// Judges every frame of a motion of `template` by its agreement.
pub fn judge_frames(frames: &[FrameAgreement], template: &Mesh) -> Vec<FrameVerdict> {
    let size = template.area().sqrt();
    let judged = |f: &FrameAgreement| {
        let states = CRITERIA.map(|c| c.state(f, size));
        let state = states.into_iter().max().unwrap_or(State::Found);
        let deciding =
            CRITERIA.iter().zip(states).filter(|(_, s)| *s == state && state > State::Found).map(|(c, _)| c);
        let reasons: Vec<String> =
            deciding.map(|c| (c.words)((c.cost)(f, size).unwrap_or(f64::NAN))).collect();
        FrameVerdict { frame: f.frame, state, reason: reasons.join(", ") }
    };
    frames.iter().map(judged).collect()
}

/// Judges a motion of `template` by the agreement of its frames; None without frames.
pub fn judge(frames: &[FrameAgreement], template: &Mesh) -> Option<Verdict> {
    let over = |value: fn(&FrameAgreement) -> Option<f64>, larger_is_worse: bool| {
        let values: Vec<(usize, f64)> = frames.iter().filter_map(|f| Some((f.frame, value(f)?))).collect();
        let cost = |v: f64| if larger_is_worse { v } else { -v };
        let worst = values.iter().copied().reduce(|a, b| if cost(b.1) > cost(a.1) { b } else { a })?;
        let mean = values.iter().map(|(_, v)| v).sum::<f64>() / values.len() as f64;
        Some(OverFrames { mean, worst: worst.1, frame: worst.0 })
    };
    let verdicts = judge_frames(frames, template);
    let count = |state| verdicts.iter().filter(|v| v.state == state).count();
    let mut verdict = Verdict {
        state: verdicts.iter().map(|v| v.state).max()?,
        sentence: String::new(),
        counts: Counts {
            found: count(State::Found),
            doubtful: count(State::Doubtful),
            lost: count(State::Lost),
        },
        doubtful: stretches(&verdicts, State::Doubtful),
        lost: stretches(&verdicts, State::Lost),
        silhouette: over(|f| f.silhouette, false),
        uncovered: over(|f| f.uncovered, true),
        psnr: over(|f| f.psnr, false),
        correlation: over(|f| f.correlation, false),
        strain_mean: over(|f| Some(f.strain_mean), true)?,
        strain_p99: over(|f| Some(f.strain_p99), true)?,
        strain_max: over(|f| Some(f.strain_max), true)?,
        creased: over(|f| Some(f.creased), true)?,
        flipped: over(|f| Some(f.flipped), true)?,
        deviation: over(|f| f.deviation, true),
    };
    verdict.sentence = match verdict.state {
        State::Found => words::praise(&verdict),
        _ => words::complaint(&verdict, frames, template.area().sqrt()),
    };
    Some(verdict)
}

/// [first, one past the last] of each stretch of frames in `state`.
fn stretches(verdicts: &[FrameVerdict], state: State) -> Vec<[usize; 2]> {
    let numbers: Vec<usize> = verdicts.iter().filter(|v| v.state == state).map(|v| v.frame).collect();
    numbers.chunk_by(|a, b| a + 1 == *b).map(|run| [run[0], run[run.len() - 1] + 1]).collect()
}

impl Verdict {
    /// What to report to whoever waits for the result: nothing if all frames are found; if some are lost, also what
    /// to do.
    pub fn warning(&self) -> Option<Warning> {
        let warning = |hint| Warning { topic: "verdict".to_owned(), found: self.sentence.clone(), hint };
        match self.state {
            State::Found => None,
            State::Doubtful => Some(warning(None)),
            State::Lost => {
                let text = "look at these frames in report.html and at their masks; film more frames a second, with a \
                            shorter exposure, or move the fabric more slowly; or leave the lost frames out of exports";
                Some(warning(Some(Hint::from(text).with(Remedy::Check).with(Remedy::WithoutLost))))
            }
        }
    }
}

#[cfg(test)]
mod tests;
