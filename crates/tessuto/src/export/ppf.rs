//! A material for ZOZO's contact solver (ppf-contact-solver): an entry of the presets of its Blender add-on.
//!
//! Source: st-tech/ppf-contact-solver, `blender_addon/presets/materials.toml`, `shell_bend_stiffness.kernel.cpp` and
//! `baraffwitkin.hpp` of 2026; the formulas stand at [`Ppf`].

use std::fmt::Write as _;

use super::Clip;
use super::row::{Output, Row};
use super::shell::{Ppf, Shell};
use tessuto_core::error::{Error, Result};

/// The row of the format.
pub(super) const FORMAT: Row = Row {
    key: "ppf",
    programs: "ZOZO's solver",
    content: "material preset for ZOZO's contact solver (TOML)",
    files: &[("_ppf.toml", "material preset for ZOZO's contact solver")],
    feature: None,
    for_blender: false,
    outputs: |clip| Ok(vec![Output::File(format!("{}_ppf.toml", clip.name), encode(clip)?)]),
};

/// One table, named after the clip.
fn encode(clip: &Clip) -> Result<Vec<u8>> {
    let Some(fabric) = clip.fabric else {
        return Err(Error::input(
            format!("result {}", clip.name),
            "has no stiffnesses per width, which the format ppf is made of",
            super::sheet::WAY_OUT,
        ));
    };
    let (shell, ppf) = (Shell::of(&fabric.per_width), Ppf::of(&fabric.per_width));
    let mut out = format!(
        "# Written by tessuto {}, for blender_addon/presets/materials.toml of ppf-contact-solver.\n\
         # Bending {:.3e} and {:.3e} N m, membrane {:.3e} N/m, shear {:.3e} N/m at {} kg/m^2.\n\
         # bend_warp and bend_weft need a UV map, u along the warp. Friction is not known: the solver's own stays.\n\
         [{}]\n\
         description = \"Recovered from a video by tessuto\"\n\
         object_type = \"SHELL\"\nshell_model = \"BARAFF_WITKIN\"\n",
        clip.version,
        fabric.per_width.bending[0],
        fabric.per_width.bending[1],
        shell.membrane,
        shell.shear,
        shell.area_density,
        clip.name,
    );
    let [bend, warp, weft] = ppf.bend;
    let _ = writeln!(out, "shell_density = {:?}", shell.area_density);
    let _ = writeln!(out, "shell_young_modulus = {:?}", ppf.young);
    let _ = writeln!(out, "young_mod_density_normalized = true");
    let _ = writeln!(out, "shell_poisson_ratio = {:?}", ppf.poisson);
    for (key, value) in [("bend", bend), ("bend_warp", warp), ("bend_weft", weft)] {
        let _ = writeln!(out, "{key} = {value:?}");
    }
    out.push_str("enable_strain_limit = false\n");
    Ok(out.into_bytes())
}
