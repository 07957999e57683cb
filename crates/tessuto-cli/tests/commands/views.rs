//! Two cameras: from clips and a calibration to files for other programs.

use std::path::Path;
use std::process::Command;

use super::held::{off, tessuto, worst};
use serde_json::{Value, json};
use tessuto::Pose;
use tessuto::io::scene::{LoadOptions, load, read_poses};

fn refused(folder: &Path, arguments: &[&str], words: &[&str]) {
    let output =
        Command::new(env!("CARGO_BIN_EXE_tessuto")).args(arguments).current_dir(folder).output().unwrap();
    let err = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && words.iter().all(|word| err.contains(word)), "{arguments:?}: {err}");
}

fn read(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn two_clips_and_a_rig_go_through() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let made = ["synth", "made", "--frames", "5", "--size", "96", "--grid", "7x7", "--surroundings"];
    tessuto(folder, &[&made[..], &["--views", "2", "--apart", "35"]].concat());
    let scene = read(&folder.join("made/scene.json"));
    let rows: Vec<f64> =
        serde_json::from_value(read(&folder.join("made/view1/poses.json"))["camera_from_world"][0].clone())
            .unwrap();
    let pose = Pose::from_rows(&rows.try_into().unwrap());
    // As OpenCV's stereo calibration has it, in millimetres.
    let matrix = json!([[scene["fx"], 0, scene["cx"]], [0, scene["fy"], scene["cy"]], [0, 0, 1]]);
    let turn = pose.rotation.transpose().to_cols_array();
    let rig = json!({
        "M1": matrix, "D1": [0, 0, 0, 0, 0], "M2": matrix, "D2": [0, 0, 0, 0, 0],
        "R": turn.chunks(3).collect::<Vec<_>>(), "T": (pose.translation * 1e3).to_array(),
    });
    std::fs::write(folder.join("stereo.json"), rig.to_string()).unwrap();
    let first = ["import", "made/rgbs", "scene", "--masks", "made/masks", "--fps", "50"];
    let second = ["--view", "right=made/view1/rgbs", "--view-masks", "right=made/view1/masks"];
    let template = ["--template", "made/template.obj"];
    let with_rig = ["--rig", "stereo.json", "--pose-scale", "0.001"];
    refused(folder, &[&first[..], &second, &["--fx", "120"]].concat(), &["right", "has no camera"]);
    refused(folder, &[&first[..], &second[..2], &with_rig].concat(), &["right", "--view-masks right=PATH"]);
    refused(folder, &[&first[..], &second[2..], &with_rig].concat(), &["--view right=CLIP"]);
    let late = [&first[..], &second, &with_rig, &["--view-late", "left=0.01"]].concat();
    refused(folder, &late, &["--view-late", "left", "--view left=CLIP"]);
    let short =
        ["--view", "right=made/view1/rgbs", "--view-masks", "right=made/view1/masks", "--frames", "0..9"];
    refused(folder, &[&first[..], &short, &with_rig].concat(), &["frames"]);
    let text = tessuto(folder, &[&first[..], &second, &template, &with_rig].concat());
    assert!(text.contains("view right stands 0.") && text.contains("turned by 35.0°"), "{text}");
    let [there, here] =
        ["made", "scene"].map(|name| load(&folder.join(name), &LoadOptions::default()).unwrap().scene);
    assert_eq!((here.view_count(), here.more[0].name.as_str()), (2, "right"));
    for (a, b) in here.more[0].poses.iter().zip(&there.more[0].poses) {
        let [angle, way] = a.apart(b);
        assert!(angle < 1e-6 && way < 1e-9, "{angle} {way}");
    }

    tessuto(folder, &["reconstruct", "scene", "--out", "result", "--preset", "motion", "--no-appearance"]);
    assert_eq!(read(&folder.join("result/views.json"))[0]["name"], "right");
    let page = std::fs::read_to_string(folder.join("result/report.html")).unwrap();
    assert!(page.contains(r#""others":[{"name":"right""#) && page.contains("show-cameras"));
    let crop = &read(&folder.join("result/views.json"))[0]["crop"];
    let side = |a: &str, b: &str| (crop[b].as_u64().unwrap() - crop[a].as_u64().unwrap()) as usize;
    for kind in ["observed", "render", "difference"] {
        let path = folder.join(format!("result/pictures/view_1/{kind}/frame_004.png"));
        let image = tessuto::io::image::read(&path).unwrap();
        assert_eq!(image.width, side("x0", "x1"), "{kind}");
        assert!(kind == "difference" || image.height == side("y0", "y1"), "{kind}");
    }
    // Seen from the further camera, the sheet is where its masks are.
    tessuto(folder, &["render", "result", "--look", "texture", "--camera", "right"]);
    let view = tessuto::io::image::read(&folder.join("result/views/texture/frame_004.png")).unwrap();
    let mask = tessuto::io::image::read_grey(&folder.join("made/view1/masks/mask_004.png")).unwrap();
    let drawn = |k: usize| view.data[3 * k..3 * k + 3].iter().any(|c| *c > 0.0);
    let (mut both, mut either) = (0, 0);
    for (k, m) in mask.data.iter().enumerate() {
        both += usize::from(drawn(k) && *m > 0.5);
        either += usize::from(drawn(k) || *m > 0.5);
    }
    println!("overlap {both} of {either}");
    assert!(f64::from(both as u32) > 0.95 * f64::from(either as u32));
    refused(
        folder,
        &["render", "result", "--camera", "left"],
        &["no camera is named left", "original, right"],
    );

    tessuto(folder, &["export", "result", "--to", "glb,usd,npz", "--force"]);
    let exported = |name: &str| folder.join("result/export").join(name);
    let usd = std::fs::read_to_string(exported("scene.usda")).unwrap();
    assert!(usd.contains("def Camera \"Camera_right\"") && usd.contains("matrix4d xformOp:transform = ("));
    let glb = std::fs::read(exported("scene.glb")).unwrap();
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let gltf: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    assert_eq!(gltf["cameras"][1]["name"], "right");
    let node = gltf["nodes"].as_array().unwrap().iter().find(|node| node["name"] == "right").unwrap();
    let place: Vec<f64> = serde_json::from_value(node["translation"].clone()).unwrap();
    let eye = here.seen_by(1).viewpoint(0).eye();
    assert!(
        (place[0] - eye.x).abs() < 1e-6 && (place[1] + eye.y).abs() < 1e-6 && (place[2] + eye.z).abs() < 1e-6
    );
}

#[test]
fn poses_of_a_further_camera_are_refined_in_the_world_of_the_first() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path();
    let made = ["synth", "made", "--frames", "6", "--size", "480", "--grid", "7x7", "--seed", "9"];
    tessuto(folder, &[&made[..], &["--orbit", "6", "--shake", "5", "--surroundings"]].concat());
    let truth = read_poses(&folder.join("made"), 6).unwrap().unwrap();
    // Two cameras side by side that see the same: both are off, each in its own way.
    for (name, seed) in [("first.json", 0.0), ("second.json", 7.0)] {
        let rows: Vec<[f64; 16]> = off(&truth, seed).iter().map(Pose::rows).collect();
        std::fs::write(folder.join(name), json!({ "camera_from_world": rows }).to_string()).unwrap();
    }
    let lens = json!({ "fl_x": 600, "fl_y": 600, "cx": 240, "cy": 240, "w": 480, "h": 480 });
    std::fs::write(folder.join("lens.json"), lens.to_string()).unwrap();
    let import = ["import", "made/rgbs", "scene", "--masks", "made/masks", "--template", "made/template.obj"];
    let first = ["--fps", "50", "--camera", "lens.json", "--poses", "first.json"];
    let view = ["--view", "other=made/rgbs", "--view-masks", "other=made/masks"];
    let more = ["--view-camera", "other=lens.json", "--view-poses", "other=second.json"];
    let import = [&import[..], &first, &view, &more].concat();
    let worst = |said: &str| {
        let read = |path: &str| read_poses(&folder.join(path), 6).unwrap().unwrap();
        let [turned, moved] = worst(&truth, &read("scene/other"));
        let apart = read("scene")[0].apart(&read("scene/other")[0]);
        let apart = [apart[0].to_degrees(), 1e3 * apart[1]];
        println!("{said}: {turned:.3}°, {moved:.2} mm; {:.3}°, {:.2} mm from the first", apart[0], apart[1]);
        [turned, moved, apart[0], apart[1]]
    };
    let text = tessuto(folder, &import);
    assert!(!text.contains("are refined"), "{text}");
    let given = worst("given");
    let text = tessuto(folder, &[&import[..], &["--refine-poses", "--force"]].concat());
    println!("{text}");
    assert!(text.contains("note: poses are refined by"), "{text}");
    assert!(text.contains("note: view other: poses are refined by"), "{text}");
    let refined = worst("refined");
    // They see the same, so they are at the same place.
    assert!(refined[0] < 0.5 * given[0] && refined[1] < given[1] && refined[2] < 0.3, "{refined:?}");
}
