//! A preset of Blender's cloth modifier, with the stiffnesses per width of the result.
//!
//! Blender counts time in frames and gravity as 0.001 of its value, so that one of its frames is 1/√1000 s and its
//! masses are a thousandth of ours. Its springs have tension/ℓ along the edges and shear/ℓ along the diagonals of
//! quads, with the edges' mean length ℓ; its angular bending springs push quads of side ℓ by 0.1 · bending · ℓ per
//! radian. On a grid of nearly square quads
//!
//!   E = tension/ℓ,   G = shear/ℓ,   D = bending · ℓ²/20,
//!
//! tried with a hanging sheet and a cantilever: docs/experiments/log/export.md.

use std::fmt::Write as _;

use super::Clip;

/// Metres per second squared that Blender makes of one metre per frame squared.
const PER_FRAME: f64 = 1000.0;
/// Steps per frame: what Blender takes at most. Its bending springs are explicit.
const QUALITY: usize = 80;

/// Name of the preset's file.
pub(super) fn name(clip: &Clip) -> String {
    format!("{}_blender_cloth.py", clip.name)
}

/// The preset; `None` of results without stiffnesses per width.
pub(super) fn encode(clip: &Clip) -> Option<Vec<u8>> {
    let widths = clip.fabric?.per_width;
    let (x, edges) = (&clip.mesh.positions, clip.mesh.edges());
    let length = |[a, b]: &[u32; 2]| x[*a as usize].distance(x[*b as usize]);
    let side = edges.iter().map(length).sum::<f64>() / edges.len().max(1) as f64;
    let area: f64 = clip
        .mesh
        .triangles()
        .iter()
        .map(|t| t.map(|v| x[v as usize]))
        .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length())
        .sum();
    let mean = |[warp, weft]: [f64; 2]| (warp * weft).sqrt();
    let (membrane, bending) = (mean(widths.membrane), mean(widths.bending));
    let settings = [
        ("quality", QUALITY as f64),
        ("mass", PER_FRAME * widths.area_density * area / x.len() as f64),
        ("time_scale", PER_FRAME.sqrt() / clip.fps),
        ("air_damping", 0.0),
        ("tension_stiffness", membrane * side),
        ("compression_stiffness", membrane * side),
        ("shear_stiffness", widths.shear * side),
        ("bending_stiffness", 20.0 * bending / (side * side)),
        // These are not of the result: they let the sheet come to rest.
        ("tension_damping", 0.5),
        ("compression_damping", 0.5),
        ("shear_damping", 0.5),
        ("bending_damping", 1.0),
    ];
    let mut out = format!(
        "# Written by tessuto {} for Blender's cloth modifier, for the mesh {} alone: cells of {:.4} m.\n\
         # Bending {bending:.3e} N m, shear {:.3e} N/m, membrane {membrane:.3e} N/m at {} kg/m^2, which is assumed.\n\
         # Select the mesh and run it in the Scripting tab, or keep it among the presets of the modifier.\n\
         import bpy\n\n\
         modifier = getattr(bpy.context, \"cloth\", None)\n\
         if modifier is None:\n    mesh = bpy.context.object\n    \
         found = [m for m in mesh.modifiers if m.type == \"CLOTH\"]\n    \
         modifier = found[0] if found else mesh.modifiers.new(\"Cloth\", \"CLOTH\")\n\
         settings = modifier.settings\nsettings.bending_model = \"ANGULAR\"\n",
        clip.version, clip.name, side, widths.shear, widths.area_density
    );
    for (key, value) in settings {
        let _ = match key {
            "quality" => writeln!(out, "settings.{key} = {value}"),
            _ => writeln!(out, "settings.{key} = {value:.6}"),
        };
    }
    Some(out.into_bytes())
}
