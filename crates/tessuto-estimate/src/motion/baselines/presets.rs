//! The settings of the published methods.

use super::RolloutSettings;
use crate::config::{Config, DynamicsSettings, Method, Preset, range};
use crate::motion::texture::TextureSettings;
use tessuto_sim::{Integrator, Model};

/// The settings of `default.preset`, which differ from those of the default method; `default` itself, if the preset is
/// none of the published ones.
pub(crate) fn settings(default: Config) -> Config {
    let published = TextureSettings { epochs: 200, ..default.texture };
    // Where the search by simulation leaves what was published, so as to reach it: see
    // docs/experiments/log/methods.md.
    let steady = RolloutSettings {
        outline_margin: 0.02,
        epochs_per_frame: 8,
        rated_frames: 10,
        stiffness_rate: 0.005,
        ..default.rollout
    };
    match default.preset {
        Preset::Saft => {
            let dynamics = DynamicsSettings {
                integrator: Integrator::LinearizedEuler,
                bend: range(-4.0, -5.0, -2.0),
                shear: range(-3.0, -4.0, -2.0),
                ..default.dynamics
            };
            Config { method: Method::Rollout, dynamics, rollout: steady, texture: published, ..default }
        }
        Preset::PhiSft => {
            let dynamics = DynamicsSettings {
                integrator: Integrator::LinearizedEuler,
                model: Model::Continuum,
                ..default.dynamics
            };
            let rollout = RolloutSettings { wind: true, ..steady };
            Config {
                method: Method::Rollout,
                irregular_vertices: 400,
                dynamics,
                rollout,
                texture: published,
                ..default
            }
        }
        Preset::PgSft => {
            let saft = settings(Config { preset: Preset::Saft, ..default });
            let dynamics = DynamicsSettings { integrator: Integrator::Surrogate, ..saft.dynamics };
            Config { preset: Preset::PgSft, dynamics, ..saft }
        }
        Preset::Default | Preset::Motion => default,
    }
}
