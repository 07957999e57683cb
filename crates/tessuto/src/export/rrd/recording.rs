//! A recording that is being written.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use glam::DVec3;
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::chunk::{Chunk, Column, Times};
use super::index::Index;
use super::subject::{Corners, FrameImage, Subject, rgb_bytes, small};
use super::wire::{FRAME, Id, Store};
use tessuto_core::camera::{Camera, Pose};
use tessuto_core::error::{Error, Result};
use tessuto_core::image::Image;
use tessuto_core::mesh::Positions;
use tessuto_estimate::session::Epoch;

/// Curves are written after this many steps, and at the end of a stage: a chunk of one row is mostly metadata.
const STEPS_TOGETHER: usize = 16;
/// Shapes of a stage that are written on `step`.
const SHAPES_PER_STAGE: usize = 20;
/// Frames encoded at once, and most bytes of positions in a chunk.
const FRAMES_TOGETHER: usize = 16;
const CHUNK_BYTES: usize = 1 << 20;
/// Largest side of the texture `[px]`, which is stored as plain bytes.
const TEXTURE_SIDE: usize = 1024;
/// Most measured points shown of a frame; their radius `[m]` and colour.
const TRUTH_POINTS: usize = 4000;
const TRUTH_RADIUS: f32 = 0.001;
const TRUTH_COLOUR: u32 = 0xFF8C_00FF;
/// The video stands behind the fabric, at this multiple of the template's largest depth.
const IMAGE_DISTANCE: f64 = 1.2;

const CAMERA: &str = "world/camera";
const OTHER_CAMERAS: &str = "world/cameras";
const FABRIC: &str = "world/fabric";
const TRUTH: &str = "world/truth";
/// Right, down, forward: x, y, z of the camera.
const RIGHT_DOWN_FORWARD: [u8; 3] = [3, 2, 5];

/// See the [module](super). Dropped before [`end`](Self::end), it leaves a readable recording of what was done.
pub struct Recording<W: Write> {
    out: W,
    /// Named in errors.
    place: PathBuf,
    store: Store,
    /// Unique numbers of this recording: a part of its own, and a counter.
    next: Id,
    corners: Corners,
    fps: f64,
    first_frame: usize,
    /// Finished steps of all stages.
    steps: i64,
    /// Rows of curves that wait, by entity.
    curves: BTreeMap<String, (Vec<i64>, Vec<f64>)>,
    waiting: usize,
    /// Bytes written, and what is in them.
    written: u64,
    index: Index,
}

impl<W: Write> Recording<W> {
    /// Writes the video, the camera, the template and the true points to `out`. `place` is what errors name; recordings
    /// with the same `id` are one for the viewer.
    ///
    /// # Errors
    /// [`Error::Output`]; those of reading the frames.
    pub fn begin(out: W, place: &Path, id: &str, subject: &Subject) -> Result<Self> {
        // Viewers keep what they made of a row under its number, across recordings.
        let digest = Sha256::digest(id);
        let own = u64::from_be_bytes(std::array::from_fn(|k| digest[k])) >> 1;
        let mut recording = Self {
            out,
            place: place.to_path_buf(),
            store: Store::new(id),
            next: [own, 1],
            corners: Corners::new(subject.mesh),
            fps: subject.fps,
            first_frame: subject.first_frame,
            steps: 0,
            curves: BTreeMap::new(),
            waiting: 0,
            written: 0,
            index: Index::default(),
        };
        let row = recording.take(1);
        let opening = recording.store.opening(row);
        recording.send(&opening)?;
        recording
            .fixed("__properties", vec![Column::texts(["RecordingInfo", "name"], "Name", &[subject.name])])?;
        recording.fixed("world", vec![Column::axes(["ViewCoordinates", "xyz"], RIGHT_DOWN_FORWARD)])?;
        let triangles = Column::triangles(&recording.corners.triangles);
        let uvs = Column::floats(["Mesh3D", "vertex_texcoords"], "Texcoord2D", 1, &recording.corners.uvs);
        recording.fixed(FABRIC, vec![triangles, uvs])?;
        recording.camera(CAMERA, &subject.camera, subject.poses, subject)?;
        recording.path(CAMERA, subject.poses.unwrap_or_default(), 0.0)?;
        recording.video(CAMERA, (&subject.camera, subject.image.as_ref(), 0.0), subject)?;
        for other in &subject.others {
            let entity = format!("{OTHER_CAMERAS}/{}", part(other.name));
            recording.camera(&entity, &other.camera, Some(other.poses), subject)?;
            recording.path(&entity, other.poses, other.late)?;
            recording.video(&entity, (&other.camera, other.image.as_ref(), other.late), subject)?;
        }
        recording.truth(subject)?;
        // Something to see before the first motion.
        recording.shapes(&[0], std::slice::from_ref(&subject.mesh.positions))?;
        Ok(recording)
    }

