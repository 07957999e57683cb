//! `tessuto template --on-table`: the plane of the table by every way, what is refused, and the whole way to an export.

use std::path::{Path, PathBuf};

use tempfile::TempDir;
use tessuto::glam::{DVec2, DVec3};
use tessuto::io::image::write_png;
use tessuto::io::{npy, obj};
use tessuto::{Camera, Mesh};

use super::run::{fail, succeed, text};
use crate::shapes::{Table, camera, drawn, lifted, rings};

const FRAMES: usize = 4;
const WIDTH: usize = 160;
/// A4 [m].
const PAPER: DVec2 = DVec2::new(0.297, 0.21);

/// A scene of a cloth of 50 cm with a hole, lifted at one side.
struct Filmed {
    home: TempDir,
    camera: Camera,
    table: Table,
}

impl Filmed {
    fn new() -> Self {
        let (camera, table) = (camera(WIDTH), Table::tilted());
        let made = Self { home: tempfile::tempdir().unwrap(), camera, table };
        let shape = Self::shape();
        for sub in ["rgbs", "masks"] {
            std::fs::create_dir_all(made.path(sub)).unwrap();
        }
        for n in 0..FRAMES {
            let time = n as f64 / 8.0;
            let at: Vec<DVec3> = shape.positions.iter().map(|p| table.at(lifted(*p, time))).collect();
            let (rgb, mask) = drawn(&shape, &at, camera);
            write_png(&made.path(&format!("rgbs/rgb_{n:03}.png")), &rgb).unwrap();
            write_png(&made.path(&format!("masks/mask_{n:03}.png")), &mask).unwrap();
        }
        made.write_scene("");
        made
    }

    fn shape() -> Mesh {
        rings(&(0..=17).map(|k| 0.08 + 0.01 * f64::from(k)).collect::<Vec<_>>())
    }

