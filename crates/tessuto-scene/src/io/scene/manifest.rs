//! scene.json: strictly read, every value checked; and written.

use std::path::Path;

use glam::DVec3;
use serde::Deserialize;
use serde_json::{Value, json};

use super::back;
use super::planes::{self, ListedPlane};
use super::poses::{self, POSES};
use crate::io::image::MAX_SIDE;
use crate::io::read_bounded;
use crate::io::text::decode;
use tessuto_core::camera::{Camera, Pose, Rect};
use tessuto_core::error::{Error, Hint, Remedy, Result, Warning};
use tessuto_core::scene::{Known, PoseUnit};
use tessuto_core::text::edits;

const KNOWN: [&str; 23] = [
    "name",
    "fps",
    "n_frames",
    "width",
    "height",
    "fx",
    "fy",
    "cx",
    "cy",
    "crop",
    "units",
    "poses",
    "depth_unit",
    "gravity",
    "held",
    "planes",
    "back",
    "notes",
    "rgbs",
    "masks",
    "depth",
    "depth_confidence",
    "views",
];
const EXAMPLE: &str = concat!(
    r#"{"name": "flag", "fps": 50, "n_frames": 40, "width": 640, "height": 480, "#,
    r#""fx": 600, "fy": 600, "cx": 319.5, "cy": 239.5}"#
);
/// A further camera may be late or early by this many frames.
const MOST_LATE: f64 = 2.0;
/// Most frames a scene may have.
const MAX_FRAMES: usize = 100_000;

/// What scene.json says.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Manifest {
    pub name: String,
    /// Frames per second.
    pub fps: f64,
    pub n_frames: usize,
    width: usize,
    height: usize,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    /// The part of the images to keep; the masks decide where it is missing.
    pub crop: Option<Rect>,
    #[serde(default)]
    pub units: Units,
    /// Folders of frames, masks and depth maps.
    #[serde(default = "rgbs")]
    pub rgbs: String,
    #[serde(default = "masks")]
    pub masks: String,
    #[serde(default = "depth")]
    pub depth: String,
    /// Folder of confidence maps of the depth maps.
    pub depth_confidence: Option<String>,
    /// Where the camera is in every frame, where it moves: the name of a file in the folder, or what such a file
    /// holds.
    poses: Option<Value>,
    /// Metres in one unit of the depth maps; what such files usually have where it is missing.
    pub depth_unit: Option<f64>,
    /// Which way gravity pulls, in the camera's frame in frame 0; only its direction counts.
    pub gravity: Option<[f64; 3]>,
    /// Vertices of the template that something holds, numbered from 0.
    pub held: Option<Vec<usize>>,
    /// What the fabric lies on.
    #[serde(default)]
    planes: Vec<ListedPlane>,
    /// What the fabric's other side looks like.
    back: Option<String>,
    /// Anything; what tessuto reads of it is [`camera_doubt`](Self::camera_doubt).
    #[serde(default)]
    notes: Value,
    /// The further cameras that `views` lists, each as the scene of one that is alone.
    #[serde(skip)]
    pub more: Vec<Self>,
    /// How much later than the scene's own camera a further one takes its frames `[s]`.
    #[serde(skip)]
    pub late: f64,
}

fn rgbs() -> String {
    "rgbs".to_owned()
}

fn masks() -> String {
    "masks".to_owned()
}

fn depth() -> String {
    super::depths::FOLDER.to_owned()
}

/// Unit of every length in the folder's files.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
pub(crate) enum Units {
    #[default]
    #[serde(rename = "m")]
    Metres,
    #[serde(rename = "cm")]
    Centimetres,
    #[serde(rename = "mm")]
    Millimetres,
}

impl Units {
    pub const ALL: [Self; 3] = [Self::Metres, Self::Centimetres, Self::Millimetres];

    /// Metres in one unit.
    pub fn scale(self) -> f64 {
        match self {
            Self::Metres => 1.0,
            Self::Centimetres => 0.01,
            Self::Millimetres => 0.001,
        }
    }

