use glam::{DMat3, DQuat, DVec3};

use super::*;
use tessuto_core::math::rng::Rng;

/// World from camera of three frames: turns and places.
fn truth() -> Vec<(DQuat, DVec3)> {
    let mut rng = Rng::new(4, 0);
    let turn = |pose: Pose| DQuat::from_mat3(&pose.rotation);
    (0..3).map(|_| (turn(Pose::random(&mut rng)), rng.vector())).collect()
}

/// What a camera that looks along +z with y down sees, there.
fn expected() -> Vec<Pose> {
    let inverse = |(turn, place): &(DQuat, DVec3)| from_camera(DMat3::from_quat(*turn), *place, false);
    truth().iter().map(inverse).collect()
}

/// The same turns of a camera that looks along −z with y up.
fn looking_back() -> Vec<(DQuat, DVec3)> {
    let half = DQuat::from_rotation_x(std::f64::consts::PI);
    truth().into_iter().map(|(turn, place)| (turn * half, place)).collect()
}

fn same(found: &[Pose], expected: &[Pose]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        let [angle, way] = a.apart(b);
        assert!(angle < 1e-6 && way < 1e-9, "{a:?} {b:?}");
    }
}

fn settings(pose_scale: Option<f64>) -> Settings {
    Settings {
        input: PathBuf::new(),
        masks: super::super::Masks::Later,
        object: None,
        invert_masks: false,
        largest_piece: false,
        calibration: super::super::Calibration::assumed(),
        poses: None,
        refine_poses: false,
        camera_motion: None,
        pose_scale,
        depths: None,
        depth_scale: None,
        fps: None,
        rate: None,
        frames: None,
        stride: 1,
        downscale: 1,
        allow_gaps: false,
        template: None,
        plate: None,
        ffmpeg: PathBuf::new(),
        views: Vec::new(),
    }
}

/// Reads `bytes` as the file `name`; the poses of its three frames, and which way is down.
fn read(name: &str, bytes: &[u8], pose_scale: Option<f64>) -> Result<(Vec<Pose>, Option<DVec3>)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, bytes).unwrap();
    // By the file, or by the folder that holds it.
    let by_folder = read_path(folder.path()).map(|path| path.entries);
    let path = read_path(&path)?;
    assert_eq!(by_folder.unwrap(), path.entries);
    let names: Vec<PathBuf> = (0..3).map(|n| PathBuf::from(format!("clip/img_{n}.png"))).collect();
    Ok(path.of(&Inputs { names: Some(&names), count: 3 }, &[0, 1, 2])?.poses(&settings(pose_scale)))
}

#[test]
fn transforms_of_nerfstudio() {
    let frames: Vec<Value> = looking_back()
        .iter()
        .enumerate()
        .map(|(n, (turn, at))| {
            let r = DMat3::from_quat(*turn).transpose();
            let row = |r: DVec3, t: f64| vec![r.x, r.y, r.z, t];
            let rows =
                [row(r.x_axis, at.x), row(r.y_axis, at.y), row(r.z_axis, at.z), vec![0.0, 0.0, 0.0, 1.0]];
            serde_json::json!({ "file_path": format!("images/img_{n}.png"), "transform_matrix": rows })
        })
        .rev()
        .collect();
    let text = serde_json::json!({ "fl_x": 500, "frames": frames }).to_string();
    let (poses, down) = read("transforms.json", text.as_bytes(), None).unwrap();
    same(&poses, &expected());
    assert!(down.is_none());
    let scaled = read("transforms.json", text.as_bytes(), Some(2.0)).unwrap().0;
    assert!((scaled[1].translation - 2.0 * poses[1].translation).length() < 1e-12);
    let sheared = text.replace("[[", "[[9.0,");
    assert!(
        read("transforms.json", sheared.as_bytes(), None).unwrap_err().to_string().contains("no rotation")
    );
}

