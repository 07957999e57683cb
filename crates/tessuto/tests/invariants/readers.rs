//! Every reader of files that may come from strangers, as a function of bytes: bytes in, a value or a clear error out.
//! The fuzz targets in `fuzz/` use this file too.

use std::path::{Path, PathBuf};
use std::time::Duration;

use sha2::{Digest, Sha256};
use tempfile::TempDir;
use tessuto::config::Config;
use tessuto::import::read_calibration;
use tessuto::io::depth::DepthMap;
use tessuto::io::scene::{LoadOptions, load};
use tessuto::io::{hdr, image, model, npy, obj};
use tessuto::session::{Checkpoints, Session};
use tessuto::{Error, Result};

/// Reads bytes as a file of its kind.
pub type Reader = fn(&[u8]) -> Result<()>;

/// Name of a reader, which is that of its fuzz target, and the reader.
pub const READERS: [(&str, Reader); 15] = [
    ("scene_json", scene_json),
    ("obj", read_obj),
    ("ply", ply),
    ("gltf", gltf),
    ("npy", read_npy),
    ("picture", picture),
    ("radiance", radiance),
    ("depth", depth),
    ("checkpoint", checkpoint),
    ("state", state),
    ("transforms", transforms),
    ("cameras", cameras),
    ("opencv", opencv),
    ("config", config),
    ("tracks", tracks),
];

/// scene.json of the scene that the tracks are read with.
const TRACKED: &str = r#"{"name": "t", "fps": 25, "n_frames": 1, "width": 24, "height": 24,
    "fx": 40, "fy": 40, "cx": 11.5, "cy": 11.5}"#;

/// What `reader` makes of `bytes`; panics if a user could not act on its error.
pub fn read(reader: Reader, bytes: &[u8]) {
    let Err(error) = reader(bytes) else { return };
    let text = error.to_string();
    assert!(matches!(error, Error::Input { .. } | Error::Usage { .. }), "{text}");
    // A message of a few lines, whatever was in the file.
    assert!(text.contains("hint: ") && text.len() < 4000, "{} bytes: {text}", text.len());
}

thread_local! {
    /// A folder for the files of this thread, in memory where the system has such a place.
    static FOLDER: TempDir = {
        let memory = Path::new("/dev/shm");
        let home = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
        let folder = tempfile::tempdir_in(home).expect("a folder in memory");
        make_scene(&folder.path().join("scene"));
        make_scene(&folder.path().join("tracked"));
        std::fs::create_dir(folder.path().join("tracked/gt")).expect("a folder in memory");
        std::fs::write(folder.path().join("tracked/scene.json"), TRACKED).expect("a file in memory");
        make_result(&folder.path().join("result"));
        std::fs::create_dir(folder.path().join("checkpoints")).expect("a folder in memory");
        folder
    };
}

fn make_scene(scene: &Path) {
    for sub in ["rgbs", "masks"] {
        std::fs::create_dir_all(scene.join(sub)).expect("a folder in memory");
    }
    let grey = tessuto::Image { width: 24, height: 24, channels: 1, data: vec![1.0; 24 * 24] };
    image::write_png(&scene.join("rgbs/rgb_000.png"), &grey).expect("an image");
    image::write_png(&scene.join("masks/mask_000.png"), &grey).expect("an image");
    let mesh = tessuto::mesh::grid(3, 3, [0.4, 0.4].into(), 1.0);
    obj::write(&scene.join("template.obj"), &mesh, None).expect("a mesh");
}

fn make_result(result: &Path) {
    std::fs::create_dir_all(result).expect("a folder in memory");
    let mesh = tessuto::mesh::grid(2, 2, [0.4, 0.4].into(), 1.0);
    obj::write(&result.join("mesh.obj"), &mesh, None).expect("a mesh");
    npy::write_field(&result.join("forces.npy"), &[mesh.positions]).expect("an array");
}

fn folder() -> PathBuf {
    FOLDER.with(|folder| folder.path().to_path_buf())
}

/// `bytes` as the file `name`.
fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder().join(name);
    std::fs::write(&path, bytes).expect("a file in memory");
    path
}

fn scene_json(bytes: &[u8]) -> Result<()> {
    file("scene/scene.json", bytes);
    load(&folder().join("scene"), &LoadOptions { frames: Some(0..1), ..LoadOptions::default() }).map(drop)
}

fn read_obj(bytes: &[u8]) -> Result<()> {
    obj::parse(bytes, "mesh.obj").map(drop)
}

fn ply(bytes: &[u8]) -> Result<()> {
    let bytes = [b"ply", bytes.strip_prefix(b"ply").unwrap_or(bytes)].concat();
    model::read(&file("mesh.ply", &bytes)).map(drop)
}

fn gltf(bytes: &[u8]) -> Result<()> {
    model::read(&file("mesh.glb", bytes)).map(drop)
}

fn tracks(bytes: &[u8]) -> Result<()> {
    file("tracked/gt/tracks.npz", bytes);
    load(&folder().join("tracked"), &LoadOptions::default()).map(drop)
}

