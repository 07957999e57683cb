//! Every setting of a reconstruction, the presets, files of settings, and changes by `key=value`.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::appearance::{AppearanceSettings, MapPrior};
use crate::io::read_bounded;
use crate::io::text::decode;
use crate::motion::baselines::{self, RolloutSettings};
use crate::motion::causes::CauseSettings;
use crate::motion::inverse::accelerations::InverseSettings;
use crate::motion::inverse::stiffness::MaterialSettings;
use crate::motion::parameters::{Dynamics, StiffnessRange};
use crate::motion::spacetime::SpacetimeSettings;
use crate::motion::texture::TextureSettings;
use tessuto_core::error::{Error, Result, Warning};
use tessuto_core::settings::{Setting, Settings, Values, ordered, settings, text};
use tessuto_core::text::nearest_key;
use tessuto_sim::{Integrator, Model, StepSettings};

mod preset;

pub use preset::Preset;

/// How the motion is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Forces and stiffnesses are optimised through the simulation and the renderer.
    Rollout,
    /// Positions are found first, forces read off by a simulation tied to them.
    Spacetime,
}

impl Method {
    /// Their names.
    pub const NAMES: &[&str] = &["spacetime", "rollout"];
}

/// The three numbers of a [`StiffnessRange`]; `unit` is that of log10.
fn stiffness(name: &str, unit: &'static str, low: f64, high: f64) -> Vec<Setting> {
    property(&format!("{name} stiffness"), unit, low, high)
}

/// The same of any property.
fn property(name: &str, unit: &'static str, low: f64, high: f64) -> Vec<Setting> {
    let row = |key: &str, what: &str| Setting {
        key: key.to_owned(),
        meaning: format!("log10 of the {name}: {what}"),
        values: Values::Number { range: low..=high, unit },
    };
    let start = "where the search starts, and its prior; between low and high";
    vec![row("start", start), row("low", "lower bound"), row("high", "upper bound")]
}

pub(crate) const fn range(start: f64, low: f64, high: f64) -> StiffnessRange {
    StiffnessRange { start, low, high }
}

settings! {
    /// Properties of a continuum.
    pub struct FabricSettings {
        /// log10 of the tension per strain along the warp `[N/m]`.
        warp: StiffnessRange = range(200f64.log10(), 1.0, 3.0),
            property("tension per strain along the warp (growing u)", "log10 N/m", -3.0, 8.0);
        /// The same along the weft.
        weft: StiffnessRange = range(200f64.log10(), 1.0, 3.0),
            property("tension per strain along the weft", "log10 N/m", -3.0, 8.0);
        /// log10 of the Poisson ratio.
        poisson: StiffnessRange = range(-0.7, -2.0, -0.3),
            property("Poisson ratio, geometric mean of both", "log10", -6.0, -0.05);
        /// log10 of the shear force per angle `[N/m]`.
        shear: StiffnessRange = range(1.3, 0.0, 2.5), property("shear force per angle", "log10 N/m", -3.0, 8.0);
        /// log10 of the bend stiffness `[J]`.
        bend: StiffnessRange = range(-5.0, -7.0, -3.0),
            property("moment per curvature and width", "log10 J", -12.0, 4.0);
    }
}

