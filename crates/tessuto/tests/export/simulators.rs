//! The fabric in files for simulators and libraries of materials.

use std::path::Path;

use glam::{DVec2, DVec3};
use serde_json::Value;
use tessuto::export::{Clip, Format, export};
use tessuto::{Motion, mesh};

use super::fabric::measured;
use super::files::{clip, y_up};

/// A sheet of 0.4×0.2 m, 5×3 vertices, moved out of the plane and stretched by a hundredth; two corners are held.
fn sheet() -> Clip {
    let mesh = mesh::grid(5, 3, DVec2::new(0.4, 0.2), 1.2);
    let moved = |p: &DVec3| DVec3::new(1.01 * p.x, p.y, p.z + 0.1 * p.x * p.x);
    let shapes = vec![mesh.positions.iter().map(moved).collect()];
    let motion = Motion::new(shapes).unwrap();
    Clip { mesh, motion, frames: vec![0], frame_count: 1, held: vec![0, 4], ..measured() }
}

fn written(clip: &Clip, format: Format, file: &str) -> String {
    let home = tempfile::tempdir().unwrap();
    export(clip, &[format], home.path(), false).unwrap();
    std::fs::read_to_string(home.path().join(file)).unwrap()
}

/// What stands between `before` and the next `after`.
fn between<'t>(text: &'t str, before: &str, after: &str) -> &'t str {
    let start = text.find(before).unwrap_or_else(|| panic!("no {before}")) + before.len();
    &text[start..start + text[start..].find(after).unwrap_or_else(|| panic!("no {after}"))]
}

fn numbers(text: &str) -> Vec<f64> {
    let words = text.split(|c: char| c.is_whitespace() || "(),[]".contains(c)).filter(|w| !w.is_empty());
    words.map(|w| w.parse().unwrap_or_else(|_| panic!("{w} is no number"))).collect()
}

#[test]
fn usd_has_the_sheet_that_a_simulator_takes() {
    let clip = sheet();
    let text = written(&clip, Format::Usd, "cloth.usda");
    let part = between(&text, "def Xform \"Simulation\"", "\n    }\n");
    let flat = part.split_whitespace().collect::<Vec<_>>().join(" ");
    for line in [
        "prepend apiSchemas = [\"PhysicsDeformableBodyAPI\"]",
        "uniform token purpose = \"guide\"",
        "prepend apiSchemas = [\"PhysicsSurfaceDeformableSimAPI\", \"PhysicsCollisionAPI\", \"MaterialBindingAPI\"]",
        // 0.1 kg/m² on 0.08 m².
        "float[] physics:masses = [0.008] uniform token physics:masses:elementType = \"constant\"",
        "float[] physics:thicknesses = [0.0005] uniform token physics:thicknesses:elementType = \"constant\"",
        "uniform token physics:restBendAnglesDefault = \"flat\"",
        "rel material:binding:physics = </cloth/Materials/Fabric>",
        "rel physics:src0 = </cloth/Simulation/Sheet> rel physics:src1 = </cloth> uniform token physics:type0 = \
         \"point\" uniform token physics:type1 = \"xform\" int[] physics:indices0 = [0, 4]",
    ] {
        assert!(flat.contains(line), "{line} is missing in {flat}");
    }
    assert!(!part.contains("timeSamples"), "a simulator begins at one shape");
    let of = |name: &str| numbers(between(part, &format!("{name} = "), "]"));
    let points = of("point3f[] points");
    let expected: Vec<f64> = y_up(&clip, 0).into_iter().map(f64::from).collect();
    assert!(points.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6) && points.len() == 45);
    assert_eq!(of("faceVertexCounts"), [3.0; 16]);
    // Flat, and of the sizes of the template.
    let rest = of("restShapePoints");
    let place = |v: usize| DVec3::new(rest[3 * v], rest[3 * v + 1], rest[3 * v + 2]);
    assert!(
        (place(0).distance(place(4)) - 0.4).abs() < 1e-6 && (place(0).distance(place(10)) - 0.2).abs() < 1e-6
    );
    assert!((0..15).all(|v| place(v).z == 0.0));
    assert_eq!(of("coords1"), [&points[..3], &points[12..15]].concat());
    // Gravity of the camera's axes is 1 m/s² along y, down.
    let scene = between(&text, "def PhysicsScene", "}");
    assert!(
        scene.contains("gravityDirection = (0, -1, -0)") && scene.contains("gravityMagnitude = 1\n"),
        "{scene}"
    );
}

