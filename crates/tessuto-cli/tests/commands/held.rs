//! A camera in the hand, with a depth sensor: from the files of other programs to those for others.

use std::path::Path;
use std::process::Command;

use crate::missing::not_tested;
use serde_json::Value;
use tessuto::Pose;
use tessuto::glam::{DQuat, DVec3};
use tessuto::io::npy;
use tessuto::io::scene::read_poses;

pub(super) fn tessuto(folder: &Path, arguments: &[&str]) -> String {
    let output =
        Command::new(env!("CARGO_BIN_EXE_tessuto")).args(arguments).current_dir(folder).output().unwrap();
    let [out, err] =
        [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert!(output.status.success(), "{arguments:?}: {out}\n{err}");
    out + &err
}

/// Poses as Stray Scanner writes them.
fn odometry(poses: &[Pose]) -> String {
    // A world whose y is up, as phones have it.
    let flipped = Pose::from_rows(&[1., 0., 0., 0., 0., -1., 0., 0., 0., 0., -1., 0., 0., 0., 0., 1.]);
    let mut table = "timestamp, frame, x, y, z, qx, qy, qz, qw\n".to_owned();
    for (n, pose) in poses.iter().enumerate() {
        let m = flipped.after(&pose.inverse()).rows();
        // Of a turn by about half of one about x, the first of the quaternion is its largest number.
        let qx = (1.0 + m[0] - m[5] - m[10]).sqrt() / 2.0;
        let [qy, qz, qw] = [m[1] + m[4], m[2] + m[8], m[9] - m[6]].map(|sum| sum / (4.0 * qx));
        let row =
            format!("{}, {n:06}, {}, {}, {}, {qx}, {qy}, {qz}, {qw}\n", n as f64 / 50.0, m[3], m[7], m[11]);
        table += &row;
    }
    table
}

/// Poses that are off by some tenths of a degree and some millimetres, others for another `seed`.
pub(super) fn off(poses: &[Pose], seed: f64) -> Vec<Pose> {
    let pose = |(n, pose): (u32, &Pose)| {
        let [x, y, z] = [1.0, 2.3, 3.1].map(|k| 4e-3 * (k * (f64::from(n * n + 1) + seed)).sin());
        let [c, s] = [y.cos(), y.sin()];
        let step = [1.0, 0.0, 0.0, x, 0.0, c, -s, y, 0.0, s, c, z, 0.0, 0.0, 0.0, 1.0];
        Pose::from_rows(&step).after(pose)
    };
    (0u32..).zip(poses).map(pose).collect()
}

/// How far poses are off the `truth` at most `[°]`, `[mm]`; places by the best scale, as the unit is no better than the
/// given one.
pub(super) fn worst(truth: &[Pose], found: &[Pose]) -> [f64; 2] {
    let pairs = || truth.iter().zip(found);
    let places = pairs().map(|(a, b)| (a.inverse().translation, b.inverse().translation));
    let [both, own] =
        places.clone().fold([0.0; 2], |[both, own], (a, b)| [both + a.dot(b), own + b.length_squared()]);
    let moved = places.map(|(a, b)| a.distance(both / own * b)).fold(0.0, f64::max);
    let turned = pairs().map(|(a, b)| a.apart(b)[0]).fold(0.0, f64::max);
    [turned.to_degrees(), 1e3 * moved]
}

#[test]
fn a_clip_with_poses_and_depth_goes_through() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let made = ["synth", "made", "--frames", "6", "--size", "96", "--grid", "7x7", "--surroundings"];
    tessuto(folder, &[&made[..], &["--orbit", "15", "--shake", "4", "--depth-noise", "1"]].concat());
    let poses = read_poses(&folder.join("made"), 6).unwrap().unwrap();
    // As nerfstudio has them: world from camera, which looks along −z; of another world.
    let elsewhere = Pose::from_rows(&[0., 0., 1., 3., 1., 0., 0., -2., 0., 1., 0., 1., 0., 0., 0., 1.]);
    let turned = |pose: &Pose| {
        let mut rows = elsewhere.after(&pose.inverse()).rows();
        (0..3).for_each(|k| [1, 2].iter().for_each(|c| rows[4 * k + c] = -rows[4 * k + c]));
        rows.chunks(4).map(<[f64]>::to_vec).collect::<Vec<_>>()
    };
    let frame = |(n, pose): (usize, &Pose)| {
        let name = format!("images/rgb_{n:03}.png");
        serde_json::json!({ "file_path": name, "transform_matrix": turned(pose) })
    };
    let frames: Vec<Value> = poses.iter().enumerate().map(frame).collect();
    let file = serde_json::json!({ "fl_x": 120, "frames": frames });
    std::fs::write(folder.join("transforms.json"), file.to_string()).unwrap();
    let scene = std::fs::read_to_string(folder.join("made/scene.json")).unwrap();
    let scene: Value = serde_json::from_str(&scene).unwrap();
    let number = |key: &str| scene[key].to_string();
    let [fx, cx, cy] = ["fx", "cx", "cy"].map(number);
    let camera = ["--fx", &fx, "--cx", &cx, "--cy", &cy, "--fps", "50"];
    let import = ["import", "made/rgbs", "scene", "--masks", "made/masks", "--template", "made/template.obj"];
    let more = ["--poses", "transforms.json", "--depths", "made", "--frames", "0..5"];
    let text = tessuto(folder, &[&import[..], &camera, &more].concat());
    assert!(text.contains("the camera moves by up to"), "{text}");
    let imported = read_poses(&folder.join("scene"), 5).unwrap().unwrap();
    for (a, b) in imported.iter().zip(&poses) {
        let [angle, way] = a.apart(b);
        assert!(angle < 1e-6 && way < 1e-9);
    }
    let [a, b] =
        ["made", "scene"].map(|name| npy::read(&folder.join(name).join("depth/depth_003.npy")).unwrap());
    assert_eq!((a.shape, a.data.len()), (b.shape, b.data.len()));

    tessuto(folder, &["reconstruct", "scene", "--out", "result", "--preset", "motion", "--no-appearance"]);
    let stored = read_poses(&folder.join("result"), 5).unwrap().unwrap();
    assert!(stored.iter().zip(&imported).all(|(a, b)| a.apart(b).iter().all(|off| *off < 1e-9)));
    tessuto(folder, &["render", "result", "--look", "texture", "--camera", "original"]);
    let views = tessuto::io::image::read(&folder.join("result/views/texture/frame_004.png")).unwrap();
    let filmed = tessuto::io::image::read(&folder.join("made/rgbs/rgb_004.png")).unwrap();
    let mask = tessuto::io::image::read_grey(&folder.join("made/masks/mask_004.png")).unwrap();
    // Where the fabric is, the image is the video's; a camera that stands still would see it elsewhere.
    let (mut apart, mut count) = (0.0, 0);
    for k in (0..mask.data.len()).filter(|k| mask.data[*k] == 1.0) {
        (0..3).for_each(|c| apart += f64::from((views.data[3 * k + c] - filmed.data[3 * k + c]).abs()));
        count += 3;
    }
    println!("{} apart", apart / f64::from(count));
    assert!(apart / f64::from(count) < 0.03);
    let text = tessuto(folder, &["evaluate", "made", "result", "--frames", "0..5"]);
    println!("{text}");
}

