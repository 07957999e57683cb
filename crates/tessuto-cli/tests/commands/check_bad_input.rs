//! Every bad input: `tessuto check` ends with status 3, names the place and the way out, writes nothing.

use std::process::{Command, Output};

use crate::scene_maker::{SIZE, TinyScene, contents, mask, template};
use tessuto::io::image::write_png;
use tessuto::io::{npy, obj};

fn check(scene: &TinyScene, more: &[&str], working_folder: &std::path::Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessuto"))
        .arg("check")
        .arg(scene.folder())
        .args(more)
        .current_dir(working_folder)
        .output()
        .unwrap()
}

/// The text in one line: the table is wrapped.
fn unwrapped(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Asserts lines of 100 characters at most (but for long paths, which stand alone), and all `fragments`.
fn shows(table: &[u8], fragments: &[&str]) {
    let text = std::str::from_utf8(table).unwrap();
    let words = |line: &str| line.split_whitespace().count();
    assert!(text.lines().all(|line| line.chars().count() <= 100 || words(line) <= 2), "{text}");
    for fragment in fragments {
        assert!(unwrapped(text).contains(&unwrapped(fragment)), "{fragment:?} is missing in:\n{text}");
    }
}

/// Asserts status 3, all `fragments` in the table, a hint, and that no file was touched.
fn refused(scene: &TinyScene, fragments: &[&str]) {
    let before = scene.contents();
    let working_folder = tempfile::tempdir().unwrap();
    let output = check(scene, &[], working_folder.path());
    let text = String::from_utf8(output.stdout).unwrap();
    let complaint = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{text}\n{complaint}");
    shows(text.as_bytes(), fragments);
    assert!(text.contains("error") && text.contains("hint: "), "{text}");
    assert!(complaint.starts_with("error: ") && complaint.contains("hint: "), "{complaint}");
    assert_eq!(scene.contents(), before);
    assert_eq!(contents(working_folder.path()), []);
}

/// Asserts status 0 and all `fragments` in the table.
fn accepted(scene: &TinyScene, fragments: &[&str]) {
    let before = scene.contents();
    let working_folder = tempfile::tempdir().unwrap();
    let output = check(scene, &[], working_folder.path());
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0), "{text}");
    shows(text.as_bytes(), fragments);
    assert_eq!(scene.contents(), before);
    assert_eq!(contents(working_folder.path()), []);
}

/// One change of scene.json and what the message must say.
fn json_refused(from: &str, to: &str, fragments: &[&str]) {
    let scene = TinyScene::new();
    scene.edit("scene.json", from, to);
    refused(&scene, fragments);
}

/// One change of template.obj and what the message must say.
fn obj_refused(from: &str, to: &str, fragments: &[&str]) {
    let scene = TinyScene::new();
    scene.edit("template.obj", from, to);
    refused(&scene, fragments);
}

#[test]
fn good_scene_has_no_warning() {
    accepted(
        &TinyScene::with_truth(),
        &["10 ok, 0 warnings, 0 errors", "1.000 (intersection over union)", "0.0 px apart"],
    );
}

#[test]
fn picture_is_written_only_where_asked() {
    let scene = TinyScene::new();
    let before = scene.contents();
    let working_folder = tempfile::tempdir().unwrap();
    let output = check(&scene, &["--picture", "p.png"], working_folder.path());
    assert_eq!(output.status.code(), Some(0));
    let image = tessuto::io::image::read(&working_folder.path().join("p.png")).unwrap();
    // Three times the crop (16 pixels and a margin of 4 on each side, as far as the image reaches), 4 pixels between.
    assert_eq!((image.width, image.height), (3 * 24 + 2 * 4, 22));
    assert_eq!(contents(working_folder.path()).len(), 1);
    assert_eq!(scene.contents(), before);
    let output = check(&scene, &["--picture", "no/such/folder/p.png"], working_folder.path());
    assert_eq!(output.status.code(), Some(5));
}

