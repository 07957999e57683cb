//! The fabric's stiffnesses in USD, with their units.
//!
//! USD has no deformable bodies yet. The names in `tessuto:physics:` are those of the proposal for them (OpenUSD
//! proposal 111, as its staged implementation has them); the numbers in `tessuto:` are what was found.

use std::fmt::Write as _;

use super::Clip;
use crate::result::Measured;

/// Thickness that the proposal's numbers take `[m]`; it cancels out of every stiffness per width.
const THICKNESS: f64 = 5e-4;

/// Attributes of the fabric's material; nothing of results without stiffnesses per width.
pub(super) fn attributes(clip: &Clip, out: &mut String) {
    let Some(Measured { per_width: w, sd_of_ln, informed }) = clip.fabric else { return };
    let mut found = |kind: &str, name: &str, value: String, unit: &str, k: Option<usize>| {
        let sure = k.map_or_else(
            || "                    bool assumed = 1\n".to_owned(),
            |k| {
                format!(
                    "                    bool informed = {}\n                    double sdOfLn = {:.4}\n",
                    u8::from(informed[k]),
                    sd_of_ln[k]
                )
            },
        );
        let _ = write!(
            out,
            "            custom {kind} tessuto:{name} = {value} (\n                customData = {{\n\
             {sure}                    \
             string unit = \"{unit}\"\n                }}\n            )\n"
        );
    };
    let pair = |[warp, weft]: [f64; 2]| format!("({}, {})", warp as f32, weft as f32);
    let one = |value: f64| format!("{}", value as f32);
    found("float2", "bendingStiffness", pair(w.bending), "N*m", Some(1));
    found("float", "shearStiffness", one(w.shear), "N/m", Some(2));
    found("float2", "membraneStiffness", pair(w.membrane), "N/m", Some(0));
    found("float", "areaDensity", one(w.area_density), "kg/m^2", None);
    let mean = |[warp, weft]: [f64; 2]| (warp * weft).sqrt();
    let proposed = [
        ("surfaceThickness", THICKNESS, "m"),
        ("density", w.area_density / THICKNESS, "kg/m^3"),
        ("surfaceStretchStiffness", mean(w.membrane) / THICKNESS, "Pa"),
        ("surfaceShearStiffness", w.shear / THICKNESS, "Pa"),
        ("surfaceBendStiffness", mean(w.bending) / THICKNESS.powi(3), "Pa"),
    ];
    for (name, value, unit) in proposed {
        let _ = write!(
            out,
            "            custom float tessuto:physics:{name} = {} (\n                \
             customData = {{\n                    \
             string unit = \"{unit}\"\n                }}\n            )\n",
            value as f32
        );
    }
}