#[test]
fn a_recording_of_a_phone_is_imported_at_once() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let made = ["synth", "made", "--frames", "4", "--size", "96", "--grid", "5x5", "--surroundings"];
    tessuto(folder, &[&made[..], &["--orbit", "15", "--shake", "4", "--depth-noise", "1"]].concat());
    let poses = read_poses(&folder.join("made"), 4).unwrap().unwrap();
    let table = odometry(&poses);
    let capture = folder.join("capture");
    std::fs::create_dir_all(capture.join("confidence")).unwrap();
    std::fs::rename(folder.join("made/depth"), capture.join("depth")).unwrap();
    std::fs::rename(folder.join("made/rgbs"), capture.join("rgb")).unwrap();
    std::fs::write(capture.join("odometry.csv"), table).unwrap();
    let scene = |name: &str| -> Value {
        serde_json::from_str(&std::fs::read_to_string(folder.join(name).join("scene.json")).unwrap()).unwrap()
    };
    let [fx, fy, cx, cy] = ["fx", "fy", "cx", "cy"].map(|key| scene("made")[key].as_f64().unwrap());
    std::fs::write(capture.join("camera_matrix.csv"), format!("{fx},0,{cx}\n0,{fy},{cy}\n0,0,1\n")).unwrap();
    let level = |n: usize| tessuto::Image {
        width: 48,
        height: 48,
        channels: 1,
        data: (0..48 * 48).map(|k| if k % 48 < 24 && n == 2 { 0.0 } else { 2.0 / 255.0 }).collect(),
    };
    for n in 0..4 {
        let file = capture.join(format!("confidence/{n:06}.png"));
        tessuto::io::image::write_png(&file, &level(n)).unwrap();
    }
    let import = ["import", "capture", "scene", "--masks", "made/masks", "--template", "made/template.obj"];
    let text = tessuto(folder, &[&import[..], &["--fps", "50"]].concat());
    assert!(text.contains("a capture of Stray Scanner: its camera, poses and depth are taken"), "{text}");
    let imported = read_poses(&folder.join("scene"), 4).unwrap().unwrap();
    for (a, b) in imported.iter().zip(&poses) {
        let [angle, way] = a.apart(b);
        assert!(angle < 1e-6 && way < 1e-9, "{angle} {way}");
    }
    assert_eq!(scene("scene")["fx"].as_f64(), Some(fx));
    let down: Vec<f64> = serde_json::from_value(scene("scene")["gravity"].clone()).unwrap();
    assert!((down[1] - 1.0).abs() < 1e-6, "{down:?}");
    let half = |n: usize| {
        let map = npy::read(&folder.join(format!("scene/depth/depth_{n:03}.npy"))).unwrap();
        map.data.iter().enumerate().filter(|(k, z)| k % 48 < 24 && **z > 0.0).count()
    };
    assert!(half(1) > 50 && half(2) == 0, "what the sensor is not sure of is left out");

    // The same as a file of Record3D, whose packed parts may also be stored as they are.
    let stored = |bytes: &[u8]| [b"bvx-", &(bytes.len() as u32).to_le_bytes()[..], bytes, b"bvx$"].concat();
    let turned = poses.iter().map(|pose| {
        // World from camera, both with y up and z back.
        let flip = |v: DVec3| DVec3::new(v.x, -v.y, -v.z);
        let q = DQuat::from_mat3(&pose.rotation.transpose());
        let place = flip(pose.in_world(DVec3::ZERO));
        serde_json::json!([q.x, -q.y, -q.z, q.w, place.x, place.y, place.z])
    });
    let metadata = serde_json::json!({"w": 96, "h": 96, "fps": 50, "K": [fx, 0, 0, 0, fy, 0, cx, cy, 1],
        "poses": turned.collect::<Vec<_>>()});
    let mut entries = vec![("metadata".to_owned(), metadata.to_string().into_bytes())];
    for n in 0..4 {
        let z = npy::read(&capture.join(format!("depth/depth_{n:03}.npy"))).unwrap();
        let z: Vec<u8> = z.data.iter().flat_map(|z| (*z as f32).to_le_bytes()).collect();
        let sure: Vec<u8> = level(n).data.iter().map(|level| (255.0 * level) as u8).collect();
        let image = std::fs::read(capture.join(format!("rgb/rgb_{n:03}.png"))).unwrap();
        entries.push((format!("rgbd/{n}.jpg"), image));
        entries.push((format!("rgbd/{n}.depth"), stored(&z)));
        entries.push((format!("rgbd/{n}.conf"), stored(&sure)));
    }
    std::fs::write(folder.join("film.r3d"), tessuto::io::zip::write(&entries)).unwrap();
    let import = ["import", "film.r3d", "other", "--masks", "made/masks", "--template", "made/template.obj"];
    let text = tessuto(folder, &import);
    assert!(text.contains("a capture of Record3D: its camera, poses and depth are taken"), "{text}");
    let imported = read_poses(&folder.join("other"), 4).unwrap().unwrap();
    for (a, b) in imported.iter().zip(&poses) {
        let [angle, way] = a.apart(b);
        assert!(angle < 1e-6 && way < 1e-9, "{angle} {way}");
    }
    assert_eq!(scene("other")["fps"].as_f64(), Some(50.0));
    // Nothing tells where it was unpacked, nor from which of both forms.
    let of = |name: &str| std::fs::read_to_string(folder.join(name).join("scene.json")).unwrap();
    assert!(
        !of("other").contains(&*std::env::temp_dir().join("tessuto-").to_string_lossy()),
        "{}",
        of("other")
    );
    std::fs::create_dir_all(folder.join("unpacked/rgbd")).unwrap();
    entries
        .iter()
        .for_each(|(name, bytes)| std::fs::write(folder.join("unpacked").join(name), bytes).unwrap());
    let import = ["import", "unpacked", "third", "--masks", "made/masks", "--template", "made/template.obj"];
    tessuto(folder, &import);
    assert_eq!(of("third").replace("unpacked", "film.r3d").replace("third", "other"), of("other"));
    // Its world is the first camera's frame: which way is down is not known.
    assert!(scene("other")["gravity"].is_null());
    for n in 0..4 {
        let [a, b] = ["scene", "other"]
            .map(|name| std::fs::read(folder.join(format!("{name}/depth/depth_{n:03}.npy"))).unwrap());
        assert!(n == 2 || a == b, "depth of frame {n}");
    }
}

