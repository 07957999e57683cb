//! The fabric's stiffnesses in USD, and the sheet that a simulator takes.
//!
//! USD has no deformable bodies yet; proposal 111 for them is open. Names, types and units in `physics:` are those of
//! its state of 21 August 2026 (commit 63c74d79), which Newton 1.8 reads: stiffnesses per width, thicknesses and
//! masses on the simulated mesh. Programs that do not know the schema skip it. What was found, by direction and with
//! its certainty, stands in `tessuto:`.

use std::fmt::Write as _;

use glam::DVec3;

use super::Clip;
use super::sheet::Sheet;
use super::shell::{Shell, THICKNESS};
use super::usd::{integers, vectors};
use crate::result::Measured;

/// Schemas that the fabric's material has; nothing for results without stiffnesses per width.
pub(super) fn schemas(clip: &Clip) -> &'static str {
    match clip.fabric {
        Some(_) => {
            " (\n            prepend apiSchemas = [\"PhysicsMaterialAPI\", \
             \"PhysicsSurfaceDeformableMaterialAPI\"]\n        )"
        }
        None => "",
    }
}

/// Attributes of the fabric's material; nothing of results without stiffnesses per width.
pub(super) fn attributes(clip: &Clip, out: &mut String) {
    let Some(Measured { per_width: w, sd_of_ln, constraints }) = clip.fabric else { return };
    let mut found = |kind: &str, name: &str, value: String, unit: &str, k: Option<usize>| {
        let sure = k.map_or_else(
            || "                    bool assumed = 1\n".to_owned(),
            |k| {
                format!(
                    "                    string constraint = \"{}\"\n                    bool informed = {}\n\
                    {:20}double sdOfLn = {:.4}\n",
                    constraints[k].word(),
                    u8::from(constraints[k].is_constrained()),
                    "",
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
    let shell = Shell::of(&w);
    for (name, value) in [
        ("density", shell.area_density / THICKNESS),
        ("surfaceStretchStiffness", shell.membrane),
        ("surfaceShearStiffness", shell.shear),
        ("surfaceBendStiffness", shell.bending),
    ] {
        let _ = writeln!(out, "            float physics:{name} = {}", value as f32);
    }
}

/// The scene's gravity, the sheet as a deformable body in the shape of the first frame, and what holds it, as guides
/// beside the animated mesh; nothing where there is no [`Sheet`].
pub(super) fn simulation(clip: &Clip, out: &mut String) {
    let Some(sheet) = Sheet::of(clip) else { return };
    let name = &clip.name;
    let up = |v: DVec3| DVec3::new(v.x, -v.y, -v.z);
    let gravity = up(clip.parameters.accelerations.constant);
    let (size, toward) = (gravity.length(), gravity.normalize_or(DVec3::NEG_Y).as_vec3());
    let flat: Vec<_> = sheet.flat.iter().map(|p| p.as_vec3()).collect();
    let counts = integers(sheet.triangles.iter().map(|_| 3));
    let indices = integers(sheet.triangles.iter().flatten().copied());
    let points = Clip::y_up(&clip.motion[0]);
    let mass = sheet.masses.iter().sum::<f64>() as f32;
    let _ = write!(
        out,
        "\n    def PhysicsScene \"Scene\"\n    {{\n        \
         vector3f physics:gravityDirection = ({}, {}, {})\n        \
         float physics:gravityMagnitude = {}\n    }}\n\n    \
         def Xform \"Simulation\" (\n        prepend apiSchemas = [\"PhysicsDeformableBodyAPI\"]\n    )\n    \
         {{\n        uniform token purpose = \"guide\"\n\n        \
         def Mesh \"Sheet\" (\n            prepend apiSchemas = [\"PhysicsSurfaceDeformableSimAPI\", \
         \"PhysicsCollisionAPI\", \"MaterialBindingAPI\"]\n        )\n        {{\n            \
         uniform bool doubleSided = 1\n            uniform token subdivisionScheme = \"none\"\n            \
         int[] faceVertexCounts = {counts}\n            int[] faceVertexIndices = {indices}\n            \
         float3[] extent = {}\n            \
         point3f[] points = {}\n            \
         float[] physics:masses = [{mass}]\n            \
         uniform token physics:masses:elementType = \"constant\"\n            \
         float[] physics:thicknesses = [{}]\n            \
         uniform token physics:thicknesses:elementType = \"constant\"\n            \
         point3f[] physics:restShapePoints = {}\n            \
         uniform token physics:restBendAnglesDefault = \"flat\"\n            \
         rel material:binding:physics = </{name}/Materials/Fabric>\n        }}\n",
        toward.x,
        toward.y,
        toward.z,
        size as f32,
        super::usd::bounds(&points),
        vectors(&points),
        THICKNESS as f32,
        vectors(&flat)
    );
    if !clip.held.is_empty() {
        let held = integers(clip.held.iter().map(|v| *v as u32));
        let places: Vec<_> = clip.held.iter().map(|v| points[*v]).collect();
        let _ = write!(
            out,
            "\n        def PhysicsAttachment \"Holds\"\n        {{\n            \
             rel physics:src0 = </{name}/Simulation/Sheet>\n            \
             rel physics:src1 = </{name}>\n            \
             uniform token physics:type0 = \"point\"\n            \
             uniform token physics:type1 = \"xform\"\n            \
             int[] physics:indices0 = {held}\n            \
             vector3f[] physics:coords1 = {}\n        }}\n",
            vectors(&places)
        );
    }
    out.push_str("    }\n");
}
