//! Small good files of every kind that is read.

use std::io::Cursor;
use std::time::Duration;

use ::image::{DynamicImage, ImageFormat};
use tessuto::session::{Checkpoints, Epoch, Session, named};

use super::readers::{CONFIG, PARAMETERS, default_settings};

/// Good files for the reader `name`.
pub fn seeds(name: &str) -> Vec<Vec<u8>> {
    let texts = |texts: &[&str]| texts.iter().map(|t| t.as_bytes().to_vec()).collect();
    match name {
        "scene_json" => texts(&[SCENE, SCENE_WITH_ALL]),
        "obj" => texts(&[OBJ]),
        "ply" => {
            let mut binary = PLY_BINARY.as_bytes().to_vec();
            for value in [0f32, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0] {
                binary.extend(value.to_le_bytes());
            }
            binary.push(3);
            (0..3i32).for_each(|v| binary.extend(v.to_le_bytes()));
            vec![PLY.as_bytes().to_vec(), binary]
        }
        "gltf" => vec![GLTF.as_bytes().to_vec(), glb(), shaped()],
        "npy" => vec![
            tessuto::io::npy::encode(&[2, 3], &[0.0f32, 1.0, 2.0, 3.0, 4.0, 5.0]),
            tessuto::io::npy::encode(&[1, 2, 3], &[0.0f64, 1.0, 2.0, 3.0, 4.0, 5.0]),
        ]
        .into_iter()
        .filter(|bytes| !bytes.is_empty())
        .collect(),
        "picture" => {
            let grey = DynamicImage::new_luma8(5, 4);
            let colours = [DynamicImage::new_rgb8(5, 4), DynamicImage::new_rgba16(3, 3), grey.clone()];
            let mut files: Vec<Vec<u8>> = colours.iter().map(|p| encoded(p, ImageFormat::Png)).collect();
            files.push(encoded(&DynamicImage::new_rgb8(9, 8), ImageFormat::Jpeg));
            files.push(encoded(&grey, ImageFormat::Jpeg));
            files
        }
        "radiance" => {
            let light = DynamicImage::new_rgb32f(8, 4);
            vec![encoded(&light, ImageFormat::OpenExr), encoded(&light, ImageFormat::Hdr)]
        }
        "depth" => {
            let mut light = DynamicImage::new_rgb32f(5, 4).into_rgb32f();
            light.pixels_mut().for_each(|p| p.0 = [1.0; 3]);
            let equal = encoded(&light.into(), ImageFormat::OpenExr);
            // Another name for the last channel: a picture with depth.
            let (name, mut named) = (b"R\0\x02\0\0\0", equal.clone());
            let at = equal.windows(name.len()).position(|w| w == name).expect("a channel R");
            named[at] = b'Z';
            let mut grey = DynamicImage::new_luma16(5, 4).into_luma16();
            grey.pixels_mut().for_each(|p| p.0 = [1000]);
            let array = tessuto::io::npy::encode(&[4, 4], &[1.0f32; 16]);
            vec![equal, named, encoded(&grey.into(), ImageFormat::Png), array]
        }
        "checkpoint" => vec![checkpoint()],
        "state" => vec![state()],
        "transforms" => texts(&[TRANSFORMS]),
        "cameras" => texts(&["# Camera list\n1 OPENCV 640 480 500 500 320 240 0.1 -0.05 0.001 0.0\n"]),
        "opencv" => texts(&[OPENCV_YAML, OPENCV_JSON]),
        "config" => {
            let config = CONFIG.replace("SETTINGS", &default_settings()).into_bytes();
            vec![config, [b"\0", PARAMETERS.as_bytes()].concat()]
        }
        "tracks" => {
            use tessuto::io::npy::{archive, encode};
            vec![archive(&[
                ("frames", encode(&[1], &[0u32])),
                ("vertices", encode(&[1, 4], &[0u32, 1, 4, 3])),
                ("weights", encode(&[1, 4], &[0.25f32; 4])),
                ("points", encode(&[1, 1, 3], &[0.0f32, 0.0, 1.0])),
            ])]
        }
        other => panic!("no seeds for {other}"),
    }
}

fn encoded(picture: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).expect("a vector takes every byte");
    bytes.into_inner()
}

type State = (Vec<Vec<glam::DVec3>>, Vec<Vec<[f32; 3]>>);

fn tracked() -> State {
    (vec![vec![glam::DVec3::new(0.1, 0.2, 1.0); 2]; 2], vec![vec![[1.0, 0.9, 1.1]; 2]])
}

fn checkpoint() -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = Session::new(|_, _| Ok(()));
    session.keep_in(Checkpoints::open(folder.path(), "scene".into(), Duration::ZERO), None).expect("empty");
    let epoch =
        Epoch { stage: "track".into(), step: 1, of: 2, losses: named([("total", 0.5)]), ..Epoch::default() };
    session.step(&epoch, &[], Some(&tracked())).expect("a checkpoint");
    std::fs::read(folder.path().join("checkpoint-000001.bin")).expect("a checkpoint")
}

/// The states in [`checkpoint`], which stand behind its header.
fn state() -> Vec<u8> {
    let whole = checkpoint();
    let end = whole.iter().position(|b| *b == b'\n').expect("a header");
    let header: serde_json::Value = serde_json::from_slice(&whole[..end]).expect("a header");
    // In alphabetical order: history, track.
    let history = header["parts"][0][1].as_u64().expect("a length") as usize;
    whole[end + 1 + history..].to_vec()
}

