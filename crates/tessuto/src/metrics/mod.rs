//! How far a motion is from what is known of the true one: Chamfer distance, point-to-surface
//! distance, depth difference and vertex distance, per frame and as means over the frames; and how
//! good material maps are ([`maps`]). Without truth: how well the frames agree with the video and with what cloth can do
//! ([`agreement`]), and whether that is good ([`verdict`]).

pub mod agreement;
mod boxes;
pub mod chamfer;
pub mod depth;
mod frame;
pub mod maps;
pub mod published;
mod resample;
pub(crate) mod similarity;
pub mod surface;
mod table;
pub mod verdict;

pub use agreement::{AgreementMeter, FrameAgreement};
pub use maps::MapMetrics;
pub use similarity::{correlation, masked_psnr, print_correlation, psnr, ssim};
pub use table::table;
pub use verdict::{Grade, OverFrames, Verdict, judge};

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::error::{Error, Hint, Remedy, Result};
use crate::mesh::{Mesh, Motion, Positions};
use crate::scene::{Scene, Truth};

/// What a motion is compared with.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// The mesh whose vertices move, shape `[V]`.
    pub template: &'a Mesh,
    /// Any camera whose pixel grid is the video's: the full image's or a crop's.
    pub camera: &'a Camera,
    /// What is known of the true motion, shape `[N]`.
    pub truth: &'a Truth,
    /// Number of the first frame, for the output and the random stream.
    pub first_frame: usize,
}

impl<'a> From<&'a Scene> for Inputs<'a> {
    fn from(scene: &'a Scene) -> Self {
        Self {
            template: &scene.template,
            camera: &scene.camera,
            truth: &scene.truth,
            first_frame: scene.first_frame,
        }
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
pub const QUANTITIES: [Quantity; 8] = [
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
];

impl Metrics {
    /// The values in the order of [`QUANTITIES`].
    pub fn values(&self) -> [Option<f64>; 8] {
        [
            self.cd1,
            self.cd2,
            self.p2s1,
            self.p2s2,
            self.p2s1_published,
            self.p2s2_published,
            self.depth,
            self.vertex,
        ]
    }

    fn from_values(values: [Option<f64>; 8]) -> Self {
        let [cd1, cd2, p2s1, p2s2, p2s1_published, p2s2_published, depth, vertex] = values;
        Self { cd1, cd2, p2s1, p2s2, p2s1_published, p2s2_published, depth, vertex }
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
    /// Means over `frames`; absent where any frame lacks the value.
    pub mean: Metrics,
    /// One entry per evaluated frame, ascending.
    pub frames: Vec<FrameMetrics>,
    /// Material maps and re-rendered frames, where the result has them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub maps: Option<MapMetrics>,
    /// Agreement with the video, which needs no truth; one entry per frame of the result, ascending.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub agreement: Vec<FrameAgreement>,
}

/// Errors of `motion` against the truth of `inputs`, for the frames `range` (indices into `motion`).
///
/// - `motion`: vertex positions `[m]`, camera frame, shape [N, V]
/// - `seed`: of the surface samples; a frame's samples depend on `seed` and its number only
///
/// The result does not depend on the number of threads.
/// `Error::Input` when shapes differ, values are not finite or there is no truth.
pub fn evaluate(inputs: &Inputs, motion: &Motion, range: Range<usize>, seed: u64) -> Result<Evaluation> {
    validate(inputs, motion, &range)?;
    let triangles = inputs.template.triangles();
    let frames: Vec<FrameMetrics> = range
        .into_par_iter()
        .map(|k| FrameMetrics {
            frame: inputs.first_frame + k,
            metrics: frame::measure(inputs, &triangles, &motion[k], k, seed),
        })
        .collect();
    Ok(Evaluation { mean: mean(&frames), frames, ..Evaluation::default() })
}

fn mean(frames: &[FrameMetrics]) -> Metrics {
    let mut sum = [Some(0.0); 8];
    for frame in frames {
        for (sum, value) in sum.iter_mut().zip(frame.metrics.values()) {
            *sum = sum.zip(value).map(|(a, b)| a + b);
        }
    }
    Metrics::from_values(sum.map(|s| s.map(|s| s / frames.len() as f64)))
}

fn validate(inputs: &Inputs, motion: &Motion, range: &Range<usize>) -> Result<()> {
    let Inputs { template, truth, first_frame, .. } = inputs;
    let count = template.positions.len();
    if truth.points.is_none() && truth.vertices.is_none() {
        return Err(Error::input(
            "ground truth",
            "the scene has neither measured points nor true vertices",
            "add gt/points/points_000.npy … or gt/vertices.npy to the scene folder",
        ));
    }
    if range.is_empty() || range.end > motion.len() {
        return Err(Error::input(
            "frames",
            format!(
                "frames {}..{} were asked for, the motion has {} frames",
                range.start,
                range.end,
                motion.len()
            ),
            "choose a range A..B with A < B inside the motion",
        ));
    }
    let lengths = [
        ("gt/points", truth.points.as_ref().map(Vec::len)),
        ("gt/vertices.npy", truth.vertices.as_deref().map(<[_]>::len)),
    ];
    for (name, length) in lengths {
        if let Some(length) = length.filter(|l| *l != motion.len()) {
            return Err(Error::input(
                "motion",
                format!("it has {} frames, {name} has {length}", motion.len()),
                Hint::from("evaluate a result of this scene, and of these frames; of a file of a part, take that part")
                    .with(Remedy::Frames(None)),
            ));
        }
    }
    motion.check_vertices(count, "motion")?;
    truth.vertices.iter().try_for_each(|vertices| vertices.check_vertices(count, "gt/vertices.npy"))?;
    for (k, points) in truth.points.iter().flatten().enumerate() {
        let place = format!("gt/points, frame {}", first_frame + k);
        if let Some(i) = points.iter().position(|p| !p.is_finite() || p.z <= 0.0) {
            let problem = format!("point {i} is {}, not in front of the camera", points[i]);
            return Err(Error::input(place, problem, "remove such points from the file"));
        }
        if points.is_empty() {
            return Err(Error::input(
                place,
                "there are no points",
                Hint::from("choose frames that have points").with(Remedy::Frames(None)),
            ));
        }
    }
    check_scale("gt/vertices.npy", truth.vertices.as_deref(), motion, 2)?;
    check_scale("gt/points", truth.points.as_deref(), motion, 20)?;
    let area = template.area();
    if area <= 0.0 || !area.is_finite() {
        return Err(Error::input("template", format!("its area is {area} m²"), "give a mesh with faces"));
    }
    Ok(())
}

/// Refuses a truth that is of another size than the motion by far: a wrong unit. Less than `least` points tell no size.
fn check_scale(place: &str, truth: Option<&[Positions]>, motion: &[Positions], least: usize) -> Result<()> {
    let Some(first) = truth.and_then(|t| t.first()).filter(|t| t.len() >= least) else { return Ok(()) };
    let diagonal = |positions: &Positions| {
        let low = positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        (high - low).length()
    };
    let ratio = diagonal(first) / diagonal(&motion[0]);
    if (0.1..=10.0).contains(&ratio) || !ratio.is_finite() {
        return Ok(());
    }
    let problem = format!("in the first frame it is {ratio:.3e} times as large as the motion");
    Err(Error::input(
        place,
        problem,
        "give the truth in the unit of the template, see \"units\" in scene.json",
    ))
}
