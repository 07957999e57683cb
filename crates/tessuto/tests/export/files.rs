//! Exports hold the motion they were made of, refuse to replace files, and never leave half of one.

use std::path::Path;

use crate::support::seamed::seamed;
use glam::{DVec2, DVec3};
use serde_json::Value;
use tessuto::export::{Clip, Format, Material, export};
use tessuto::motion::parameters::Parameters;
use tessuto::result::Folder;
use tessuto::sim::Accelerations;
use tessuto::{Camera, Image, Mesh, Motion, Rect, io};

const FRAMES: usize = 4;

/// A grid of quads with a seam down the middle (one vertex column with two uvs), bending in 4 frames.
pub(super) fn clip(maps: bool) -> Clip {
    let grid = seamed();
    let bent = |n: usize| {
        let depth = |p: &DVec3| 0.1 * n as f64 * (5.0 * p.x + 0.3 * n as f64).sin() + 0.02 * p.y;
        grid.positions.iter().map(|p| (*p + DVec3::Z * depth(p)).as_vec3().as_dvec3()).collect()
    };
    let image = |channels: usize, at: f32| Image {
        width: 4,
        height: 4,
        channels,
        data: (0..16 * channels).map(|k| at + 0.02 * k as f32 / channels as f32).collect(),
    };
    Clip {
        name: "cloth".into(),
        version: "0.0".into(),
        motion: Motion::new((0..FRAMES).map(bent).collect()).unwrap(),
        frames: (0..FRAMES).collect(),
        frame_count: FRAMES,
        verdicts: Vec::new(),
        fps: 25.0,
        first_frame: 7,
        camera: Camera { fx: 700.0, fy: 650.0, cx: 300.0, cy: 250.0, width: 640, height: 480 },
        poses: None,
        others: Vec::new(),
        other_images: Vec::new(),
        crop: Rect { x0: 0, y0: 0, x1: 640, y1: 480 },
        images: Vec::new(),
        video: None,
        environment: None,
        material: Material {
            name: "cloth".into(),
            base_colour: image(3, 0.5),
            roughness_metallic: maps.then(|| [image(1, 0.3), image(1, 0.1)]),
        },
        back: None,
        parameters: Parameters {
            model: tessuto::sim::Model::Springs,
            log_stiffness: vec![2.0, -3.0, -4.0],
            accelerations: Accelerations {
                constant: DVec3::Y,
                dynamic: vec![vec![DVec3::X; 15]; FRAMES - 1],
                entries_per_frame: 1,
                wind: None,
            },
        },
        fabric: None,
        held: Vec::new(),
        seen: vec![("seen_vertices", vec![3], vec![4.0, 0.0, 2.0])],
        mesh: grid,
    }
}

/// The formats of this build that need no estimated physics.
fn of_any_result() -> Vec<Format> {
    Format::built().filter(|format| ![Format::Mujoco, Format::Ppf].contains(format)).collect()
}

pub(super) fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

pub(super) fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

/// Positions of frame `n` with y up, as f32.
pub(super) fn y_up(clip: &Clip, n: usize) -> Vec<f32> {
    clip.motion[n].iter().flat_map(|p| [p.x as f32, -p.y as f32, -p.z as f32]).collect()
}

/// JSON and binary chunk of a GLB file.
pub(super) fn parse_glb(bytes: &[u8]) -> (Value, &[u8]) {
    assert_eq!(&bytes[..8], b"glTF\x02\0\0\0");
    assert_eq!(word(bytes, 8), bytes.len());
    let length = word(bytes, 12);
    assert_eq!(&bytes[16..20], b"JSON");
    let gltf = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    assert_eq!(&bytes[24 + length..28 + length], b"BIN\0");
    (gltf, &bytes[28 + length..])
}

pub(super) fn accessor<'a>(gltf: &Value, binary: &'a [u8], index: &Value) -> &'a [u8] {
    let accessor = &gltf["accessors"][index.as_u64().unwrap() as usize];
    let view = &gltf["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let number = |key: &str| view[key].as_u64().unwrap() as usize;
    &binary[number("byteOffset")..number("byteOffset") + number("byteLength")]
}

