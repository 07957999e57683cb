//! Every setting of a reconstruction, the presets, and changes by `key=value`.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::appearance::{AppearanceSettings, MapPrior};
use crate::error::{Error, Result};
use crate::motion::inverse::accelerations::InverseSettings;
use crate::motion::inverse::stiffness::MaterialSettings;
use crate::motion::parameters::{Dynamics, StiffnessRange};
use crate::motion::rollout::RolloutSettings;
use crate::motion::spacetime::SpacetimeSettings;
use crate::motion::texture::TextureSettings;
use crate::sim::{Integrator, StepSettings};
use crate::text::nearest_key;

/// Named set of settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// The published method.
    Saft,
    /// All frames at once, then the forces; more accurate and faster.
    Default,
}

/// How the motion is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Accelerations and stiffnesses are optimised through the simulation and the renderer.
    Rollout,
    /// Positions are found first, forces read off by a simulation tied to them.
    Spacetime,
}

/// Time stepping and material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DynamicsSettings {
    /// Integrator.
    pub integrator: Integrator,
    /// Steps per frame.
    pub substeps: usize,
    /// Factor on the velocity per 5 ms; a longer step takes a power of it.
    pub damping_per_5ms: f64,
    /// log10 of the stretch stiffness [N/m].
    pub stretch: StiffnessRange,
    /// log10 of the bend stiffness [J/rad²].
    pub bend: StiffnessRange,
    /// log10 of the shear stiffness [J/rad²].
    pub shear: StiffnessRange,
}

impl DynamicsSettings {
    /// For a video of `fps` frames per second.
    pub fn at(&self, fps: f64) -> Dynamics {
        let h = 1.0 / (fps * self.substeps as f64);
        Dynamics {
            step: StepSettings {
                integrator: self.integrator,
                step: h,
                damping: self.damping_per_5ms.powf(h / 5e-3),
                tolerance: 1e-8,
                // Crumpled cloth of many vertices would take dozens, and follows its forces no better for it.
                newton_limit: 8,
            },
            substeps: self.substeps,
            stiffness: [self.stretch, self.bend, self.shear],
        }
    }
}

/// All settings of a reconstruction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Where the settings started from.
    pub preset: Preset,
    /// How the motion is found.
    pub method: Method,
    /// Seed of everything random (the samples of the metrics).
    pub seed: u64,
    /// Time stepping and material.
    pub dynamics: DynamicsSettings,
    /// Texture phase.
    pub texture: TextureSettings,
    /// Motion by rollouts.
    pub rollout: RolloutSettings,
    /// Motion by positions.
    pub spacetime: SpacetimeSettings,
    /// Accelerations of a trajectory.
    pub inverse: InverseSettings,
    /// Stiffnesses of a motion.
    pub material: MaterialSettings,
    /// Material maps and light; the settings of results without them.
    #[serde(default)]
    pub appearance: AppearanceSettings,
}

impl Config {
    /// The settings of `preset`.
    pub fn preset(preset: Preset) -> Self {
        let range = |start, low, high| StiffnessRange { start, low, high };
        let published = DynamicsSettings {
            integrator: Integrator::LinearizedEuler,
            substeps: 4,
            damping_per_5ms: 0.9,
            stretch: range(200f64.log10(), 1.0, 3.0),
            bend: range(-3.0, -4.0, -2.0),
            shear: range(-4.0, -5.0, -2.0),
        };
        let (method, dynamics) = match preset {
            Preset::Saft => (Method::Rollout, published),
            Preset::Default => {
                (Method::Spacetime, DynamicsSettings { integrator: Integrator::ImplicitEuler, ..published })
            }
        };
        Self {
            preset,
            method,
            seed: 0,
            dynamics,
            texture: TextureSettings::default(),
            rollout: RolloutSettings::default(),
            spacetime: SpacetimeSettings::default(),
            inverse: InverseSettings::default(),
            material: MaterialSettings::default(),
            appearance: AppearanceSettings::default(),
        }
    }

