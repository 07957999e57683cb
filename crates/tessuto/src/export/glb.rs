//! glTF 2.0, binary: the frames as morph targets of one mesh, with normals, uv and a metallic-roughness material.
//!
//! Viewers hold about 256 targets, so a longer clip is cut into segments, each a mesh of its own that is
//! visible (scale 1) during its time and has scale 0 otherwise. Neighbouring segments share a frame: nothing is lost.
//!
//! Source: Khronos Group, *glTF 2.0 Specification*, 2021.

use std::collections::BTreeMap;

use glam::{DQuat, Vec3};
use serde_json::{Value, json};

use super::Clip;
use super::row::{Output, Row};
use tessuto_core::camera::{Camera, Pose};
use tessuto_core::image::Image;
use tessuto_estimate::io::image::encode_png;

/// Most morph targets of one mesh.
const MAX_TARGETS: usize = 256;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// The binary chunk and the tables that point into it.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffer {
    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.bytes.extend(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, view: usize, component: u32, kind: &str, count: usize) -> usize {
        self.accessors
            .push(json!({"bufferView": view, "componentType": component, "type": kind, "count": count}));
        self.accessors.len() - 1
    }

    fn floats(&mut self, values: &[f32], kind: &str, width: usize, target: Option<u32>) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes, target);
        self.accessor(view, FLOAT, kind, values.len() / width)
    }

    /// Vectors of a vertex attribute; bounds are required for positions.
    fn vectors(&mut self, vectors: &[Vec3], bounds: bool) -> usize {
        let values: Vec<f32> = vectors.iter().flat_map(|v| v.to_array()).collect();
        let accessor = self.floats(&values, "VEC3", 3, Some(ARRAY_BUFFER));
        if bounds {
            let low = vectors.iter().copied().reduce(Vec3::min).unwrap_or_default();
            let high = vectors.iter().copied().reduce(Vec3::max).unwrap_or_default();
            self.accessors[accessor]["min"] = json!(low.to_array());
            self.accessors[accessor]["max"] = json!(high.to_array());
        }
        accessor
    }

    /// Times `[s]`, with the bounds that animation inputs need.
    fn times(&mut self, times: &[f32]) -> usize {
        let accessor = self.floats(times, "SCALAR", 1, None);
        self.accessors[accessor]["min"] = json!([times[0]]);
        self.accessors[accessor]["max"] = json!([times[times.len() - 1]]);
        accessor
    }
}

/// Corners of the mesh: glTF has one uv per vertex, so a vertex on a seam becomes several.
struct Corners {
    /// Vertex and uv of each, in the order of the vertices.
    pairs: Vec<[u32; 2]>,
    /// Indices into `pairs`, three per triangle.
    indices: Vec<u32>,
}

/// One side of the mesh, or both if they look alike.
struct Side {
    /// Accessor of the indices.
    indices: usize,
    /// Whether its triangles go around the other way, so that its normals point the other way.
    reversed: bool,
    /// Number of its material.
    material: usize,
}

impl Corners {
    fn new(clip: &Clip) -> Self {
        let (triangles, uvs) = (clip.mesh.triangles(), clip.mesh.triangle_uvs());
        let used: Vec<[u32; 2]> =
            triangles.iter().flatten().zip(uvs.iter().flatten()).map(|(v, uv)| [*v, *uv]).collect();
        let mut pairs = used.clone();
        pairs.sort_unstable();
        pairs.dedup();
        let at: BTreeMap<[u32; 2], u32> = pairs.iter().copied().zip(0..).collect();
        Self { indices: used.iter().map(|pair| at[pair]).collect(), pairs }
    }

    fn of(&self, values: &[Vec3]) -> Vec<Vec3> {
        self.pairs.iter().map(|[v, _]| values[*v as usize]).collect()
    }
}

/// The row of the format.
pub(super) const FORMAT: Row = Row {
    key: "glb",
    programs: "Blender, web",
    content: "animated mesh, a morph target per frame, normals, uv, material (y up)",
    files: &[(".glb", "moving mesh with texture: Blender, web, phones")],
    feature: None,
    for_blender: true,
    outputs: |clip| Ok(vec![Output::File(format!("{}.glb", clip.name), encode(clip))]),
};

/// The file.
fn encode(clip: &Clip) -> Vec<u8> {
    encode_segments(clip, MAX_TARGETS)
}

