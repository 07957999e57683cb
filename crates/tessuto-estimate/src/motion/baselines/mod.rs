//! The published rivals of the default method, kept to compare with: `tessuto compare` runs them beside it.
//!
//! | preset | source | what is searched | simulated by |
//! |---|---|---|---|
//! | `saft` | \[SAFT\] | springs' stiffnesses, accelerations of all vertices | a linearised implicit step |
//! | `phi-sft` | \[phi-SfT\] | a continuum's stiffnesses, wind, accelerations | the same |
//! | `pg-sft` | \[PG-SfT\] | as `saft` | a small network ([`tessuto_sim::surrogate`]) |
//!
//! All three make parameters whose simulation, drawn, looks like the video: `rollout` is their common search. `presets`
//! has their settings. The default method and its stages use nothing of this module.

pub mod compared;
mod guard;
mod losses;
pub(crate) mod presets;
mod rollout;

pub use losses::{LossWeights, Losses};
pub use rollout::{LossAndGradients, RolloutFit, RolloutSettings};

use super::parameters::Parameters;
use crate::config::Config;
use crate::session::Session;
use compared::Compared;
use tessuto_core::error::{Error, Result};
use tessuto_core::scene::Scene;
use tessuto_render::raster::{Rasterizer, Texture};
use tessuto_sim::Cloth;

/// Parameters whose simulation looks like the video, and why the search ended early, if it did.
pub(crate) fn search(
    scene: &Scene,
    cloth: &Cloth,
    rasterizer: &Rasterizer,
    texture: &Texture,
    config: &Config,
    session: &mut Session,
) -> Result<(Parameters, Option<Error>)> {
    session.begin("rollout");
    let fit = RolloutFit {
        scene,
        cloth,
        rasterizer,
        texture,
        compared: Compared::away_from_outlines(scene, config.rollout.outline_margin)?,
        dynamics: config.dynamics.at(scene.fps),
        settings: &config.rollout,
    };
    fit.run(fit.start(), session)
}