    /// As written in scene.json.
    pub fn key(self) -> &'static str {
        match self {
            Self::Metres => "m",
            Self::Centimetres => "cm",
            Self::Millimetres => "mm",
        }
    }
}

impl Manifest {
    /// What a scene.json of these values says, lengths in metres.
    pub fn new(name: String, fps: f64, n_frames: usize, camera: Camera, crop: Option<Rect>) -> Self {
        let Camera { fx, fy, cx, cy, width, height } = camera;
        let units = Units::Metres;
        Self {
            name,
            fps,
            n_frames,
            width,
            height,
            fx,
            fy,
            cx,
            cy,
            crop,
            units,
            rgbs: rgbs(),
            masks: masks(),
            depth: depth(),
            depth_confidence: None,
            poses: None,
            depth_unit: None,
            gravity: None,
            held: None,
            planes: Vec::new(),
            back: None,
            notes: Value::Null,
            more: Vec::new(),
            late: 0.0,
        }
    }

    /// Reads scene.json in `folder`.
    pub fn read(folder: &Path) -> Result<Self> {
        if folder.is_file() {
            let hint = Hint::from("a video becomes a scene first").with(Remedy::Import(folder.to_path_buf()));
            return Err(Error::input(
                folder.display().to_string(),
                "is a file, not the folder of a scene",
                hint,
            ));
        }
        if !folder.is_dir() {
            return Err(Error::input(
                folder.display().to_string(),
                "is not a folder",
                "name the scene's folder, which holds scene.json, template.obj, rgbs/ and masks/",
            ));
        }
        let path = folder.join("scene.json");
        let place = path.display().to_string();
        if !path.exists() {
            return Err(Error::input(place, "does not exist", format!("write it there, e.g. {EXAMPLE}")));
        }
        let bytes = read_bounded(&super::inside(folder, &path)?, 16 << 20)?;
        let manifest = parse(&decode(bytes, &place)?, &place)?;
        manifest.check(&place)?;
        Ok(manifest)
    }

    /// Camera of the full image.
    pub fn camera(&self) -> Camera {
        Camera { fx: self.fx, fy: self.fy, cx: self.cx, cy: self.cy, width: self.width, height: self.height }
    }

    /// What it says of causes, for a template of `vertices` vertices; `place` is where it is from.
    ///
    /// # Errors
    /// [`Error::Input`] for a vertex that is not there.
    pub fn known(&self, vertices: usize, place: &str) -> Result<Known> {
        let mut held = self.held.clone();
        if let Some(held) = &mut held {
            held.sort_unstable();
            held.dedup();
            if let Some(v) = held.last().filter(|v| **v >= vertices) {
                let problem = format!("\"held\" names vertex {v} of a template with {vertices}");
                return Err(Error::input(place, problem, "number vertices from 0, in template.obj's order"));
            }
        }
        let down = self.gravity.map(|g| DVec3::from_array(g).normalize());
        let back = self.back.as_deref().map(|text| back::parse(text, place)).transpose()?;
        Ok(Known { down, held, planes: planes::read(&self.planes, self.units.scale(), place)?, back })
    }

    /// Poses of all frames as they are listed; poses.json counts for the first camera where it is there and nothing is
    /// named. `None` where there are none.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that cannot be read, and for poses that are none.
    pub fn poses(
        &self,
        folder: &Path,
        first: bool,
        warnings: &mut Vec<Warning>,
    ) -> Result<Option<(Vec<Pose>, PoseUnit)>> {
        let (frames, scale) = (self.n_frames, self.units.scale());
        let read = |name: &str, warnings: &mut Vec<Warning>| {
            poses::read(&super::inside(folder, &folder.join(name))?, frames, scale, warnings).map(Some)
        };
        match &self.poses {
            None if first && folder.join(POSES).is_file() => read(POSES, warnings),
            None | Some(Value::Null) => Ok(None),
            Some(Value::String(name)) => read(name, warnings),
            Some(list) => {
                let place = folder.join("scene.json").display().to_string() + ", \"poses\"";
                let found = poses::from_json(list, frames, scale, &place, warnings)?;
                Ok(Some((found, poses::unit(list))))
            }
        }
    }

