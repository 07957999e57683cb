//! Files for templates as programs save them: byte order marks and tables, shapes of glTF, depth maps of any channel
//! and unit.

use std::path::Path;
use std::process::Command;

use tessuto::Mesh;
use tessuto::glam::DVec2;
use tessuto::io::obj;
use tessuto::mesh::grid;

use crate::scene_maker::TinyScene;

/// Runs the program; status and what was printed, in one line.
fn tessuto(arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_tessuto")).args(arguments).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap();
    (output.status.code(), text.split_whitespace().collect::<Vec<_>>().join(" "))
}

/// Runs `tessuto template SCENE …`.
fn template(scene: &TinyScene, options: &[&str]) -> (Option<i32>, String) {
    tessuto(&[&["template", scene.folder().to_str().unwrap()], options].concat())
}

fn made(scene: &TinyScene) -> Mesh {
    obj::read(&scene.path("template.obj")).unwrap()
}

/// `text` in UTF-8 with a mark, and in UTF-16 both ways round.
fn marked(text: &str) -> [Vec<u8>; 3] {
    let all = format!("\u{feff}{text}");
    let units = || all.encode_utf16();
    [
        all.clone().into_bytes(),
        units().flat_map(u16::to_le_bytes).collect(),
        units().flat_map(u16::to_be_bytes).collect(),
    ]
}

#[test]
fn a_byte_order_mark_is_passed_over_in_every_text_file() {
    let scene = TinyScene::new();
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let sheet = grid(3, 3, DVec2::new(0.4, 0.4), 1.0);
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
               property float s\nproperty float t\n\
               element face 1\nproperty list uchar int vertex_indices\nend_header\n\
               -0.2 -0.2 1 0 1\n0.2 -0.2 1 1 1\n0.2 0.2 1 1 0\n-0.2 0.2 1 0 0\n4 0 1 2 3\n";
    let numbers: [f32; 18] =
        [-0.2, 0.2, -1.0, 0.2, 0.2, -1.0, -0.2, -0.2, -1.0, 0.2, -0.2, -1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0];
    let bytes: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).chain([0, 2, 1, 1, 2, 3]).collect();
    let gltf = serde_json::json!({
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": bytes.len(), "uri": format!("data:;base64,{}", tessuto::text::base64(&bytes))}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48},
                        {"buffer": 0, "byteOffset": 72, "byteLength": 6}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR"},
        ],
    });
    for (name, text) in
        [("a.obj", obj::encode(&sheet, None)), ("a.ply", ply.to_owned()), ("a.gltf", gltf.to_string())]
    {
        std::fs::write(at(name), &text).unwrap();
        let options = ["--from", &at(name), "--remesh", "5", "--force"];
        let (status, said) = template(&scene, &options);
        assert_eq!(status, Some(0), "{name}: {said}");
        let plain = made(&scene);
        for bytes in marked(&text) {
            std::fs::write(at(name), &bytes).unwrap();
            let (status, said) = template(&scene, &options);
            assert_eq!(status, Some(0), "{name} {:?}: {said}", &bytes[..2]);
            assert_eq!(made(&scene), plain, "{name} {:?}", &bytes[..2]);
        }
    }
    // The scene's own files.
    for name in ["template.obj", "scene.json"] {
        let text = std::fs::read_to_string(scene.path(name)).unwrap();
        for bytes in marked(&text) {
            std::fs::write(scene.path(name), &bytes).unwrap();
            let (status, said) = tessuto(&["check", scene.folder().to_str().unwrap()]);
            assert_eq!(status, Some(0), "{name} {:?}: {said}", &bytes[..2]);
        }
    }
    // Settings: read as far as what is wrong in them.
    for bytes in marked(r#"{"spacetime.resolution": "wide"}"#) {
        std::fs::write(at("settings.json"), bytes).unwrap();
        let (status, said) = tessuto(&[
            "reconstruct",
            scene.folder().to_str().unwrap(),
            "--config",
            &at("settings.json"),
            "--out",
            &at("out"),
        ]);
        assert!(status != Some(0) && said.contains("spacetime.resolution"), "{said}");
    }
    std::fs::write(at("settings.json"), b"{\n\"preset\": \"d\xE9faut\"}").unwrap();
    let (status, said) =
        tessuto(&["reconstruct", scene.folder().to_str().unwrap(), "--config", &at("settings.json")]);
    assert!(
        status == Some(3) && said.contains("settings.json, line 2: is not UTF-8 text: byte 0xE9"),
        "{said}"
    );
}

