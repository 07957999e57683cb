//! Recordings for rerun, read back message by message: framing, ids, and every value that was written.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::Path;

use crate::support::seamed::seamed;
use arrow_array::cast::AsArray;
use arrow_array::types::{
    DurationNanosecondType, Float32Type, Float64Type, Int64Type, UInt8Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, RecordBatch};
use glam::DVec3;
use tessuto::export::rrd::{Recording, Subject, is_ours};
use tessuto::export::{Clip, Format, Material, export};
use tessuto::motion::parameters::Parameters;
use tessuto::result::OtherCamera;
use tessuto::session::{Epoch, named};
use tessuto::sim::Accelerations;
use tessuto::{Camera, Image, Mesh, Motion, Pose, Positions, Rect};

const CAMERA: Camera = Camera { fx: 700.0, fy: 650.0, cx: 300.0, cy: 250.0, width: 640, height: 480 };
const CROP: Rect = Rect { x0: 20, y0: 30, x1: 84, y1: 78 };

/// Where the further camera is.
const RIGHT: Pose = Pose { rotation: glam::DMat3::IDENTITY, translation: DVec3::new(-0.5, 0.0, 0.25) };

fn moved(mesh: &Mesh, n: usize) -> Positions {
    let depth = |p: &DVec3| 0.1 * n as f64 * (5.0 * p.x + 0.3 * n as f64).sin() + 0.02 * p.y;
    mesh.positions.iter().map(|p| *p + DVec3::Z * depth(p)).collect()
}

/// Where the camera is in frame `n`.
fn pose(n: usize) -> Pose {
    let turn = glam::DMat3::from_rotation_y(1e-4 * n as f64);
    Pose { rotation: turn, translation: DVec3::new(1e-4 * n as f64, 0.0, 0.0) }
}

fn epoch(stage: &'static str, step: usize, of: usize) -> Epoch {
    let losses = named([("total", 1.0 / step as f64), ("out line", step as f64)]);
    Epoch { stage: stage.into(), step, of, losses, parameters: named([("bend", 0.1)]), ..Epoch::default() }
}

/// One chunk.
struct Chunk {
    entity: String,
    is_static: bool,
    batch: RecordBatch,
    /// Offset and length of the message's body, length of the Arrow data.
    place: [usize; 3],
}

impl Chunk {
    /// Values of an index column.
    fn index(&self, name: &str) -> Vec<i64> {
        let array = self.batch.column_by_name(name).unwrap_or_else(|| panic!("no {name} in {}", self.entity));
        match array.as_primitive_opt::<Int64Type>() {
            Some(numbers) => numbers.values().to_vec(),
            None => array.as_primitive::<DurationNanosecondType>().values().to_vec(),
        }
    }

    fn has(&self, column: &str) -> bool {
        self.batch.column_by_name(column).is_some()
    }

    /// The list of a component in row `row`.
    fn list(&self, column: &str, row: usize) -> ArrayRef {
        self.batch.column_by_name(column).unwrap().as_list::<i32>().value(row)
    }

    /// Its vectors of floats, one after the other.
    fn floats(&self, column: &str, row: usize) -> Vec<f32> {
        let vectors = self.list(column, row);
        vectors.as_fixed_size_list().values().as_primitive::<Float32Type>().values().to_vec()
    }

    /// Its only file.
    fn blob(&self, column: &str, row: usize) -> Vec<u8> {
        let files = self.list(column, row);
        assert_eq!(files.len(), 1);
        files.as_list::<i32>().value(0).as_primitive::<UInt8Type>().values().to_vec()
    }
}