fn glb() -> Vec<u8> {
    let text = GLTF.split("data:").next().expect("a text").len();
    // The same document with its buffer as a chunk.
    let end = GLTF[text..].find('"').expect("the end of the uri") + text;
    let mut json = format!("{}{}", &GLTF[..text].replace(",\n\"uri\":\"", ""), &GLTF[end + 1..]).into_bytes();
    while !json.len().is_multiple_of(4) {
        json.push(b' ');
    }
    let mut chunk = Vec::new();
    for value in [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
        chunk.extend(value.to_le_bytes());
    }
    chunk.extend([0u8, 0, 1, 0, 2, 0, 0, 0]);
    let word = |n: usize| (n as u32).to_le_bytes();
    let total = 12 + 8 + json.len() + 8 + chunk.len();
    let header: [&[u8]; 3] = [b"glTF", &word(2), &word(total)];
    let first: [&[u8]; 3] = [&word(json.len()), b"JSON", &json];
    let second: [&[u8]; 3] = [&word(chunk.len()), b"BIN\0", &chunk];
    [header.concat(), first.concat(), second.concat()].concat()
}

/// A triangle with a morph target and a skin of one joint, whose numbers are sparse.
fn shaped() -> Vec<u8> {
    let floats = [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let weights = [1f32, 0.0, 0.0, 0.0].repeat(3);
    let mut bytes: Vec<u8> = floats.iter().chain(&weights).flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend([0u8, 1, 2, 0]);
    let view = |offset: usize| serde_json::json!({"buffer": 0, "byteOffset": offset, "byteLength": 4});
    let sparse = |kind: u64, count: usize, width: &str, from: usize| {
        serde_json::json!({"componentType": kind, "count": 3, "type": width, "sparse": {
            "count": count, "indices": {"bufferView": 2, "componentType": 5121}, "values": {"bufferView": from}}})
    };
    let document = serde_json::json!({
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0, "skin": 0, "weights": [0.5]}, {"translation": [0, 0, -1]}],
        "meshes": [{"weights": [1.0], "primitives": [{
            "attributes": {"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3}, "targets": [{"POSITION": 1}]}]}],
        "skins": [{"joints": [1]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            sparse(5126, 2, "VEC3", 0), sparse(5121, 1, "VEC4", 0),
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC4"},
        ],
        "bufferViews": [view(0), view(36), view(84)],
        "buffers": [{"byteLength": bytes.len(), "uri": format!("data:;base64,{}", tessuto::text::base64(&bytes))}],
    });
    document.to_string().into_bytes()
}

const SCENE: &str =
    r#"{"name":"tiny","fps":25,"n_frames":1,"width":24,"height":24,"fx":40,"fy":40,"cx":11.5,"cy":11.5}"#;
const SCENE_WITH_ALL: &str = r#"{"name":"tiny","fps":25,"n_frames":1,"width":24,"height":24,"fx":40,"fy":40,"cx":11.5,
"cy":11.5,"crop":{"x0":2,"y0":2,"x1":23,"y1":24},"units":"m","notes":[1,{"a":"b"}]}"#;
const OBJ: &str = "# a quad\nmtllib a.mtl\nv 0 0 1\nv 1 0 1.5\nv 1 1 1 0.5\nv 0 1e0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
vn 0 0 1\nf 1/1 2/2/1 3/3/1 \\\n -1/-1\nf 1/1 3/3 4/4\n";
const PLY: &str = "ply\nformat ascii 1.0\ncomment a quad\nelement vertex 4\nproperty float x\nproperty float y\n\
property float z\nproperty float s\nproperty float t\nelement face 1\nproperty list uchar int vertex_indices\n\
end_header\n0 0 1 0 0\n1 0 1 1 0\n1 1 1 1 1\n0 1 1 0 1\n4 0 1 2 3\n";
const PLY_BINARY: &str = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
property float z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n";
/// One triangle: three positions of floats, three indices of 16 bits.
const GLTF: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
"nodes":[{"children":[1],"translation":[0,0,-1]},{"mesh":0,"rotation":[0,0,0,1],"scale":[1,1,1]}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"mode":4}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","normalized":false},
{"bufferView":1,"byteOffset":0,"componentType":5123,"count":3,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36,"byteStride":12},{"buffer":0,"byteOffset":36,"byteLength":6}],
"buffers":[{"byteLength":44,
"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIAAAA="}]}"#;
const TRANSFORMS: &str = r#"{"camera_model":"OPENCV","fl_x":500.0,"fl_y":501.5,"cx":320.0,"cy":240.0,"w":640,"h":480,
"k1":0.1,"k2":-0.05,"p1":0.0,"p2":0.001,"frames":[{"file_path":"a.png",
"transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,0],
[0,0,0,1]]},{"file_path":"b.png","transform_matrix":[[1,0,0,0.1],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}"#;
const OPENCV_YAML: &str = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: \
!!opencv-matrix\n   rows: 3\n   cols: \
3\n   dt: d\n   data: [ 500., 0., 319.5, 0., 500., 239.5, 0., 0., 1. ]\ndistortion_model: plumb_bob\n\
distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ 0.1, -0.05, 0., 0., 0. ]\n";
const OPENCV_JSON: &str = r#"{"camera_matrix":[[500,0,319.5],[0,500,239.5],[0,0,1]],"dist_coeffs":[0.1,-0.05,0,0,0],
"image_size":[640,480]}"#;
