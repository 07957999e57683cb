//! A camera that moved, in the files of other programs.

use glam::{DMat4, DQuat, DVec3, DVec4};
use tessuto::export::{Clip, Format, export};
use tessuto::math::rng::Rng;
use tessuto::{Pose, Viewpoint};

use super::files::{accessor, clip, floats, parse_glb};
use super::gaps::array;

/// A clip whose third frame is lost, filmed from everywhere.
fn moving() -> Clip {
    let whole = clip(false);
    let mut rng = Rng::new(8, 0);
    let poses: Vec<Pose> = whole.frames.iter().map(|_| Pose::random(&mut rng)).collect();
    let motion = [0, 1, 3].map(|n| whole.motion[n].clone()).to_vec();
    Clip { poses: Some(poses), frames: vec![0, 1, 3], motion: tessuto::Motion::new(motion).unwrap(), ..whole }
}

/// Whether `world_from_camera`, with y up and looking along −z, sees all vertices of frame `k` where the recording
/// camera did.
fn sees_the_same(clip: &Clip, k: usize, world_from_camera: DMat4) {
    let pose = clip.poses.as_ref().unwrap()[clip.frames[k]];
    let view = Viewpoint { camera: clip.camera, camera_from_world: Some(pose) };
    let turn = DMat4::from_scale(DVec3::new(1.0, -1.0, -1.0));
    let seen = turn * world_from_camera.inverse() * turn;
    for x in &clip.motion[k] {
        let found = (seen * DVec4::new(x.x, x.y, x.z, 1.0)).truncate();
        assert!((found - view.in_camera(*x)).length() < 1e-5, "frame {k}: {found} {}", view.in_camera(*x));
    }
}

#[test]
fn glb_moves_its_camera() {
    let (clip, folder) = (moving(), tempfile::tempdir().unwrap());
    export(&clip, &[Format::Glb], folder.path(), false).unwrap();
    let bytes = std::fs::read(folder.path().join("cloth.glb")).unwrap();
    let (gltf, binary) = parse_glb(&bytes);
    let animation = &gltf["animations"][0];
    let node = gltf["nodes"].as_array().unwrap().iter().position(|node| node["camera"] == 0).unwrap();
    let of = |way: &str| {
        let channels = animation["channels"].as_array().unwrap();
        let channel =
            channels.iter().find(|c| c["target"]["path"] == way && c["target"]["node"] == node).unwrap();
        let sampler = &animation["samplers"][channel["sampler"].as_u64().unwrap() as usize];
        let read = |key: &str| floats(accessor(&gltf, binary, &sampler[key]));
        assert_eq!(read("input"), [0.0, 0.04, 0.12]);
        read("output").into_iter().map(f64::from).collect::<Vec<_>>()
    };
    let (places, turns) = (of("translation"), of("rotation"));
    for k in 0..3 {
        let turn = DQuat::from_slice(&turns[4 * k..]);
        let pose = DMat4::from_rotation_translation(turn, DVec3::from_slice(&places[3 * k..]));
        sees_the_same(&clip, k, pose);
        assert!(k == 0 || turn.dot(DQuat::from_slice(&turns[4 * k - 4..])) >= 0.0, "the shorter way");
    }
}

#[test]
fn usd_moves_its_camera() {
    let (clip, folder) = (moving(), tempfile::tempdir().unwrap());
    export(&clip, &[Format::Usd], folder.path(), false).unwrap();
    let text = std::fs::read_to_string(folder.path().join("cloth.usda")).unwrap();
    let samples = text.split("matrix4d xformOp:transform.timeSamples = {").nth(1).unwrap();
    let samples = samples.split('}').next().unwrap();
    assert!(text.contains("uniform token[] xformOpOrder = [\"xformOp:transform\"]"));
    let lines: Vec<&str> = samples.lines().filter(|line| line.contains(':')).collect();
    assert_eq!(lines.len(), 3);
    for (k, line) in lines.into_iter().enumerate() {
        let (frame, rows) = line.split_once(':').unwrap();
        assert_eq!(frame.trim(), clip.frames[k].to_string());
        let numbers = rows.split(|c: char| "(), ".contains(c)).filter_map(|word| word.parse().ok());
        let numbers: Vec<f64> = numbers.collect();
        // Its points are rows: what is written by rows are this matrix's columns.
        sees_the_same(&clip, k, DMat4::from_cols_slice(&numbers));
    }
}

#[test]
fn npz_and_script_hold_the_poses() {
    let (clip, folder) = (moving(), tempfile::tempdir().unwrap());
    export(&clip, &[Format::Npz, Format::Glb], folder.path(), false).unwrap();
    let poses = clip.poses.as_ref().unwrap();
    let npz = std::fs::read(folder.path().join("cloth.npz")).unwrap();
    let npy = array(&npz, "camera_from_world");
    let numbers: Vec<f64> =
        npy[npy.len() - 8 * 64..].chunks(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(Pose::from_rows(numbers[32..48].try_into().unwrap()), poses[2]);
    let script = std::fs::read_to_string(folder.path().join("cloth_blender.py")).unwrap();
    let table = script.split("CLIP = ").nth(1).unwrap();
    let table: serde_json::Value =
        serde_json::Deserializer::from_str(table).into_iter().next().unwrap().unwrap();
    let row: Vec<f64> = table["poses"][3].as_array().unwrap().iter().filter_map(|v| v.as_f64()).collect();
    assert_eq!(Pose::from_rows(&row.try_into().unwrap()), poses[3]);
    // One that stands still has none.
    let still = tempfile::tempdir().unwrap();
    export(&Clip { poses: None, ..clip }, &[Format::Usd, Format::Glb], still.path(), false).unwrap();
    let text = std::fs::read_to_string(still.path().join("cloth.usda")).unwrap();
    assert!(!text.contains("xformOp:transform.timeSamples"));
    let bytes = std::fs::read(still.path().join("cloth.glb")).unwrap();
    assert_eq!(parse_glb(&bytes).0["animations"][0]["channels"].as_array().unwrap().len(), 1);
}