#[test]
fn depth_and_poses_that_do_not_pair_are_refused() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let made = ["synth", "made", "--frames", "3", "--size", "64", "--grid", "5x5"];
    tessuto(folder, &[&made[..], &["--orbit", "5", "--depth-noise", "1"]].concat());
    std::fs::remove_file(folder.join("made/depth/depth_002.npy")).unwrap();
    let refused = |option: [&str; 2], word: &str| {
        let import = ["import", "made/rgbs", "scene", "--masks", "made/masks", "--fx", "80", "--fps", "50"];
        let mut command = Command::new(env!("CARGO_BIN_EXE_tessuto"));
        let output = command.args(import).args(option).current_dir(folder).output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && text.contains(word) && text.contains("hint"), "{text}");
        assert!(!folder.join("scene").exists());
    };
    refused(["--depths", "made"], "holds 2 depth maps, the input 3 frames");
    refused(["--poses", "made/template.obj"], "not a file of camera poses");
}

#[test]
fn the_motion_of_a_camera_is_found_from_the_surroundings() {
    if Command::new("colmap").arg("help").output().is_err() {
        return not_tested("colmap");
    }
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let made = ["synth", "made", "--frames", "8", "--size", "800", "--grid", "9x9", "--seed", "9"];
    tessuto(folder, &[&made[..], &["--orbit", "20", "--shake", "5", "--surroundings"]].concat());
    let import = ["import", "made/rgbs", "scene", "--masks", "made/masks", "--template", "made/template.obj"];
    let camera =
        ["--fx", "1000", "--cx", "399.5", "--cy", "399.5", "--fps", "50", "--camera-motion", "colmap"];
    let text = tessuto(folder, &[&import[..], &camera].concat());
    println!("{text}");
    assert!(text.contains("whose length is found with the motion"), "{text}");
    let [truth, found] = ["made", "scene"].map(|name| read_poses(&folder.join(name), 8).unwrap().unwrap());
    let turned: Vec<f64> = truth.iter().zip(&found).map(|(a, b)| a.apart(b)[0].to_degrees()).collect();
    println!("turned by {turned:.2?}°");
    assert!(text.contains("poses are refined by") && turned.iter().all(|angle| *angle < 0.3), "{text}");
    assert!(!folder.join("scene/.colmap").exists());
    let without = ["import", "made/rgbs", "other", "--fx", "600", "--fps", "50", "--camera-motion", "colmap"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_tessuto"));
    let output = command.args(without).current_dir(folder).output().unwrap();
    assert!(String::from_utf8_lossy(&output.stderr).contains("without masks"));
}

#[test]
fn given_poses_are_refined_by_the_surroundings() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let made = ["synth", "made", "--frames", "6", "--size", "480", "--grid", "7x7", "--seed", "9"];
    tessuto(folder, &[&made[..], &["--orbit", "6", "--shake", "5", "--surroundings"]].concat());
    let truth = read_poses(&folder.join("made"), 6).unwrap().unwrap();
    let given = off(&truth, 0.0);
    let rows: Vec<[f64; 16]> = given.iter().map(Pose::rows).collect();
    let text = serde_json::json!({ "camera_from_world": rows }).to_string();
    std::fs::write(folder.join("off.json"), text).unwrap();
    let import = ["import", "made/rgbs", "scene", "--masks", "made/masks", "--template", "made/template.obj"];
    let camera = ["--fx", "600", "--cx", "239.5", "--cy", "239.5", "--fps", "50", "--poses", "off.json"];
    let worst = |said: &str| {
        let [turned, moved] = worst(&truth, &read_poses(&folder.join("scene"), 6).unwrap().unwrap());
        println!("{said}: {turned:.3}°, {moved:.2} mm");
        [turned, moved]
    };
    tessuto(folder, &[&import[..], &camera].concat());
    let [turned, moved] = worst("given");
    assert!(turned > 0.2 && moved > 3.0);
    let text = tessuto(folder, &[&import[..], &camera, &["--refine-poses", "--force"]].concat());
    println!("{text}");
    assert!(text.contains("poses are refined by") && text.contains("before to"), "{text}");
    assert!(text.contains("6 poses: the camera moves by up to"), "{text}");
    let [turned, moved] = worst("refined");
    assert!(turned < 0.1 && moved < 3.5, "{turned} {moved}");

    // The same poses in a capture of a phone.
    let capture = folder.join("capture");
    std::fs::create_dir(&capture).unwrap();
    std::fs::rename(folder.join("made/rgbs"), capture.join("rgb")).unwrap();
    std::fs::write(capture.join("odometry.csv"), odometry(&given)).unwrap();
    let import = ["import", "capture", "scene", "--masks", "made/masks", "--force", "--refine-poses"];
    let text = tessuto(folder, &[&import[..], &camera[..8]].concat());
    assert!(text.contains("a capture of Stray Scanner") && text.contains("poses are refined by"), "{text}");
    let [turned, moved] = worst("refined, of a capture");
    assert!(turned < 0.1 && moved < 3.5, "{turned} {moved}");

    // Nothing is to be seen around this one.
    tessuto(folder, &["synth", "dark", "--frames", "6", "--size", "96", "--grid", "5x5", "--shake", "10"]);
    let import = ["import", "dark/rgbs", "other", "--masks", "dark/masks", "--fx", "120", "--fps", "50"];
    let output = Command::new(env!("CARGO_BIN_EXE_tessuto"))
        .args([&import[..], &["--poses", "dark/poses.json", "--refine-poses"]].concat())
        .current_dir(folder)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && text.contains("take the poses as they are given"), "{text}");
    let output = Command::new(env!("CARGO_BIN_EXE_tessuto"))
        .args([&import[..], &["--refine-poses"]].concat())
        .current_dir(folder)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && text.contains("--poses PATH"), "{text}");
}