#[test]
fn mujoco_has_every_vertex_with_its_own_mass() {
    let clip = sheet();
    let text = written(&clip, Format::Mujoco, "cloth_mujoco.xml");
    let masses: Vec<f64> = (0..15)
        .map(|v| {
            let body = between(&text, &format!("<body name=\"v{v}\""), "</body>");
            numbers(between(body, "mass=\"", "\""))[0]
        })
        .collect();
    assert!((masses.iter().sum::<f64>() / 0.008 - 1.0).abs() < 1e-5, "{masses:?}");
    // Corners of one and of two triangles, and the middle of six thirds of 0.0005 kg.
    let third = 0.1 * 0.005 / 3.0;
    let mut corners = [0, 4, 10, 14].map(|v| (masses[v] / third).round() as usize);
    corners.sort_unstable();
    assert_eq!(corners, [1, 1, 2, 2]);
    assert!((masses[7] / third - 6.0).abs() < 1e-4, "{masses:?}");

    let place = |v: usize| {
        let n = numbers(between(&text, &format!("<body name=\"v{v}\" pos=\""), "\""));
        DVec3::new(n[0], n[1], n[2])
    };
    let qpos = numbers(between(&text, "<key name=\"first\" qpos=\"", "\""));
    assert_eq!(qpos.len(), 45);
    for (v, p) in clip.motion[0].iter().enumerate() {
        let found = place(v) + DVec3::new(qpos[3 * v], qpos[3 * v + 1], qpos[3 * v + 2]);
        assert!(found.distance(DVec3::new(p.x, p.z, -p.y)) < 1e-7, "vertex {v}: {found}");
    }
    assert!((place(0).distance(place(4)) - 0.4).abs() < 1e-6, "the reference is not stretched");
    // The first row of the grid is the upper one, here as in the image.
    assert!(place(0).z > place(10).z);

    let elements = numbers(between(&text, "element=\"", "\""));
    assert!(elements.len() == 48 && elements.iter().all(|v| *v < 15.0));
    let of =
        |name: &str| numbers(between(between(&text, "<elasticity", "/>"), &format!("{name}=\""), "\""))[0];
    let (young, t) = (of("young"), of("thickness"));
    assert!((young * t / 200.0 - 1.0).abs() < 1e-5 && (young * t.powi(3) / 12.0 / 2e-4 - 1.0).abs() < 1e-5);
    assert_eq!((of("poisson"), text.matches("joint1=").count()), (0.0, 6));
    assert_eq!(numbers(between(&text, "gravity=\"", "\"")), [0.0, 0.0, -1.0]);
    let held = numbers(between(&text, "joint1=\"v4x\" polycoef=\"", "\""));
    assert!((held[0] - qpos[12]).abs() < 1e-9, "{held:?}");
    assert!(
        !text.contains("elastic3d") && text.contains("elastic2d=\"both\"") && text.contains("\"discrete\"")
    );
    let free = Clip { held: Vec::new(), ..clip };
    assert!(!written(&free, Format::Mujoco, "cloth_mujoco.xml").contains("<equality>"));
}

#[test]
fn what_is_made_of_stiffnesses_is_refused_without_them() {
    for (clip, format) in
        [(clip(false), Format::Mujoco), (measured(), Format::Mujoco), (clip(false), Format::Ppf)]
    {
        let folder = tempfile::tempdir().unwrap();
        let error = export(&clip, &[Format::Glb, format], folder.path(), false).unwrap_err();
        let said = error.to_string();
        assert_eq!(error.exit_code(), 3);
        assert!(
            said.contains("result cloth") && said.contains(format.key()) && said.contains("flat panel"),
            "{said}"
        );
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

#[test]
fn ppf_is_a_preset_divided_by_the_density() {
    let text = written(&measured(), Format::Ppf, "cloth_ppf.toml");
    let value = |key: &str| {
        let line = text.lines().find(|l| l.starts_with(&format!("{key} = "))).expect(key);
        line.split(" = ").nth(1).unwrap().to_owned()
    };
    let number = |key: &str| value(key).parse::<f64>().expect(key);
    assert!(text.lines().any(|l| l == "[cloth]"));
    assert_eq!(
        (value("object_type"), value("shell_model")),
        ("\"SHELL\"".into(), "\"BARAFF_WITKIN\"".into())
    );
    assert_eq!((value("young_mod_density_normalized"), number("shell_density")), ("true".into(), 0.1));
    let (y, nu) = (number("shell_young_modulus"), number("shell_poisson_ratio"));
    assert!((0.1 * y / (2.0 * (1.0 + nu)) / 200.0 - 1.0).abs() < 1e-9);
    assert!((0.1 * y * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)) / 2.5 - 1.0).abs() < 1e-9);
    let unit = 1.28e-5 * 0.1;
    assert!(((number("bend") + number("bend_warp")) * unit / 1e-4 - 1.0).abs() < 1e-9);
    assert!(((number("bend") + number("bend_weft")) * unit / 4e-4 - 1.0).abs() < 1e-9);
    assert_eq!(number("bend_warp"), 0.0);
}