fn read_npy(bytes: &[u8]) -> Result<()> {
    let path = file("array.npy", bytes);
    npy::read(&path)?;
    let points = npy::read_points(&path).map(drop);
    points.or(npy::read_field(&path).map(drop))
}

fn picture(bytes: &[u8]) -> Result<()> {
    let path = file("picture.png", bytes);
    image::read(&path)?;
    image::read_grey(&path)?;
    image::read_mask(&path).map(drop)
}

fn radiance(bytes: &[u8]) -> Result<()> {
    hdr::read_environment(&file("light.exr", bytes)).map(drop)
}

fn depth(bytes: &[u8]) -> Result<()> {
    DepthMap::read(&file("depth.exr", bytes), None).map(drop)
}

fn checkpoint(bytes: &[u8]) -> Result<()> {
    let folder = folder().join("checkpoints");
    file("checkpoints/checkpoint-000001.bin", bytes);
    let found = Checkpoints::open(&folder, "scene".into(), Duration::MAX).newest(&mut |_| {})?;
    let mut session = Session::new(|_, _| Ok(()));
    session.keep_in(Checkpoints::open(&folder, "scene".into(), Duration::MAX), found)?;
    // Shapes and colours, which is what the stages' states are made of.
    session.restore::<(Vec<Vec<glam::DVec3>>, Vec<Vec<[f32; 3]>>)>("track").map(drop)
}

/// A checkpoint that is whole, but whose states are `bytes`.
fn state(bytes: &[u8]) -> Result<()> {
    let (name, bytes) = match bytes.split_first() {
        Some((0, rest)) => ("history", rest),
        _ => ("track", bytes),
    };
    let parts = serde_json::json!([[name, bytes.len()]]);
    let fields =
        serde_json::json!(["tessuto checkpoint 2", env!("CARGO_PKG_VERSION"), "scene", "track 1/2", parts]);
    let mut hash = Sha256::new();
    hash.update(serde_json::to_vec(&fields).expect("plain data"));
    hash.update(bytes);
    let sha256: String = hash.finalize().iter().map(|b| format!("{b:02x}")).collect();
    let header = serde_json::json!({
        "format": fields[0], "program": fields[1], "identity": fields[2], "reached": fields[3],
        "parts": parts, "sha256": sha256
    });
    let mut file = serde_json::to_vec(&header).expect("plain data");
    file.push(b'\n');
    file.extend(bytes);
    checkpoint(&file)
}

fn camera(name: &str, bytes: &[u8]) -> Result<()> {
    let calibration = read_calibration(&file(name, bytes), None)?;
    calibration.scaled_to([640, 480], &mut Vec::new()).map(drop)
}

fn transforms(bytes: &[u8]) -> Result<()> {
    camera("transforms.json", bytes)
}

fn cameras(bytes: &[u8]) -> Result<()> {
    camera("cameras.txt", bytes)
}

fn opencv(bytes: &[u8]) -> Result<()> {
    // Both forms, told apart by their first character.
    camera(if bytes.starts_with(b"{") { "camera.json" } else { "camera.yaml" }, bytes)
}

/// A result folder whose config.json or, after a byte 0, parameters.json is `bytes`.
fn config(bytes: &[u8]) -> Result<()> {
    file("result/config.json", CONFIG.replace("SETTINGS", &default_settings()).as_bytes());
    file("result/parameters.json", PARAMETERS.as_bytes());
    let (name, bytes) = match bytes.split_first() {
        Some((0, rest)) => ("parameters.json", rest),
        _ => ("config.json", bytes),
    };
    file(&format!("result/{name}"), bytes);
    tessuto::result::Folder::open(&folder().join("result")).map(drop)
}

/// The settings of the default preset as JSON.
pub fn default_settings() -> String {
    let config = Config::preset(tessuto::config::Preset::Default);
    serde_json::to_string(&config).expect("plain data")
}

/// config.json of a result, without its settings.
pub const CONFIG: &str = r#"{"version":"0.1.0","scene":"scenes/flag","frames":[0,2],"settings":SETTINGS}"#;

/// parameters.json of a result.
pub const PARAMETERS: &str = r#"{"remark":"effective",
"stretch":{"value":100.0,"unit":"N/m","bounds":[10.0,1000.0],"at_bound":false},
"bend":{"value":0.001,"unit":"J/rad^2","bounds":[1e-4,0.01],"at_bound":false},
"shear":{"value":0.001,"unit":"J/rad^2","bounds":[1e-5,0.01],"at_bound":false},"log10_stiffness":[2.0,-3.0,-3.0],
"constant_force":{"value":[0.0,9.8,0.0],"unit":"m/s^2"},"dynamic_force":{"value":"forces.npy","unit":"m/s^2"},
"dynamic_parts":1,"area_density":{"value":0.1,"unit":"kg/m^2"},"frame_rate":{"value":50.0,"unit":"1/s"},
"camera":{"fx":40.0,"fy":40.0,"cx":11.5,"cy":11.5,"width":24,"height":24},"crop":{"x0":0,"y0":0,"x1":24,"y1":24}}"#;