    /// Standard deviation of the focal length, as a fraction of it, where the notes have it.
    pub fn camera_doubt(&self) -> Option<f64> {
        self.notes.get("camera")?.get("uncertainty")?.as_f64().filter(|doubt| *doubt > 0.0)
    }

    /// Refuses values that no video has; `place` is where they are from.
    pub fn check(&self, place: &str) -> Result<()> {
        for view in &self.more {
            let place = format!("{place}, view {}", view.name);
            view.check(&place)?;
            if view.late.abs() * self.fps > MOST_LATE {
                let problem =
                    format!("\"time_offset\" is {:.2} frames from the first view's", view.late * self.fps);
                let hint = format!("cut the clips to within {MOST_LATE} frames of each other");
                return Err(Error::input(place, problem, hint));
            }
        }
        let demand = |ok: bool, key: &str, value: String, hint: &str| {
            if ok { Ok(()) } else { Err(Error::input(place, format!("\"{key}\" is {value}"), hint)) }
        };
        demand(
            self.fps > 0.0 && self.fps <= 100_000.0,
            "fps",
            self.fps.to_string(),
            "give the frames per second of the video, above 0",
        )?;
        demand(
            (1..=MAX_FRAMES).contains(&self.n_frames),
            "n_frames",
            self.n_frames.to_string(),
            "give the number of frames in rgbs/, 1 to 100000",
        )?;
        for (key, side) in [("width", self.width), ("height", self.height)] {
            let hint = "give the size of the images in pixels, 2 to 16384";
            demand((2..=MAX_SIDE).contains(&side), key, side.to_string(), hint)?;
        }
        for (key, focal) in [("fx", self.fx), ("fy", self.fy)] {
            let hint = "give the focal length in pixels: width / (2 tan(half the horizontal field of view))";
            demand(focal > 0.0 && focal <= 1e6, key, focal.to_string(), hint)?;
        }
        for (key, centre, side) in [("cx", self.cx, self.width), ("cy", self.cy, self.height)] {
            let hint = "give the principal point in pixels, near the middle of the image";
            demand(centre.abs() <= 10.0 * side as f64, key, centre.to_string(), hint)?;
        }
        if let Some(unit) = self.depth_unit {
            let hint = "give the metres in one unit of the depth maps: 0.001 for millimetres";
            demand(unit > 0.0 && unit <= 1e3, "depth_unit", unit.to_string(), hint)?;
        }
        if let Some(gravity) = self.gravity {
            demand(
                DVec3::from_array(gravity).try_normalize().is_some(),
                "gravity",
                format!("{gravity:?}"),
                "give its direction in the camera's frame in frame 0, x to the right, y down, z ahead: [0, 1, 0] \
                 for a level camera",
            )?;
        }
        if let Some(held) = &self.held {
            let hint = "name the vertices of the template that something holds; or leave held out to have them found";
            demand(!held.is_empty(), "held", "empty".into(), hint)?;
        }
        if let Some(Rect { x0, y0, x1, y1 }) = self.crop {
            demand(
                x0 < x1 && y0 < y1 && x1 <= self.width && y1 <= self.height,
                "crop",
                format!("columns {x0}..{x1}, rows {y0}..{y1} of {}×{}", self.width, self.height),
                "x0 < x1 ≤ width and y0 < y1 ≤ height; or leave crop out to take it from the masks",
            )?;
        }
        Ok(())
    }
}

/// Keys that a view has of its own, where it has them; the others hold for the whole scene.
const OF_VIEW: [&str; 13] = [
    "width",
    "height",
    "fx",
    "fy",
    "cx",
    "cy",
    "crop",
    "poses",
    "depth_unit",
    "rgbs",
    "masks",
    "depth",
    "depth_confidence",
];

/// A further view as the text of a scene of its own, and how much later than the first it takes its frames `[s]`.
type Further = (String, f64);

