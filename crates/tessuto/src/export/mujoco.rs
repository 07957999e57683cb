//! A model of MuJoCo (MJCF): the sheet as a two-dimensional flex of one body a vertex, flat where the model is at its
//! reference, and the first frame as a keyframe.
//!
//! A `flexcomp` would spread the weight evenly over the vertices, which makes the border of a sheet twice as heavy and
//! its corners four times; here every body has its own. MuJoCo 4.0 or later bends as the theory of plates says, and
//! only its integrator `discrete` is implicit in elasticity.
//!
//! Source: MuJoCo 4.0, *XML Reference*, flex, elasticity; the formulas stand at [`Shell`](super::shell::Shell).

use std::fmt::Write as _;

use glam::DVec3;

use super::Clip;
use super::row::{Output, Row};
use super::sheet::Sheet;
use super::shell::THICKNESS;

/// Time step `[s]`: in the middle of what MuJoCo's documents recommend for this integrator.
const STEP: f64 = 0.002;
/// Rayleigh damping `[s]`, chosen: swings die away within a second or two.
const DAMPING: f64 = 0.01;
/// Radius of gyration `[m]` of the bodies, which do not turn: MuJoCo asks for one.
const GYRATION: f64 = 1e-3;

/// What keeps held vertices in place: a time constant of two steps, and hardly any give. A vertex weighs far less than
/// the cloth that hangs on it, which is what softer ones give way to.
const HOLD: &str = "solref=\"0.004 1\" solimp=\"0.9999 0.9999 0.0001\"";

/// The row of the format.
pub(super) const FORMAT: Row = Row {
    key: "mujoco",
    programs: "MuJoCo",
    content: "model of the sheet as a flex, with the fabric's stiffness (z up)",
    files: &[("_mujoco.xml", "model of the sheet: MuJoCo 4.0 or later")],
    feature: None,
    for_blender: false,
    outputs: |clip| {
        let sheet = Sheet::needed(clip, "mujoco")?;
        Ok(vec![Output::File(format!("{}_mujoco.xml", clip.name), encode(clip, &sheet))])
    },
};

/// (x, y, z) of the camera's axes with z up: the camera looks along +y.
fn z_up(v: DVec3) -> DVec3 {
    DVec3::new(v.x, v.z, -v.y)
}

fn words(values: impl IntoIterator<Item = DVec3>) -> String {
    let words: Vec<String> =
        values.into_iter().map(|v| format!("{:.9} {:.9} {:.9}", v.x, v.y, v.z)).collect();
    words.join(" ")
}

fn encode(clip: &Clip, sheet: &Sheet) -> Vec<u8> {
    let first: Vec<DVec3> = clip.motion[0].iter().map(|p| z_up(*p)).collect();
    let mean = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len() as f64;
    // The panel lies upright where the fabric was filmed: v of the texture is up.
    let flat: Vec<DVec3> = sheet.flat.iter().map(|p| DVec3::new(p.x, 0.0, p.y)).collect();
    let shift = mean(&first) - mean(&flat);
    let flat: Vec<DVec3> = flat.into_iter().map(|p| p + shift).collect();
    let moved = || first.iter().zip(&flat).map(|(p, q)| *p - *q);
    let shell = &sheet.shell;
    let mut out = format!(
        "<mujoco model=\"{}\">\n  \
         <!-- Written by tessuto {}. E = {:.4e} N/m, D = {:.4e} N m, {} kg/m^2, means of warp and weft.\n       \
         Flat at the reference; the keyframe \"first\" is the first frame of the video. -->\n  \
         <option timestep=\"{STEP}\" integrator=\"discrete\" solver=\"Newton\" tolerance=\"1e-8\" gravity=\"{}\"/>\n  \
         <default>\n    <joint type=\"slide\"/>\n    <equality {HOLD}/>\n  </default>\n  <worldbody>\n",
        clip.name,
        clip.version,
        shell.membrane,
        shell.bending,
        shell.area_density,
        words([z_up(clip.parameters.accelerations.constant)]),
    );
    for (v, (place, mass)) in flat.iter().zip(&sheet.masses).enumerate() {
        let _ = writeln!(
            out,
            "    <body name=\"v{v}\" pos=\"{}\"><inertial pos=\"0 0 0\" mass=\"{mass:.6e}\" diaginertia=\"{1}\"/>\
             <joint name=\"v{v}x\" axis=\"1 0 0\"/><joint name=\"v{v}y\" axis=\"0 1 0\"/>\
             <joint name=\"v{v}z\" axis=\"0 0 1\"/></body>",
            words([*place]),
            [0; 3].map(|_| format!("{:.6e}", mass * GYRATION * GYRATION)).join(" "),
        );
    }
    let bodies: Vec<String> = (0..flat.len()).map(|v| format!("v{v}")).collect();
    let elements: Vec<String> = sheet.triangles.iter().flatten().map(ToString::to_string).collect();
    let _ = write!(
        out,
        "  </worldbody>\n  <deformable>\n    <flex name=\"fabric\" dim=\"2\" radius=\"{}\"\n          \
         body=\"{}\"\n          element=\"{}\">\n      \
         <elasticity young=\"{:.6e}\" poisson=\"0\" thickness=\"{:.6e}\" elastic2d=\"both\" \
         damping=\"{DAMPING}\"/>\n      <contact selfcollide=\"none\"/>\n    </flex>\n  </deformable>\n",
        0.5 * THICKNESS,
        bodies.join(" "),
        elements.join(" "),
        shell.young(),
        shell.thickness(),
    );
    if !clip.held.is_empty() {
        let moved: Vec<DVec3> = moved().collect();
        out.push_str("  <equality>\n");
        for v in &clip.held {
            for (axis, by) in ["x", "y", "z"].into_iter().zip(moved[*v].to_array()) {
                let _ = writeln!(out, "    <joint joint1=\"v{v}{axis}\" polycoef=\"{by:.9} 0 0 0 0\"/>");
            }
        }
        out.push_str("  </equality>\n");
    }
    let _ = write!(
        out,
        "  <keyframe>\n    <key name=\"first\" qpos=\"{}\"/>\n  </keyframe>\n</mujoco>\n",
        words(moved())
    );
    out.into_bytes()
}
