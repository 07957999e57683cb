//! What is searched: the sheet, what is known of it, and how finely it is simulated.

use glam::DVec3;

use super::drive::Drive;
use super::forces::{Causes, Knots, Spread};
use super::held::{Guess, held_vertices};
use super::lengths::rest_lengths;
use super::objective::{Data, Prior};
use super::search::Search;
use super::{CauseSettings, Found, cut_cloth};
use crate::motion::inverse::accelerations::interpolated;
use crate::motion::parameters::Dynamics;
use tessuto_core::camera::Viewpoint;
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_core::scene::Known;
use tessuto_sim::cloth::Edge;
use tessuto_sim::{Cloth, panel};

/// Deviation of positions of which nothing better is known `[m]`.
const UNKNOWN: f64 = 0.01;
/// What deviations count here, over what is said of the positions: springs cannot follow all that found positions do.
const CAUTION: f64 = 1.2;
/// Strength of the ties of held vertices [1/s²].
pub(super) const HOLD: f64 = 1e9;
/// Drag coefficient at the start: that of a plate across the wind.
const DRAG: f64 = 1.2;
/// Spread of its logarithm: a sheet that hardly moves says nothing of it, but plates have from half to twice as much.
const DRAG_SPREAD: f64 = 0.5;
/// Internal friction at the start [J·s/rad²] and the spread of its logarithm: without these it stands for gravity,
/// and for the hold, of a sheet that hangs from more than was found.
const FRICTION: f64 = 1e-5;
const FRICTION_SPREAD: f64 = 1.0;
/// Spread of gravity's direction about +y `[rad]`.
const TILT: f64 = 0.35;
/// The same about a direction that is known `[rad]`: of what a level or a phone's sensor measures.
pub(super) const KNOWN_TILT: f64 = 0.01;

/// How finely the cloth is simulated.
pub(super) struct Grain {
    /// Longest step `[s]`; the simulation is of second order.
    step: f64,
    /// How far a step's solution may be off `[m]`.
    tolerance: f64,
}

pub(super) const FINE: Grain = Grain { step: 0.01, tolerance: 1e-5 };
/// First, and while hands are looked for: a frame of most videos.
pub(super) const COARSE: Grain = Grain { step: 0.034, tolerance: 1e-4 };

/// A sheet whose causes are searched, and what is known of it and them.
pub(super) struct Sheet<'a> {
    pub template: &'a Mesh,
    /// How every frame is seen, shape `[N]`.
    views: &'a [Viewpoint],
    /// Shape [N, V] `[m]`.
    pub deviations: Vec<Vec<f64>>,
    pub fps: f64,
    pub dynamics: &'a Dynamics,
    pub settings: &'a CauseSettings,
    /// Without load, before the search has a say.
    pub rest_lengths: Vec<f64>,
    cloth: Cloth,
    ways: Vec<[f64; 2]>,
    mean: Causes,
    pub spread: Spread,
    pub guess: Guess,
}