#[test]
fn folder_or_scene_file_missing() {
    let scene = TinyScene::new();
    std::fs::remove_file(scene.path("scene.json")).unwrap();
    refused(&scene, &["scene.json", "does not exist", "\"fps\": 50"]);
    std::fs::remove_dir_all(scene.folder()).unwrap();
    let output = check(&scene, &[], &std::env::temp_dir());
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&output.stdout).contains("is not a folder"));
}

#[test]
fn a_video_instead_of_a_scene() {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("my clip.mp4"), "film").unwrap();
    for command in [&["reconstruct", "my clip.mp4"][..], &["check", "my clip.mp4"]] {
        let output = Command::new(env!("CARGO_BIN_EXE_tessuto"))
            .args(command)
            .current_dir(home.path())
            .output()
            .unwrap();
        let told = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        assert_eq!(output.status.code(), Some(3), "{told}");
        for way_out in
            ["is a file, not the folder of a scene", "tessuto studio", "tessuto import 'my clip.mp4' SCENE"]
        {
            assert!(unwrapped(&told).contains(way_out), "{told}");
        }
    }
}

#[test]
fn a_clip_without_a_name_for_its_scene() {
    let output =
        Command::new(env!("CARGO_BIN_EXE_tessuto")).args(["import", "films/my clip.mp4"]).output().unwrap();
    let told = unwrapped(&String::from_utf8(output.stderr).unwrap());
    assert_eq!(output.status.code(), Some(2), "{told}");
    for way_out in
        ["tessuto import 'films/my clip.mp4' 'scenes/my clip' --fov 65", "tessuto studio 'films/my clip.mp4'"]
    {
        assert!(told.contains(way_out), "{told}");
    }
}

#[test]
fn scene_json_keys() {
    json_refused("\"width\"", "\"widht\"", &["scene.json:5", "widht", "did you mean \"width\"?"]);
    json_refused("\"fps\"", "\"FPS\"", &["scene.json:3", "did you mean \"fps\"?"]);
    json_refused("  \"fps\": 25,\n", "", &["missing field `fps`"]);
    json_refused("\"fps\": 25", "\"fps\": 25, \"fps\": 50", &["scene.json:3", "duplicate field `fps`"]);
    json_refused("\"fps\": 25", "\"fps\": \"25\"", &["scene.json:3", "invalid type: string"]);
    json_refused("\"fps\": 25,", "\"fps\": 25", &["scene.json:4", "expected `,`"]);
    json_refused("\"n_frames\": 4", "\"n_frames\": 4.5", &["scene.json:4", "invalid type: floating point"]);
    json_refused("\"name\"", "\"units\": \"inch\", \"name\"", &["scene.json:2", "unknown variant `inch`"]);
    json_refused("\"name\"", "\"crop\": {\"x\": 1}, \"name\"", &["scene.json:2", "unknown field `x`"]);
}

#[test]
fn scene_json_values() {
    json_refused("\"fps\": 25", "\"fps\": 0", &["scene.json", "\"fps\" is 0"]);
    json_refused("\"n_frames\": 4", "\"n_frames\": 0", &["\"n_frames\" is 0"]);
    json_refused("\"n_frames\": 4", "\"n_frames\": 4000000000", &["\"n_frames\" is 4000000000"]);
    json_refused("\"width\": 24", "\"width\": 1000000", &["\"width\" is 1000000", "2 to 16384"]);
    json_refused("\"fx\": 40", "\"fx\": -40", &["\"fx\" is -40"]);
    json_refused("\"fx\": 40", "\"fx\": 1e999", &["scene.json:7", "out of range"]);
    json_refused("\"cx\": 11.5", "\"cx\": 1150", &["\"cx\" is 1150"]);
    let crop = "\"crop\": {\"x0\": 4, \"y0\": 0, \"x1\": 25, \"y1\": 24}, \"name\"";
    json_refused("\"name\"", crop, &["\"crop\" is columns 4..25"]);
}

