//! A tiny good scene in a temporary folder, to change one thing of at a time.
#![allow(dead_code, reason = "the tests of the library and of the program each use their own part")]

use std::path::{Path, PathBuf};

use tessuto::io::image::write_png;
use tessuto::io::{npy, obj};
use tessuto::{Image, Mesh};

/// Width and height of the images [px].
pub const SIZE: usize = 24;
/// Number of frames.
pub const FRAMES: usize = 4;
/// scene.json of the good scene.
pub const SCENE_JSON: &str = r#"{
  "name": "tiny",
  "fps": 25,
  "n_frames": 4,
  "width": 24,
  "height": 24,
  "fx": 40,
  "fy": 40,
  "cx": 11.5,
  "cy": 13.5
}
"#;

/// A scene folder that vanishes with this value.
pub struct TinyScene {
    home: tempfile::TempDir,
}

impl TinyScene {
    /// A scene without any fault: fabric in columns 4..20, rows 6..22, at 1 m.
    pub fn new() -> Self {
        let scene = Self { home: tempfile::tempdir().unwrap() };
        for sub in ["rgbs", "masks"] {
            std::fs::create_dir_all(scene.path(sub)).unwrap();
        }
        scene.put("scene.json", SCENE_JSON);
        obj::write(&scene.path("template.obj"), &template(), None).unwrap();
        for n in 0..FRAMES {
            write_png(&scene.path(&format!("rgbs/rgb_{n:03}.png")), &colour(n)).unwrap();
            write_png(&scene.path(&format!("masks/mask_{n:03}.png")), &mask()).unwrap();
        }
        scene
    }

    /// The scene with true points and vertices.
    pub fn with_truth() -> Self {
        let scene = Self::new();
        std::fs::create_dir_all(scene.path("gt/points")).unwrap();
        let positions = template().positions;
        for n in 0..FRAMES {
            npy::write_points(&scene.path(&format!("gt/points/points_{n:03}.npy")), &positions).unwrap();
        }
        npy::write_field(&scene.path("gt/vertices.npy"), &vec![positions; FRAMES]).unwrap();
        scene
    }

    /// The scene's folder.
    pub fn folder(&self) -> &Path {
        self.home.path()
    }

    /// A path in the scene's folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.home.path().join(name)
    }

    /// Writes a text file.
    pub fn put(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    /// Replaces `from`, which must be there, in a text file.
    pub fn edit(&self, name: &str, from: &str, to: &str) {
        let text = std::fs::read_to_string(self.path(name)).unwrap();
        assert!(text.contains(from), "{name} has no {from:?}");
        self.put(name, &text.replacen(from, to, 1));
    }

    /// Keeps the first half of a file.
    pub fn truncate(&self, name: &str) {
        let bytes = std::fs::read(self.path(name)).unwrap();
        std::fs::write(self.path(name), &bytes[..bytes.len() / 2]).unwrap();
    }

    /// Writes the template with every position changed.
    pub fn move_template(&self, change: impl Fn([f64; 3]) -> [f64; 3]) {
        let mut mesh = template();
        mesh.positions.iter_mut().for_each(|p| *p = change(p.to_array()).into());
        obj::write(&self.path("template.obj"), &mesh, None).unwrap();
    }

    /// Path and content of every file, to see that nothing was written.
    pub fn contents(&self) -> Vec<(PathBuf, Vec<u8>)> {
        contents(self.folder())
    }
}

/// Path and content of every file below `folder`, in order.
pub fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(contents(&path));
        } else {
            files.push((path.clone(), std::fs::read(&path).unwrap_or_default()));
        }
    }
    files.sort();
    files
}

/// 5×5 vertices that project to columns 3.5..19.5, rows 5.5..21.5.
pub fn template() -> Mesh {
    tessuto::mesh::grid(5, 5, [0.4, 0.4].into(), 1.0)
}

/// White fabric on black.
pub fn mask() -> Image {
    paint(1, |x, y, _| f32::from(u8::from(fabric(x, y))))
}

/// Whether a pixel shows fabric.
pub fn fabric(x: usize, y: usize) -> bool {
    (4..20).contains(&x) && (6..22).contains(&y)
}

/// A gradient on the fabric that changes with the frame; black elsewhere.
pub fn colour(frame: usize) -> Image {
    paint(3, |x, y, c| {
        let level = (10 * x + 3 * y + 20 * c + 2 * frame) % 256;
        if fabric(x, y) { level as f32 / 255.0 } else { 0.0 }
    })
}

/// An image of the scene's size from a function of column, row and channel.
pub fn paint(channels: usize, value: impl Fn(usize, usize, usize) -> f32) -> Image {
    let mut image = Image::new(SIZE, SIZE, channels);
    for y in 0..SIZE {
        for x in 0..SIZE {
            for c in 0..channels {
                image.pixel_mut(x, y)[c] = value(x, y, c);
            }
        }
    }
    image
}
