//! Where the camera was in every frame, from the files of other programs.

mod arkit;
mod colmap;
mod estimate;
mod nerfstudio;
mod own;

use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};
use serde_json::Value;

use super::Settings;
use super::names::name;
use crate::io::{read_bounded, text::decode};
use tessuto_core::camera::Pose;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::scene::PoseUnit;

/// Most bytes of a file of poses.
const MOST: u64 = 256 << 20;
/// Poses that a message names at most.
const NAMED: usize = 3;

pub use estimate::{
    FrameFit, Known, Mistake, PoseFit, by_colmap, from_clip, pose_fit, refined, refined_or_not,
};

/// One pose of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entry {
    /// Name of the frame's image, with or without folders and ending.
    name: Option<String>,
    /// Place of the frame in the video, from 0.
    number: Option<usize>,
    camera_from_world: Pose,
}

/// What a file says of the camera's way.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPath {
    /// The file, for messages.
    place: String,
    entries: Vec<Entry>,
    /// Lengths are metres.
    metric: bool,
    /// Which way is up in the file's world, where it says so.
    up: Option<DVec3>,
}

/// A kind of file.
struct Reader {
    /// Names of the files and the program that writes them, for messages.
    about: &'static str,
    /// The file that a folder holds; the folder itself where it is empty.
    inside: &'static [&'static str],
    knows: fn(&Contents) -> bool,
    read: fn(&Contents) -> Result<CameraPath>,
}

/// A file of poses.
struct Contents {
    path: PathBuf,
    place: String,
    bytes: Vec<u8>,
    /// Where it is a text.
    text: Option<String>,
    /// Where that is JSON.
    json: Option<Value>,
}

/// The kinds of files; the first that knows a file reads it.
const READERS: [&Reader; 7] = [
    &own::READER,
    &nerfstudio::READER,
    &colmap::TEXT,
    &colmap::BINARY,
    &arkit::STRAY,
    &arkit::RECORD3D,
    &arkit::POLYCAM,
];

/// The files of poses that are read, in words.
pub fn pose_files() -> String {
    READERS.map(|reader| reader.about).join(", ")
}

/// Reads the poses in `path`, a file of one of the kinds that [`pose_files`] names or a folder that holds one.
///
/// # Errors
/// [`Error::Input`] naming what cannot be read.
pub fn read_path(path: &Path) -> Result<CameraPath> {
    let names = READERS.iter().flat_map(|reader| reader.inside);
    let inside = names.map(|name| path.join(name)).find(|file| path.is_dir() && file.exists());
    let contents = Contents::read(inside.as_deref().unwrap_or(path))?;
    match READERS.iter().find(|reader| (reader.knows)(&contents)) {
        Some(reader) => (reader.read)(&contents),
        None => {
            let hint = format!("files of poses are {}", pose_files());
            Err(Error::input(contents.place, "is not a file of camera poses that can be read", hint))
        }
    }
}

impl Contents {
    fn read(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let bytes = if path.is_dir() { Vec::new() } else { read_bounded(path, MOST)? };
        let text = decode(bytes.clone(), &place).ok();
        let json =
            text.as_ref().and_then(|text| serde_json::from_str(text.trim_start_matches('\u{feff}')).ok());
        Ok(Self { path: path.to_path_buf(), place, bytes, text, json })
    }

    fn name(&self) -> String {
        name(&self.path).to_lowercase()
    }
}

/// The images of the input, in their order: names where they have some, and how many there are.
pub(super) struct Inputs<'a> {
    pub names: Option<&'a [PathBuf]>,
    pub count: usize,
}

impl CameraPath {
    /// Number of poses.
    pub(super) fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether its poses differ.
    pub(super) fn moves(&self) -> bool {
        self.entries.iter().any(|entry| entry.camera_from_world != self.entries[0].camera_from_world)
    }

    /// Whether its lengths are metres, once scaled as `settings` say.
    pub(super) fn unit(&self, settings: &Settings) -> PoseUnit {
        if self.metric || settings.pose_scale.is_some() { PoseUnit::Metres } else { PoseUnit::Unknown }
    }