    /// Changes one setting; `assignment` is `key=value` with a dotted key such as `rollout.weights.energy=0`.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown key or a value of the wrong type.
    pub fn set(&mut self, assignment: &str) -> Result<()> {
        let (key, value) = assignment.split_once('=').ok_or_else(|| {
            Error::usage(
                format!("--set {assignment}: no '='"),
                "write --set key=value, such as --set rollout.last_epochs=30",
            )
        })?;
        let mut all = serde_json::to_value(&*self).expect("settings are plain data");
        let known = paths(&all);
        let pointer = format!("/{}", key.replace('.', "/"));
        let Some(slot) = all.pointer_mut(&pointer).filter(|slot| !slot.is_object()) else {
            let hint = match nearest_key(key, &known) {
                Some(near) => format!("did you mean {near}? All keys: {}", known.join(", ")),
                None => format!("the keys are: {}", known.join(", ")),
            };
            return Err(Error::usage(format!("--set {key}: no such setting"), hint));
        };
        let old = slot.clone();
        *slot = serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.to_owned()));
        let changed: Self = serde_json::from_value(all).map_err(|e| {
            Error::usage(format!("--set {key}={value}: {e}"), format!("the present value is {old}"))
        })?;
        changed.validate()?;
        changed.check_build()?;
        *self = changed;
        Ok(())
    }

    /// Keys and values of all settings that differ from the preset, as [`set`](Self::set) takes them.
    pub fn changes(&self) -> Vec<(String, String)> {
        let value = |c: &Self| serde_json::to_value(c).expect("settings are plain data");
        let (own, preset) = (value(self), value(&Self::preset(self.preset)));
        let at = |v: &Value, key: &str| v.pointer(&format!("/{}", key.replace('.', "/"))).cloned();
        let text = |v: Value| v.as_str().map_or_else(|| v.to_string(), str::to_owned);
        paths(&own)
            .into_iter()
            .filter(|key| at(&own, key) != at(&preset, key))
            .filter_map(|key| at(&own, &key).map(|v| (key, text(v))))
            .collect()
    }

    /// Checks ranges that types cannot express.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the setting, its value and its range.
    pub fn validate(&self) -> Result<()> {
        let t = &self.spacetime;
        let checks = [
            ("dynamics.substeps", self.dynamics.substeps as f64, 1.0, 64.0),
            ("dynamics.damping_per_5ms", self.dynamics.damping_per_5ms, 0.0, 1.0),
            ("texture.size", self.texture.size as f64, 2.0, 8192.0),
            ("rollout.first_frames", self.rollout.first_frames as f64, 2.0, 1e6),
            ("rollout.epochs_per_frame", self.rollout.epochs_per_frame as f64, 1.0, 1e6),
            ("rollout.clip_history", self.rollout.clip_history as f64, 1.0, 1e6),
            ("rollout.clip_quantile", self.rollout.clip_quantile, 0.0, 1.0),
            ("spacetime.coarsest", t.coarsest as f64, t.finest as f64, 8.0),
            ("spacetime.strain", t.strain, 1e-6, 10.0),
            ("spacetime.tail", t.tail, 1e-3, 1e6),
            ("spacetime.bend", t.bend, 1e-6, 1e3),
            ("spacetime.shear", t.shear, 1e-6, 1e3),
            ("spacetime.acceleration", t.acceleration, 1e-7, 10.0),
            ("spacetime.colour", t.colour, 1e-4, 10.0),
            ("spacetime.colour_area", t.colour_area, 1e-3, 1e6),
            ("spacetime.outline", t.outline, 1e-3, 1e3),
            ("spacetime.outline_length", t.outline_length, 1e-3, 1e6),
            ("material.spread", self.material.spread, 1e-3, 1e3),
            ("inverse.tracking_stiffness", self.inverse.tracking_stiffness, 1e-6, 1e9),
        ];
        for (key, value, low, high) in checks.into_iter().chain(self.appearance.ranges()) {
            if !(low..=high).contains(&value) {
                return Err(Error::usage(
                    format!("setting {key} = {value}"),
                    format!("it must lie between {low} and {high}"),
                ));
            }
        }
        if self.method == Method::Spacetime && self.dynamics.integrator != Integrator::ImplicitEuler {
            return Err(Error::usage(
                "dynamics.integrator = linearized_euler with method = spacetime",
                "forces are read off by implicit_euler: set it, or --set method=rollout",
            ));
        }
        Ok(())
    }

    /// Refuses what this build was made without. Results of other builds are read nevertheless.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check_build(&self) -> Result<()> {
        if cfg!(not(feature = "decoder")) && self.appearance.prior == MapPrior::Decoder {
            return Err(Error::left_out("appearance.prior=decoder", "decoder"));
        }
        Ok(())
    }
}

/// Dotted keys of all values that are no objects.
fn paths(value: &Value) -> Vec<String> {
    let Value::Object(map) = value else { return vec![String::new()] };
    let join =
        |key: &String, rest: String| if rest.is_empty() { key.clone() } else { format!("{key}.{rest}") };
    map.iter().flat_map(|(key, v)| paths(v).into_iter().map(move |rest| join(key, rest))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_survive_a_round_trip_and_are_valid() {
        for preset in [Preset::Saft, Preset::Default] {
            let config = Config::preset(preset);
            config.validate().unwrap();
            let text = serde_json::to_string(&config).unwrap();
            assert_eq!(serde_json::from_str::<Config>(&text).unwrap(), config);
        }
    }

    #[test]
    fn set_changes_one_value() {
        let mut config = Config::preset(Preset::Saft);
        config.set("rollout.weights.energy=0").unwrap();
        config.set("dynamics.integrator=implicit_euler").unwrap();
        assert_eq!(config.rollout.weights.energy, 0.0);
        assert_eq!(config.dynamics.integrator, Integrator::ImplicitEuler);
    }

    #[test]
    fn a_wrong_key_names_the_nearest_and_a_wrong_value_the_range() {
        let mut config = Config::preset(Preset::Default);
        let before = config.clone();
        let message = |e: Error| e.to_string();
        assert!(message(config.set("energi=1").unwrap_err()).contains("rollout.weights.energy"));
        assert!(message(config.set("rollout=1").unwrap_err()).contains("no such setting"));
        assert!(message(config.set("texture.size=big").unwrap_err()).contains("512"));
        assert!(message(config.set("inverse.tracking_stiffness=-1").unwrap_err()).contains("between"));
        assert_eq!(config, before);
    }
    #[cfg(not(feature = "decoder"))]
    #[test]
    fn the_decoder_is_refused_by_builds_without_it_and_read_from_results() {
        let mut config = Config::preset(Preset::Default);
        let error = config.set("appearance.prior=decoder").unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("--features full"), "{error}");
        config.appearance.prior = MapPrior::Decoder;
        config.validate().unwrap();
        config.check_build().unwrap_err();
    }
}
