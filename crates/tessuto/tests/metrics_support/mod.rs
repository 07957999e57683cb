//! What the metrics tests share: the recorded scenes and a smooth, made-up motion.
#![allow(dead_code, reason = "each test file uses its part")]

use std::path::{Path, PathBuf};

use glam::DVec3;
use tessuto::mesh::Face;
use tessuto::{Camera, Mesh, Shape, Truth};

/// A scene without its images.
pub struct Data {
    pub camera: Camera,
    pub template: Mesh,
    pub truth: Truth,
}

/// The recorded scene `name`; None, with a printed line, where the data is not there.
pub fn load(name: &str) -> Option<Data> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if !folder.exists() {
        assert!(std::env::var("CI").is_err(), "{} is missing", folder.display());
        println!("skipped: {} is missing", folder.display());
        return None;
    }
    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("scene.json")).unwrap()).unwrap();
    let number = |key: &str| json[key].as_f64().unwrap();
    let camera = Camera {
        fx: number("fx"),
        fy: number("fy"),
        cx: number("cx"),
        cy: number("cy"),
        width: number("width") as usize,
        height: number("height") as usize,
    };
    let frames = number("n_frames") as usize;
    let points = (0..frames).map(|k| vectors(&folder.join(format!("gt/points/points_{k:03}.npy")))).collect();
    let template = mesh(&folder.join("template.obj"));
    let file = folder.join("gt/vertices.npy");
    let vertices = file
        .exists()
        .then(|| vectors(&file).chunks_exact(template.positions.len()).map(<[DVec3]>::to_vec).collect());
    Some(Data { camera, template, truth: Truth { points: Some(points), vertices } })
}

/// `template` with a travelling wave of 3 cm in each direction.
pub fn wave(template: &[DVec3], frames: usize) -> Vec<Shape> {
    let moved = |f: usize| {
        let t = f as f64;
        template
            .iter()
            .map(|p| {
                *p + 0.03
                    * DVec3::new(
                        (7.0 * p.x + 0.1 * t).sin(),
                        (9.0 * p.y - 0.2 * t).sin(),
                        (5.0 * p.x + 6.0 * p.y + 0.15 * t).sin(),
                    )
            })
            .collect()
    };
    (0..frames).map(moved).collect()
}

fn vectors(path: &PathBuf) -> Vec<DVec3> {
    let bytes = std::fs::read(path).unwrap();
    let file = npyz::NpyFile::new(&bytes[..]).unwrap();
    let values: Vec<f32> = file.into_vec().unwrap();
    values.chunks_exact(3).map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into())).collect()
}

fn mesh(path: &PathBuf) -> Mesh {
    let mut mesh = Mesh { positions: Vec::new(), uvs: Vec::new(), faces: Vec::new() };
    for line in std::fs::read_to_string(path).unwrap().lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.first() {
            Some(&"v") => {
                let v: Vec<f64> = words[1..4].iter().map(|w| w.parse().unwrap()).collect();
                mesh.positions.push(DVec3::from_slice(&v));
            }
            Some(&"f") => {
                let corner = |w: &&str| w.split('/').next().unwrap().parse::<u32>().unwrap() - 1;
                mesh.faces.push(Face { vertices: words[1..].iter().map(corner).collect(), uvs: Vec::new() });
            }
            _ => {}
        }
    }
    mesh
}