#[test]
fn the_table_of_the_workflow_is_read_or_refused_by_its_name() {
    let workflow = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../workflow");
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("scenes.csv");
    let read = |bytes: &[u8]| {
        std::fs::write(&table, bytes).unwrap();
        let code = "import sys; sys.path.insert(0, sys.argv[1]); import runs\n\
                    try: print(*runs.read(sys.argv[2]))\n\
                    except runs.TableError as e: print('refused:', e)";
        let said =
            Command::new("python3").args(["-B", "-c", code]).arg(&workflow).arg(&table).output().ok()?;
        assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
        Some(String::from_utf8_lossy(&said.stdout).trim().to_owned())
    };
    let text = "scene,preset,seed\nflag,saft,1|2\r\n\"curtain\",,\n,,\n";
    let Some(plain) = read(text.as_bytes()) else {
        eprintln!("NOT TESTED: python3 is missing");
        return;
    };
    assert_eq!(plain, "flag@preset=saft,seed=1 flag@preset=saft,seed=2 curtain");
    let semicolons = text.replace(',', ";");
    let tabs = text.replace(',', "\t");
    for text in [text, &semicolons, &tabs, &format!("sep=;\n{semicolons}")] {
        for bytes in marked(text) {
            assert_eq!(read(&bytes).unwrap(), plain, "{text:?} {:?}", &bytes[..2]);
        }
    }
    for (bytes, fragment) in [
        (
            &b"scene\nVorh\xE4nge\n"[..],
            "scenes.csv, line 2: byte 0xE4 is no UTF-8 text; save the table as \"CSV UTF-8\"",
        ),
        (b"\xFF\xFEs\0c", "is no UTF-16 text"),
        (b"scene,preset\n\"flag,saft\n", "is no CSV"),
        (b"scene;spacetime.bend\nflag;0,5\n", "numbers need a decimal point"),
        (b"scene,spacetime.bend\nflag,0,5\n", "one too many"),
    ] {
        let said = read(bytes).unwrap();
        assert!(said.starts_with("refused:") && said.contains(fragment), "{said}");
    }
}

#[test]
fn a_depth_map_of_another_unit_is_doubted_until_the_unit_is_told() {
    let scene = TinyScene::new();
    std::fs::remove_file(scene.path("template.obj")).unwrap();
    // The fabric of the scene, 0.4 m at 1 m, in quarter millimetres.
    let manifest: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(scene.path("scene.json")).unwrap()).unwrap();
    let [width, height] = ["width", "height"].map(|key| manifest[key].as_u64().unwrap() as u32);
    let depth = image::ImageBuffer::<image::Luma<u16>, _>::from_pixel(width, height, image::Luma([8000]));
    depth.save(scene.path("l515.png")).unwrap();
    let file = scene.path("l515.png").display().to_string();
    let options = ["--depth", &file, "--from-mask", "--grid", "5"];
    let (status, said) = template(&scene, &options);
    assert!(status == Some(0) && said.contains("a unit of the depth map is assumed to be 1 mm"), "{said}");
    assert!(said.contains("warning: the sheet has a diagonal of 4.") && said.contains("at 8.00 m"), "{said}");
    assert!(said.contains("at 2.00 m with 0.25 mm (RealSense L515)"), "{said}");
    let (_, said) = tessuto(&["check", scene.folder().to_str().unwrap()]);
    assert!(
        said.contains("warning scale the sheet has a diagonal") && said.contains("--depth-scale"),
        "{said}"
    );
    let (status, said) =
        template(&scene, &[&options[..], &["--depth-scale", "0.000125", "--force"]].concat());
    assert!(
        status == Some(0) && !said.contains("warning") && said.contains("depth map is 0.125 mm"),
        "{said}"
    );
    let (_, said) = tessuto(&["check", scene.folder().to_str().unwrap()]);
    assert!(!said.contains("warning scale") && said.contains("in units of 0.125 mm"), "{said}");
    let size = made(&scene).positions[0].distance(made(&scene).positions[4]);
    assert!((size - 0.4).abs() < 0.02, "{size}");
    for wrong in ["0", "-1", "0,2", "nan", "mm"] {
        let (status, said) = template(&scene, &[&options[..], &["--depth-scale", wrong]].concat());
        assert!(status == Some(2) && said.contains("--depth-scale"), "{wrong}: {said}");
    }
    // Beside what takes no depth map it is refused, not passed over.
    for others in [&["--flat", "1x1m", "--from-mask"][..], &["--scale", "2"], &["--weld"], &["--grid", "5"]] {
        for own in [["--depth-scale", "1"], ["--depth-camera", &file]] {
            let (status, said) = template(&scene, &[others, &own[..], &["--force"]].concat());
            assert!(status == Some(2) && said.contains(own[0]), "{others:?}: {said}");
        }
    }
}

#[test]
fn vertices_that_nearly_touch_are_welded() {
    let scene = TinyScene::new();
    let mut mesh = made(&scene);
    let copy = mesh.positions.len() as u32;
    // As a file of seven digits has it, on both sides of a seam.
    mesh.positions.push(mesh.positions[12] + tessuto::glam::DVec3::new(3e-7, 0.0, 0.0));
    mesh.faces[10].vertices.iter_mut().filter(|v| **v == 12).for_each(|v| *v = copy);
    let count = mesh.positions.len();
    obj::write(&scene.path("template.obj"), &mesh, None).unwrap();
    let (status, said) = template(&scene, &["--weld=0", "--force"]);
    assert!(status == Some(0) && said.contains("merged 0 vertices"), "{said}");
    let (status, said) = template(&scene, &["--weld", "--force"]);
    assert!(
        status == Some(0) && said.contains("merged 1 vertices") && said.contains("(1e-6 of the size)"),
        "{said}"
    );
    assert_eq!(made(&scene).positions.len(), count - 1);
    let (status, said) = template(&scene, &["--weld=2", "--force"]);
    assert!(status == Some(2) && said.contains("--weld"), "{said}");
}
