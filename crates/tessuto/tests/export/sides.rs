//! A fabric whose other side has one colour, in exports: two surfaces, each seen from its own side.

use glam::Vec3;
use serde_json::Value;
use tessuto::export::{Clip, Format, PlainBack, export};
use tessuto::mesh::Side;

use super::files::{accessor, clip, floats, parse_glb};

const COLOUR: [f32; 3] = [0.5, 0.125, 0.25];

/// The clip, its triangles as they are or wound the other way.
fn lined(turned: bool) -> Clip {
    let mut clip = clip(false);
    if turned {
        for face in &mut clip.mesh.faces {
            face.vertices.reverse();
            face.uvs.reverse();
        }
    }
    let front = Side::front(&clip.mesh, &clip.camera.into());
    let outward = front.sign() < 0;
    Clip { back: Some(PlainBack { colour: COLOUR, outward }), ..clip }
}

/// The file of `clip` that ends in `ending`.
fn written(clip: &Clip, format: Format, ending: &str) -> Vec<u8> {
    let home = tempfile::tempdir().unwrap();
    export(clip, &[format], home.path(), false).unwrap();
    std::fs::read(home.path().join(format!("cloth{ending}"))).unwrap()
}

#[test]
fn glb_has_two_surfaces_that_are_seen_from_one_side_each() {
    for clip in [lined(false), lined(true)] {
        let bytes = written(&clip, Format::Glb, ".glb");
        let (gltf, binary) = parse_glb(&bytes);
        let vectors = |index: &Value| -> Vec<Vec3> {
            let numbers = floats(accessor(&gltf, binary, index));
            numbers.chunks_exact(3).map(Vec3::from_slice).collect()
        };
        let primitives = gltf["meshes"][0]["primitives"].as_array().unwrap();
        assert_eq!(primitives.len(), 2);
        for (k, primitive) in primitives.iter().enumerate() {
            assert_eq!(primitive["material"], k);
            let bytes = accessor(&gltf, binary, &primitive["indices"]).chunks_exact(4);
            let indices: Vec<usize> =
                bytes.map(|b| u32::from_le_bytes(b.try_into().unwrap()) as usize).collect();
            let (positions, normals) =
                (&primitive["attributes"]["POSITION"], &primitive["attributes"]["NORMAL"]);
            let (mut positions, mut normals) = (vectors(positions), vectors(normals));
            for n in 0..clip.motion.len() {
                if n > 0 {
                    let target = &primitive["targets"][n - 1];
                    let add = |to: &mut [Vec3], base: &str, index: &Value| {
                        let start = vectors(&primitive["attributes"][base]);
                        let moved = vectors(index);
                        to.iter_mut().zip(start.iter().zip(moved)).for_each(|(to, (a, b))| *to = *a + b);
                    };
                    add(&mut positions, "POSITION", &target["POSITION"]);
                    add(&mut normals, "NORMAL", &target["NORMAL"]);
                }
                for t in indices.chunks_exact(3) {
                    let [a, b, c] = [t[0], t[1], t[2]].map(|i| positions[i]);
                    let facing = (b - a).cross(c - a);
                    // The camera is at the origin: it sees the print.
                    assert_eq!(facing.dot(a) < 0.0, k == 0, "frame {n}, surface {k}");
                    assert!(t.iter().all(|i| normals[*i].dot(facing) > 0.0), "frame {n}, surface {k}");
                }
            }
        }
        let [print, back] = [0, 1].map(|k| &gltf["materials"][k]);
        assert_eq!([&print["doubleSided"], &back["doubleSided"]], [false, false]);
        let colour = &back["pbrMetallicRoughness"]["baseColorFactor"];
        assert_eq!(*colour, serde_json::json!([0.5, 0.125, 0.25, 1.0]));
        assert_eq!(back["name"], "cloth_back");
    }
}

#[test]
fn usd_and_the_script_for_blender_have_the_other_side() {
    for clip in [lined(false), lined(true)] {
        let outward = clip.back.unwrap().outward;
        let [print, back] = if outward { ["right", "left"] } else { ["left", "right"] };
        let text = String::from_utf8(written(&clip, Format::Usd, ".usda")).unwrap();
        let flat = text.split_whitespace().collect::<Vec<_>>().join(" ");
        for part in [
            format!("uniform bool doubleSided = 0 uniform token orientation = \"{print}Handed\""),
            format!(
                "def Mesh \"Back\" ( prepend references = </cloth/Fabric> ) {{ uniform token orientation = \
                 \"{back}Handed\" normal3f[] normals = None rel material:binding = </cloth/Materials/Back> }}"
            ),
            "def Material \"Back\" { token outputs:surface.connect = </cloth/Materials/Back/surface".into(),
            "color3f inputs:diffuseColor = (0.5, 0.125, 0.25) float inputs:roughness = 1 ".into(),
        ] {
            assert!(flat.contains(&part), "{part} is missing");
        }
        assert_eq!(text.matches('{').count(), text.matches('}').count());
        let script = String::from_utf8(written(&clip, Format::Usd, "_blender.py")).unwrap();
        assert!(script.contains("\"back\": [") && script.ends_with("\n\n\nmain()\n"));
        assert!(script.contains("outputs[\"Backfacing\"]"));
    }
}

#[test]
fn nothing_tells_of_another_side_where_both_are_the_same() {
    let clip = clip(true);
    for (format, ending) in [(Format::Glb, ".glb"), (Format::Usd, ".usda"), (Format::Usd, "_blender.py")] {
        let bytes = written(&clip, format, ending);
        let text = String::from_utf8_lossy(&bytes);
        let marks = ["Back\"", "cloth_back", "orientation", "Backfacing", "\"back\""];
        assert!(marks.iter().all(|mark| !text.contains(mark)), "{ending}");
    }
    // Formats of one surface are what they were.
    for format in [Format::Obj, Format::Ply, Format::Pc2, Format::Npz] {
        let files = |clip: &Clip| {
            let home = tempfile::tempdir().unwrap();
            let mut all: Vec<_> = Vec::new();
            for path in export(clip, &[format], home.path(), false).unwrap() {
                if path.is_file() {
                    all.push(std::fs::read(path).unwrap());
                }
            }
            all
        };
        let back = Some(PlainBack { colour: COLOUR, outward: true });
        assert!(files(&clip) == files(&Clip { back, ..clip.clone() }), "{format:?}");
    }
}