/// `text` with what its first view says, if it lists views, as of the scene itself; and one such text for every
/// further view, and how much later than the first that takes its frames `[s]`. `None` if it lists none.
///
/// # Errors
/// [`Error::Input`] for a list without views, and for keys that a view cannot have.
fn of_views(text: &str, place: &str) -> Result<Option<(String, Vec<Further>)>> {
    let Ok(mut scene) = serde_json::from_str::<Value>(text) else { return Ok(None) };
    let Some(views) = scene.as_object_mut().and_then(|scene| scene.remove("views")) else { return Ok(None) };
    let views: Vec<&Value> = views.as_array().map_or_else(Vec::new, |views| views.iter().collect());
    if views.is_empty() {
        return Err(Error::input(
            place,
            "\"views\" lists 0 views",
            "list one object per camera, or leave it out",
        ));
    }
    let (mut texts, mut offsets) = (Vec::new(), Vec::new());
    for (k, view) in views.into_iter().enumerate() {
        let view = view.as_object();
        let name = view.and_then(|view| view.get("name")).and_then(Value::as_str);
        let name = name.map_or_else(|| format!("view {k}"), str::to_owned);
        let of_view = format!("{place}, view {name}");
        let view = view.ok_or_else(|| {
            Error::input(&of_view, "is no object", r#"write {"name": "left", "rgbs": "left/rgbs", …}"#)
        })?;
        let offset = match view.get("time_offset") {
            None => 0.0,
            Some(value) => value.as_f64().ok_or_else(|| {
                let problem = format!("\"time_offset\" is {value}, not a number of seconds");
                Error::input(&of_view, problem, "give how much later it takes its frames [s]")
            })?,
        };
        offsets.push(offset);
        let mut merged = scene.clone();
        if k > 0 {
            // Of the scene's own camera.
            [
                "crop",
                "poses",
                "depth_unit",
                "rgbs",
                "masks",
                "depth",
                "depth_confidence",
                "gravity",
                "held",
                "planes",
                "back",
                "notes",
            ]
            .iter()
            .filter_map(|key| merged.as_object_mut()?.remove(*key))
            .for_each(drop);
            merged["name"] = json!(name);
        }
        for (key, value) in view.iter().filter(|(key, _)| !["name", "time_offset"].contains(&key.as_str())) {
            if !OF_VIEW.contains(&key.as_str()) {
                let nearest = OF_VIEW.into_iter().min_by_key(|known| edits(key, known)).unwrap_or("fx");
                let hint = format!("did you mean \"{nearest}\"? A view has: {}", OF_VIEW.join(", "));
                return Err(Error::input(of_view, format!("unknown key \"{key}\""), hint));
            }
            merged[key] = value.clone();
        }
        let folders = ["rgbs", "masks"].map(|key| merged.get(key).cloned());
        if k > 0 && folders.iter().any(Option::is_none) {
            let hint = r#"name its folders: "rgbs": "right/rgbs", "masks": "right/masks""#;
            return Err(Error::input(of_view, "names no folder of its frames and masks", hint));
        }
        texts.push(merged.to_string());
    }
    let (first, start) = (texts.remove(0), offsets.remove(0));
    let late = offsets.into_iter().map(|offset| offset - start);
    Ok(Some((first, texts.into_iter().zip(late).collect())))
}

/// The manifest in `text`; messages name line and nearest key.
fn parse(text: &str, place: &str) -> Result<Manifest> {
    let Some((first, more)) = of_views(text, place)? else { return parse_one(text, place) };
    let mut manifest = parse_one(&first, place)?;
    let view = |(text, late): &Further| Ok(Manifest { late: *late, ..parse_one(text, place)? });
    manifest.more = more.iter().map(view).collect::<Result<_>>()?;
    Ok(manifest)
}

fn parse_one(text: &str, place: &str) -> Result<Manifest> {
    let error = match serde_json::from_str::<Manifest>(text) {
        Ok(manifest) => return Ok(manifest),
        Err(error) => error,
    };
    let line = text.lines().nth(error.line().saturating_sub(1)).unwrap_or_default().trim();
    let line: String = line.chars().take(80).collect();
    let message = error.to_string();
    let message = message.split(" at line ").next().unwrap_or_default();
    let hint = if message.starts_with("unknown field") {
        let unknown = message.split('`').nth(1).unwrap_or_default();
        format!(
            "did you mean \"{}\"? Known keys: {}; put anything else under \"notes\"",
            nearest(unknown),
            KNOWN.join(", ")
        )
    } else if message.starts_with("missing field") {
        format!("add the key, e.g. {EXAMPLE}")
    } else {
        "correct this line".to_string()
    };
    let message = message.split(", expected one of").next().unwrap_or_default();
    Err(Error::input(format!("{place}:{}", error.line()), format!("{message}, in: {line}"), hint))
}

/// The known key with the fewest edits to `key`.
fn nearest(key: &str) -> &'static str {
    KNOWN.into_iter().min_by_key(|known| edits(key, known)).unwrap_or("name")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_causes_are_read_and_refused_where_they_cannot_be() {
        let with = |key: &str| EXAMPLE.replacen('{', &format!("{{{key}, "), 1);
        let read = |key: &str| {
            let manifest = parse(&with(key), "scene.json")?;
            manifest.check("scene.json")?;
            manifest.known(9, "scene.json")
        };
        let known = read(r#""gravity": [0, 3, 4], "held": [7, 0, 7]"#).unwrap();
        assert!(known.down.unwrap().distance(DVec3::new(0.0, 0.6, 0.8)) < 1e-12);
        assert_eq!(known.held.unwrap(), [0, 7]);
        assert_eq!(parse(EXAMPLE, "").unwrap().known(9, "").unwrap(), Known::default());
        for wrong in [r#""gravity": [0, 0, 0]"#, r#""held": []"#, r#""held": [9]"#, r#""held": [-1]"#] {
            let error = read(wrong).unwrap_err().to_string();
            assert!(error.contains("gravity") || error.contains("held"), "{error}");
        }
    }

    #[test]
    fn the_first_view_is_the_scenes_own() {
        let text = r#"{"name": "flag", "fps": 50, "n_frames": 40, "width": 640, "height": 480,
            "views": [{"name": "left", "rgbs": "left/rgbs", "masks": "left/masks", "fx": 600, "fy": 600,
            "cx": 319.5, "cy": 239.5, "poses": "left/poses.json", "time_offset": 0}]}"#;
        let manifest = parse(text, "scene.json").unwrap();
        let folders = [&manifest.rgbs, &manifest.masks, &manifest.depth];
        assert_eq!(
            (manifest.fx, folders),
            (600.0, ["left/rgbs", "left/masks", "depth"].map(str::to_owned).each_ref())
        );
        assert_eq!(manifest.name, "flag");
        let two = text.replace("0}]", "0}, {}]");
        assert!(parse(&two, "scene.json").unwrap_err().to_string().contains("names no folder"));
        let two = text.replace(
            "0}]",
            r#"0}, {"rgbs": "r/rgbs", "masks": "r/masks", "fx": 9, "fy": 9, "cx": 1, "cy": 2}]"#,
        );
        let both = parse(&two, "scene.json").unwrap();
        let other = &both.more[0];
        assert_eq!((both.fx, other.fx, other.n_frames, other.width), (600.0, 9.0, 40, 640));
        assert_eq!((both.more.len(), other.name.as_str(), other.poses.is_none()), (1, "view 1", true));
        let late = two.replace(r#""cx": 1,"#, r#""cx": 1, "time_offset": 0.01,"#);
        let late = parse(&late, "scene.json").unwrap();
        assert_eq!(late.more[0].late, 0.01);
        late.check("scene.json").unwrap();
        let early = two.replace(r#""time_offset": 0}"#, r#""time_offset": 0.5}"#);
        let early = parse(&early, "scene.json").unwrap();
        assert!(early.check("s").unwrap_err().to_string().contains("is -25.00 frames from the first"));
    }

    #[test]
    fn nearest_key_is_the_one_meant() {
        for (typed, meant) in [("widht", "width"), ("FPS", "fps"), ("frames", "n_frames"), ("unit", "units")]
        {
            assert_eq!(nearest(typed), meant);
        }
    }
}