impl<'a> Sheet<'a> {
    pub fn new(
        (template, known, views): (&'a Mesh, &Known, &'a [Viewpoint]),
        found: &[Positions],
        deviations: Option<&[Vec<f64>]>,
        (fps, dynamics): (f64, &'a Dynamics),
        settings: &'a CauseSettings,
    ) -> Self {
        let unknown = || vec![vec![UNKNOWN; template.positions.len()]; found.len()];
        let cautious =
            |of: &[Vec<f64>]| of.iter().map(|of| of.iter().map(|d| CAUTION * d).collect()).collect();
        let rest_lengths = rest_lengths(template, found);
        let down = known.down.unwrap_or(DVec3::Y);
        let guess = match &known.held {
            Some(held) => Guess { held: held.clone(), wider: Vec::new(), still: true, told: true },
            None => held_vertices(template, (found, views), down),
        };
        let ln = |log10: f64| log10 * std::f64::consts::LN_10;
        let mean = Causes {
            ln_stiffness: dynamics.springs().map(|range| ln(range.start)),
            down,
            ln_drag: DRAG.ln(),
            ln_friction: FRICTION.ln(),
            ln_length: [0.0; 2],
            wind: Vec::new(),
        };
        let s = settings.spread;
        let spread = Spread {
            ln_stiffness: [0.5 * s, s, s],
            down: if known.down.is_some() { KNOWN_TILT } else { TILT },
            ln_drag: DRAG_SPREAD,
            ln_friction: FRICTION_SPREAD,
        };
        let cloth = cut_cloth(template, &rest_lengths);
        Self {
            template,
            views,
            deviations: deviations.map_or_else(unknown, cautious),
            fps,
            dynamics,
            settings,
            rest_lengths,
            ways: ways(template, &cloth),
            cloth,
            mean,
            spread,
            guess,
        }
    }

    /// The search for causes of the motion `found`.
    pub fn task<'t>(&'t self, found: &'t [Positions], grain: &Grain) -> Task<'t> {
        let Self { settings, dynamics, fps, .. } = self;
        let ln = |log10: f64| log10 * std::f64::consts::LN_10;
        let window = (settings.window / self.cloth.masses.len()).clamp(8, 1 << 20).min(found.len());
        let end = ((window - 1) as f64 / fps).max(1e-6);
        let knots = Knots { count: ((end / settings.wind_interval).round() as usize + 1).max(2), end };
        let substeps = (1.0 / (fps * grain.step) - 1e-9).ceil().clamp(1.0, 64.0) as usize;
        Task {
            cloth: &self.cloth,
            ways: &self.ways,
            data: Data::new(&found[..window], &self.deviations, self.views, *fps),
            prior: Prior {
                mean: Causes { wind: vec![DVec3::ZERO; knots.count], ..self.mean.clone() },
                spread: self.spread,
                wind: [0.1 * settings.wind, settings.wind, 0.5 * settings.wind],
            },
            bounds: dynamics.springs().map(|range| [ln(range.low), ln(range.high)]),
            tie: settings.tie,
            targets: interpolated(&found[..window], substeps),
            h: 1.0 / (fps * substeps as f64),
            substeps,
            tolerance: grain.tolerance,
            knots,
        }
    }

    /// `found`, and with it the lengths of the edges, by `causes`.
    pub fn with(&self, found: &Found, causes: Causes) -> Found {
        let mut out = Found { causes, ..found.clone() };
        // As they are written: a replay starts from the same bits.
        let lengths = std::mem::take(&mut out.causes.ln_length);
        for ((out, length), [u, v]) in out.rest_lengths.iter_mut().zip(&self.rest_lengths).zip(&self.ways) {
            *out = f64::from((*length * (u * lengths[0] + v * lengths[1]).exp()) as f32);
        }
        out
    }
}

/// What is searched, except who holds the cloth.
pub(super) struct Task<'a> {
    cloth: &'a Cloth,
    ways: &'a [[f64; 2]],
    pub data: Data<'a>,
    pub prior: Prior,
    /// Of ln stiffnesses.
    bounds: [[f64; 2]; 3],
    tie: f64,
    pub targets: Vec<Positions>,
    h: f64,
    pub substeps: usize,
    tolerance: f64,
    pub knots: Knots,
}

impl Task<'_> {
    fn drive(&self, held: &[usize]) -> Drive<'_> {
        let mut ties = vec![self.tie; self.cloth.masses.len()];
        held.iter().for_each(|v| ties[*v] = HOLD);
        Drive {
            cloth: self.cloth,
            h: self.h,
            tolerance: self.tolerance,
            substeps: self.substeps,
            targets: &self.targets,
            ties,
            ways: self.ways,
            knots: self.knots,
        }
    }

    /// What `end` makes of the search for causes where `held` vertices are held, starting from `start`
    /// near the steps of a similar run; `None` where the cloth cannot be simulated so.
    pub fn search<T>(
        &self,
        held: &[usize],
        (start, near): (&Causes, &[Positions]),
        end: impl FnOnce(Search) -> T,
    ) -> Option<T> {
        let drive = self.drive(held);
        Some(end(Search::new(&drive, &self.data, &self.prior, start.clone(), near, self.bounds).ok()?))
    }
}

/// How much of every edge runs along u and along v of the panel.
pub(super) fn ways(template: &Mesh, cloth: &Cloth) -> Vec<[f64; 2]> {
    let Some(flat) = panel(template) else { return vec![[0.5; 2]; cloth.edges.len()] };
    let way = |edge: &Edge| {
        let d = edge.along(&flat).normalize_or_zero();
        [d.x * d.x, d.y * d.y]
    };
    cloth.edges.iter().map(way).collect()
}