/// Fields of a protobuf message: number, and bytes or number.
fn fields(mut bytes: &[u8]) -> Vec<(u64, Vec<u8>, u64)> {
    fn varint(bytes: &mut &[u8]) -> u64 {
        let (mut value, mut shift) = (0, 0);
        loop {
            let byte = bytes[0];
            *bytes = &bytes[1..];
            value |= u64::from(byte & 0x7F) << shift;
            shift += 7;
            if byte < 0x80 {
                return value;
            }
        }
    }
    let mut out = Vec::new();
    while !bytes.is_empty() {
        let key = varint(&mut bytes);
        let (data, number) = match key & 7 {
            0 => (Vec::new(), varint(&mut bytes)),
            kind => {
                let length = if kind == 1 { 8 } else { varint(&mut bytes) as usize };
                let (data, rest) = bytes.split_at(length);
                bytes = rest;
                (data.to_vec(), 0)
            }
        };
        out.push((key >> 3, data, number));
    }
    out
}

fn bytes_of(fields: &[(u64, Vec<u8>, u64)], field: u64) -> &[u8] {
    &fields.iter().find(|(k, ..)| *k == field).unwrap_or_else(|| panic!("no field {field}")).1
}

fn number_of(fields: &[(u64, Vec<u8>, u64)], field: u64) -> u64 {
    fields.iter().find(|(k, ..)| *k == field).unwrap_or_else(|| panic!("no field {field}")).2
}

/// The chunks of a stream up to the last whole message, whether the end mark follows, and where the messages end.
fn parse(bytes: &[u8]) -> (Vec<Chunk>, bool, Vec<usize>) {
    assert_eq!(&bytes[..12], b"RRF2\0\x24\0\0\0\x02\0\0");
    let (mut at, mut chunks, mut ends, mut store) = (12, Vec::new(), Vec::new(), Vec::new());
    let mut ids = BTreeSet::new();
    while bytes.len() >= at + 16 {
        let word = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
        let (kind, length) = (word(at), word(at + 8) as usize);
        let Some(body) = bytes.get(at + 16..at + 16 + length) else { break };
        at += 16 + length;
        ends.push(at);
        let message = fields(body);
        match kind {
            0 => {
                // Where the index is, its checksum, the mark.
                let footer = &bytes[at..];
                if footer.is_empty() {
                    ends.pop();
                    break;
                }
                check_index(&fields(bytes_of(&message, 1)), &store, &chunks);
                let place = [at - length, length].map(|n| (n as u64).to_le_bytes()).concat();
                assert_eq!((&footer[..16], &footer[20..]), (&place[..], &b"RRF2FOOT\x01\0\0\0"[..]));
                return (chunks, true, ends);
            }
            1 => {
                assert!(store.is_empty(), "one recording");
                store = bytes_of(&fields(bytes_of(&message, 2)), 2).to_vec();
                let named = fields(&store);
                assert_eq!(number_of(&named, 1), 1);
                assert_eq!(bytes_of(&fields(bytes_of(&named, 3)), 1), b"tessuto");
            }
            2 => {
                assert_eq!(bytes_of(&message, 1), store);
                let arrow = bytes_of(&message, 5);
                // Not compressed, Arrow IPC.
                assert_eq!([2, 3, 4].map(|k| number_of(&message, k)), [1, arrow.len() as u64, 1]);
                let mut reader = arrow_ipc::reader::StreamReader::try_new(arrow, None).unwrap();
                let batch = reader.next().unwrap().unwrap();
                assert!(reader.next().is_none());
                let schema = batch.schema();
                let id = fields(bytes_of(&message, 6));
                let [high, low] = [1, 2].map(|k| u64::from_le_bytes(bytes_of(&id, k).try_into().unwrap()));
                assert_eq!(schema.metadata()["rerun:id"], format!("chunk_{high:016X}{low:016x}"));
                assert!(ids.insert([high.to_be_bytes(), low.to_be_bytes()].concat()));
                let rows = batch.column(0).as_fixed_size_binary();
                assert_eq!(
                    (schema.field(0).name().as_str(), rows.value_length()),
                    ("rerun.controls.RowId", 16)
                );
                for row in rows.iter() {
                    let row = row.unwrap().to_vec();
                    assert!(ids.last().is_some_and(|last| *last < row) && ids.insert(row), "ids rise");
                }
                let is_static = number_of(&message, 7) == 1;
                let indices =
                    schema.fields().iter().filter(|f| f.metadata()["rerun:kind"] == "index").count();
                assert_eq!(is_static, indices == 0);
                chunks.push(Chunk {
                    place: [at - length, length, arrow.len()],
                    entity: schema.metadata()["rerun:entity_path"].clone(),
                    is_static,
                    batch,
                });
            }
            _ => panic!("message of kind {kind}"),
        }
    }
    (chunks, false, ends)
}

