//! Stiffnesses with their units in exports.

use tessuto::export::{Clip, Format, export};
use tessuto::motion::causes::Constraint;
use tessuto::result::Measured;
use tessuto::sim::per_width::PerWidth;

use super::files::clip;

pub(super) fn measured() -> Clip {
    let per_width = PerWidth {
        bending: [1e-4, 4e-4],
        shear: 2.5,
        membrane: [100.0, 400.0],
        bent: 0.1,
        area_density: 0.1,
    };
    let constraints = [Constraint::Unconstrained, Constraint::Constrained, Constraint::Constrained];
    let fabric = Measured { per_width, sd_of_ln: [0.5, 0.125, 0.0625], constraints };
    Clip { fabric: Some(fabric), ..clip(false) }
}

#[test]
fn usd_tells_stiffness_per_width_with_units_and_certainty() {
    let home = tempfile::tempdir().unwrap();
    export(&measured(), &[Format::Usd], home.path(), false).unwrap();
    let text = std::fs::read_to_string(home.path().join("cloth.usda")).unwrap();
    let flat = text.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in [
        "custom float2 tessuto:bendingStiffness = (0.0001, 0.0004) ( customData = { string constraint = \
         \"constrained\" bool informed = 1 double sdOfLn = 0.1250 string unit = \"N*m\" } )",
        "custom float tessuto:shearStiffness = 2.5 ( customData = { string constraint = \
         \"constrained\" bool informed = 1",
        "custom float2 tessuto:membraneStiffness = (100, 400) ( customData = { string constraint = \
         \"unconstrained\" bool informed = 0",
        "custom float tessuto:areaDensity = 0.1 ( customData = { bool assumed = 1 string unit = \"kg/m^2\" } )",
        "def Material \"Fabric\" ( prepend apiSchemas = [\"PhysicsMaterialAPI\", \
         \"PhysicsSurfaceDeformableMaterialAPI\"] )",
        "float physics:density = 200",
        "float physics:surfaceStretchStiffness = 200 ",
        "float physics:surfaceShearStiffness = 2.5 ",
        "float physics:surfaceBendStiffness = 0.0002 ",
        "kilogramsPerUnit = 1",
    ] {
        assert!(flat.contains(part), "{part} is missing");
    }
    // The proposal has given up the thickness of a material, and moduli in its place; a seam is no flat panel.
    for part in ["tessuto:physics", "surfaceThickness", "PhysicsDeformableBodyAPI"] {
        assert!(!flat.contains(part), "{part}");
    }
    // Effective values that only replay a motion are no stiffnesses.
    let other = tempfile::tempdir().unwrap();
    let names: Vec<_> = export(&clip(false), &[Format::Usd], other.path(), false).unwrap();
    assert!(!std::fs::read_to_string(other.path().join("cloth.usda")).unwrap().contains("physics:"));
    assert!(names.iter().all(|path| !path.to_string_lossy().contains("blender_cloth")));
}

#[test]
fn blender_gets_a_preset_in_its_own_units() {
    let home = tempfile::tempdir().unwrap();
    let clip = measured();
    export(&clip, &[Format::Glb], home.path(), false).unwrap();
    let text = std::fs::read_to_string(home.path().join("cloth_blender_cloth.py")).unwrap();
    let value = |key: &str| -> f64 {
        let line = text.lines().find(|l| l.starts_with(&format!("settings.{key} = "))).expect(key);
        line.rsplit(' ').next().unwrap().parse().unwrap()
    };
    // Back from Blender's numbers: E = tension/ℓ, G = shear/ℓ, D = bending ℓ²/20, and the whole mass.
    let side = value("shear_stiffness") / 2.5;
    let edges = clip.mesh.edges();
    let longest = edges
        .iter()
        .map(|[a, b]| clip.mesh.positions[*a as usize].distance(clip.mesh.positions[*b as usize]));
    let (short, long) = longest.fold((f64::INFINITY, 0.0f64), |(s, l), d| (s.min(d), l.max(d)));
    assert!((short..=long).contains(&side), "{side} m of {short} to {long}");
    assert!((value("tension_stiffness") / side / 200.0 - 1.0).abs() < 1e-3);
    assert!((value("bending_stiffness") * side * side / 20.0 / 2e-4 - 1.0).abs() < 1e-3);
    assert!((value("time_scale") * clip.fps / 1000f64.sqrt() - 1.0).abs() < 1e-5);
    let area: f64 = clip
        .mesh
        .triangles()
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| clip.mesh.positions[v as usize]);
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    let whole = value("mass") * clip.mesh.positions.len() as f64;
    assert!((whole / (100.0 * area) - 1.0).abs() < 1e-3, "{whole} of {area} m²");
}
