//! Camera files as phones, robots and calibrations write them.

use super::import::camera_file;
use super::import_files::{Files, names};

#[test]
fn camera_matrices_by_columns() {
    let rows = "[400, 0, 150.5, 0, 400, 168.5, 0, 0, 1]";
    let columns = "[400, 0, 0, 0, 400, 0, 150.5, 168.5, 1]";
    let nested = "[[400, 0, 0], [0, 400, 0], [150.5, 168.5, 1]]";
    for text in [
        format!(
            r#"{{"class_name": "PinholeCameraIntrinsic", "intrinsic_matrix": {columns}, "width": 320, "height": 320}}"#
        ),
        format!(r#"{{"h": 320, "w": 320, "fps": 30, "K": {columns}}}"#),
        format!(r#"{{"camera_matrix": {nested}, "image_width": 320, "image_height": 320}}"#),
        format!(r#"{{"intrinsics": {columns}, "imageResolution": [320, 320]}}"#),
        format!(r#"{{"camera_matrix": {rows}, "image_size": [320, 320]}}"#),
        r#"{"fx": 400, "fy": 400, "ppx": 150.5, "ppy": 168.5, "width": 320, "height": 320}"#.to_owned(),
    ] {
        let found = camera_file("c.json", &text).unwrap_or_else(|e| panic!("{text}: {e}"));
        let camera = found.scaled_to([320, 320], &mut Vec::new()).unwrap();
        assert_eq!([camera.fx, camera.fy, camera.cx, camera.cy], [400.0, 400.0, 150.5, 168.5], "{text}");
        assert_eq!(found.size, Some([320, 320]), "{text}");
    }
    let neither = r#"{"K": [400, 0, 150.5, 0, 400, 168.5, 1, 2, 1]}"#;
    let told = camera_file("c.json", neither).unwrap_err().to_string();
    assert!(
        told.contains("last row 1 2 1 and the last column 150.5 168.5 1, and neither is 0 0 1"),
        "{told}"
    );
}

#[test]
fn fisheye_cameras_as_calibrations_write_them() {
    let k = Some([0.1, -0.02, 0.003, -0.0004]);
    let ros = "image_width: 640\nimage_height: 480\ncamera_matrix:\n  \
               data: [300, 0, 320, 0, 301, 240, 0, 0, 1]\ndistortion_model: equidistant\n\
               distortion_coefficients:\n  data: [0.1, -0.02, 0.003, -0.0004]\n";
    let kalibr = "cam0:\n  camera_model: pinhole\n  intrinsics: [300, 301, 320, 240]\n  \
                  distortion_model: equidistant\n  distortion_coeffs: [0.1, -0.02, 0.003, -0.0004]\n  \
                  resolution: [640, 480]\n";
    let sample = r#"{"DIM": [640, 480], "K": [[300, 0, 320], [0, 301, 240], [0, 0, 1]],
        "D": [[0.1], [-0.02], [0.003], [-0.0004]]}"#;
    let opencv = "%YAML:1.0\n---\nfisheye_model: 1\nimage_width: 640\nimage_height: 480\n\
                  camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
                  data: [ 300., 0., 320., 0., 301., 240., 0., 0., 1. ]\n\
                  distortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   \
                  data: [ 0.1, -0.02, 0.003, -0.0004 ]\n";
    let colmap = "1 OPENCV_FISHEYE 640 480 300 301 320.5 240.5 0.1 -0.02 0.003 -0.0004";
    let nerfstudio = r#"{"camera_model": "OPENCV_FISHEYE", "fl_x": 300, "fl_y": 301, "cx": 320.5, "cy": 240.5,
        "w": 640, "h": 480, "k1": 0.1, "k2": -0.02, "k3": 0.003, "k4": -0.0004, "frames": []}"#;
    for (name, text) in [
        ("ros.yaml", ros),
        ("camchain.yaml", kalibr),
        ("sample.json", sample),
        ("opencv.yml", opencv),
        ("cameras.txt", colmap),
        ("transforms.json", nerfstudio),
        (
            "transforms.json",
            &nerfstudio.replace(r#""camera_model": "OPENCV_FISHEYE""#, r#""is_fisheye": true"#),
        ),
    ] {
        let found = camera_file(name, text).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(found.distortion.fisheye, k, "{name}");
        let camera = found.scaled_to([640, 480], &mut Vec::new()).unwrap();
        assert_eq!([camera.fx, camera.fy, camera.cx, camera.cy], [300.0, 301.0, 320.0, 240.0], "{name}");
    }
    for (name, text, fragment) in [
        (
            "c.json",
            r#"{"is_fisheye": true, "K": [300, 0, 320, 0, 300, 240, 0, 0, 1], "D": [0, 0, 0, 0, 0]}"#,
            "5 distortion coefficients",
        ),
        (
            "c.yml",
            "camera_model: omni\nK: [300, 0, 320, 0, 300, 240, 0, 0, 1]",
            "camera model omni is not read",
        ),
        ("cameras.txt", "1 THIN_PRISM_FISHEYE 8 8 3 3 4 4 0 0 0 0 0 0 0 0", "THIN_PRISM_FISHEYE is not read"),
        (
            "transforms.json",
            r#"{"camera_model": "OPENCV_FISHEYE", "fl_x": 3, "p1": 0.1, "frames": []}"#,
            "fisheye lens as k1 k2 k3 k4",
        ),
    ] {
        let told = camera_file(name, text).unwrap_err().to_string();
        assert!(told.contains(fragment), "{name}: {told}");
    }
    // The images are straightened, and what that costs is said.
    let files = Files::with(&names(0..2, |n| format!("{n}.png")), &names(0..2, |n| format!("{n}.png")));
    let camera = r#"{"is_fisheye": true, "K": [14, 0, 11.5, 0, 14, 11.5, 0, 0, 1], "D": [0.01, 0, 0, 0],
        "width": 24, "height": 24}"#;
    std::fs::write(files.path("c.json"), camera).unwrap();
    let (status, text) = files.run(&["import", "@frames", "@out", "--fps", "25", "--camera", "@c.json"]);
    assert!(
        status == Some(0) && text.contains("of the fisheye lens the middle 81° across are kept"),
        "{text}"
    );
}