#[test]
fn the_motion_of_a_hand_is_found_from_the_clip_alone() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let made = ["synth", "made", "--frames", "6", "--size", "480", "--grid", "7x7", "--seed", "9"];
    tessuto(folder, &[&made[..], &["--shake", "10", "--surroundings"]].concat());
    let import = ["import", "made/rgbs", "scene", "--masks", "made/masks", "--template", "made/template.obj"];
    let camera = ["--fx", "600", "--cx", "239.5", "--cy", "239.5", "--fps", "50"];
    let how = ["--camera-motion", "estimate"];
    let text = tessuto(folder, &[&import[..], &camera, &how].concat());
    println!("{text}");
    assert!(text.contains("places around the fabric") && text.contains("px"), "{text}");
    let [truth, found] = ["made", "scene"].map(|name| read_poses(&folder.join(name), 6).unwrap().unwrap());
    let turned: Vec<f64> = truth.iter().zip(&found).map(|(a, b)| a.apart(b)[0].to_degrees()).collect();
    println!("turned by {turned:.3?}°");
    assert!(turned.iter().all(|angle| *angle < 0.3));
    // The same bytes for any number of threads.
    let first = std::fs::read(folder.join("scene/poses.json")).unwrap();
    tessuto(folder, &[&import[..], &camera, &how, &["--force", "--threads", "1"]].concat());
    assert!(first == std::fs::read(folder.join("scene/poses.json")).unwrap());

    // Nothing is to be seen around this one.
    tessuto(folder, &["synth", "dark", "--frames", "3", "--size", "96", "--grid", "5x5", "--shake", "10"]);
    let import = ["import", "dark/rgbs", "other", "--masks", "dark/masks", "--fx", "120", "--fps", "50"];
    let output = Command::new(env!("CARGO_BIN_EXE_tessuto"))
        .args([&import[..], &how].concat())
        .current_dir(folder)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        !output.status.success() && text.contains("rgbs/rgb_000") && text.contains("--poses PATH"),
        "{text}"
    );
    assert!(!folder.join("other").exists());
}