#[test]
fn images_of_colmap_as_text_and_as_bytes() {
    let poses = expected();
    let number = |pose: &Pose| {
        let q = DQuat::from_mat3(&pose.rotation);
        [q.w, q.x, q.y, q.z, pose.translation.x, pose.translation.y, pose.translation.z]
    };
    let mut text = "# Image list with two lines of data per image:\n".to_owned();
    let mut bytes = 3u64.to_le_bytes().to_vec();
    for (n, pose) in poses.iter().enumerate().rev() {
        let numbers = number(pose).map(|v| v.to_string()).join(" ");
        text += &format!("{} {numbers} 1 img_{n}.png\n{}\n", n + 1, if n == 1 { "" } else { "1.5 2.5 -1" });
        bytes.extend((n as u32).to_le_bytes());
        number(pose).iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        bytes.extend(1u32.to_le_bytes());
        bytes.extend(format!("img_{n}.png\0").as_bytes());
        bytes.extend(1u64.to_le_bytes());
        bytes.extend([7; 24]);
    }
    for (name, file) in [("images.txt", text.as_bytes()), ("sparse/0/images.bin", &bytes)] {
        same(&read(name, file, Some(1.0)).unwrap().0, &poses);
    }
    assert!(read("images.bin", &bytes[..100], None).is_err());
    assert!(read("images.txt", b"1 2 3\n\n", None).is_err());
}

#[test]
fn recordings_of_phones() {
    let poses = expected();
    let down = |poses: &[Pose]| poses[0].rotation * -DVec3::Y;
    let mut csv = "timestamp, frame, x, y, z, qx, qy, qz, qw, fx\n".to_owned();
    for (n, (q, p)) in truth().iter().enumerate() {
        csv +=
            &format!("{}, {n:06}, {}, {}, {}, {}, {}, {}, {}, 1400\n", n, p.x, p.y, p.z, q.x, q.y, q.z, q.w);
    }
    let (found, told) = read("odometry.csv", csv.as_bytes(), None).unwrap();
    same(&found, &poses);
    assert!((told.unwrap() - down(&poses)).length() < 1e-9);
    let rows: Vec<[f64; 7]> =
        looking_back().iter().map(|(q, p)| [q.x, q.y, q.z, q.w, p.x, p.y, p.z]).collect();
    let metadata = serde_json::json!({ "poses": rows, "fps": 60 }).to_string();
    let (found, told) = read("metadata", metadata.as_bytes(), None).unwrap();
    same(&found, &poses);
    assert!((told.unwrap() - down(&poses)).length() < 1e-9);
    // A file for each image.
    let folder = tempfile::tempdir().unwrap();
    let cameras = folder.path().join("keyframes/corrected_cameras");
    std::fs::create_dir_all(&cameras).unwrap();
    for (n, (q, p)) in looking_back().iter().enumerate() {
        let r = DMat3::from_quat(*q).transpose();
        let mut json = serde_json::json!({ "fx": 700.0 });
        for (i, (row, t)) in [(r.x_axis, p.x), (r.y_axis, p.y), (r.z_axis, p.z)].into_iter().enumerate() {
            for (j, v) in [row.x, row.y, row.z, t].into_iter().enumerate() {
                json[format!("t_{i}{j}")] = v.into();
            }
        }
        std::fs::write(cameras.join(format!("{}.json", 900 + n)), json.to_string()).unwrap();
    }
    let path = read_path(folder.path()).unwrap();
    let names: Vec<PathBuf> =
        (0..3).map(|n| PathBuf::from(format!("keyframes/images/{}.jpg", 900 + n))).collect();
    let found = path.of(&Inputs { names: Some(&names), count: 3 }, &[2, 0]).unwrap().poses(&settings(None)).0;
    same(&found, &[poses[2], poses[0]]);
}

#[test]
fn poses_that_are_not_of_the_frames_are_refused() {
    let rows: Vec<[f64; 16]> = expected().iter().map(Pose::rows).collect();
    let text = serde_json::json!({ "camera_from_world": rows }).to_string();
    same(&read("poses.json", text.as_bytes(), None).unwrap().0, &expected());
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("poses.json");
    std::fs::write(&file, text).unwrap();
    let path = read_path(&file).unwrap();
    let error = path.of(&Inputs { names: None, count: 5 }, &[0]).unwrap_err().to_string();
    assert!(error.contains("3 poses") && error.contains("5 frames"), "{error}");
    std::fs::write(&file, "{}").unwrap();
    let error = read_path(&file).unwrap_err().to_string();
    assert!(error.contains("odometry.csv") && error.contains("COLMAP"), "{error}");
}