#[test]
fn frames_missing() {
    let scene = TinyScene::new();
    std::fs::remove_file(scene.path("rgbs/rgb_002.png")).unwrap();
    refused(&scene, &["rgbs", "1 of 4 files are missing: rgb_002.png"]);
    let scene = TinyScene::new();
    std::fs::remove_file(scene.path("masks/mask_001.png")).unwrap();
    std::fs::remove_file(scene.path("masks/mask_003.png")).unwrap();
    refused(&scene, &["masks", "2 of 4 files are missing: mask_001.png, mask_003.png"]);
    json_refused("\"n_frames\": 4", "\"n_frames\": 20", &["16 of 20", "rgb_004.png", "rgb_008.png, …"]);
    let scene = TinyScene::new();
    std::fs::remove_dir_all(scene.path("masks")).unwrap();
    refused(&scene, &["masks", "cannot be read"]);
    let scene = TinyScene::new();
    std::fs::copy(scene.path("rgbs/rgb_001.png"), scene.path("rgbs/rgb_1.png")).unwrap();
    refused(&scene, &["rgb_001.png and rgb_1.png are both frame 1"]);
}

#[test]
fn frames_unreadable() {
    let scene = TinyScene::new();
    scene.truncate("rgbs/rgb_003.png");
    scene.truncate("rgbs/rgb_001.png");
    let size = std::fs::metadata(scene.path("rgbs/rgb_001.png")).unwrap().len();
    // The lowest of the broken frames, whatever thread met it first.
    refused(&scene, &["rgb_001.png", "cannot be decoded", &format!("file of {size} bytes")]);
    for (name, text) in [("rgbs/rgb_002.png", "not an image"), ("masks/mask_000.png", "")] {
        let scene = TinyScene::new();
        scene.put(name, text);
        refused(&scene, &[name, "is neither PNG nor JPEG"]);
    }
    let scene = TinyScene::new();
    std::fs::remove_file(scene.path("rgbs/rgb_001.png")).unwrap();
    std::fs::create_dir(scene.path("rgbs/rgb_001.png")).unwrap();
    refused(&scene, &["rgb_001.png", "is not a file"]);
}

#[test]
fn sizes_that_differ() {
    let scene = TinyScene::new();
    write_png(&scene.path("rgbs/rgb_002.png"), &tessuto::Image::new(SIZE, SIZE + 1, 3)).unwrap();
    refused(&scene, &["rgb_002.png", "24×25", "scene.json says 24×24"]);
    let scene = TinyScene::new();
    write_png(&scene.path("masks/mask_001.png"), &tessuto::Image::new(12, 12, 1)).unwrap();
    refused(&scene, &["mask_001.png", "12×12"]);
}

#[test]
fn empty_and_inverted_masks() {
    for frame in [0, 2] {
        let scene = TinyScene::new();
        let name = format!("masks/mask_00{frame}.png");
        write_png(&scene.path(&name), &tessuto::Image::new(SIZE, SIZE, 1)).unwrap();
        refused(&scene, &[&name, "the mask is empty", "brightest value is 0 of 255"]);
    }
    // Smaller than the image's half, so that the inverse is the better guess by far.
    let scene = TinyScene::new();
    let mut inverse = mask();
    inverse.data.iter_mut().for_each(|v| *v = 1.0 - *v);
    for n in 0..4 {
        write_png(&scene.path(&format!("masks/mask_00{n}.png")), &inverse).unwrap();
    }
    refused(&scene, &["far from the mask", "look inverted"]);
}