/// The document and the names of the files in its folder.
fn u3m(clip: &Clip) -> (Value, Vec<String>) {
    let home = tempfile::tempdir().unwrap();
    export(clip, &[Format::U3m], home.path(), false).unwrap();
    let folder = home.path().join("cloth_u3m");
    let names = |folder: &Path| {
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort_unstable();
        names
    };
    (serde_json::from_slice(&std::fs::read(folder.join("cloth.u3m")).unwrap()).unwrap(), names(&folder))
}

fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value.as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

#[test]
fn u3m_has_what_its_schema_asks_for_and_no_more() {
    let sheet = sheet();
    let maps = Clip { material: clip(true).material, ..sheet.clone() };
    let (document, files) = u3m(&maps);
    assert_eq!(files, ["cloth.u3m", "cloth_basecolor.png", "cloth_metallic.png", "cloth_roughness.png"]);
    assert_eq!((keys(&document), &document["schema"]), (vec!["custom", "material", "schema"], &"1.1".into()));
    let material = &document["material"];
    let of_material =
        ["back", "created", "description", "front", "id", "metadata", "modified", "name", "physics", "side"];
    assert_eq!(keys(material), of_material);
    let of_side = [
        "alpha",
        "anisotropy_rotation",
        "anisotropy_value",
        "basecolor",
        "clearcoat_normal",
        "clearcoat_roughness",
        "clearcoat_value",
        "displacement",
        "ior",
        "metalness",
        "normal",
        "preview",
        "roughness",
        "shader",
        "sheen_tint",
        "sheen_value",
        "specular_tint",
        "specular_value",
        "subsurface_color",
        "subsurface_radius",
        "subsurface_value",
        "transmission",
    ];
    assert_eq!(keys(&material["front"]), of_side);
    assert_eq!(
        keys(&material["physics"]),
        ["composition", "construction", "devices", "material_type", "thickness", "weight"]
    );
    assert_eq!(
        (material["physics"]["weight"].as_f64(), &material["physics"]["thickness"]),
        (Some(100.0), &Value::Null)
    );
    // 4 pixels on 400 and 200 mm.
    let image = &material["front"]["roughness"]["texture"]["image"];
    assert_eq!(keys(image), ["dpi", "height", "path", "repeat", "width"]);
    let close = |value: &Value, expected: f64| (value.as_f64().unwrap() / expected - 1.0).abs() < 1e-9;
    assert!(close(&image["width"], 400.0) && close(&image["height"], 200.0), "{image}");
    assert!(close(&image["dpi"]["x"], 0.254) && close(&image["dpi"]["y"], 0.508), "{image}");
    assert_eq!(image["path"], "cloth_roughness.png");
    // A UUID of version 4 that follows from the content.
    let id = material["id"].as_str().unwrap();
    assert!(id.len() == 36 && &id[14..15] == "4" && "89ab".contains(&id[19..20]), "{id}");
    assert_eq!(u3m(&maps).0, document);
    let other = u3m(&Clip { held: Vec::new(), ..sheet }).0;
    assert_ne!(other["material"]["id"], material["id"]);
    assert_eq!(other["material"]["front"]["roughness"]["texture"], Value::Null);
    assert_eq!(document["custom"]["tessuto"]["stiffness_per_width"]["shear"], 2.5);
    // Without physics and without a panel there are still maps.
    let plain = u3m(&clip(false)).0;
    assert_eq!((&plain["custom"], &plain["material"]["physics"]), (&Value::Null, &Value::Null));
    assert_eq!(plain["material"]["front"]["basecolor"]["texture"]["image"]["width"], 0.0);
}
