//! The quantities that a frame is judged by, and from where on they are wrong.
//!
//! The limits say where a reconstruction is no longer what the video shows or what cloth does. Those of the image
//! were set on made-up clips of 48 to 160 pixels (`tools/stress.py --scenes 200`), such that most frames whose
//! vertices are off by 15 mm of a sheet of 0.5 m are flagged and few others, and on recordings of which the error is
//! known, whose folds are finer than the mesh. That a high 99th percentile of strain is doubtful but does not lose
//! a frame was decided after seeing one recording whose coarse mesh folds between its vertices.
//!
//! | quantity | doubtful from | lost from | why |
//! |---|---|---|---|
//! | part of the mask that the mesh leaves uncovered | 6 % | 10 % | a square moved by as much of its side: 30 mm and 50 mm of 0.5 m; a hem that the first frame hides and that unrolls later is 5 %, and of 1819 made-up frames (seeds 131, 137) 3 % alone flagged none that was off |
//! | intersection over union of the silhouettes, of plain cloth | 0.90 | 0.75 | a square moved by 5 % and by 14 % of its side |
//! | correlation of the prints | 0.60 | 0.40 | the print explains a third and a sixth of the local contrast; 0 is another print |
//! | \|strain\| of the 99th percentile of threads | 50 % | | a place where a fold of the template has opened, or a spike; of 4515 made-up frames (seeds 43, 61, 71, 101, 103) 20 % alone flagged 32 that were right and none that was off by 15 mm |
//! | mean \|strain\| of the threads | 5 % | 10 % | the whole cloth, where woven cloth gives way by 1 to 3 % |
//! | creased inner edges | 5 % | 15 % | one sharp fold across n×n vertices is 1 / 3n of them |
//! | area in flipped triangles | 1 % | 5 % | a sound sheet has none; one spike of a coarse mesh is 1 to 2 % |
//! | standard deviation of the positions, of the sheet's size, times ⁴√((u + 0.5 %) / 1 %) of the part u of the mask, at most 1 %, that the mesh leaves uncovered | 1.96 % | 5 % | chosen on made-up frames (seeds 223 to 241); of those of eight other seeds (251 to 283) it and the other quantities flag 93 % of the ones off by 15 mm of 0.5 m and 4.5 % of the others |
//!
//! Where a print is to be seen it shows whether the mesh is too large, and what is drawn outside the mask may be
//! hidden by something in front. Where there is none, only the silhouette can show it. The PSNR of the colours is
//! reported but not judged: the recovered texture holds the first frame's light, and where the light on the cloth
//! changes, the true motion has a PSNR that falls by 30 dB.

use super::State;
use crate::metrics::agreement::FrameAgreement;
use crate::metrics::names::SILHOUETTE;

/// Correlations of the prints below this are doubtful.
pub const CORRELATION: f64 = 0.60;

/// What a deviation counts where this part of the mask is uncovered: a sheet that covers all of it is surer. 1 at
/// half a percent.
fn uncovering(part: Option<f64>) -> f64 {
    part.map_or(1.0, |u| ((u.min(0.01) + 0.005) / 0.01).powf(0.25))
}

/// One line of the table above.
pub(super) struct Criterion {
    /// Doubtful and lost from here on.
    limits: [f64; 2],
    /// The larger, the worse; the second argument is the size of the sheet `[m]`.
    pub cost: fn(&FrameAgreement, f64) -> Option<f64>,
    /// A cost in words.
    pub words: fn(f64) -> String,
}

pub(super) const CRITERIA: [Criterion; 8] = [
    Criterion {
        limits: [0.06, 0.10],
        cost: |f, _| f.uncovered,
        words: |cost| format!("{:.0} % of the mask not covered", 100.0 * cost),
    },
    Criterion {
        limits: [0.10, 0.25],
        cost: |f, _| f.silhouette.filter(|_| f.correlation.is_none()).map(|v| 1.0 - v),
        words: |cost| format!("{SILHOUETTE} {:.0} %", 100.0 * (1.0 - cost)),
    },
    Criterion {
        limits: [1.0 - CORRELATION, 0.60],
        cost: |f, _| f.correlation.map(|v| 1.0 - v),
        words: |cost| format!("texture displaced, correlation {:.2}", 1.0 - cost),
    },
    Criterion {
        limits: [0.50, f64::INFINITY],
        cost: |f, _| Some(f.strain_p99),
        words: |cost| format!("1 thread in 100 strained by {:.0} % or more", 100.0 * cost),
    },
    Criterion {
        limits: [0.05, 0.10],
        cost: |f, _| Some(f.strain_mean),
        words: |cost| format!("threads strained by {:.0} % on average", 100.0 * cost),
    },
    Criterion {
        limits: [0.05, 0.15],
        cost: |f, _| Some(f.creased),
        words: |cost| format!("{:.0} % of the edges creased", 100.0 * cost),
    },
    Criterion {
        limits: [0.01, 0.05],
        cost: |f, _| Some(f.flipped),
        words: |cost| format!("{:.0} % of the area in flipped triangles", 100.0 * cost),
    },
    Criterion {
        limits: [0.0196, 0.05],
        cost: |f, size| f.deviation.map(|d| d / size * uncovering(f.uncovered)),
        words: |cost| format!("positions uncertain by {:.0} % of the sheet's size", 100.0 * cost),
    },
];

impl Criterion {
    pub fn state(&self, frame: &FrameAgreement, size: f64) -> State {
        let [doubtful, lost] = self.limits;
        match (self.cost)(frame, size) {
            Some(cost) if cost >= lost || cost.is_nan() => State::Lost,
            Some(cost) if cost >= doubtful => State::Doubtful,
            _ => State::Found,
        }
    }
}