#[test]
fn masks_that_are_none_of_one_cloth() {
    let with_masks = |draw: &dyn Fn(usize, usize) -> f32| {
        let scene = TinyScene::new();
        let mut image = tessuto::Image::new(SIZE, SIZE, 1);
        for (i, v) in image.data.iter_mut().enumerate() {
            *v = draw(i % SIZE, i / SIZE);
        }
        write_png(&scene.path("masks/mask_002.png"), &image).unwrap();
        scene
    };
    let inside = |x: usize, y: usize| (4..20).contains(&x) && (6..22).contains(&y);
    let value = |b: bool| f32::from(u8::from(b));
    // The colours in place of the masks: greys everywhere.
    refused(
        &with_masks(&|x, y| if inside(x, y) { 0.6 } else { 0.2 }),
        &["masks", "100 % of the mask of frame 2 is neither black nor white", "white is fabric"],
    );
    let crumbs = with_masks(&|x, y| value(inside(x, y) && x % 3 != 0 && y % 3 != 0));
    let fragments = ["the mask of frame 2 is", "pieces, the largest holds", "leave only the fabric white"];
    refused(&crumbs, &fragments);
    // What a check refuses is not computed on either.
    let elsewhere = tempfile::tempdir().unwrap();
    let out = elsewhere.path().join("out");
    let output = Command::new(env!("CARGO_BIN_EXE_tessuto"))
        .arg("reconstruct")
        .arg(crumbs.folder())
        .arg("--out")
        .arg(&out)
        .output()
        .unwrap();
    let told = unwrapped(&String::from_utf8(output.stderr).unwrap());
    assert_eq!(output.status.code(), Some(3), "{told}");
    assert!(fragments.iter().all(|f| told.contains(f)) && !out.exists(), "{told}");
    accepted(
        &with_masks(&|x, y| value(inside(x, y) || (x, y) == (1, 1))),
        &["warning masks", "the mask of frame 2 is 2 pieces, the largest holds 99.6 % of it"],
    );
    accepted(
        &with_masks(&|x, y| value(inside(x, y) && !((8..10).contains(&x) && (10..12).contains(&y)))),
        &["warning masks", "the mask of frame 2 has holes, 1.6 % of the fabric"],
    );
}

#[test]
fn templates_before_the_lens() {
    let scene = TinyScene::new();
    // The same picture from very near, as a floor before the camera would be.
    scene.move_template(|p| p.map(|c| 0.09 * c));
    scene.edit("scene.json", "\"name\"", "\"units\": \"m\", \"name\"");
    refused(&scene, &["nearest vertex is 90 mm from the camera", "nothing is filmed from so near"]);
}

#[test]
fn template_that_cannot_be_read() {
    let scene = TinyScene::new();
    std::fs::remove_file(scene.path("template.obj")).unwrap();
    refused(
        &scene,
        &["template.obj", "cannot be read", "--flat WIDTHxHEIGHTm --from-mask", "5 ok, 0 warnings, 1 errors"],
    );
    obj_refused("v -0.2 -0.2 1", "v nan -0.2 1", &["template.obj:1 ", "\"nan\" is not a number"]);
    obj_refused("v -0.2 -0.2 1", "v 1e99 -0.2 1", &["template.obj:1 ", "\"1e99\""]);
    obj_refused("f 1/1 6/6", "f 1 6", &["template.obj:51 ", "no texture coordinate", "uv"]);
    obj_refused("f 1/1 6/6", "f 0/1 6/6", &["template.obj:51 ", "vertex 0 does not exist", "start at 1"]);
    obj_refused("f 1/1 6/6", "f 26/1 6/6", &["template.obj:51 ", "vertex 26 does not exist; 25 are defined"]);
    obj_refused("f 1/1 6/6", "f 6/6 6/6", &["template.obj:51 ", "names vertex 6 twice"]);
}