#[test]
fn what_comes_after_a_result_takes_the_unit_that_it_found() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let made =
        ["synth", "made", "--frames", "6", "--size", "96", "--grid", "7x7", "--orbit", "15", "--shake", "4"];
    tessuto(folder, &made);
    let poses = std::fs::read_to_string(folder.join("made/poses.json")).unwrap();
    let mut poses: Value = serde_json::from_str(&poses).unwrap();
    for row in poses["camera_from_world"].as_array_mut().unwrap() {
        [3, 7, 11].iter().for_each(|k| row[*k] = (row[*k].as_f64().unwrap() / 0.37).into());
    }
    poses["unit"] = Value::Null;
    std::fs::write(folder.join("made/poses.json"), poses.to_string()).unwrap();
    let made = ["reconstruct", "made", "--out", "result", "--preset", "motion", "--no-appearance"];
    let told = tessuto(folder, &made);
    assert!(told.contains("one unit is 0.3"), "{told}");
    let metrics = std::fs::read_to_string(folder.join("result/metrics.json")).unwrap();
    let [first, again] = [metrics, tessuto(folder, &["evaluate", "made", "result", "--json"])]
        .map(|text| serde_json::from_str::<Value>(&text).unwrap()["mean"]["depth"].as_f64().unwrap());
    println!("depth off by {first} m");
    // What is stored is rounded to 32 bits.
    assert!(first < 0.01 && (again / first - 1.0).abs() < 1e-4, "{again}");
    // Of a motion alone nobody knows the unit.
    let mut command = Command::new(env!("CARGO_BIN_EXE_tessuto"));
    let output =
        command.args(["evaluate", "made", "result/motion.npy"]).current_dir(folder).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && text.contains("no unit") && text.contains("hint"), "{text}");
}