    fn write_scene(&self, more: &str) {
        let Camera { fx, fy, cx, cy, width, height } = self.camera;
        let scene = format!(
            r#"{{"name": "ring", "fps": 25, "n_frames": {FRAMES}, "width": {width}, "height": {height},
                "fx": {fx}, "fy": {fy}, "cx": {cx}, "cy": {cy}{more}}}"#
        );
        std::fs::write(self.path("scene.json"), scene).unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        self.home.path().join(name)
    }

    /// `tessuto template SCENE --on-table … --force`.
    fn arguments<'a>(&'a self, more: &[&'a str]) -> Vec<&'a str> {
        [&["template", text(self.home.path()), "--on-table", "--force", "--grid", "17"], more].concat()
    }

    fn made(&self, more: &[&str]) -> String {
        succeed(&self.arguments(more)).split_whitespace().collect::<Vec<_>>().join(" ")
    }

    fn refused(&self, code: i32, more: &[&str]) -> String {
        fail(code, &self.arguments(more)).split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Where the camera sees a point of the table.
    fn seen(&self, p: DVec2) -> String {
        let q = self.camera.project(self.table.at(p.extend(0.0)));
        format!("{:.3},{:.3}", q.x, q.y)
    }

    /// The options of a sheet of paper of this name or size, its corners given in this order.
    fn paper(&self, size: &str, order: [usize; 4]) -> Vec<String> {
        let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
            .map(|c| self.seen(DVec2::from_array(c) * PAPER + DVec2::new(0.3, 0.15)));
        let mut all = ["--paper", size, "--paper-corners"].map(str::to_owned).to_vec();
        all.extend(order.map(|k| corners[k].clone()));
        all
    }

    /// The plane of the table as an option.
    fn plane(&self) -> String {
        let plane = self.table.plane();
        let [p, n] = [plane.point, plane.normal];
        format!("{},{},{},{},{},{}", p.x, p.y, p.z, n.x, n.y, n.z)
    }

    /// The template [m], which has to lie on the table and be as large as the fabric.
    fn check_mesh(&self, metres: f64) -> Mesh {
        let mut mesh = obj::read(&self.path("template.obj")).unwrap();
        mesh.positions.iter_mut().for_each(|p| *p *= metres);
        let off = mesh.positions.iter().map(|p| self.table.within(*p).z.abs()).fold(0.0, f64::max);
        let area = mesh.area() / Self::shape().area();
        assert!(off < 2e-3 && (area - 1.0).abs() < 0.015, "{off} m off, area {area}");
        mesh
    }
}

fn borrowed(options: &[String]) -> Vec<&str> {
    options.iter().map(|o| &**o).collect()
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn paper_and_the_plane_as_printed_make_the_same_mesh() {
    let scene = Filmed::new();
    // Crosswise: they are put in order.
    let paper = scene.paper("A4", [0, 2, 1, 3]);
    let said = scene.made(&borrowed(&paper));
    assert!(said.contains("put in order") && said.contains("with 0 corners, 1 hole"), "{said}");
    assert_eq!(said.matches("treated as one sheet").count(), 1, "{said}");
    let exact = scene.check_mesh(1.0);
    let record = json(&scene.path("template.json"));
    assert_eq!(
        (&record["kind"], &record["table"]["source"]),
        (&"outline".into(), &"a sheet of paper".into())
    );
    assert!(record["table"]["length_deviation"].as_f64().unwrap() > 1e-3, "{record}");
    assert!(record["overlap"].as_f64().unwrap() > 0.95, "{record}");
    let checked = succeed(&["check", text(scene.home.path())]);
    assert!(checked.contains("outline of") && checked.contains("0 warnings"), "{checked}");
    let plane = said.split("--plane ").nth(1).unwrap().split(' ').next().unwrap();
    assert!(scene.made(&["--plane", plane]).contains("plane of the table: --plane"));
    let again = scene.check_mesh(1.0);
    assert!(exact.positions.iter().zip(&again.positions).all(|(a, b)| a.distance(*b) < 1e-4));
    // In millimetres, where the scene is.
    scene.write_scene(", \"units\": \"mm\"");
    let said = scene.made(&borrowed(&paper));
    let plane = said.split("--plane ").nth(1).unwrap().split(' ').next().unwrap();
    scene.made(&["--plane", plane]);
    scene.check_mesh(1e-3);
}

#[test]
fn one_distance_or_depth_says_where_the_table_is() {
    let scene = Filmed::new();
    let n = scene.table.rotation.z_axis;
    scene.write_scene(&format!(", \"gravity\": [{}, {}, {}]", n.x, n.y, n.z));
    let ends = [DVec2::new(-0.25, 0.0), DVec2::new(0.2, 0.15)].map(|p| scene.seen(p));
    let length = format!("{:.3}mm", 1e3 * DVec2::new(0.45, 0.15).length());
    let normal = format!("{},{},{}", -n.x, -n.y, -n.z);
    for tilt in ["level", &normal] {
        let said = scene.made(&["--distance", &length, "--between", &ends[0], &ends[1], "--tilt", tilt]);
        assert!(said.contains("lengths ±"), "{said}");
        scene.check_mesh(1.0);
    }
    // Depth maps of the scene, or one that is named.
    std::fs::create_dir_all(scene.path("depth")).unwrap();
    let (columns, rows) = (80, 60);
    let sensor = scene.camera.resized([columns, rows]);
    let depth = |k: u32| {
        let ray = sensor.ray(DVec2::new(f64::from(k % columns), f64::from(k / columns)));
        scene.table.plane().meet(ray).map_or(0.0, |p| p.z as f32)
    };
    let map: Vec<f32> = (0..columns * rows).map(depth).collect();
    for n in 0..FRAMES {
        npy::write(&scene.path(&format!("depth/depth_{n:03}.npy")), &[rows as usize, columns as usize], &map)
            .unwrap();
    }
    let named = scene.path("depth/depth_000.npy");
    for more in [&[][..], &["--depth", text(&named)]] {
        let said = scene.made(more);
        assert!(said.contains("measured depths are off by"), "{said}");
        scene.check_mesh(1.0);
    }
    assert_eq!(json(&scene.path("template.json"))["table"]["source"], "the depth map depth_000.npy");
}

#[test]
fn what_is_missing_or_wrong_is_said_with_the_way_out() {
    let scene = Filmed::new();
    let said = scene.refused(2, &[]);
    assert!(said.contains("plane of the table is not given") && said.contains("--paper A4"), "{said}");
    let said = scene.refused(3, &borrowed(&scene.paper("100x900mm", [0, 1, 2, 3])));
    assert!(said.contains("no sheet of 100×900 mm looks like this"), "{said}");
    assert!(scene.refused(2, &["--paper", "A4"]).contains("--paper-corners"));
    assert!(scene.refused(2, &["--plane", "0,0,1"]).contains("write a point and a normal"));
    let said = scene.refused(2, &["--distance", "50cm", "--between", "10,10", "90,90", "--tilt", "level"]);
    assert!(said.contains("which way gravity pulls is not known"), "{said}");
    let said = scene.refused(3, &["--plane", "0,0.05,1,0,-1,0.02"]);
    assert!(said.contains("edge-on"), "{said}");
    let plane = scene.plane();
    let said = scene.refused(2, &["--plane", &plane, "--side", "1mm"]);
    assert!(said.contains("16 to 4000 are possible"), "{said}");
    let said = scene.refused(2, &["--plane", &plane, "--camera", "estimate"]);
    assert!(said.contains("--on-table with --camera estimate"), "{said}");
    let said = scene.refused(2, &["--plane", &plane, "--flat", "50x50cm"]);
    assert!(said.contains("cannot be used with"), "{said}");
    std::fs::remove_dir_all(scene.path("masks")).unwrap();
    assert!(scene.refused(2, &["--plane", &plane]).contains("make masks first"));
}

#[test]
fn a_cloth_with_a_hole_goes_the_whole_way_to_an_export() {
    let scene = Filmed::new();
    scene.made(&["--plane", &scene.plane()]);
    let out = scene.path("result");
    let mut arguments = vec!["reconstruct", text(scene.home.path()), "--out", text(&out)];
    for setting in [
        "texture.size=64",
        "texture.epochs=5",
        "appearance.steps=4",
        "appearance.batch=500",
        "appearance.map_size=32",
        "appearance.render_samples_per_pixel=8",
    ] {
        arguments.extend(["--set", setting]);
    }
    succeed(&arguments);
    let flat = scene.check_mesh(1.0).positions;
    let motion = npy::read_field(&out.join("motion.npy")).unwrap();
    assert_eq!((motion.len(), motion[0].len()), (FRAMES, flat.len()));
    let truth: Vec<DVec3> =
        flat.iter().map(|p| scene.table.at(lifted(scene.table.within(*p), 3.0 / 8.0))).collect();
    let mean = |a: &[DVec3]| a.iter().zip(&truth).map(|(a, b)| a.distance(*b)).sum::<f64>() / a.len() as f64;
    let (found, still) = (mean(&motion[3]), mean(&flat));
    println!("{:.2} mm off in the last frame, {:.2} mm if held still", 1e3 * found, 1e3 * still);
    assert!(found < 3e-3 && found < 0.25 * still, "{found} m off, {still} m if held still");
    for format in ["glb", "obj", "usd"] {
        succeed(&["export", text(&out), "--to", format, "--out", text(&scene.path(format))]);
        assert!(scene.path(format).exists());
    }
    assert!(std::fs::metadata(out.join("texture.png")).unwrap().len() > 100);
}