#[test]
fn template_that_cannot_be_used() {
    let scene = TinyScene::new();
    scene.move_template(|[x, y, z]| [x, y, z - 1.1]);
    refused(&scene, &["template.obj", "25 of 25 vertices are behind the camera, first vertex 1"]);
    let scene = TinyScene::new();
    scene.move_template(|[x, y, z]| [x, -y, -z]);
    refused(&scene, &["behind the camera", "OpenGL", "negate y and z", "--flip yz --force"]);
    let scene = TinyScene::new();
    scene.move_template(|[x, y, z]| [x + 0.4, y, z]);
    refused(&scene, &["the template is far from the mask", "overlap with the mask of frame 0 is 0.0"]);
    let scene = TinyScene::new();
    let mut mesh = template();
    let [a, b] = [mesh.faces[0].vertices[0], mesh.faces[0].vertices[1]];
    for other in [23, 24] {
        let corners = vec![a, b, other];
        mesh.faces.push(tessuto::mesh::Face { vertices: corners.clone(), uvs: corners });
    }
    obj::write(&scene.path("template.obj"), &mesh, None).unwrap();
    refused(&scene, &["1 edges have more than two faces", "vertices 1 and 6 with 3"]);
    let scene = TinyScene::new();
    let mut mesh = template();
    let corners = vec![0, 1, 2];
    mesh.faces.push(tessuto::mesh::Face { vertices: corners.clone(), uvs: corners });
    obj::write(&scene.path("template.obj"), &mesh, None).unwrap();
    refused(&scene, &["1 of 17 faces have no area, first face 17 (vertices 1 2 3)"]);
}

#[test]
fn template_in_another_unit() {
    let scene = TinyScene::new();
    scene.move_template(|p| p.map(|c| c * 1000.0));
    refused(&scene, &["565.6854 m", "write \"units\": \"mm\" in scene.json (0.57 m then)"]);
    scene.edit("scene.json", "\"name\"", "\"units\": \"mm\", \"name\"");
    accepted(&scene, &["diagonal 0.566 m", "0 warnings"]);
    let scene = TinyScene::new();
    scene.move_template(|p| p.map(|c| c * 100.0));
    refused(&scene, &["write \"units\": \"cm\""]);
    json_refused("\"name\"", "\"units\": \"mm\", \"name\"", &["0.0006 m", "write \"units\": \"m\""]);
}

#[test]
fn truth_that_does_not_fit() {
    let scene = TinyScene::with_truth();
    std::fs::rename(scene.path("gt/points/points_002.npy"), scene.path("gt/points/points_004.npy")).unwrap();
    refused(&scene, &["gt/points", "points_004.npy is beyond n_frames = 4, while points_002.npy is missing"]);
    let scene = TinyScene::with_truth();
    npy::write_field(&scene.path("gt/vertices.npy"), &[template().positions]).unwrap();
    refused(&scene, &["gt/vertices.npy", "has 1 frames of 25 vertices", "have 4 of 25"]);
    let scene = TinyScene::with_truth();
    scene.truncate("gt/vertices.npy");
    refused(&scene, &["gt/vertices.npy", "promises shape [4, 25, 3]"]);
    let scene = TinyScene::with_truth();
    npy::write(&scene.path("gt/points/points_001.npy"), &[1, 3], &[0.0_f32, f32::NAN, 1.0]).unwrap();
    refused(&scene, &["points_001.npy", "point 0 of 1 is not finite (NaN)"]);
}

#[cfg(unix)]
#[test]
fn links_out_of_the_folder() {
    let elsewhere = TinyScene::new();
    for name in ["template.obj", "rgbs/rgb_001.png", "scene.json", "masks"] {
        let scene = TinyScene::new();
        let path = scene.path(name);
        if path.is_dir() { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) }.unwrap();
        std::os::unix::fs::symlink(elsewhere.path(name), &path).unwrap();
        refused(&scene, &[name, "is a link out of the scene folder"]);
    }
}

#[test]
fn several_errors_are_listed_together() {
    let scene = TinyScene::with_truth();
    scene.edit("template.obj", "v -0.2 -0.2 1", "v x -0.2 1");
    scene.truncate("rgbs/rgb_001.png");
    scene.truncate("gt/vertices.npy");
    refused(&scene, &["template.obj:1", "rgb_001.png", "vertices.npy", "0 ok, 0 warnings, 3 errors"]);
}

