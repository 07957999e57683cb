//! What is exported, read from a result folder.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};

use crate::result::{Folder, Measured, OtherCamera, of_other};
use tessuto_core::camera::{Camera, Pose, Rect};
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::image::{Image, srgb};
use tessuto_core::mesh::{Mesh, Motion, Positions, Side, vertex_normals, vertex_uvs};
use tessuto_core::scene::Back;
use tessuto_estimate::io;
use tessuto_estimate::metrics::{FrameVerdict, State};
use tessuto_estimate::motion::parameters::Parameters;

/// Largest file of a light that is taken along `[bytes]`.
const LARGEST_LIGHT: u64 = 256 << 20;

/// The images that make up the look.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Start of the images' file names; other programs confuse images of equal names.
    pub name: String,
    /// Base colour, sRGB-encoded, shape [h, w, 3].
    pub base_colour: Image,
    /// Roughness and metallic, linear, shape [h, w, 1] each; without them the fabric is matt.
    pub roughness_metallic: Option<[Image; 2]>,
}

impl Material {
    /// File name of image `kind`.
    pub(super) fn file(&self, kind: &str) -> String {
        format!("{}_{kind}.png", self.name)
    }

    /// The images as files.
    pub(super) fn files(&self) -> Vec<(String, Vec<u8>)> {
        let mut files = vec![(self.file("basecolor"), io::image::encode_png(&self.base_colour))];
        if let Some([roughness, metallic]) = &self.roughness_metallic {
            files.push((self.file("roughness"), io::image::encode_png(roughness)));
            files.push((self.file("metallic"), io::image::encode_png(metallic)));
        }
        files
    }
}

/// The other side of a fabric that has one colour there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlainBack {
    /// Linear base colour: the albedo where the maps were estimated, the colour as filmed else.
    pub colour: [f32; 3],
    /// Whether the print is on the side that the triangles' normals point to.
    pub outward: bool,
}

impl PlainBack {
    /// That of a result, as its maps show it if there are any and `lit` is asked for.
    ///
    /// # Errors
    /// Those of reading the maps.
    pub(crate) fn of(folder: &Folder, lit: bool) -> Result<Option<Self>> {
        let Back::Plain(filmed) = folder.back else { return Ok(None) };
        let albedo = if lit { folder.material()?.and_then(|maps| maps.back) } else { None };
        let colour = albedo.or(filmed.map(|colour| colour.map(srgb::decode)));
        let outward = Side::front(&folder.mesh, &folder.viewpoint(0)).sign() < 0;
        Ok(colour.map(|colour| Self { colour, outward }))
    }
}