settings! {
    /// Time stepping and material.
    pub struct DynamicsSettings {
        /// Time integrator.
        integrator: Integrator = Integrator::ImplicitEuler, choice(Integrator::NAMES);
        /// How the cloth resists: springs along the edges and between them, or a continuum on any mesh (method =
        /// rollout).
        model: Model = Model::Springs, choice(Model::NAMES);
        /// Simulation steps per frame, at least.
        substeps: usize = 4, number(1.0..=64.0, "");
        /// Longest step `[s]`; slow videos take more steps per frame, at most 64. Compressed cloth can go several
        /// ways in a long step, and then forces do not lead where they led when they were found.
        longest_step: f64 = 5e-3, number(1e-5..=1.0, "s");
        /// Factor on the velocity per 5 ms; a longer step takes a power of it.
        damping_per_5ms: f64 = 0.9, number(0.0..=1.0, "");
        /// log10 of the stretch stiffness `[N/m]`.
        stretch: StiffnessRange = range(200f64.log10(), 1.0, 3.0), stiffness("stretch", "log10 N/m", -3.0, 8.0);
        /// log10 of the bend stiffness `[J/rad²]`.
        bend: StiffnessRange = range(-3.0, -4.0, -2.0), stiffness("bend", "log10 J/rad²", -10.0, 4.0);
        /// log10 of the shear stiffness `[J/rad²]`.
        shear: StiffnessRange = range(-4.0, -5.0, -2.0), stiffness("shear", "log10 J/rad²", -10.0, 4.0);
        /// Properties of model = continuum; stretch, bend and shear are those of model = springs.
        fabric: FabricSettings = FabricSettings::default(), group::<FabricSettings>();
    }
}

impl DynamicsSettings {
    /// The ranges of the model's properties, in their order, by their settings.
    pub fn ranges(&self) -> Vec<(&'static str, StiffnessRange)> {
        match self.model {
            Model::Springs => vec![
                ("dynamics.stretch", self.stretch),
                ("dynamics.bend", self.bend),
                ("dynamics.shear", self.shear),
            ],
            Model::Continuum => {
                let FabricSettings { warp, weft, poisson, shear, bend } = self.fabric;
                vec![
                    ("dynamics.fabric.warp", warp),
                    ("dynamics.fabric.weft", weft),
                    ("dynamics.fabric.poisson", poisson),
                    ("dynamics.fabric.shear", shear),
                    ("dynamics.fabric.bend", bend),
                ]
            }
        }
    }

    /// For a video of `fps` frames per second.
    pub fn at(&self, fps: f64) -> Dynamics {
        // 20 ms are four steps of 5 ms in spite of rounding.
        let needed = (1.0 / (fps * self.longest_step) - 1e-9).ceil().min(64.0) as usize;
        let substeps = self.substeps.max(needed);
        let h = 1.0 / (fps * substeps as f64);
        Dynamics {
            step: StepSettings {
                integrator: self.integrator,
                step: h,
                damping: self.damping_per_5ms.powf(h / 5e-3),
                tolerance: 1e-7,
                // Crumpled cloth of many vertices would take dozens, and follows its forces no better for it.
                newton_limit: 8,
            },
            substeps,
            model: self.model,
            stiffness: self.ranges().into_iter().map(|(_, range)| range).collect(),
        }
    }
}

impl DynamicsSettings {
    /// A warning where the properties of the model, given by log10, lie at their bounds.
    pub fn doubt(&self, log_stiffness: &[f64]) -> Option<Warning> {
        let rows = self.model.properties().iter().zip(self.ranges());
        let found: Vec<String> = rows
            .zip(log_stiffness)
            .filter_map(|((property, (_, range)), log_k)| {
                let bound = range.bound_at(*log_k)?;
                // Three digits are enough to recognise the bound.
                let value: f64 = format!("{:.2e}", 10f64.powf(*log_k)).parse().expect("a number");
                let value = format!("{value} {}", property.unit);
                Some(format!("{} at its {bound} bound ({})", property.key, value.trim_end()))
            })
            .collect();
        let hint = "these are effective values of the replay, not properties of the fabric";
        (!found.is_empty()).then(|| Warning::new("stiffness", found.join(", "), hint))
    }
}

/// Largest seed: JSON's other readers keep integers up to here.
const LARGEST_SEED: f64 = 9_007_199_254_740_992.0;