/// The index says of every chunk what is in it and where.
fn check_index(index: &[(u64, Vec<u8>, u64)], store: &[u8], chunks: &[Chunk]) {
    assert_eq!(bytes_of(index, 1), store);
    let table = fields(bytes_of(index, 4));
    let mut reader = arrow_ipc::reader::StreamReader::try_new(bytes_of(&table, 2), None).unwrap();
    let table = reader.next().unwrap().unwrap();
    assert_eq!(table.num_rows(), chunks.len());
    let column = |name: &str| table.column_by_name(name).unwrap_or_else(|| panic!("no column {name}"));
    let number = |name: &str, k: usize| column(name).as_primitive::<UInt64Type>().value(k) as usize;
    for (k, chunk) in chunks.iter().enumerate() {
        assert_eq!(column("chunk_entity_path").as_string::<i32>().value(k), chunk.entity);
        assert_eq!(column("chunk_is_static").as_boolean().value(k), chunk.is_static);
        assert_eq!(number("chunk_num_rows", k), chunk.batch.num_rows());
        let names = ["chunk_byte_offset", "chunk_byte_size", "chunk_byte_size_uncompressed"];
        assert_eq!(names.map(|name| number(name, k)), chunk.place);
        let name = "Mesh3D:vertex_positions";
        let starts = column(&format!("frame:{name}:start")).as_primitive::<Int64Type>();
        let has = chunk.has(name) && chunk.has("frame");
        assert_eq!(starts.is_valid(k).then(|| starts.value(k)), has.then(|| chunk.index("frame")[0]));
        let rows = if has { chunk.batch.num_rows() } else { 0 };
        assert_eq!(number(&format!("frame:{name}:num_rows"), k), rows);
        let surface = "Mesh3D:triangle_indices";
        assert_eq!(column(&format!("{surface}:has_static_data")).as_boolean().value(k), chunk.has(surface));
    }
}

fn of<'a>(chunks: &'a [Chunk], entity: &str, column: &str) -> Vec<&'a Chunk> {
    chunks.iter().filter(|c| c.entity == entity && c.has(column)).collect()
}

/// Positions of `shape` with the three vertices of the seam again.
fn corners(shape: &Positions) -> Vec<f32> {
    shape.iter().chain([2, 7, 12].map(|v| &shape[v])).flat_map(|p| p.as_vec3().to_array()).collect()
}