fn encode_segments(clip: &Clip, max_targets: usize) -> Vec<u8> {
    let mut buffer = Buffer::default();
    let corners = Corners::new(clip);
    // Viewers leave out triangles that are seen from behind where the two sides have materials of their own.
    let sides: Vec<Side> = [false, true][..1 + usize::from(clip.back.is_some())]
        .iter()
        .enumerate()
        .map(|(material, other)| {
            let reversed = clip.back.is_some_and(|back| back.outward == *other);
            Side { indices: indices(&corners, reversed, &mut buffer), reversed, material }
        })
        .collect();
    let uvs: Vec<f32> = corners
        .pairs
        .iter()
        .flat_map(|[_, k]| {
            let uv = clip.mesh.uvs[*k as usize];
            // glTF has v = 0 at the image's first row.
            [uv.x as f32, (1.0 - uv.y) as f32]
        })
        .collect();
    let uvs = buffer.floats(&uvs, "VEC2", 2, Some(ARRAY_BUFFER));

    let last = clip.motion.len() - 1;
    let mut starts: Vec<usize> = (0..last.max(1)).step_by(max_targets).collect();
    starts.push(last);
    let (mut meshes, mut nodes, mut channels, mut samplers) = (vec![], vec![], vec![], vec![]);
    for (node, range) in starts.windows(2).enumerate() {
        let (from, to) = (range[0], range[1]);
        meshes.push(mesh(clip, &corners, &mut buffer, (&sides, uvs), from..=to));
        let name = if starts.len() > 2 { format!("{}_{from}", clip.name) } else { clip.name.clone() };
        nodes.push(json!({"name": name, "mesh": node}));
        if to > from {
            let times: Vec<f32> = (from..=to).map(|k| clip.time(k)).collect();
            let weights: Vec<f32> = (from..=to)
                .flat_map(|n| (from + 1..=to).map(move |target| f32::from(u8::from(n == target))))
                .collect();
            let (input, output) = (buffer.times(&times), buffer.floats(&weights, "SCALAR", 1, None));
            channels.push(json!({"sampler": samplers.len(), "target": {"node": node, "path": "weights"}}));
            samplers.push(json!({"input": input, "output": output, "interpolation": "LINEAR"}));
        }
        if starts.len() > 2 {
            // Visible from its first frame on, up to the next segment's.
            let times: Vec<f32> = (0..starts.len() - 1).map(|k| clip.time(starts[k])).collect();
            let scales: Vec<f32> =
                (0..starts.len() - 1).flat_map(|k| [f32::from(u8::from(k == node)); 3]).collect();
            let (input, output) = (buffer.times(&times), buffer.floats(&scales, "VEC3", 3, None));
            channels.push(json!({"sampler": samplers.len(), "target": {"node": node, "path": "scale"}}));
            samplers.push(json!({"input": input, "output": output, "interpolation": "STEP"}));
            if node > 0 {
                nodes[node]["scale"] = json!([0, 0, 0]);
            }
        }
    }
    let own: Option<Vec<Pose>> = (0..=last).map(|k| clip.camera_y_up(k)).collect();
    let others = clip.others.iter().map(|other| (other.name.as_str(), &other.camera, clip.path_y_up(other)));
    let all: Vec<(&str, &Camera, Vec<Pose>)> =
        std::iter::once(("camera", &clip.camera, own.unwrap_or_default())).chain(others).collect();
    for (k, (name, _, path)) in all.iter().enumerate() {
        let mut node = json!({"name": name, "camera": k});
        let places: Vec<f32> = path.iter().flat_map(|pose| pose.translation.as_vec3().to_array()).collect();
        let turns: Vec<f32> = quaternions(path).concat();
        if !path.is_empty() {
            (node["translation"], node["rotation"]) = (json!(places[..3]), json!(turns[..4]));
        }
        if path.len() > 1 {
            let input = buffer.times(&(0..=last).map(|k| clip.time(k)).collect::<Vec<_>>());
            for (way, values, kind, width) in
                [("translation", places, "VEC3", 3), ("rotation", turns, "VEC4", 4)]
            {
                let output = buffer.floats(&values, kind, width, None);
                let target = json!({"node": nodes.len(), "path": way});
                channels.push(json!({"sampler": samplers.len(), "target": target}));
                samplers.push(json!({"input": input, "output": output, "interpolation": "LINEAR"}));
            }
        }
        nodes.push(node);
    }

    let mut gltf = json!({
        "asset": {"version": "2.0", "generator": format!("tessuto {}", clip.version)},
        "scene": 0,
        "scenes": [{"name": clip.name, "nodes": [],
            "extras": {"frames_per_second": clip.fps, "first_frame": clip.first_frame}}],
        "meshes": meshes,
        "materials": materials(clip),
        "samplers": [{"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}],
        "textures": [], "images": [],
    });
    let left_out = clip.left_out();
    if !left_out.is_empty() {
        // Numbers in the video. Between its neighbours in time the mesh goes straight.
        gltf["scenes"][0]["extras"]["frames_left_out"] = left_out.into();
    }
    if !channels.is_empty() {
        gltf["animations"] = json!([{"name": "motion", "channels": channels, "samplers": samplers}]);
    }
    for (kind, image) in images(clip) {
        let view = buffer.view(&encode_png(&image), None);
        let source = gltf["images"].as_array().map_or(0, Vec::len);
        let image =
            json!({"name": format!("{}_{kind}", clip.name), "bufferView": view, "mimeType": "image/png"});
        push(&mut gltf["images"], image);
        push(&mut gltf["textures"], json!({"sampler": 0, "source": source}));
    }
    gltf["cameras"] = all.iter().map(|(name, camera, _)| perspective(name, camera)).collect();
    gltf["scenes"][0]["nodes"] = (0..nodes.len()).collect();
    gltf["nodes"] = nodes.into();
    gltf["buffers"] = json!([{"byteLength": buffer.bytes.len()}]);
    gltf["bufferViews"] = buffer.views.into();
    gltf["accessors"] = buffer.accessors.into();
    container(&gltf, buffer.bytes)
}

/// A glTF camera is centred with square pixels: the exact one is in the extras.
fn perspective(name: &str, c: &Camera) -> Value {
    let perspective = json!({
        "yfov": 2.0 * (0.5 * c.height as f64 / c.fy).atan(),
        "aspectRatio": c.width as f64 / c.fx * c.fy / c.height as f64,
        "znear": 0.01, "zfar": 100.0,
    });
    json!({"type": "perspective", "name": name, "perspective": perspective, "extras": c})
}

/// Unit quaternions x, y, z, w of the turns of `path`, each the shorter way from the one before.
fn quaternions(path: &[Pose]) -> Vec<[f32; 4]> {
    let mut last = DQuat::IDENTITY;
    let next = |pose: &Pose| {
        let turn = DQuat::from_mat3(&pose.rotation).normalize();
        last = if turn.dot(last) < 0.0 { -turn } else { turn };
        last.as_quat().to_array()
    };
    path.iter().map(next).collect()
}

fn push(array: &mut Value, value: Value) {
    array.as_array_mut().expect("made as an array").push(value);
}

/// One segment: its first frame is the base, each of the others a target.
fn mesh(
    clip: &Clip,
    corners: &Corners,
    buffer: &mut Buffer,
    (sides, uvs): (&[Side], usize),
    frames: std::ops::RangeInclusive<usize>,
) -> Value {
    let normals = |n: usize, reversed: bool| {
        let normals = corners.of(&clip.normals(&clip.motion[n]));
        if reversed { normals.into_iter().map(|n| -n).collect() } else { normals }
    };
    let attributes = |n: usize| [corners.of(&Clip::y_up(&clip.motion[n])), normals(n, sides[0].reversed)];
    let base = attributes(*frames.start());
    let mut targets = Vec::new();
    for n in frames.clone().skip(1) {
        let frame = attributes(n);
        let [position, normal]: [Vec<Vec3>; 2] =
            std::array::from_fn(|k| frame[k].iter().zip(&base[k]).map(|(a, b)| *a - *b).collect());
        targets.push(
            json!({"POSITION": buffer.vectors(&position, true), "NORMAL": buffer.vectors(&normal, false)}),
        );
    }
    let [position, normal] = base;
    let attributes = json!({
        "POSITION": buffer.vectors(&position, true),
        "NORMAL": buffer.vectors(&normal, false),
        "TEXCOORD_0": uvs,
    });
    let mut primitive =
        json!({"attributes": attributes, "indices": sides[0].indices, "material": sides[0].material});
    let mut mesh = json!({"name": clip.name});
    if !targets.is_empty() {
        mesh["weights"] = vec![0; targets.len()].into();
        let names: Vec<_> = frames.clone().skip(1).map(|k| format!("frame {}", clip.frames[k])).collect();
        mesh["extras"] = json!({"targetNames": names});
        primitive["targets"] = targets.into();
    }
    mesh["primitives"] = json!([primitive]);
    // The same places with normals of their own.
    for side in &sides[1..] {
        let base = normals(*frames.start(), side.reversed);
        let mut other = primitive.clone();
        other["attributes"] =
            json!({"POSITION": primitive["attributes"]["POSITION"], "NORMAL": buffer.vectors(&base, false)});
        (other["indices"], other["material"]) = (side.indices.into(), side.material.into());
        for (k, n) in frames.clone().skip(1).enumerate() {
            let moved: Vec<Vec3> =
                normals(n, side.reversed).iter().zip(&base).map(|(a, b)| *a - *b).collect();
            other["targets"][k]["NORMAL"] = buffer.vectors(&moved, false).into();
        }
        push(&mut mesh["primitives"], other);
    }
    mesh
}

/// Accessor of the triangles' corners, going around the other way if `reversed`.
fn indices(corners: &Corners, reversed: bool, buffer: &mut Buffer) -> usize {
    let order = if reversed { [0, 2, 1] } else { [0, 1, 2] };
    let indices = corners.indices.chunks_exact(3).flat_map(|t| order.map(|k| t[k]));
    let bytes: Vec<u8> = indices.flat_map(u32::to_le_bytes).collect();
    let view = buffer.view(&bytes, Some(ELEMENT_ARRAY_BUFFER));
    buffer.accessor(view, UNSIGNED_INT, "SCALAR", corners.indices.len())
}

/// That of the print, and that of the other side if it has one of its own.
fn materials(clip: &Clip) -> Vec<Value> {
    let of_back = clip.back.map(|back| {
        let [r, g, b] = back.colour;
        let look = json!({"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0, "roughnessFactor": 1});
        json!({"name": format!("{}_back", clip.name), "pbrMetallicRoughness": look, "doubleSided": false})
    });
    std::iter::once(material(clip)).chain(of_back).collect()
}

fn material(clip: &Clip) -> Value {
    let mut look = json!({"baseColorTexture": {"index": 0}});
    if clip.material.roughness_metallic.is_some() {
        look["metallicRoughnessTexture"] = json!({"index": 1});
    } else {
        look["metallicFactor"] = 0.into();
        look["roughnessFactor"] = 1.into();
    }
    json!({"name": clip.name, "pbrMetallicRoughness": look, "doubleSided": clip.back.is_none()})
}

/// The images of the material; roughness is green, metallic blue.
fn images(clip: &Clip) -> Vec<(&'static str, Image)> {
    let mut images = vec![("basecolor", clip.material.base_colour.clone())];
    if let Some([roughness, metallic]) = &clip.material.roughness_metallic {
        let data = roughness.data.iter().zip(&metallic.data).flat_map(|(r, m)| [0.0, *r, *m]).collect();
        images.push(("roughness_metallic", Image { channels: 3, data, ..*roughness }));
    }
    images
}

/// Header, JSON chunk, binary chunk.
fn container(gltf: &Value, mut binary: Vec<u8>) -> Vec<u8> {
    let mut text = gltf.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let word = |n: usize| u32::try_from(n).expect("a GLB file is below 4 GiB").to_le_bytes();
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend(word(12 + 8 + text.len() + 8 + binary.len()));
    out.extend(word(text.len()));
    out.extend(b"JSON");
    out.extend(text);
    out.extend(word(binary.len()));
    out.extend(b"BIN\0");
    out.extend(binary);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::mesh::Motion;

    #[test]
    fn a_long_clip_is_cut_into_segments_that_share_a_frame() {
        let mesh = tessuto_core::mesh::grid(3, 2, glam::DVec2::new(0.2, 0.1), 1.0);
        let moved = |n: usize| mesh.positions.iter().map(|p| *p + glam::DVec3::Z * 0.01 * n as f64).collect();
        let clip = Clip {
            motion: Motion::new((0..6).map(moved).collect()).unwrap(),
            frames: (0..6).collect(),
            frame_count: 6,
            ..super::super::clip::tests::clip(mesh.clone())
        };
        for (max_targets, counts) in [(2, vec![2, 2, 1]), (5, vec![5]), (256, vec![5])] {
            let bytes = encode_segments(&clip, max_targets);
            let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
            let gltf: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
            let found: Vec<usize> = gltf["meshes"]
                .as_array()
                .unwrap()
                .iter()
                .map(|m| m["primitives"][0]["targets"].as_array().unwrap().len())
                .collect();
            assert_eq!(found, counts);
            let channels = gltf["animations"][0]["channels"].as_array().unwrap().len();
            assert_eq!(channels, if counts.len() > 1 { 2 * counts.len() } else { 1 });
        }
    }
}
