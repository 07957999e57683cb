//! Notices when an optimisation leaves the valley, and keeps the way back.
//!
//! A simulation can fail without a number that is not finite: the linearised step throws cloth metres away where its
//! matrix is nearly singular. The sign of it is a loss that grows on frames that were fitted better before.

use serde::{Deserialize, Serialize};

/// Growth of the loss over the same frames that counts as divergence.
const GROWTH: f64 = 2.0;
/// After this many epochs the reference is renewed even if the loss did not fall: new frames may cost old ones.
const RENEWAL: usize = 11;

/// The last state that was sound, and how often it had to be gone back to.
#[derive(Serialize, Deserialize)]
pub(super) struct DivergenceGuard<S> {
    reference: Option<Reference<S>>,
    /// Failed epochs since the reference was last renewed.
    pub failures: usize,
    /// Factor on the learning rates: halved at every failure, doubled back when the reference is renewed.
    pub rate: f64,
}

#[derive(Serialize, Deserialize)]
struct Reference<S> {
    state: S,
    frames: usize,
    mean_loss: f64,
    age: usize,
}

impl<S: Clone> DivergenceGuard<S> {
    /// Knows of no state yet.
    pub fn new() -> Self {
        Self { reference: None, failures: 0, rate: 1.0 }
    }

    /// Whether the state to go back to, if there is one, is what `fits` says, of at most `frames` frames.
    pub fn fits(&self, frames: usize, fits: impl Fn(&S) -> bool) -> bool {
        self.reference.as_ref().is_none_or(|r| (1..=frames).contains(&r.frames) && fits(&r.state))
    }

    /// Judges `state` by its losses per frame (two frames or more): how it fails, if it does. A sound state may
    /// become the one to go back to.
    pub fn judge(&mut self, state: &S, losses: &[f64]) -> Result<(), String> {
        let mean = |losses: &[f64]| losses.iter().sum::<f64>() / losses.len() as f64;
        if let Some(frame) = losses.iter().position(|l| !l.is_finite()) {
            return Err(format!("the loss of frame {frame} is {}", losses[frame]));
        }
        let renew = match &mut self.reference {
            None => true,
            Some(reference) => {
                let now = mean(&losses[..reference.frames]);
                if now > GROWTH * reference.mean_loss {
                    return Err(format!(
                        "the loss of the first {} frames grew from {:.3e} to {now:.3e}",
                        reference.frames, reference.mean_loss
                    ));
                }
                reference.age += 1;
                // Strictly: the state that was gone back to does not count as progress.
                now < reference.mean_loss || reference.age >= RENEWAL
            }
        };
        if renew {
            let (state, mean_loss) = (state.clone(), mean(losses));
            self.reference = Some(Reference { state, frames: losses.len(), mean_loss, age: 0 });
            self.failures = 0;
            self.rate = (self.rate * 2.0).min(1.0);
        }
        Ok(())
    }

    /// The state to go back to after a failure, if there is one; the next steps shall be shorter.
    pub fn back(&mut self) -> Option<S> {
        self.failures += 1;
        self.rate *= 0.5;
        self.reference.as_mut().map(|r| {
            r.age = 0;
            r.state.clone()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_on_old_frames_is_a_failure_and_on_new_ones_is_not() {
        let mut guard = DivergenceGuard::new();
        assert!(guard.judge(&0, &[1.0, 1.0]).is_ok());
        assert!(guard.judge(&1, &[0.9, 1.0, 50.0]).is_ok());
        let failure = guard.judge(&2, &[0.9, 1.0, 150.0]).unwrap_err();
        assert!(failure.contains("first 3 frames"), "{failure}");
        assert_eq!(guard.back(), Some(1));
        assert!(guard.judge(&3, &[0.9, f64::NAN, 1.0]).unwrap_err().contains("frame 1"));
        assert_eq!((guard.back(), guard.failures, guard.rate), (Some(1), 2, 0.25));
        assert!(guard.judge(&4, &[0.8, 1.0, 40.0]).is_ok());
        assert_eq!((guard.back(), guard.rate), (Some(4), 0.25));
    }

    #[test]
    fn slow_growth_is_accepted_in_the_end_and_fast_growth_never() {
        let mut guard = DivergenceGuard::new();
        let mut epochs = (0..100).map(|n| guard.judge(&n, &[1.02f64.powi(n), 0.0]));
        assert!(epochs.all(|e| e.is_ok()));
        let mut guard = DivergenceGuard::new();
        assert!((0..100).any(|n| guard.judge(&n, &[1.3f64.powi(n), 0.0]).is_err()));
    }
}
