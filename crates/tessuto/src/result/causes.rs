//! The causes of a motion in parameters.json, and forces.npz.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Quantity, quantity};
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_estimate::io;
use tessuto_estimate::motion::causes::{
    Cause, Causes, Constraint, Constraints, Explained, Found, Knots, Sizes, Spread,
};
use tessuto_sim::per_width::PerWidth;

/// Gravity.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Gravity {
    value: [f64; 3],
    unit: String,
    /// Of its direction.
    sd_degrees: f64,
    informed: bool,
    #[serde(flatten)]
    said: Said,
}

/// A number with its standard deviation.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Measured {
    value: f64,
    sd: f64,
    unit: String,
    informed: bool,
    #[serde(flatten)]
    said: Said,
}

/// What the video says of a number; empty in results of earlier versions.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Said {
    /// [`Constraint::word`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    constraint: Option<String>,
    /// The bound, in the number's unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    bound: Option<f64>,
    /// The number that it is traded off with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    with: Option<Cause>,
}

impl Said {
    /// Of a number of this `value`.
    pub fn new(constraint: &Constraint, value: f64) -> Self {
        Self {
            constraint: Some(constraint.word().to_owned()),
            bound: constraint.bound(value),
            with: constraint.with(),
        }
    }
}

/// What a replay needs, to the last bit, beside forces.npy and rest_lengths.npy.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Model {
    causes: Causes,
    spread: Spread,
    prior: Spread,
    knots: Knots,
    misfit: f64,
    /// Nothing in results of earlier versions.
    #[serde(default)]
    constraints: Option<Constraints>,
}

/// `causes` of parameters.json.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CauseFile {
    gravity: Gravity,
    /// Drag coefficient of the air.
    drag: Measured,
    /// Internal friction of bending and shearing.
    friction: Measured,
    /// Velocity of the air, [N, 3].
    wind: Quantity<Vec<[f64; 3]>>,
    /// Held vertices; their paths are those of motion.npy.
    held: Vec<usize>,
    /// Root mean squares.
    sizes: Quantity<Sizes>,
    /// The stiffnesses whatever the mesh [N·m, N/m], where its texture coordinates are a flat panel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    per_width: Option<PerWidth>,
    model: Model,
}

/// File of the motion without the correction.
pub(super) const LED: &str = "changed/by_causes.npy";

/// Standard deviation of a stiffness, and what the video says of it.
pub(super) fn certainty(found: &Found, k: usize) -> (f64, Constraint) {
    (found.causes.stiffness()[k] * found.spread.ln_stiffness[k], found.constraints.stiffness[k])
}

impl CauseFile {
    /// Of a video of `frames` frames, `fps` per second.
    pub fn new(explained: &Explained, frames: usize, fps: f64) -> Self {
        let found = &explained.found;
        let (causes, spread, prior) = (&found.causes, &found.spread, &found.prior);
        let said = &found.constraints;
        let measured = |value: f64, sd: f64, unit: &str, constraint: &Constraint| Measured {
            value,
            sd: value * sd,
            unit: unit.to_owned(),
            informed: constraint.is_constrained(),
            said: Said::new(constraint, value),
        };
        let wind = |n: usize| causes.wind_at(&found.knots, n as f64 / fps).to_array();
        Self {
            gravity: Gravity {
                value: causes.gravity().to_array(),
                unit: "m/s^2".to_owned(),
                sd_degrees: spread.down.to_degrees(),
                informed: said.down.is_constrained(),
                said: Said::new(&said.down, 1.0),
            },
            drag: measured(causes.drag(), spread.ln_drag, "1", &said.drag),
            friction: measured(causes.friction(), spread.ln_friction, "J s/rad^2", &said.friction),
            wind: quantity((0..frames).map(wind).collect(), "m/s"),
            held: found.held.clone(),
            sizes: quantity(explained.sizes, "m/s^2"),
            per_width: explained.per_width,
            model: Model {
                causes: causes.clone(),
                spread: *spread,
                prior: *prior,
                knots: found.knots,
                misfit: found.misfit,
                constraints: Some(*said),
            },
        }
    }

