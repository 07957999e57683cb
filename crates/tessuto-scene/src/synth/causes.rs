//! What moves a synthetic sheet, as truth.

use serde_json::{Value, json};

use super::breeze::{Breeze, DRAG, FRICTION};
use super::gust::{Hanging, Otherwise, swing};
use super::lattice::lattice;
use super::settings::Settings;
use super::sheet;
use tessuto_core::error::Result;
use tessuto_core::mesh::Positions;
use tessuto_sim::cloth::AREA_DENSITY;

/// Frames after the clip in which the air is still and the hands stay.
const CALM: usize = 20;
/// How much stiffer the sheet is that shows what the bend stiffness does.
const STIFFER: f64 = 10.0;

/// What is known of the sheet and of what moves it, for `gt/physics.json`: SI units, camera axes.
pub fn physics(settings: &Settings) -> Value {
    let mesh = lattice(settings.mesh, settings.grid, sheet::SIZE, 1.0, settings.seed);
    let hanging = Hanging::new(&mesh, settings);
    let mut out = json!({
        "gravity": hanging.tilt.direction(sheet::GRAVITY).to_array(),
        "stretch": settings.stretch,
        "bend": settings.bend,
        "shear": settings.shear,
        "area_density": AREA_DENSITY,
        "held": hanging.held(),
        "rest": format!("flat {} m x {} m", sheet::SIZE.x, sheet::SIZE.y),
    });
    if settings.air {
        let breeze = Breeze::new(settings.wind, settings.seed);
        let wind = |n: usize| hanging.tilt.direction(breeze.velocity(n as f64 / settings.fps)).to_array();
        out["drag"] = json!(DRAG);
        out["friction"] = json!(FRICTION);
        out["wind_mean_per_frame"] = json!((0..settings.frames).map(wind).collect::<Vec<_>>());
    }
    out
}

/// The same clip with other causes.
pub struct Futures {
    /// After the clip, in still air and with hands that stay, shape [20, V] `[m]`.
    pub calm: Vec<Positions>,
    /// The clip with ten times the bend stiffness, shape [N, V] `[m]`.
    pub stiffer: Vec<Positions>,
}

/// What would have come otherwise.
///
/// # Errors
/// [`tessuto_core::Error::Numerical`] from the simulation.
pub fn futures(settings: &Settings) -> Result<Futures> {
    let sharp = Settings { blur: 0.0, ..settings.clone() };
    let calm = swing(&sharp, Otherwise { bend: 1.0, calm: CALM })?;
    let stiffer = swing(&sharp, Otherwise { bend: STIFFER, calm: 0 })?;
    Ok(Futures { calm: calm.frames[settings.frames..].to_vec(), stiffer: stiffer.frames })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::settings::Mover;

    #[test]
    fn physics_names_what_is_held_and_where_down_is() {
        let settings = Settings { seed: 3, mover: Mover::Hands, ..Settings::default() };
        let carried = physics(&settings);
        let held: Vec<u64> =
            carried["held"].as_array().unwrap().iter().map(|v| v.as_u64().unwrap()).collect();
        assert!(held.len() >= 4 && held.is_sorted() && held.iter().all(|v| *v < 441), "{held:?}");
        let gravity: Vec<f64> =
            carried["gravity"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
        assert!((gravity.iter().map(|g| g * g).sum::<f64>().sqrt() - 9.81).abs() < 1e-9);
        assert!(gravity[1] > 8.0 && gravity[1] < 9.8);
        assert!(carried.get("drag").is_none());
        let pinned = physics(&Settings { air: true, mover: Mover::Wind, ..settings });
        assert_eq!(pinned["held"], json!([0, 10, 20]));
        assert_eq!(pinned["wind_mean_per_frame"].as_array().unwrap().len(), 24);
    }

    #[test]
    fn what_would_have_come_goes_on_from_the_clip_and_differs_from_it() {
        let settings = Settings { frames: 5, grid: [7, 7], air: true, wind: 2.0, ..Settings::default() };
        let clip = swing(&settings, Otherwise::NOTHING).unwrap().frames;
        let futures = futures(&settings).unwrap();
        let off =
            |a: &Positions, b: &Positions| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert_eq!((futures.calm.len(), futures.stiffer.len()), (CALM, 5));
        assert!(off(&futures.calm[0], &clip[4]) < 0.05);
        assert_eq!(off(&futures.stiffer[0], &clip[0]), 0.0);
        assert!(off(&futures.stiffer[4], &clip[4]) > 1e-4);
        assert!(off(&futures.calm[19], &futures.calm[0]) > 1e-3);
    }
}
