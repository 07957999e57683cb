//! How far a motion is from what is known of the true one: Chamfer distance, point-to-surface distance, depth
//! difference, distances of vertices and of tracked points, per frame and as means over the frames of which
//! something is known; and how good material maps are ([`maps`]). Without truth: how well the frames agree with
//! the video and with what cloth can do ([`agreement`]), and whether that is good ([`verdict`]).

pub mod agreement;
pub mod causes;
pub mod chamfer;
pub mod depth;
mod frame;
pub mod maps;
pub mod names;
pub mod published;
mod resample;
pub(crate) mod similarity;
mod table;
pub(crate) mod tracked;
mod validate;
pub mod verdict;

pub use agreement::{AgreementMeter, FrameAgreement};
#[doc(hidden)]
pub use agreement::{overlaps, print_correlation};
pub use causes::CauseMetrics;
pub use maps::MapMetrics;
pub use similarity::{correlation, local_correlation, masked_psnr, psnr, ssim};
pub use table::table;
pub use verdict::{Counts, FrameVerdict, OverFrames, State, Verdict, judge, judge_frames};

use std::ops::Range;

use serde::{Deserialize, Serialize};
use tessuto_core::parallel;

use tessuto_core::camera::Viewpoint;
use tessuto_core::error::Result;
use tessuto_core::mesh::{Mesh, Motion};
use tessuto_core::scene::{Scene, Truth};

/// What a motion is compared with.
#[derive(Debug, Clone)]
pub struct Inputs<'a> {
    /// The mesh whose vertices move, shape `[V]`.
    pub template: &'a Mesh,
    /// How every frame is seen, shape `[N]`, or one for all. Any cameras whose pixel grid is the video's: the full
    /// image's or a crop's.
    pub views: Vec<Viewpoint>,
    /// What is known of the true motion, shape `[N]`.
    pub truth: &'a Truth,
    /// Number of the first frame, for the output and the random stream.
    pub first_frame: usize,
}

impl<'a> From<&'a Scene> for Inputs<'a> {
    fn from(scene: &'a Scene) -> Self {
        Self {
            template: &scene.template,
            views: scene.viewpoints(),
            truth: &scene.truth,
            first_frame: scene.first_frame,
        }
    }
}

impl Inputs<'_> {
    /// How the frame of this index is seen.
    ///
    /// # Panics
    /// If no view is given.
    pub(crate) fn view(&self, index: usize) -> &Viewpoint {
        self.views.get(index).unwrap_or_else(|| self.views.last().expect("one view at least"))
    }
}

/// Errors of one frame, or their means. What the truth does not allow to measure is absent.
///
/// P: measured points, S: as many area-uniform samples of the mesh, T: its triangles.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// L1 Chamfer distance `[m]`: mean_P min_S |p−s| + mean_S min_P |p−s|.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cd1: Option<f64>,
    /// L2 Chamfer distance `[m²]`: the same with squared distances.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cd2: Option<f64>,
    /// Point-to-surface distance `[m]`: mean_P min_T d(p, t) + mean_T min_P d(p, t), exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p2s1: Option<f64>,
    /// The same with squared distances `[m²]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p2s2: Option<f64>,
    /// Point-to-surface distance `[m]` by the inexact formula of the published evaluator.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p2s1_published: Option<f64>,
    /// The same with squared distances `[m²]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p2s2_published: Option<f64>,
    /// Depth difference δ `[m]`: mean |z_mesh − z_measured| over the points the mesh covers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<f64>,
    /// Mean distance `[m]` of corresponding vertices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertex: Option<f64>,
    /// Mean distance `[m]` of the tracked points from their places on the mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub track: Option<f64>,
    /// Distance `[m]` that 90 % of the tracked points do not exceed; as a mean over frames: of the points of all
    /// frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub track_p90: Option<f64>,
    /// Largest distance `[m]` of a tracked point; as a mean over frames: of all frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub track_worst: Option<f64>,
}

/// Name, meaning and unit of one field of [`Metrics`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quantity {
    /// Key in JSON.
    pub key: &'static str,
    /// What it is, for people.
    pub label: &'static str,
    /// `"m"` or `"m²"`.
    pub unit: &'static str,
}

/// The fields of [`Metrics`], in the order of [`Metrics::values`].
pub const QUANTITIES: [Quantity; 11] = [
    Quantity { key: "cd1", label: "Chamfer distance, L1", unit: "m" },
    Quantity { key: "cd2", label: "Chamfer distance, L2", unit: "m²" },
    Quantity { key: "p2s1", label: "point to surface, L1", unit: "m" },
    Quantity { key: "p2s2", label: "point to surface, L2", unit: "m²" },
    Quantity { key: "p2s1_published", label: "point to surface, L1, published variant (inexact)", unit: "m" },
    Quantity {
        key: "p2s2_published",
        label: "point to surface, L2, published variant (inexact)",
        unit: "m²",
    },
    Quantity { key: "depth", label: "depth difference", unit: "m" },
    Quantity { key: "vertex", label: "distance of corresponding vertices", unit: "m" },
    Quantity { key: "track", label: "distance of tracked points", unit: "m" },
    Quantity { key: "track_p90", label: "distance of tracked points, 90 % below", unit: "m" },
    Quantity { key: "track_worst", label: "distance of tracked points, largest", unit: "m" },
];