#[test]
fn an_exported_result_is_read_back_as_it_was() {
    let (mesh, folder) = (seamed(), tempfile::tempdir().unwrap());
    // Two chunks of positions.
    let frames = 6000;
    let print: Vec<f32> = (0..36).map(|k| k as f32 / 51.0).collect();
    let images: Vec<_> = (0..frames).map(|n| folder.path().join(format!("{}.png", n % 2))).collect();
    for (path, grey) in images.iter().zip([0.2, 0.8]) {
        let image = Image { width: 64, height: 48, channels: 3, data: vec![grey; 64 * 48 * 3] };
        tessuto::io::image::write_png(path, &image).unwrap();
    }
    // One frame was lost.
    let kept: Vec<usize> = (0..frames).filter(|n| *n != 3).collect();
    let clip = Clip {
        name: "cloth".into(),
        version: "0.0".into(),
        motion: Motion::new(kept.iter().map(|n| moved(&mesh, *n)).collect()).unwrap(),
        frames: kept,
        frame_count: frames,
        verdicts: Vec::new(),
        fps: 25.0,
        first_frame: 7,
        camera: CAMERA,
        poses: Some((0..frames).map(pose).collect()),
        others: vec![OtherCamera {
            name: "the right".into(),
            camera: CAMERA,
            poses: vec![RIGHT; frames],
            crop: Rect { x0: 100, y0: 40, x1: 164, y1: 88 },
            late: 0.004,
        }],
        back: None,
        other_images: vec![images.clone()],
        crop: CROP,
        images,
        video: None,
        environment: None,
        fabric: None,
        held: Vec::new(),
        material: Material {
            name: "cloth".into(),
            base_colour: Image { width: 4, height: 3, channels: 3, data: print },
            roughness_metallic: None,
        },
        parameters: Parameters {
            model: tessuto::sim::Model::Springs,
            log_stiffness: vec![2.0, -3.0, -4.0],
            accelerations: Accelerations {
                constant: DVec3::Y,
                dynamic: vec![],
                entries_per_frame: 1,
                wind: None,
            },
        },
        seen: Vec::new(),
        mesh,
    };
    export(&clip, &[Format::Rrd], folder.path(), false).unwrap();
    let path = folder.path().join("cloth.rrd");
    let bytes = std::fs::read(&path).unwrap();
    assert!(is_ours(&bytes[..512]));
    let (chunks, whole, _) = parse(&bytes);
    assert!(whole);

    // The motion, exactly; the first frame comes twice, as template and as motion.
    let mut found = vec![None; frames];
    let positions = of(&chunks, "/world/fabric", "Mesh3D:vertex_positions");
    assert!(positions.len() > 2 && positions.iter().all(|c| !c.is_static));
    for chunk in &positions {
        for (row, (frame, time)) in chunk.index("frame").into_iter().zip(chunk.index("time")).enumerate() {
            assert_eq!(time, frame * 40_000_000);
            found[frame as usize - 7] = Some(chunk.floats("Mesh3D:vertex_positions", row));
        }
    }
    for (n, positions) in clip.frames.iter().zip(clip.motion.iter()) {
        assert_eq!(found[*n].as_ref().unwrap(), &corners(positions), "frame {n}");
    }
    assert_eq!(found[3], None);
    assert_ne!(found[1], found[2]);

    // The surface: triangles of the template, and each corner's own texture coordinate.
    let surface = of(&chunks, "/world/fabric", "Mesh3D:triangle_indices")[0];
    assert!(surface.is_static);
    let triangles = surface.list("Mesh3D:triangle_indices", 0);
    let triangles = triangles.as_fixed_size_list().values().as_primitive::<UInt32Type>().values().to_vec();
    let uvs = surface.floats("Mesh3D:vertex_texcoords", 0);
    let expected = clip.mesh.triangles().concat().into_iter().zip(clip.mesh.triangle_uvs().concat());
    assert_eq!(triangles.len(), 48);
    for (corner, (vertex, uv)) in triangles.iter().map(|k| *k as usize).zip(expected) {
        assert_eq!(if corner < 15 { corner as u32 } else { [2, 7, 12][corner - 15] }, vertex);
        let uv = clip.mesh.uvs[uv as usize];
        assert_eq!(
            uvs[2 * corner..2 * corner + 2],
            [uv.x as f32, 1.0 - uv.y as f32],
            "row 0 is v = 0 in rerun"
        );
    }
    let texture = of(&chunks, "/world/fabric", "Mesh3D:albedo_texture_buffer")[0];
    let pixels: Vec<u8> = (0..36).map(|k| 5 * k).collect();
    assert_eq!(texture.blob("Mesh3D:albedo_texture_buffer", 0), pixels);
    let format = texture.list("Mesh3D:albedo_texture_format", 0);
    let side =
        |name: &str| format.as_struct().column_by_name(name).unwrap().as_primitive::<UInt32Type>().value(0);
    assert_eq!([side("width"), side("height")], [4, 3]);

    // The camera of the crop, pixel corners at whole numbers.
    let camera = of(&chunks, "/world/camera", "Pinhole:image_from_camera")[0];
    let matrix = camera.floats("Pinhole:image_from_camera", 0);
    assert_eq!(matrix, [700.0, 0.0, 0.0, 0.0, 650.0, 0.0, 280.5, 220.5, 1.0]);
    assert_eq!(camera.floats("Pinhole:resolution", 0), [64.0, 48.0]);
    let moved = of(&chunks, "/world/camera", "Transform3D:translation")[0];
    assert_eq!((moved.index("frame")[5], moved.is_static), (12, false));
    let back = pose(5).inverse();
    assert_eq!(moved.floats("Transform3D:translation", 5), back.translation.as_vec3().to_array());
    assert_eq!(moved.floats("Transform3D:mat3x3", 5), back.rotation.as_mat3().to_cols_array());
    let video = of(&chunks, "/world/camera/image", "EncodedImage:blob");
    let numbers: Vec<i64> = video.iter().flat_map(|c| c.index("frame")).collect();
    assert_eq!(numbers, (7..7 + frames as i64).collect::<Vec<_>>());
    for (row, expected) in [51u8, 204].into_iter().enumerate() {
        let file = folder.path().join("frame.jpg");
        std::fs::write(&file, video[0].blob("EncodedImage:blob", row)).unwrap();
        let image = tessuto::io::image::read_bytes(&file).unwrap();
        assert_eq!([image.width, image.height], [64, 48]);
        assert!(image.data.iter().all(|v| v.abs_diff(expected) < 4));
        assert_eq!(video[0].list("EncodedImage:media_type", row).as_string::<i32>().value(0), "image/jpeg");
    }

    // The further camera: its own crop, place, images and times.
    let right = of(&chunks, "/world/cameras/the_right", "Pinhole:image_from_camera")[0];
    let matrix = right.floats("Pinhole:image_from_camera", 0);
    assert_eq!(matrix, [700.0, 0.0, 0.0, 0.0, 650.0, 0.0, 200.5, 210.5, 1.0]);
    let placed = of(&chunks, "/world/cameras/the_right", "Transform3D:translation")[0];
    assert_eq!(placed.floats("Transform3D:translation", 9), [0.5, 0.0, -0.25]);
    assert_eq!([placed.index("frame")[9], placed.index("time")[9]], [16, 16 * 40_000_000 + 4_000_000]);
    let video = of(&chunks, "/world/cameras/the_right/image", "EncodedImage:blob");
    assert_eq!(video.iter().map(|c| c.index("frame").len()).sum::<usize>(), frames);
    assert_eq!(video[0].index("time")[0], 7 * 40_000_000 + 4_000_000);
    let distance = |camera: &Chunk| {
        camera.list("Pinhole:image_plane_distance", 0).as_primitive::<Float32Type>().value(0)
    };
    let behind = distance(right) - distance(camera);
    assert!((behind - 1.2 * 0.25).abs() < 1e-5, "its image stands behind the sheet as it sees it: {behind}");

    export(&clip, &[Format::Rrd], folder.path(), true).unwrap();
    assert!(std::fs::read(&path).unwrap() == bytes, "same clip, same bytes");
}

