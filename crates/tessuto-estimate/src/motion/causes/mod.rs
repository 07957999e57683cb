//! From a motion to its causes: stiffnesses, gravity, air and what holds the cloth.
//!
//! For every vertex m a = −∂E/∂x − c θ̇ ∂θ/∂x + m g + air + hold + m D. The cloth is flat as cut
//! ([`tessuto_sim::Cloth::flat`]), its angles θ have internal friction c ([`tessuto_sim::Cloth::rub`]), g has a
//! known size, air acts across the cloth and the wind's velocity w changes smoothly in time, few vertices are
//! held; D is what is left.
//!
//! The unknowns p, ln stiffnesses, the direction of g, ln C_d, ln c, ln of the panel's two lengths and the wind at
//! [`Knots`], make a motion x(p) by a drive: a simulation of second order in time whose held vertices follow their
//! found paths and whose others are tied to theirs by weak springs, the gain of a steady filter: they keep errors
//! of the model from growing without end. p minimises
//!
//!   1/ν Σ ½ τ² ln(1 + e²/τ²) + priors,   e² = ‖(x(p) − found)/σ‖²,
//!
//! with σ, the deviations of the found positions times 1.2, soft along the view ray and firm across it, and as
//! errors are smooth in space and time, the number ν of vertices and frames that err together; ν grows where the
//! model is off by more than σ. So stiffnesses never meet the noise of found positions, which regression on these
//! treats as softness, and the inverse of the Gauss-Newton matrix says how sure they are.
//!
//! Positions and causes are found in turn: roughly the causes ([`begin`]), the motion that they make
//! ([`Begun::motion`]), positions whose accelerations are near those of that motion
//! ([`crate::motion::spacetime::Problem::along`]), and finely the causes of these ([`Begun::explain`]).

mod changes;
mod constraint;
mod drive;
mod explained;
mod fit;
mod follow;
mod forces;
mod grips;
mod guide;
mod held;
mod lead;
mod lengths;
mod objective;
mod parts;
mod profile;
mod search;
mod settings;
mod task;

pub use changes::{Changes, Hold, Otherwise};
pub use constraint::{Cause, Constraint, Constraints};
pub use explained::{Explained, Sizes};
pub use fit::{Begun, PARTS, begin, find};
pub use follow::follow;
pub use forces::{Causes, GRAVITY, Knots, Spread};
pub use parts::Parts;
pub use settings::CauseSettings;

use crate::motion::parameters::Parameters;
use tessuto_core::error::{Error, Warning};
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_sim::Cloth;

/// A number is informed if its standard deviation is less than this fraction of what it was without the video.
const INFORMED: f64 = 0.4;
/// Gravity this many standard deviations of what was known from where a camera that looks ahead has it stands for
/// something else.
const UNLIKELY: f64 = 2.0;

/// Where the motion that the causes make is off by more than this many σ, root mean square, something else
/// holds or moves the cloth, and nothing is reported as informed.
const DOUBTED: f64 = 1.6;

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Stiffnesses, gravity, air.
    pub causes: Causes,
    /// Their standard deviations.
    pub spread: Spread,
    /// Those of the prior: what was known before.
    pub prior: Spread,
    /// Times of the wind's values.
    pub knots: Knots,
    /// Vertices that are held, in ascending order.
    pub held: Vec<usize>,
    /// Lengths of the edges without load `[m]`: a fold smaller than a cell hides some of it in the template.
    pub rest_lengths: Vec<f64>,
    /// RMS residual in units of 1.2 times the positions' standard deviations.
    pub misfit: f64,
    /// What the clip says of every number.
    pub constraints: Constraints,
}

impl Found {
    /// Whether the video constrains stretch, bend and shear stiffness.
    pub fn informed_stiffness(&self) -> [bool; 3] {
        self.constraints.stiffness.map(|constraint| constraint.is_constrained())
    }

    /// What standard deviations alone say of every number: the constraints of a result without profiles.
    pub fn by_deviations(causes: &Causes, spread: &Spread, prior: &Spread) -> Constraints {
        let (found, before) = (spread.ln_stiffness, prior.ln_stiffness);
        Constraints {
            stiffness: [0, 1, 2].map(|k| Constraint::of_deviation(found[k], before[k])),
            down: match is_unlikely(causes, prior) {
                true => Constraint::Unconstrained,
                false => Constraint::of_deviation(spread.down, prior.down),
            },
            drag: Constraint::of_deviation(spread.ln_drag, prior.ln_drag),
            friction: Constraint::of_deviation(spread.ln_friction, prior.ln_friction),
        }
    }

    /// A warning where the video constrains nothing, and all is the prior.
    pub fn doubt(&self) -> Option<Warning> {
        let why = match self.misfit > DOUBTED {
            true => format!(
                "the simulated motion is {:.1} standard deviations off: something else holds or moves the fabric",
                self.misfit
            ),
            false => "the fabric moves too little to constrain them".into(),
        };
        let found = format!("stiffness, gravity and air keep their prior and are not measured; {why}");
        let hint = "name what holds it as \"held\" in scene.json, or film it moving freely";
        (self.spread == self.prior).then(|| Warning::new("causes", found, hint))
    }
}

/// Whether gravity stands for something else.
fn is_unlikely(causes: &Causes, prior: &Spread) -> bool {
    causes.down.angle_between(glam::DVec3::Y) >= UNLIKELY * prior.down
}

/// The cloth of `template` as it was cut, with edges of `rest_lengths` `[m]` that hardly resist when shorter.
pub fn cut_cloth(template: &Mesh, rest_lengths: &[f64]) -> Cloth {
    let mut cloth = Cloth::flat(template, settings::COMPRESSION);
    cloth.edges.iter_mut().zip(rest_lengths).for_each(|(edge, l)| edge.rest_length = *l);
    cloth
}

/// A motion's causes, and what replays it.
#[derive(Debug)]
pub struct Explanation {
    /// Stiffnesses and forces.
    pub parameters: Parameters,
    /// What they are of.
    pub explained: Explained,
    /// The motion that these make, shape [N, V] `[m]`: the one that was found, to a few hundredths of a
    /// millimetre; where compressed cloth buckles another way under them ([`Sizes::replay`]), the one that was
    /// found.
    pub frames: Vec<Positions>,
    /// Where the simulation failed, forces are zero from then on.
    pub failure: Option<Error>,
}