    /// What was found, given the lengths of the edges from `folder`.
    pub fn found(&self, folder: &Path, mesh: &Mesh) -> Result<Found> {
        let path = folder.join("rest_lengths.npy");
        let bad = |problem: String| Error::input(path.display().to_string(), problem, super::UNCHANGED);
        let rest_lengths = io::npy::read(&path)?.data;
        let edges = mesh.edges().len();
        if rest_lengths.len() != edges || rest_lengths.iter().any(|l| !(*l > 0.0 && l.is_finite())) {
            return Err(bad(format!(
                "{} lengths, mesh.obj has {edges} edges; all must be above 0",
                rest_lengths.len()
            )));
        }
        let Model { causes, spread, prior, knots, misfit, constraints } = self.model.clone();
        let numbers =
            causes.ln_stiffness.iter().chain([&causes.ln_drag, &causes.ln_friction]).all(|x| x.is_finite());
        let vertices = mesh.positions.len();
        let wind = causes.wind.len() == knots.count && knots.count >= 2 && knots.end > 0.0;
        if !numbers
            || !wind
            || !causes.wind.iter().all(|w| w.is_finite())
            || self.held.iter().any(|v| *v >= vertices)
        {
            return Err(Error::input(
                folder.join("parameters.json").display().to_string(),
                "the physics is that of another mesh",
                super::UNCHANGED,
            ));
        }
        let constraints = constraints.unwrap_or_else(|| Found::by_deviations(&causes, &spread, &prior));
        Ok(Found { causes, spread, prior, knots, held: self.held.clone(), rest_lengths, misfit, constraints })
    }

    /// Multiplies the stiffnesses of the model by 10 to the power of `log10`.
    pub fn scale(&mut self, found: &Found, log10: [f64; 3]) {
        for (k, l) in log10.iter().enumerate() {
            self.model.causes.ln_stiffness[k] = found.causes.ln_stiffness[k] + l * std::f64::consts::LN_10;
        }
        if let Some(widths) = &mut self.per_width {
            let [stretch, bend, shear] = log10.map(|l| 10f64.powf(l));
            widths.membrane.iter_mut().for_each(|e| *e *= stretch);
            widths.bending.iter_mut().for_each(|d| *d *= bend);
            widths.shear *= shear;
        }
    }

    /// Stiffnesses whatever the mesh.
    pub fn per_width(&self) -> Option<PerWidth> {
        self.per_width
    }

    /// The sizes.
    pub fn sizes(&self) -> Sizes {
        self.sizes.value
    }
}

/// Writes forces.npz, `gravity`, `air`, `friction`, `hold`, `residual` and `correction` [N − 1, V, 3] m/s² of this
/// many `vertices`, `rest_lengths.npy`, one for each edge, m, and the motion without the correction.
pub(super) fn write_forces(folder: &Path, explained: &Explained, vertices: usize) -> Result<()> {
    let parts = &explained.parts;
    let shape = [parts.air.len(), vertices, 3];
    let bytes = |field: &[Positions]| {
        let numbers: Vec<f32> = field.iter().flatten().flat_map(|a| a.as_vec3().to_array()).collect();
        io::npy::encode(&shape, &numbers)
    };
    let gravity: Vec<Positions> = vec![vec![parts.gravity; vertices]; parts.air.len()];
    let arrays = [
        ("gravity", bytes(&gravity)),
        ("air", bytes(&parts.air)),
        ("friction", bytes(&parts.friction)),
        ("hold", bytes(&parts.hold)),
        ("residual", bytes(&parts.residual)),
        ("correction", bytes(&parts.correction)),
    ];
    io::atomic_write(&folder.join("forces.npz"), &io::npy::archive(&arrays))?;
    let led = folder.join(LED);
    let place = led.parent().expect("in a folder");
    std::fs::create_dir_all(place).map_err(|source| Error::Output { path: place.to_path_buf(), source })?;
    io::npy::write_field(&led, &explained.led)?;
    let lengths: Vec<f32> = explained.found.rest_lengths.iter().map(|l| *l as f32).collect();
    io::npy::write(&folder.join("rest_lengths.npy"), &[lengths.len()], &lengths)
}