settings! {
    /// All settings of a reconstruction.
    pub struct Config {
        /// Where the settings started from.
        preset: Preset = Preset::Default, choice(Preset::NAMES);
        /// How the motion is found: positions of all frames first and forces afterwards, or forces and stiffnesses
        /// through simulation and renderer.
        method: Method = Method::Spacetime, choice(Method::NAMES);
        /// Seed of everything random: the samples of the metrics, the pixels that material and light are found from.
        seed: u64 = 0, number(0.0..=LARGEST_SEED, "");
        /// Vertices of the irregular mesh that is made of the template and takes its place; 0 keeps the template.
        irregular_vertices: usize = 0, number(0.0..=4000.0, "");
        /// Time stepping and material.
        dynamics: DynamicsSettings = DynamicsSettings::default(), group::<DynamicsSettings>();
        /// Texture.
        texture: TextureSettings = TextureSettings::default(), group::<TextureSettings>();
        /// Motion by simulation, of method = rollout.
        rollout: RolloutSettings = RolloutSettings::default(), group::<RolloutSettings>();
        /// Motion by positions, of method = spacetime.
        spacetime: SpacetimeSettings = SpacetimeSettings::default(), group::<SpacetimeSettings>();
        /// Forces of a motion, of method = spacetime.
        inverse: InverseSettings = InverseSettings::default(), group::<InverseSettings>();
        /// Stiffnesses of a motion, of method = spacetime.
        material: MaterialSettings = MaterialSettings::default(), group::<MaterialSettings>();
        /// Stiffnesses, gravity, air and what is held, of method = spacetime; takes the place of `material`.
        causes: CauseSettings = CauseSettings::default(), group::<CauseSettings>();
        /// Material maps and light.
        appearance: AppearanceSettings = AppearanceSettings::default(), group::<AppearanceSettings>();
    }
}

impl Config {
    /// The settings of `preset`.
    pub fn preset(preset: Preset) -> Self {
        let default = Self { preset, ..Self::default() };
        match preset {
            Preset::Motion => default,
            Preset::Default => {
                let dynamics = DynamicsSettings {
                    // A fold of the template, flat as cut, goes another way in 5 ms.
                    longest_step: 2.5e-3,
                    damping_per_5ms: 1.0,
                    stretch: range(200f64.log10(), 0.0, 4.0),
                    bend: range(-3.0, -7.0, -1.0),
                    shear: range(-4.0, -7.0, -1.0),
                    ..default.dynamics
                };
                let causes = CauseSettings { fit: true, ..default.causes };
                Self { dynamics, causes, ..default }
            }
            Preset::Saft | Preset::PhiSft | Preset::PgSft => baselines::presets::settings(default),
        }
    }

    /// The settings of a file: config.json of a result, or settings alone as JSON, where those that are left out
    /// are the preset's.
    ///
    /// # Errors
    /// [`Error::Input`] naming the file; [`Error::Usage`] naming the setting, its value and its range.
    pub fn read(path: &Path) -> Result<Self> {
        let place = || path.display().to_string();
        let hint = "give config.json of a result, or settings such as {\"texture\": {\"size\": 256}}";
        let text = decode(read_bounded(path, LARGEST_FILE)?, &place())?;
        let file: Value =
            serde_json::from_str(&text).map_err(|e| Error::input(place(), e.to_string(), hint))?;
        let given = file.get("settings").unwrap_or(&file);
        if !given.is_object() {
            return Err(Error::input(place(), "holds no settings", hint));
        }
        let name = given.get("preset").and_then(Value::as_str).unwrap_or("default");
        let mut all = to_json(&Self::preset(Preset::named(name)?));
        for (key, value) in leaves(given) {
            put(&mut all, &key, value.clone())?;
        }
        Self::from_json(all)
    }

    /// Changes one setting; `assignment` is `key=value` with a dotted key such as `rollout.weights.energy=0`.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown key, a value of the wrong type or out of its range.
    pub fn set(&mut self, assignment: &str) -> Result<()> {
        self.set_all([assignment])
    }