/// Name, shape and numbers of an array.
pub type NamedArray = (&'static str, Vec<usize>, Vec<f32>);

/// A recovered motion with all that other programs can take of it.
#[derive(Debug, Clone)]
pub struct Clip {
    /// Start of all file names: letters, digits, `_` and `-`, no digit first.
    pub name: String,
    /// Version of the program that made it.
    pub version: String,
    /// The template.
    pub mesh: Mesh,
    /// Positions `[m]`, in the frame of the camera in the first frame of the video, shape [N, V].
    pub motion: Motion,
    /// Where each of these N frames is in the clip, counted from its first frame, ascending. Its time is this / `fps`.
    pub frames: Vec<usize>,
    /// Frames of the whole clip, N and those that were left out.
    pub frame_count: usize,
    /// The verdict on every frame of the whole clip; empty where there is none.
    pub verdicts: Vec<FrameVerdict>,
    /// Frames per second.
    pub fps: f64,
    /// Number of the first frame in the video.
    pub first_frame: usize,
    /// Camera of the whole image.
    pub camera: Camera,
    /// Where it was in every frame of the whole clip, if it moved; at the origin else.
    pub poses: Option<Vec<Pose>>,
    /// Further cameras, where they are in every frame of the video.
    pub others: Vec<OtherCamera>,
    /// Images of each further camera, as `images`.
    pub other_images: Vec<Vec<PathBuf>>,
    /// The part of the whole image that was computed on.
    pub crop: Rect,
    /// Images of all frames of the whole clip, cut to the crop; none if the result lacks some.
    pub images: Vec<PathBuf>,
    /// First frame of the video, in the scene's folder, where that is known.
    pub video: Option<PathBuf>,
    /// The recovered light, where there is one: an OpenEXR file.
    pub environment: Option<Vec<u8>>,
    /// The look.
    pub material: Material,
    /// The other side, if it has one colour.
    pub back: Option<PlainBack>,
    /// Stiffnesses and forces.
    pub parameters: Parameters,
    /// Stiffnesses per width, of results with causes.
    pub fabric: Option<Measured>,
    /// Vertices that something holds, of results with causes, ascending.
    pub held: Vec<usize>,
    /// How often what was seen, where that is known: name, shape, numbers.
    pub seen: Vec<NamedArray>,
}

impl Clip {
    /// That of a result: `material/` where it exists, `texture.png` otherwise.
    ///
    /// # Errors
    /// [`Error::Input`] naming the file.
    pub fn of(folder: &Folder) -> Result<Self> {
        let name = identifier(&folder.run.name());
        let motion = folder.motion()?.clone();
        let first_frame = folder.run.frames[0];
        let frame_count = motion.len();
        let verdicts = folder.metrics()?.map_or_else(Vec::new, |m| m.verdicts.clone());
        Ok(Self {
            material: read_material(folder.path(), &name)?,
            back: PlainBack::of(folder, true)?,
            environment: environment(folder.path())?,
            video: first_image(&folder.run.scene, first_frame),
            name,
            images: images(&folder.path().join("pictures"), first_frame, frame_count),
            other_images: (0..folder.others.len())
                .map(|k| images(&folder.path().join(of_other(k)), first_frame, frame_count))
                .collect(),
            version: folder.run.version.clone(),
            mesh: folder.mesh.clone(),
            motion,
            frames: (0..frame_count).collect(),
            frame_count,
            verdicts,
            fps: folder.fps,
            first_frame,
            camera: folder.camera,
            poses: folder.poses.clone(),
            others: folder.others.clone(),
            crop: folder.crop,
            parameters: folder.parameters.clone(),
            fabric: folder.measured(),
            held: folder.found.as_ref().map_or_else(Vec::new, |found| found.held.clone()),
            seen: seen(folder.path())?,
        })
    }

    /// The clip without the frames that are lost; all others keep their times.
    ///
    /// # Errors
    /// [`Error::Input`] if no frame has a verdict, or all are lost.
    pub fn without_lost(self) -> Result<Self> {
        let place = format!("result {}", self.name);
        if self.verdicts.is_empty() {
            let problem = "holds no verdicts on its frames: metrics.json does not say which are lost";
            let hint = "export all frames, or reconstruct the scene again, which judges them";
            return Err(Error::input(place, problem, hint));
        }
        let lost: BTreeSet<usize> =
            self.verdicts.iter().filter(|v| v.state == State::Lost).map(|v| v.frame).collect();
        let kept = |k: &usize| !lost.contains(&(self.first_frame + self.frames[*k]));
        let kept: Vec<usize> = (0..self.frames.len()).filter(kept).collect();
        if kept.is_empty() {
            let hint = "export all of them, or reconstruct a part of the scene";
            return Err(Error::input(
                place,
                "has no frame that is not lost",
                Hint::from(hint).with(Remedy::Frames(None)),
            ));
        }
        let motion = Motion::new(kept.iter().map(|k| self.motion[*k].clone()).collect())?;
        let frames = kept.iter().map(|k| self.frames[*k]).collect();
        Ok(Self { motion, frames, ..self })
    }

    /// Name of the file of the light.
    pub(super) fn environment_file(&self) -> String {
        format!("{}_environment.exr", self.name)
    }

    /// Numbers in the video of the frames that were left out, ascending.
    pub fn left_out(&self) -> Vec<usize> {
        let absent = |n: &usize| self.frames.binary_search(n).is_err();
        (0..self.frame_count).filter(absent).map(|n| self.first_frame + n).collect()
    }

    /// Time `[s]` of frame `k` of the motion.
    pub(super) fn time(&self, k: usize) -> f32 {
        (self.frames[k] as f64 / self.fps) as f32
    }

    /// Where the camera is at frame `k` of the motion, with y up, as it looks along −z: world from camera. `None` if it
    /// stands at the origin.
    pub(super) fn camera_y_up(&self, k: usize) -> Option<Pose> {
        Some(Self::turned_y_up(&self.poses.as_ref()?[self.frames[k]]))
    }

    /// The same of a further camera; one pose of one that stands still.
    pub(super) fn path_y_up(&self, other: &OtherCamera) -> Vec<Pose> {
        let poses = self.frames.iter().map(|n| &other.poses[*n]);
        let still = poses.clone().all(|pose| *pose == other.poses[self.frames[0]]);
        poses.take(if still { 1 } else { usize::MAX }).map(Self::turned_y_up).collect()
    }

    fn turned_y_up(pose: &Pose) -> Pose {
        let back = pose.inverse();
        // Both frames are turned about x by half a turn.
        let turn = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        Pose { rotation: turn * back.rotation * turn, translation: turn * back.translation }
    }

    /// `positions` with y up.
    pub(super) fn y_up(positions: &Positions) -> Vec<Vec3> {
        positions.iter().map(|p| Vec3::new(p.x as f32, -p.y as f32, -p.z as f32)).collect()
    }

    /// Unit vertex normals with y up: means of the triangles' normals, weighted by area; z where there is none.
    pub(super) fn normals(&self, positions: &Positions) -> Vec<Vec3> {
        let y_up =
            |n: DVec3| if n == DVec3::ZERO { Vec3::Z } else { n.as_vec3() * Vec3::new(1.0, -1.0, -1.0) };
        vertex_normals(&self.mesh.triangles(), positions).into_iter().map(y_up).collect()
    }

    /// One texture coordinate per vertex, if no vertex has several.
    pub(super) fn vertex_uvs(&self) -> Option<Vec<Vec2>> {
        vertex_uvs(&self.mesh, 0.0).map(|uvs| uvs.into_iter().map(DVec2::as_vec2).collect())
    }
}

/// `name`, made safe for file names and USD prims.
pub(super) fn identifier(name: &str) -> String {
    let safe: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    match safe.chars().next() {
        Some(c) if !c.is_ascii_digit() && safe.chars().any(|c| c != '_') => safe,
        _ => format!("fabric{}", if safe.is_empty() { String::new() } else { format!("_{safe}") }),
    }
}

/// The video in a folder of pictures.
fn images(pictures: &Path, first: usize, count: usize) -> Vec<PathBuf> {
    let path = |n| pictures.join(format!("observed/frame_{n:03}.png"));
    let paths: Vec<PathBuf> = (first..first + count).map(path).collect();
    if paths.iter().all(|p| p.is_file()) { paths } else { Vec::new() }
}

/// Image `number` of the scene in `folder`.
fn first_image(folder: &Path, number: usize) -> Option<PathBuf> {
    let is = |path: &PathBuf| {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        stem.strip_prefix("rgb_").and_then(|digits| digits.parse().ok()) == Some(number)
    };
    std::fs::read_dir(folder.join("rgbs")).ok()?.filter_map(|entry| Some(entry.ok()?.path())).filter(is).min()
}

/// How often vertices, texels and directions of light were seen.
fn seen(folder: &Path) -> Result<Vec<NamedArray>> {
    let files = [
        ("seen_vertices", "seen_vertices.npy"),
        ("seen_texels", "seen_texels.npy"),
        ("seen_directions", "seen_directions.npy"),
    ];
    let there = files.into_iter().map(|(name, file)| (name, folder.join(file))).filter(|(_, p)| p.is_file());
    let read = |(name, path): (&'static str, PathBuf)| {
        let array = io::npy::read(&path)?;
        Ok((name, array.shape, array.data.iter().map(|v| *v as f32).collect()))
    };
    there.map(read).collect()
}

/// The file of the light that was estimated.
fn environment(folder: &Path) -> Result<Option<Vec<u8>>> {
    let path = folder.join("material/environment.exr");
    if !path.is_file() {
        return Ok(None);
    }
    // What is no light is refused here, not by the program that opens it.
    io::hdr::read_environment(&path)?;
    io::read_bounded(&path, LARGEST_LIGHT).map(Some)
}

fn read_material(folder: &Path, name: &str) -> Result<Material> {
    let map = |file: &str| folder.join("material").join(file);
    let diffuse = map("diffuse.png");
    if !diffuse.is_file() {
        let base_colour = io::image::read(&folder.join("texture.png"))?;
        return Ok(Material { name: name.to_owned(), base_colour, roughness_metallic: None });
    }
    let scalar = |file: &str| io::image::read_grey(&map(file));
    let (base_colour, roughness, metallic) =
        (io::image::read(&diffuse)?, scalar("roughness.png")?, scalar("metallic.png")?);
    // glTF packs the two into one image.
    if (roughness.width, roughness.height) != (metallic.width, metallic.height) {
        return Err(Error::input(
            map("metallic.png").display().to_string(),
            format!(
                "is {}×{} pixels, roughness.png {}×{}",
                metallic.width, metallic.height, roughness.width, roughness.height
            ),
            "give both maps one size",
        ));
    }
    Ok(Material { name: name.to_owned(), base_colour, roughness_metallic: Some([roughness, metallic]) })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use tessuto_sim::Accelerations;

    /// One frame of `mesh`, grey.
    pub(in super::super) fn clip(mesh: Mesh) -> Clip {
        let base_colour = Image { width: 2, height: 2, channels: 3, data: vec![0.5; 12] };
        Clip {
            name: "cloth".into(),
            version: "0".into(),
            motion: Motion::new(vec![mesh.positions.clone()]).unwrap(),
            frames: vec![0],
            frame_count: 1,
            verdicts: Vec::new(),
            fps: 25.0,
            first_frame: 0,
            camera: Camera { fx: 50.0, fy: 50.0, cx: 16.0, cy: 12.0, width: 32, height: 24 },
            poses: None,
            others: Vec::new(),
            other_images: Vec::new(),
            crop: Rect { x0: 0, y0: 0, x1: 32, y1: 24 },
            images: Vec::new(),
            video: None,
            environment: None,
            material: Material { name: "cloth".into(), base_colour, roughness_metallic: None },
            back: None,
            parameters: Parameters {
                model: tessuto_sim::Model::Springs,
                log_stiffness: vec![2.0, -3.0, -4.0],
                accelerations: Accelerations { constant: DVec3::Y, ..Accelerations::zeros(1, 1, 0) },
            },
            fabric: None,
            held: Vec::new(),
            seen: Vec::new(),
            mesh,
        }
    }

    #[test]
    fn names_are_safe_for_files_and_prims() {
        for (name, expected) in
            [("S1", "S1"), ("my curtain.2", "my_curtain_2"), ("3 flags", "fabric_3_flags"), ("…", "fabric__")]
        {
            assert_eq!(identifier(name), expected);
        }
    }

    #[test]
    fn normals_are_unit_and_face_the_side_of_the_winding() {
        let clip = clip(tessuto_core::mesh::grid(4, 3, glam::DVec2::new(0.3, 0.2), 1.0));
        // The grid's polygons run counter-clockwise for the camera's axes, which look along +z.
        let expected = {
            let [a, b, c] = clip.mesh.triangles()[0].map(|v| Clip::y_up(&clip.motion[0])[v as usize]);
            (b - a).cross(c - a).normalize()
        };
        for normal in clip.normals(&clip.motion[0]) {
            assert!((normal - expected).length() < 1e-6);
        }
    }
}