    /// Records a finished step, and a few times in each stage of the last frame of the motion so far, which may be
    /// empty.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn step(&mut self, epoch: &Epoch, motion: &[Positions]) -> Result<()> {
        self.steps += 1;
        for (kind, values) in [("losses", &epoch.losses), ("parameters", &epoch.parameters)] {
            for (name, value) in values {
                let entity = format!("{kind}/{}/{}", part(&epoch.stage), part(name));
                let (steps, rows) = self.curves.entry(entity).or_default();
                steps.push(self.steps);
                rows.push(*value);
            }
        }
        self.waiting += 1;
        let last = epoch.step == epoch.of;
        if self.waiting >= STEPS_TOGETHER || last {
            self.write_curves()?;
        }
        match motion.last() {
            Some(vertices)
                if last || epoch.step.is_multiple_of(epoch.of.div_ceil(SHAPES_PER_STAGE).max(1)) =>
            {
                let times = vec![Times::Sequence("step", vec![self.steps])];
                let positions = [self.corners.of(vertices)];
                let columns = vec![Column::points(["Mesh3D", "vertex_positions"], &positions)];
                self.write(&Chunk { entity: FABRIC, times, columns })
            }
            _ => Ok(()),
        }
    }

    /// Writes the motion [N, V] m, from the first frame on.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn motion(&mut self, motion: &[Positions]) -> Result<()> {
        let frames: Vec<usize> = (0..motion.len()).collect();
        self.motion_at(&frames, motion)
    }

    /// Writes the motion [N, V] m at `frames` `[N]`, counted from the first of the recording. The viewer shows the
    /// frame before where one is left out.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn motion_at(&mut self, frames: &[usize], motion: &[Positions]) -> Result<()> {
        let bytes = 12 * self.corners.vertices.len().max(1);
        let together = (CHUNK_BYTES / bytes).max(1);
        for (frames, shapes) in frames.chunks(together).zip(motion.chunks(together)) {
            self.shapes(frames, shapes)?;
        }
        Ok(())
    }

    /// Writes the texture of the fabric, sRGB-encoded, shape [h, w, 3]; smaller if a side is above 1024 px.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn texture(&mut self, image: &Image) -> Result<()> {
        let [shorter, longer] = [image.width.min(image.height), image.width.max(image.height)];
        let factor = longer.div_ceil(TEXTURE_SIDE).clamp(1, shorter.max(1));
        let image = if factor > 1 { &image.downsampled(factor) } else { image };
        let size = [image.width as u32, image.height as u32];
        let pixels = [rgb_bytes(image)];
        self.fixed(
            FABRIC,
            vec![
                Column::blobs(["Mesh3D", "albedo_texture_buffer"], "ImageBuffer", &pixels),
                Column::rgb_format(["Mesh3D", "albedo_texture_format"], size),
            ],
        )
    }

    /// The recording is whole.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn end(mut self) -> Result<()> {
        self.write_curves()?;
        let index = std::mem::take(&mut self.index).finish();
        self.send(&self.store.ending(&index, self.written))
    }

    /// The pinhole of `camera`; its image stands behind the template, where it is in the first of its `poses`.
    fn camera(
        &mut self,
        entity: &str,
        camera: &Camera,
        poses: Option<&[Pose]>,
        subject: &Subject,
    ) -> Result<()> {
        let c = small(camera);
        let first = if entity == CAMERA { None } else { poses.and_then(<[Pose]>::first) };
        let depth = |p: &DVec3| first.map_or(p.z, |pose| (pose.rotation * *p + pose.translation).z);
        let depth = subject.mesh.positions.iter().map(depth).fold(0.0, f64::max);
        // By columns. Here pixel centres are at whole numbers, in the viewer pixel corners are.
        let matrix = [[c.fx, 0.0, 0.0, 0.0, c.fy, 0.0, c.cx + 0.5, c.cy + 0.5, 1.0].map(|v| v as f32)];
        let resolution = [[c.width as f32, c.height as f32]];
        let distance = (IMAGE_DISTANCE * depth) as f32;
        self.fixed(
            entity,
            vec![
                Column::floats(["Pinhole", "image_from_camera"], "PinholeProjection", 1, &matrix),
                Column::floats(["Pinhole", "resolution"], "Resolution", 1, &resolution),
                Column::axes(["Pinhole", "camera_xyz"], RIGHT_DOWN_FORWARD),
                Column::float(["Pinhole", "image_plane_distance"], "ImagePlaneDistance", distance),
            ],
        )
    }

    /// Where a camera is in every frame, which it takes `late` by so many seconds.
    fn path(&mut self, entity: &str, poses: &[Pose], late: f64) -> Result<()> {
        if poses.is_empty() {
            return Ok(());
        }
        let back: Vec<Pose> = poses.iter().map(Pose::inverse).collect();
        let places: Vec<[f32; 3]> = back.iter().map(|pose| pose.translation.as_vec3().to_array()).collect();
        // By columns.
        let turns: Vec<[f32; 9]> = back.iter().map(|pose| pose.rotation.as_mat3().to_cols_array()).collect();
        let columns = vec![
            Column::floats(["Transform3D", "translation"], "Translation3D", poses.len(), &places),
            Column::floats(["Transform3D", "mat3x3"], "TransformMat3x3", poses.len(), &turns),
        ];
        self.write(&Chunk { entity, times: self.frames(0..poses.len(), late), columns })
    }

    /// What a camera filmed, below its `entity`.
    fn video(
        &mut self,
        entity: &str,
        (camera, image, late): (&Camera, Option<&FrameImage>, f64),
        subject: &Subject,
    ) -> Result<()> {
        let Some(image) = image else { return Ok(()) };
        let entity = format!("{entity}/image");
        for start in (0..subject.frame_count).step_by(FRAMES_TOGETHER) {
            let range = start..(start + FRAMES_TOGETHER).min(subject.frame_count);
            let encoded = range.clone().into_par_iter().map(|n| subject.encoded(image, camera, n));
            let files: Vec<Vec<u8>> = encoded.collect::<Result<_>>()?;
            let columns = vec![
                Column::blobs(["EncodedImage", "blob"], "Blob", &files),
                Column::texts(["EncodedImage", "media_type"], "MediaType", &vec!["image/jpeg"; files.len()]),
            ];
            self.write(&Chunk { entity: &entity, times: self.frames(range, late), columns })?;
        }
        Ok(())
    }

    fn truth(&mut self, subject: &Subject) -> Result<()> {
        let Some(truth) = subject.truth else { return Ok(()) };
        self.fixed(
            TRUTH,
            vec![
                Column::float(["Points3D", "radii"], "Radius", TRUTH_RADIUS),
                Column::colour(["Points3D", "colors"], TRUTH_COLOUR),
            ],
        )?;
        for (k, frames) in truth.chunks(FRAMES_TOGETHER).enumerate() {
            let some = |points: &Positions| -> Vec<[f32; 3]> {
                let stride = points.len().div_ceil(TRUTH_POINTS).max(1);
                points.iter().step_by(stride).map(|p| p.as_vec3().to_array()).collect()
            };
            let points: Vec<_> = frames.iter().map(some).collect();
            let start = k * FRAMES_TOGETHER;
            let times = self.frames(start..start + frames.len(), 0.0);
            let columns = vec![Column::points(["Points3D", "positions"], &points)];
            self.write(&Chunk { entity: TRUTH, times, columns })?;
        }
        Ok(())
    }

    /// `shapes` at `frames`.
    fn shapes(&mut self, frames: &[usize], shapes: &[Positions]) -> Result<()> {
        let positions: Vec<_> = shapes.iter().map(|vertices| self.corners.of(vertices)).collect();
        let columns = vec![Column::points(["Mesh3D", "vertex_positions"], &positions)];
        self.write(&Chunk { entity: FABRIC, times: self.frames(frames.iter().copied(), 0.0), columns })
    }

    /// Times of frames, counted from the first of the recording, that are taken `late` by so many seconds.
    fn frames(&self, frames: impl Iterator<Item = usize>, late: f64) -> Vec<Times> {
        let numbers: Vec<i64> = frames.map(|n| (self.first_frame + n) as i64).collect();
        let nanoseconds = |n: &i64| ((*n as f64 / self.fps + late) * 1e9).round() as i64;
        let nanoseconds = numbers.iter().map(nanoseconds).collect();
        vec![Times::Sequence("frame", numbers), Times::Duration("time", nanoseconds)]
    }

    fn write_curves(&mut self) -> Result<()> {
        self.waiting = 0;
        for (entity, (steps, values)) in std::mem::take(&mut self.curves) {
            let times = vec![Times::Sequence("step", steps)];
            self.write(&Chunk { entity: &entity, times, columns: vec![Column::scalars(values)] })?;
        }
        Ok(())
    }

    /// What holds always.
    fn fixed(&mut self, entity: &str, columns: Vec<Column>) -> Result<()> {
        self.write(&Chunk { entity, times: Vec::new(), columns })
    }

    fn write(&mut self, chunk: &Chunk) -> Result<()> {
        let id = self.take(1);
        let row = self.take(chunk.rows());
        let arrow = chunk.encode(id, row);
        let bytes = self.store.chunk(id, chunk.times.is_empty(), &arrow);
        let body = bytes.len() as u64 - FRAME;
        self.index.add(chunk, id, [self.written + FRAME, body, arrow.len() as u64]);
        self.send(&bytes)
    }

    /// The first of `count` unique numbers.
    fn take(&mut self, count: usize) -> Id {
        let first = self.next;
        self.next[1] += count as u64;
        first
    }

    fn send(&mut self, bytes: &[u8]) -> Result<()> {
        self.written += bytes.len() as u64;
        let sent = self.out.write_all(bytes).and_then(|()| self.out.flush());
        sent.map_err(|source| {
            // Nothing may follow half a message.
            self.curves.clear();
            Error::Output { path: self.place.clone(), source }
        })
    }
}

impl<W: Write> Drop for Recording<W> {
    /// An interrupted run leaves its last steps too.
    fn drop(&mut self) {
        // Nobody is left to hear of a failure.
        let _ = self.write_curves();
    }
}

/// `name` as a part of an entity's path, where some characters would need escapes.
fn part(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || c == '_' || c == '-' { c } else { '_' }).collect()
}