    /// Changes several settings at once, so that what they must be together is checked at the end only.
    ///
    /// # Errors
    /// As [`set`](Self::set).
    pub fn set_all<'a>(&mut self, assignments: impl IntoIterator<Item = &'a str>) -> Result<()> {
        let mut all = to_json(self);
        for assignment in assignments {
            let (key, value) = assignment.split_once('=').ok_or_else(|| {
                let hint = "write key=value, such as rollout.last_epochs=30";
                Error::usage(format!("setting {assignment}: no '='"), hint)
            })?;
            if key == "preset" {
                let hint =
                    "choose the preset that the settings start from instead, then change single settings";
                return Err(Error::usage(
                    format!("setting {assignment}: a preset is no single setting"),
                    hint,
                ));
            }
            let value = serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.to_owned()));
            put(&mut all, key, value)?;
        }
        let changed = Self::from_json(all)?;
        changed.check_build()?;
        *self = changed;
        Ok(())
    }

    /// Keys and values of all settings that differ from the preset, as [`set`](Self::set) takes them.
    pub fn changes(&self) -> Vec<(String, String)> {
        let (own, preset) = (to_json(self), to_json(&Self::preset(self.preset)));
        leaves(&own)
            .into_iter()
            .zip(leaves(&preset))
            .filter(|((_, own), (_, preset))| own != preset)
            .map(|((key, value), _)| (key, text(value)))
            .collect()
    }

    /// Every setting with its value here, in the order of the table.
    pub fn table(&self) -> Vec<(Setting, String)> {
        let all = to_json(self);
        let value = |key: &str| all.pointer(&pointer(key)).map(text).unwrap_or_default();
        Self::settings().into_iter().map(|s| (s.clone(), value(&s.key))).collect()
    }

    /// Checks the ranges, and what several settings must be together.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the setting, its value and its range.
    pub fn validate(&self) -> Result<()> {
        let all = to_json(self);
        Self::settings()
            .iter()
            .try_for_each(|s| s.check(all.pointer(&pointer(&s.key)).unwrap_or(&Value::Null)))?;
        self.check_together()
    }

    fn from_json(all: Value) -> Result<Self> {
        let config: Self = serde_json::from_value(all).expect("every value was checked as it was put in");
        config.check_together()?;
        Ok(config)
    }

    fn check_together(&self) -> Result<()> {
        let dynamics = &self.dynamics;
        for (name, k) in dynamics.ranges() {
            let key = |part: &str| format!("{name}.{part}");
            ordered(&key("low"), k.low, &key("start"), k.start)?;
            ordered(&key("start"), k.start, &key("high"), k.high)?;
        }
        self.appearance.check_order()?;
        if self.method == Method::Spacetime && dynamics.integrator != Integrator::ImplicitEuler {
            return Err(Error::usage(
                "dynamics.integrator = linearized_euler or surrogate with method = spacetime",
                "forces are read off by implicit_euler: set it, or method=rollout",
            ));
        }
        if self.method == Method::Spacetime && dynamics.model != Model::Springs {
            return Err(Error::usage(
                "dynamics.model = continuum with method = spacetime",
                "its forces are read off by springs: set dynamics.model=springs, or method=rollout",
            ));
        }
        let is_springs = dynamics.model == Model::Springs && self.irregular_vertices == 0;
        if dynamics.integrator == Integrator::Surrogate && !is_springs {
            return Err(Error::usage(
                "dynamics.integrator = surrogate with another model than springs, or with irregular_vertices",
                "it has learned springs on regular grids: set dynamics.model=springs and irregular_vertices=0",
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

/// Largest file of settings `[bytes]`.
const LARGEST_FILE: u64 = 1 << 20;

fn to_json(config: &Config) -> Value {
    serde_json::to_value(config).expect("settings are plain data")
}

fn pointer(key: &str) -> String {
    format!("/{}", key.replace('.', "/"))
}

/// Puts a value in the place of the setting `key`.
fn put(all: &mut Value, key: &str, value: Value) -> Result<()> {
    let settings = Config::settings();
    let setting = settings.iter().find(|s| s.key == key).ok_or_else(|| no_such_setting(key, &settings))?;
    setting.check(&value)?;
    let slot = all.pointer_mut(&pointer(key)).expect("every setting of the table is a field");
    let whole = |v: &Value| v.as_f64().filter(|v| v.fract() == 0.0).map(|v| v as u64);
    *slot = match (slot.is_u64(), value.is_number()) {
        // 1e6 is a count too.
        (true, true) => whole(&value)
            .map(Value::from)
            .ok_or_else(|| Error::usage(format!("setting {key} = {value}"), "it must be a whole number"))?,
        _ => value,
    };
    Ok(())
}

fn no_such_setting(key: &str, settings: &[Setting]) -> Error {
    let known: Vec<String> = settings.iter().map(|s| s.key.clone()).collect();
    let below: Vec<&str> =
        known.iter().filter(|k| k.starts_with(&format!("{key}."))).map(String::as_str).collect();
    let hint = match (below.is_empty(), nearest_key(key, &known)) {
        (false, _) => format!("its settings are: {}", below.join(", ")),
        (true, Some(near)) => format!("did you mean {near}?"),
        (true, None) => format!("the settings are: {}", known.join(", ")),
    };
    Error::usage(format!("setting {key}: no such setting"), hint)
}

/// Dotted keys and values of all that are no objects, in their order.
fn leaves(value: &Value) -> Vec<(String, &Value)> {
    let Value::Object(map) = value else { return vec![(String::new(), value)] };
    let join =
        |key: &String, rest: String| if rest.is_empty() { key.clone() } else { format!("{key}.{rest}") };
    map.iter()
        .flat_map(|(key, v)| leaves(v).into_iter().map(move |(rest, leaf)| (join(key, rest), leaf)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_videos_take_more_steps() {
        let settings = DynamicsSettings::default();
        let substeps = |fps: f64| {
            let dynamics = settings.at(fps);
            assert!((dynamics.step.step * fps * dynamics.substeps as f64 - 1.0).abs() < 1e-12);
            dynamics.substeps
        };
        assert_eq!([240.0, 50.0, 30.0, 25.0, 10.0, 1.0].map(substeps), [4, 4, 7, 8, 20, 64]);
    }

    #[test]
    fn presets_survive_a_round_trip_and_are_valid() {
        for preset in Preset::ALL {
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
        let mut refused = |assignment: &str| {
            let error = config.set(assignment).unwrap_err();
            assert_eq!((error.exit_code(), &config), (2, &before), "{assignment}");
            error.to_string()
        };
        assert!(refused("energi=1").contains("did you mean rollout.weights.energy?"));
        assert!(refused("inverse=1").contains("inverse.tracking_stiffness"));
        assert!(refused("preset=saft").contains("preset"));
        assert!(refused("texture.size=2.5").contains("whole number"));
        for (assignment, range) in [
            ("texture.size=big", "between 2 and 8192 texel"),
            ("spacetime.signed_bend=0", "between 1e-6 and 1000 rad"),
            ("spacetime.signed_bend=NaN", "between 1e-6 and 1000 rad"),
            ("spacetime.signed_bend=1e999", "between 1e-6 and 1000 rad"),
            ("spacetime.signed_bend=null", "between 1e-6 and 1000 rad"),
            ("texture.learning_rate=-1", "between 0 and 1 sRGB"),
            ("spacetime.neighbour_weight=-1", "between 0 and 100"),
            ("spacetime.gain_smoothness=inf", "between 0 and 1e6"),
            ("dynamics.bend.start=30", "between -10 and 4 log10 J/rad²"),
            ("dynamics.bend.start=-8", "dynamics.bend.low = -7 is above dynamics.bend.start = -8"),
            ("spacetime.levels=0", "between 1 and 8"),
            ("method=simulation", "spacetime, rollout"),
            ("material.fit=1", "true, false"),
        ] {
            let message = refused(assignment);
            assert!(message.contains(range), "{assignment}: {message}");
        }
        // Together they are in order.
        config.set_all(["spacetime.levels=3", "texture.epochs=1e2"]).unwrap();
        assert_eq!((config.spacetime.levels, config.texture.epochs), (3, 100));
        config.spacetime.strain = f64::NAN;
        assert!(config.validate().unwrap_err().to_string().contains("NaN"));
    }

    #[test]
    fn every_value_has_a_row_and_every_row_a_value_in_its_range() {
        for preset in Preset::ALL {
            let all = to_json(&Config::preset(preset));
            let fields: Vec<String> = leaves(&all).into_iter().map(|(key, _)| key).collect();
            let rows: Vec<String> = Config::settings().into_iter().map(|s| s.key).collect();
            assert_eq!(fields, rows);
            for (setting, value) in Config::preset(preset).table() {
                assert!(setting.meaning.len() > 10 && !value.is_empty(), "{}", setting.key);
                let is_number = value.parse::<f64>().is_ok();
                assert_eq!(is_number, matches!(setting.values, Values::Number { .. }), "{}", setting.key);
            }
        }
        // The words are those that the types take, and all of them.
        for setting in Config::settings() {
            let Values::Choice(words) = setting.values else { continue };
            let read = |word: &str| {
                let mut all = to_json(&Config::default());
                *all.pointer_mut(&pointer(&setting.key)).unwrap() = word.into();
                serde_json::from_value::<Config>(all)
            };
            words.iter().for_each(|word| assert!(read(word).is_ok(), "{word}"));
            let said = read("none of them").unwrap_err().to_string();
            assert_eq!(said.split('`').skip(3).step_by(2).count(), words.len(), "{said}");
        }
    }

    #[test]
    fn stiffnesses_at_a_bound_are_doubted() {
        let dynamics = DynamicsSettings::default();
        assert_eq!(dynamics.doubt(&[2.0, -3.0, -4.0]), None);
        let doubt = dynamics.doubt(&[1.00004, -3.0, -2.0]).unwrap();
        assert!(
            doubt.found.contains("stretch at its lower bound (10 N/m), shear at its upper bound"),
            "{doubt}"
        );
    }

    #[test]
    fn a_file_of_settings_is_read_whole_or_in_part() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("config.json");
        let read = |text: &str| {
            std::fs::write(&file, text).unwrap();
            Config::read(&file)
        };
        let mut config = Config::preset(Preset::Saft);
        config.set_all(["texture.size=64", "seed=9007199254740992"]).unwrap();
        let text = serde_json::to_string(&config).unwrap();
        assert_eq!(read(&text).unwrap(), config);
        assert_eq!(read(&format!(r#"{{"version": "1", "settings": {text}}}"#)).unwrap(), config);
        let part = read(r#"{"preset": "saft", "texture": {"size": 64}}"#).unwrap();
        assert_eq!((part.method, part.texture.size), (Method::Rollout, 64));
        assert!(read(r#"{"texture": {"sise": 64}}"#).unwrap_err().to_string().contains("texture.size"));
        assert!(read(r#"{"texture": {"size": -1}}"#).unwrap_err().to_string().contains("between"));
        assert!(read(r#"{"preset": "fast"}"#).unwrap_err().to_string().contains("default, motion, saft"));
        for damaged in ["", "[]", "{", r#"{"settings": 3}"#] {
            assert_eq!(read(damaged).unwrap_err().exit_code(), 3, "{damaged}");
        }
    }
    #[cfg(not(feature = "decoder"))]
    #[test]
    fn the_decoder_is_refused_by_builds_without_it_and_read_from_results() {
        let mut config = Config::preset(Preset::Default);
        let error = config.set("appearance.prior=decoder").unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("feature decoder"), "{error}");
        config.appearance.prior = MapPrior::Decoder;
        config.validate().unwrap();
        config.check_build().unwrap_err();
    }
}