#[test]
fn glb_holds_every_frame() {
    for maps in [false, true] {
        let (clip, folder) = (clip(maps), tempfile::tempdir().unwrap());
        export(&clip, &[Format::Glb], folder.path(), false).unwrap();
        let bytes = std::fs::read(folder.path().join("cloth.glb")).unwrap();
        let (gltf, binary) = parse_glb(&bytes);
        let primitive = &gltf["meshes"][0]["primitives"][0];
        let read = |index: &Value| floats(accessor(&gltf, binary, index));
        let base = read(&primitive["attributes"]["POSITION"]);
        let uvs = read(&primitive["attributes"]["TEXCOORD_0"]);
        // The seam's three vertices are there twice.
        assert_eq!((base.len(), uvs.len()), (3 * 18, 2 * 18));
        assert_eq!(uvs[1], 0.0, "row 0 of the image is v = 0 in glTF");
        let targets = primitive["targets"].as_array().unwrap();
        assert_eq!(targets.len(), FRAMES - 1);
        let pairs: Vec<usize> = (0..15).flat_map(|v| if v % 5 == 2 { vec![v, v] } else { vec![v] }).collect();
        for n in 0..FRAMES {
            let moved = if n == 0 { vec![0.0; base.len()] } else { read(&targets[n - 1]["POSITION"]) };
            let expected = y_up(&clip, n);
            for (corner, v) in pairs.iter().enumerate() {
                for axis in 0..3 {
                    let found = base[3 * corner + axis] + moved[3 * corner + axis];
                    assert!((found - expected[3 * v + axis]).abs() < 1e-6);
                }
            }
        }
        let sampler = &gltf["animations"][0]["samplers"][0];
        assert_eq!(read(&sampler["input"]), [0.0, 0.04, 0.08, 0.12]);
        let weights = read(&sampler["output"]);
        assert_eq!(weights, [0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.]);
        let look = &gltf["materials"][0]["pbrMetallicRoughness"];
        assert_eq!(look.get("metallicRoughnessTexture").is_some(), maps);
        assert_eq!(gltf["images"].as_array().unwrap().len(), if maps { 2 } else { 1 });
        assert_eq!(gltf["cameras"][0]["extras"]["cx"], 300.0);
    }
}

#[test]
fn usd_is_the_text_it_should_be() {
    let (clip, folder) = (clip(true), tempfile::tempdir().unwrap());
    export(&clip, &[Format::Usd], folder.path(), false).unwrap();
    let text = std::fs::read_to_string(folder.path().join("cloth.usda")).unwrap();
    for line in [
        "timeCodesPerSecond = 25",
        "endTimeCode = 3",
        "metersPerUnit = 1",
        "upAxis = \"Y\"",
        "int[] faceVertexCounts = [4, 4, 4, 4, 4, 4, 4, 4]",
        "asset inputs:file = @./cloth_textures/cloth_metallic.png@",
        "token inputs:sourceColorSpace = \"raw\"",
        // 700 px of 640 on 0.36; 19.5 px to the left of the centre, 10.5 px below it.
        "float focalLength = 0.39375",
        "float horizontalApertureOffset = 0.01096875",
    ] {
        assert!(text.contains(line), "{line} is not in\n{text}");
    }
    for (n, start) in [(0, "0: [(-0.2, 0.1, -1.198)"), (3, "3: [(-0.2, 0.1, ")] {
        assert!(text.contains(start), "frame {n}: {start} is not in\n{text}");
    }
    let balance = |open: char, close: char| text.matches(open).count() == text.matches(close).count();
    assert!(balance('{', '}') && balance('[', ']') && balance('(', ')'));
    assert!(folder.path().join("cloth_textures/cloth_roughness.png").is_file());
}