#[test]
fn doubts_are_warnings() {
    let scene = TinyScene::new();
    scene.move_template(|[x, y, z]| [x + 0.1, y, z]);
    accepted(
        &scene,
        &["warning  overlap", "is 0.60", "warning  outline", "px apart in the mean", "the camera are right"],
    );
    let scene = TinyScene::new();
    scene.edit("template.obj", "v -0.2 -0.2 1", "v -0.2 -0.2 1\n#"); // keep the count of vertices
    scene.edit("template.obj", "vt ", "v 0 0 1.5\nvt ");
    accepted(&scene, &["warning  vertices", "1 vertices belong to no face, first vertex 26"]);
    let scene = TinyScene::new();
    std::fs::copy(scene.path("rgbs/rgb_001.png"), scene.path("rgbs/rgb_002.png")).unwrap();
    accepted(&scene, &["warning  motion", "1 frames repeat the one before, first frame 2"]);
    let scene = TinyScene::new();
    scene.edit("scene.json", "\"n_frames\": 4", "\"n_frames\": 3");
    accepted(&scene, &["1 files in rgbs/ from rgb_003.png on are beyond n_frames = 3"]);
    let scene = TinyScene::new();
    scene.edit("template.obj", "vt 0 1", "vt -0.5 1");
    accepted(&scene, &["warning  uv", "1 coordinates outside 0…1"]);
    let scene = TinyScene::new();
    scene.move_template(|[x, y, z]| [x, y * 0.5 - 0.05, z]);
    scene.edit("scene.json", "\"fy\": 40", "\"fy\": 80");
    accepted(&scene, &["warning  intrinsics", "differ by over 20 %"]);
}

#[test]
fn pieces_of_the_template() {
    let scene = TinyScene::new();
    let mut mesh = template();
    // The right half gets vertices of its own along the middle column: the same place, another vertex.
    let shift = mesh.positions.len() as u32;
    for face in mesh.faces.iter_mut().filter(|f| f.vertices.iter().any(|v| v % 5 > 2)) {
        face.vertices.iter_mut().filter(|v| **v % 5 == 2).for_each(|v| *v = shift + *v / 5);
    }
    mesh.positions.extend((0..5).map(|r| template().positions[5 * r + 2]));
    obj::write(&scene.path("template.obj"), &mesh, None).unwrap();
    accepted(
        &scene,
        &[
            "warning pieces 2 separate pieces, of 8 to 8 faces",
            "5 vertices lie on another one",
            "--weld --force",
        ],
    );
    let scene = TinyScene::new();
    let mut mesh = template();
    mesh.faces.retain(|f| !(f.vertices.contains(&0) || f.vertices.contains(&6) && f.vertices.contains(&12)));
    obj::write(&scene.path("template.obj"), &mesh, None).unwrap();
    accepted(&scene, &["warning pieces", "faces meet at 1 vertices", "first vertex 7"]);
}

#[test]
fn flipped_axes_are_named() {
    // Fabric in the lower left; the template's y points up.
    let scene = TinyScene::new();
    scene.edit("scene.json", "\"cy\": 13.5", "\"cy\": 5.5");
    scene.move_template(|[x, y, z]| [x, -(y + 0.2), z]);
    refused(
        &scene,
        &[
            "far from the mask",
            "axes look different",
            "y negated, from a frame with y up",
            "--flip y --force",
        ],
    );
    // In millimetres besides.
    scene.move_template(|[x, y, z]| [1000.0 * x, -1000.0 * (y + 0.2), -1000.0 * z]);
    refused(&scene, &["write \"units\": \"mm\"", "--scale 0.001 --force", "--flip yz --scale 0.001 --force"]);
}

#[test]
fn wrong_usage_is_status_2() {
    let run = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_tessuto")).args(arguments).output().unwrap();
        output.status.code()
    };
    assert_eq!(run(&[]), Some(2));
    assert_eq!(run(&["check"]), Some(2));
    assert_eq!(run(&["chek", "x"]), Some(2));
    assert_eq!(run(&["check", "x", "--nothing"]), Some(2));
    assert_eq!(run(&["--version"]), Some(0));
}