/// A run of 40 steps and two frames, ended properly or not.
fn run(out: impl Write, ended: bool) -> tessuto::Result<()> {
    let mesh = seamed();
    let truth: Vec<Positions> = vec![vec![DVec3::ONE; 2], vec![DVec3::ONE; 3]];
    let subject = Subject {
        name: "cloth",
        mesh: &mesh,
        fps: 50.0,
        first_frame: 3,
        frame_count: 2,
        camera: CAMERA,
        poses: None,
        image: None,
        others: Vec::new(),
        truth: Some(&truth),
    };
    let mut recording = Recording::begin(out, Path::new("run.rrd"), "tessuto-1", &subject)?;
    for k in 1..=20 {
        recording.step(&epoch("texture", k, 20), &[])?;
    }
    for k in 1..=20 {
        recording.step(&epoch("track", k, 60), &[moved(&mesh, k), moved(&mesh, k + 1)])?;
    }
    if !ended {
        return Ok(());
    }
    recording.motion(&[moved(&mesh, 0), moved(&mesh, 50)])?;
    let stripes = (0..1100 * 4 * 3).map(|k| if k / 3 % 2 == 0 { 0.2 } else { 0.6 }).collect();
    recording.texture(&Image { width: 1100, height: 4, channels: 3, data: stripes })?;
    recording.end()
}