#[test]
fn sequences_and_caches_hold_every_frame() {
    let (clip, folder) = (clip(false), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    export(&clip, &of_any_result(), folder.path(), false).unwrap();
    for n in 0..FRAMES {
        let mesh: Mesh = io::obj::read(&at(&format!("cloth_obj/cloth_{:04}.obj", n + 7))).unwrap();
        let found: Vec<f32> = mesh.positions.iter().flat_map(|p| p.as_vec3().to_array()).collect();
        assert_eq!(found, y_up(&clip, n));
        assert_eq!((&mesh.faces, &mesh.uvs), (&clip.mesh.faces, &clip.mesh.uvs));
        let ply = std::fs::read(at(&format!("cloth_ply/cloth_{:04}.ply", n + 7))).unwrap();
        let header = ply.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let text = String::from_utf8_lossy(&ply[..header]).into_owned();
        assert!(text.contains("element vertex 15\n") && !text.contains("property float s"), "{text}");
        let rows = floats(&ply[header..header + 15 * 24]);
        let found: Vec<f32> = rows.chunks(6).flat_map(|r| r[..3].to_vec()).collect();
        assert_eq!(found, y_up(&clip, n));
        assert_eq!(ply.len(), header + 15 * 24 + 8 * 17);
    }
    let pc2 = std::fs::read(at("cloth.pc2")).unwrap();
    assert_eq!((&pc2[..12], word(&pc2, 16), word(&pc2, 28)), (&b"POINTCACHE2\0"[..], 15, FRAMES));
    let expected: Vec<f32> = (0..FRAMES).flat_map(|n| y_up(&clip, n)).collect();
    assert_eq!(floats(&pc2[32..]), expected);
    assert_eq!(io::obj::read(&at("cloth_pc2.obj")).unwrap().positions.len(), 15);
}

#[test]
fn npz_is_a_zip_file_of_arrays() {
    let (clip, folder) = (clip(false), tempfile::tempdir().unwrap());
    export(&clip, &[Format::Npz], folder.path(), false).unwrap();
    let bytes = std::fs::read(folder.path().join("cloth.npz")).unwrap();
    // Walk the local headers.
    let (mut at, mut names) = (0, Vec::new());
    while &bytes[at..at + 4] == b"PK\x03\x04" {
        let (size, name) = (word(&bytes, at + 18), usize::from(bytes[at + 26]));
        let start = at + 30 + name;
        names.push(String::from_utf8(bytes[at + 30..start].to_vec()).unwrap());
        if names.last().unwrap() == "motion.npy" {
            let path = folder.path().join("motion.npy");
            std::fs::write(&path, &bytes[start..start + size]).unwrap();
            assert_eq!(io::npy::read_motion(&path).unwrap(), clip.motion);
        }
        at = start + size;
    }
    assert_eq!(&bytes[at..at + 4], b"PK\x01\x02");
    let end = bytes.len() - 22;
    assert_eq!((&bytes[end..end + 4], word(&bytes, end + 16)), (&b"PK\x05\x06"[..], at));
    assert_eq!(usize::from(bytes[end + 10]), names.len());
    for name in ["camera.npy", "dynamic_force.npy", "face_uvs.npy", "stretch.npy", "seen_vertices.npy"] {
        assert!(names.iter().any(|n| n == name), "{names:?}");
    }
}

#[test]
fn nothing_is_replaced_without_force() {
    let (clip, folder) = (clip(false), tempfile::tempdir().unwrap());
    let target = folder.path().join("out");
    std::fs::create_dir(&target).unwrap();
    std::fs::write(target.join("cloth.glb"), b"mine").unwrap();
    let all: Vec<Format> = of_any_result();
    let error = export(&clip, &all, &target, false).unwrap_err();
    assert_eq!(error.exit_code(), 3);
    assert!(error.to_string().contains("cloth.glb"), "{error}");
    assert_eq!(export(&clip, &all, &target, true).unwrap_err().exit_code(), 3, "it is not tessuto's");
    let entries = |folder: &Path| std::fs::read_dir(folder).unwrap().count();
    assert_eq!((entries(&target), std::fs::read(target.join("cloth.glb")).unwrap()), (1, b"mine".to_vec()));

    std::fs::remove_file(target.join("cloth.glb")).unwrap();
    let written = export(&clip, &[Format::Usd, Format::Glb, Format::Glb], &target, false).unwrap();
    // GLB, USD, its textures, the script for Blender; and the manifest.
    assert_eq!((written.len(), entries(&target)), (4, 5));
    let message = export(&clip, &[Format::Glb], &target, false).unwrap_err().to_string();
    assert!(message.contains("cloth.glb") && message.contains("replace = true"), "{message}");
    let first = std::fs::read(target.join("cloth.glb")).unwrap();
    export(&clip, &[Format::Glb, Format::Usd], &target, true).unwrap();
    assert_eq!(std::fs::read(target.join("cloth.glb")).unwrap(), first, "same clip, same bytes");
    assert_eq!(entries(&target), 5, "something half-written is left");
}

#[test]
fn a_folder_that_is_no_result_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let error = Folder::open(folder.path()).unwrap_err();
    assert_eq!(error.exit_code(), 3);
    assert!(error.to_string().contains("config.json"), "{error}");
}