/// Place of the depth difference, the last one of [`QUANTITIES`] that is measured from points.
const DEPTH: usize = 6;

impl Metrics {
    /// The values in the order of [`QUANTITIES`].
    pub fn values(&self) -> [Option<f64>; 11] {
        [
            self.cd1,
            self.cd2,
            self.p2s1,
            self.p2s2,
            self.p2s1_published,
            self.p2s2_published,
            self.depth,
            self.vertex,
            self.track,
            self.track_p90,
            self.track_worst,
        ]
    }

    fn from_values(values: [Option<f64>; 11]) -> Self {
        let [cd1, cd2, p2s1, p2s2, p2s1_published, p2s2_published, depth, vertex, ..] = values;
        let [.., track, track_p90, track_worst] = values;
        Self {
            cd1,
            cd2,
            p2s1,
            p2s2,
            p2s1_published,
            p2s2_published,
            depth,
            vertex,
            track,
            track_p90,
            track_worst,
        }
    }
}

/// Errors of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FrameMetrics {
    /// Number of the frame in the scene folder.
    pub frame: usize,
    /// Its errors.
    #[serde(flatten)]
    pub metrics: Metrics,
}

/// Errors of a motion.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Means over those of `frames` whose truth is of the kind; absent where the mesh does not allow to measure
    /// one of them.
    pub mean: Metrics,
    /// One entry per evaluated frame with any truth, ascending.
    pub frames: Vec<FrameMetrics>,
    /// Number of frames of the motion that were to be evaluated and have no truth.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub frames_without_truth: usize,
    /// Material maps and re-rendered frames, where the result has them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub maps: Option<MapMetrics>,
    /// Stiffnesses and forces, where the result knows their causes and the scene the true ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub causes: Option<CauseMetrics>,
    /// Agreement with the video, which needs no truth; one entry per frame of the result, ascending.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub agreement: Vec<FrameAgreement>,
    /// What follows from it: whether each of these frames is to be trusted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub verdicts: Vec<FrameVerdict>,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl Evaluation {
    /// Number of frames that were to be evaluated, with truth or without.
    pub fn frame_count(&self) -> usize {
        self.frames.len() + self.frames_without_truth
    }

    /// Number of frames with a value of quantity `k` of [`QUANTITIES`].
    pub fn frames_with(&self, k: usize) -> usize {
        self.frames.iter().filter(|f| f.metrics.values()[k].is_some()).count()
    }

    /// `truth in 12 of 80 frames`, if it is not in all.
    pub fn partial_truth(&self) -> Option<String> {
        let count = self.frame_count();
        (self.frames_without_truth > 0).then(|| format!("truth in {} of {count} frames", self.frames.len()))
    }
}

/// Errors of `motion` against the truth of `inputs`, for the frames `range` (indices into `motion`) that have any.
///
/// - `motion`: vertex positions `[m]`, camera frame, shape [N, V]
/// - `seed`: of the surface samples; a frame's samples depend on `seed` and its number only
///
/// The result does not depend on the number of threads.
/// `Error::Input` when shapes differ, values are not finite or there is no truth.
pub fn evaluate(inputs: &Inputs, motion: &Motion, range: Range<usize>, seed: u64) -> Result<Evaluation> {
    validate::validate(inputs, motion, &range)?;
    let triangles = inputs.template.triangles();
    let count = range.len();
    let known = range.filter(|k| inputs.truth.knows(*k)).collect();
    let measured: Vec<(FrameMetrics, Vec<f64>)> = parallel::consume(known, |_, k| {
        let (metrics, tracked) = frame::measure(inputs, &triangles, &motion[k], k, seed);
        (FrameMetrics { frame: inputs.first_frame + k, metrics }, tracked)
    });
    let (frames, tracked): (Vec<FrameMetrics>, Vec<Vec<f64>>) = measured.into_iter().unzip();
    let over_points = tracked::Distances::of(tracked.concat());
    let mean = Metrics {
        track_p90: over_points.as_ref().map(|d| d.p90),
        track_worst: over_points.as_ref().map(|d| d.worst),
        ..mean(&frames)
    };
    let frames_without_truth = count - frames.len();
    Ok(Evaluation { mean, frames, frames_without_truth, ..Evaluation::default() })
}

fn mean(frames: &[FrameMetrics]) -> Metrics {
    let values: Vec<_> = frames.iter().map(|f| f.metrics.values()).collect();
    Metrics::from_values(std::array::from_fn(|k| {
        // A frame with points has all that is measured from points; else it is not known, which is no reason to
        // leave it out.
        let of_points = k <= DEPTH;
        let known: Vec<_> =
            values.iter().filter(|v| if of_points { v[0].is_some() } else { v[k].is_some() }).collect();
        let sum = known.iter().map(|v| v[k]).try_fold(0.0, |sum, v| v.map(|v| sum + v));
        sum.filter(|_| !known.is_empty()).map(|sum| sum / known.len() as f64)
    }))
}