    /// The poses of the frames `chosen` of the input alone, in their order. Paired by name, else by number, else one by
    /// one.
    ///
    /// # Errors
    /// [`Error::Input`] if frames have no pose.
    pub(super) fn of(&self, inputs: &Inputs, chosen: &[usize]) -> Result<Self> {
        let of = self.pairing(inputs)?;
        let entry = |n: &usize| {
            of(*n).cloned().ok_or_else(|| {
                let of_image =
                    inputs.names.and_then(|names| names.get(*n)).map(|path| format!(" ({})", name(path)));
                let problem = format!("has no pose of frame {n}{}", of_image.unwrap_or_default());
                let hint = Hint::from("leave out the frames that have none, or estimate their poses, too");
                Error::input(&self.place, problem, hint.with(Remedy::Frames(None)))
            })
        };
        Ok(Self { entries: chosen.iter().map(entry).collect::<Result<_>>()?, ..self.clone() })
    }

    /// camera_from_world of all poses, scaled as `settings` say, and the direction of gravity in the frame of the first
    /// of them, where the file tells it.
    pub(super) fn poses(&self, settings: &Settings) -> (Vec<Pose>, Option<DVec3>) {
        let scale = settings.pose_scale.unwrap_or(1.0);
        let of_entry = |entry: &Entry| {
            let pose = entry.camera_from_world;
            Pose { translation: pose.translation * scale, ..pose }
        };
        let poses: Vec<Pose> = self.entries.iter().map(of_entry).collect();
        let down = self.up.map(|up| poses[0].rotation * -up);
        (poses, down)
    }

    /// Which entry is of a frame of the input.
    fn pairing<'a>(&'a self, inputs: &'a Inputs) -> Result<Box<dyn Fn(usize) -> Option<&'a Entry> + 'a>> {
        let stem = |name: &str| {
            let file = name.rsplit(['/', '\\']).next().unwrap_or(name);
            file.rsplit_once('.').map_or(file, |(stem, _)| stem).to_lowercase()
        };
        let named: std::collections::BTreeMap<String, &Entry> =
            self.entries.iter().filter_map(|entry| Some((stem(entry.name.as_ref()?), entry))).collect();
        if let Some(names) = inputs.names {
            let names: Vec<String> = names.iter().map(|path| stem(&name(path))).collect();
            if names.iter().any(|name| named.contains_key(name)) {
                return Ok(Box::new(move |n| named.get(&names[n]).copied()));
            }
        }
        if self.entries.len() == inputs.count {
            return Ok(Box::new(|n| self.entries.get(n)));
        }
        if self.entries.iter().all(|entry| entry.number.is_some()) {
            return Ok(Box::new(|n| self.entries.iter().find(|entry| entry.number == Some(n))));
        }
        let some: Vec<&str> =
            self.entries.iter().filter_map(|entry| entry.name.as_deref()).take(NAMED).collect();
        let problem = format!(
            "holds {} poses of other names ({}…) than the input's {} frames",
            self.entries.len(),
            some.join(", "),
            inputs.count
        );
        Err(Error::input(&self.place, problem, "import the images that the poses were estimated of"))
    }
}

/// The pose of a camera that is at `place` with the axes `turn` in the world; `looks_back`: along −z with y up, as
/// OpenGL has it.
fn from_camera(turn: DMat3, place: DVec3, looks_back: bool) -> Pose {
    let axes = if looks_back { DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)) } else { DMat3::IDENTITY };
    Pose { rotation: turn * axes, translation: place }.inverse()
}

/// The rotation of a quaternion x, y, z, w.
///
/// # Errors
/// [`Error::Input`] at `place` if it is none.
fn quaternion([x, y, z, w]: [f64; 4], place: &str) -> Result<DMat3> {
    let q = DQuat::from_xyzw(x, y, z, w);
    if !q.is_finite() || (q.length() - 1.0).abs() > 0.01 {
        let problem = format!("{x} {y} {z} {w} is no quaternion of a rotation");
        return Err(Error::input(place, problem, "restore the file"));
    }
    Ok(DMat3::from_quat(q.normalize()))
}

/// A number in JSON.
///
/// # Errors
/// [`Error::Input`] at `place` if `value` is none.
fn number(value: &Value, key: &str, place: &str) -> Result<f64> {
    let found = value.as_f64().filter(|v| v.is_finite());
    found.ok_or_else(|| Error::input(place, format!("{key} is {value}, not a number"), "restore the file"))
}

#[cfg(test)]
mod tests;