/// What other programs are given comes back as a template: merged at the seam, with its texture coordinates.
#[test]
fn exports_are_read_back_as_templates() {
    let folder = tempfile::tempdir().unwrap();
    let clip = clip(false);
    export(&clip, &[Format::Glb, Format::Obj, Format::Ply], folder.path(), false).unwrap();
    let still = |path: &str| io::model::read(&folder.path().join(path)).unwrap();
    let [glb, obj, ply] = ["cloth.glb", "cloth_obj/cloth_0007.obj", "cloth_ply/cloth_0007.ply"].map(still);
    assert!(
        glb.has_uv && obj.has_uv && !ply.has_uv,
        "PLY has one texture coordinate a vertex: none at seams"
    );
    assert!(glb.notes.iter().any(|n| n.contains("3 vertices split at seams")), "{:?}", glb.notes);
    // glTF says that y is up; OBJ and PLY do not say.
    let y_down = |p: &DVec3| DVec3::new(p.x, -p.y, -p.z);
    let shapes = [
        glb.mesh.positions.clone(),
        obj.mesh.positions.iter().map(y_down).collect(),
        ply.mesh.positions.iter().map(y_down).collect(),
    ];
    for shape in shapes {
        assert_eq!(shape.len(), clip.mesh.positions.len());
        let nearest = |p: &DVec3| shape.iter().map(|q| q.distance(*p)).fold(f64::INFINITY, f64::min);
        assert!(clip.motion[0].iter().all(|p| nearest(p) < 1e-6));
    }
    let mut uvs: Vec<_> = clip.mesh.uvs.iter().map(|uv| uv.as_vec2()).collect();
    let mut found: Vec<_> = glb.mesh.uvs.iter().map(|uv| uv.as_vec2()).collect();
    for list in [&mut uvs, &mut found] {
        list.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    }
    assert!(uvs.iter().zip(&found).all(|(a, b)| a.distance(*b) < 1e-6) && uvs.len() == found.len());
    assert_eq!(glb.mesh.faces.len(), 2 * clip.mesh.faces.len());
}

#[test]
fn models_that_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float \
                  z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let cases: [(&str, Vec<u8>, &str); 8] = [
        (
            "a.ply",
            format!("{header}0 0 1\n1 0 1\n0 1 1\n3 0 1 7\n").into(),
            "has the vertices [0, 1, 7]; 3 exist",
        ),
        ("a.ply", format!("{header}0 0 1\n1 0 1\n").into(), "a.ply"),
        ("a.ply", format!("{header}0 0 1\n1 1e9 1\n0 1 1\n3 0 1 2\n").into(), "vertex 2 of 3"),
        ("a.ply", header.replace("vertex 3", "vertex 4000000000").into(), "promises 4000000000"),
        ("a.glb", b"glTF\x02\0\0\0\x40\0\0\0\xff\xff\0\0JSON{}".to_vec(), "truncated"),
        (
            "a.gltf",
            b"{\"scenes\": [{\"nodes\": [0]}], \"nodes\": [{\"mesh\": 0}], \"meshes\": \
                     [{\"primitives\": [{}]}]}"
                .to_vec(),
            "lacks positions",
        ),
        (
            "a.gltf",
            b"{\"extensionsRequired\": \
                     [\"KHR_draco_mesh_compression\"]}"
                .to_vec(),
            "KHR_draco_mesh_compression",
        ),
        ("a.gltf", b"{\"buffers\": [{\"uri\": \"../secret.bin\"}]}".to_vec(), "is not beside it"),
    ];
    for (name, bytes, fragment) in cases {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let error = io::model::read(&path).unwrap_err();
        assert!(
            error.to_string().contains(fragment) && error.exit_code() == 3,
            "{fragment:?} is missing in: {error}"
        );
    }
    // A triangle of its own, ASCII, with texture coordinates at the corners of the face.
    let cornered = header.replace("end_header", "property list uchar float texcoord\nend_header");
    let path = folder.path().join("b.ply");
    std::fs::write(&path, format!("{cornered}0 0 1\n1 0 1\n0 1 1\n3 0 1 2 6 0 0 1 0 0 1\n")).unwrap();
    let model = io::model::read(&path).unwrap();
    assert!(model.has_uv);
    assert_eq!(model.mesh.uvs, [DVec2::ZERO, DVec2::X, DVec2::Y]);
}

#[cfg(not(feature = "rerun"))]
#[test]
fn a_recording_is_refused_by_builds_without_it_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let formats = [Format::Glb, "rrd".parse().unwrap()];
    let error = export(&clip(false), &formats, folder.path(), false).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().contains("feature rerun"), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