#[test]
fn a_run_leaves_its_steps_whenever_it_ends() {
    let [mut killed, mut ended, mut again] = [vec![], vec![], vec![]];
    run(&mut killed, false).unwrap();
    run(&mut ended, true).unwrap();
    run(&mut again, true).unwrap();
    assert!(ended == again, "same run, same bytes");
    let chunks = parse(&ended).0;
    let texture = of(&chunks, "/world/fabric", "Mesh3D:albedo_texture_buffer")[0];
    let pixels = texture.blob("Mesh3D:albedo_texture_buffer", 0);
    assert!(pixels.len() == 550 * 2 * 3 && pixels.iter().all(|v| *v == 102), "made smaller, by means");
    for (bytes, is_whole) in [(&killed, false), (&ended, true)] {
        let (chunks, whole, ends) = parse(bytes);
        assert_eq!(whole, is_whole);
        for (stage, first) in [("texture", 1), ("track", 21)] {
            let chunks = of(&chunks, &format!("/losses/{stage}/total"), "Scalars:scalars");
            let steps: Vec<i64> = chunks.iter().flat_map(|c| c.index("step")).collect();
            assert_eq!(steps, (first..first + 20).collect::<Vec<_>>(), "{stage}");
            let rows =
                chunks.iter().flat_map(|c| (0..c.batch.num_rows()).map(|k| c.list("Scalars:scalars", k)));
            let values: Vec<f64> = rows.map(|l| l.as_primitive::<Float64Type>().value(0)).collect();
            assert_eq!(values, (1..=20).map(|k| 1.0 / f64::from(k)).collect::<Vec<_>>());
        }
        assert_eq!(of(&chunks, "/losses/track/out_line", "Scalars:scalars").len(), 2);
        assert!(!of(&chunks, "/parameters/track/bend", "Scalars:scalars").is_empty());
        // Every third of 60 steps, with the last frame of the motion so far.
        let shapes = of(&chunks, "/world/fabric", "step");
        let steps: Vec<i64> = shapes.iter().flat_map(|c| c.index("step")).collect();
        assert_eq!(steps, [23, 26, 29, 32, 35, 38]);
        assert_eq!(shapes[0].floats("Mesh3D:vertex_positions", 0), corners(&moved(&seamed(), 4)));
        let truth = of(&chunks, "/world/truth", "Points3D:positions")[0];
        assert_eq!((truth.index("frame"), truth.index("time")), (vec![3, 4], vec![60_000_000, 80_000_000]));
        assert_eq!([0, 1].map(|row| truth.list("Points3D:positions", row).len()), [2, 3]);
        // Stopped anywhere, all messages before are there.
        for cut in (12..bytes.len()).step_by(997) {
            let (_, whole, found) = parse(&bytes[..cut]);
            assert!(!whole && found[..] == ends[..ends.partition_point(|e| *e <= cut)]);
        }
    }
}

/// Takes some bytes, then none.
struct Full<'a>(&'a mut Vec<u8>, usize);

impl Write for Full<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let taken = bytes.len().min(self.1 - self.0.len());
        self.0.extend(&bytes[..taken]);
        if taken == 0 { Err(std::io::ErrorKind::StorageFull.into()) } else { Ok(taken) }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_full_disk_is_an_output_error_and_what_was_written_stays_readable() {
    let mut whole = Vec::new();
    run(&mut whole, true).unwrap();
    for room in (1..whole.len()).step_by(1501) {
        let mut written = Vec::new();
        let error = run(Full(&mut written, room), true).unwrap_err();
        assert!(error.exit_code() == 5 && error.to_string().contains("run.rrd"), "{error}");
        assert!(written == whole[..room]);
    }
}
