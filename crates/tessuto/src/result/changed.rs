//! changed/: what would have been otherwise, simulated beforehand for the page.

use super::Folder;
use super::causes::LED;
use crate::report::EmbeddedMotion;
use crate::report::causes::Replay;
use tessuto_core::error::Result;
use tessuto_estimate::io;
use tessuto_estimate::motion::causes::{Hold, Otherwise};

/// Frames that a changed replay goes on after the clip, at most.
const FURTHER: usize = 20;
/// Time `[s]` for which a cloth that is let go is followed: it falls 0.4 m, and stays in sight.
const FALL: f64 = 0.3;
/// Factor on the bend stiffness of a stiffer cloth.
pub(crate) const STIFFER: f64 = 10.0;
/// Bytes of the page that all of them may have.
const BUDGET: usize = 4 << 20;

/// A change that is simulated beforehand.
#[derive(Debug)]
pub(crate) struct Change {
    /// Name of its file.
    pub key: &'static str,
    /// Its name for people.
    pub label: &'static str,
    /// The change.
    pub otherwise: Otherwise,
    note: &'static str,
}

impl Change {
    /// Its file in a result folder.
    pub fn file(&self) -> String {
        format!("changed/{}.npy", self.key)
    }
}

/// The changes of a clip with `fps` frames per second.
pub(crate) fn changes(fps: f64) -> [Change; 3] {
    let fall = ((FALL * fps).round() as usize).clamp(5, FURTHER);
    let plain = Otherwise::default();
    [
        Change {
            key: "still_air",
            label: "still air",
            note: "After the clip the air goes still, and what is held stays.",
            otherwise: Otherwise { further: FURTHER, air: 0.0, hold: Hold::Still, ..plain },
        },
        Change {
            key: "stiffer",
            label: "stiffer",
            note: "The clip again with ten times the bend stiffness.",
            otherwise: Otherwise { scale: [1.0, STIFFER, 1.0, 1.0], ..plain },
        },
        Change {
            key: "let_go",
            label: "let go",
            note: "After the clip all that is held is let go.",
            otherwise: Otherwise { further: fall, hold: Hold::Release, ..plain },
        },
    ]
}

/// Those that are there and fit into the page, of a clip of `frames` frames.
pub(super) fn read(saved: &Folder, frames: usize) -> Result<Vec<Replay>> {
    let (mut out, mut size) = (Vec::new(), 0);
    let beside = saved.sizes.map_or(0.0, |sizes| 1e3 * sizes.beside);
    let by_causes = format!(
        "The clip simulated with the estimated physics and the residual force: {beside:.1} mm from the found motion."
    );
    let replays = std::iter::once(("by_causes", "by its causes", by_causes, 0, LED.to_owned())).chain(
        changes(saved.fps).map(|change| {
            let from = if change.otherwise.further > 0 { frames.saturating_sub(1) } else { 0 };
            (change.key, change.label, change.note.to_owned(), from, change.file())
        }),
    );
    for (key, label, note, from, file) in replays {
        let path = saved.path().join(file);
        if !path.is_file() {
            continue;
        }
        let motion = io::npy::read_motion(&path)?;
        motion.check_vertices(saved.mesh.positions.len(), &path.display().to_string())?;
        let motion = EmbeddedMotion::new(&motion);
        size += motion.steps.len();
        if size > BUDGET {
            break;
        }
        out.push(Replay { key, label, note, from, motion });
    }
    Ok(out)
}
