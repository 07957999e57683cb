//! glTF 2.0, as .glb or .gltf: the triangles of all meshes in the scene's nodes, with their first texture coordinates,
//! shaped as the file has them at rest: morph targets by their default weights, skins by the pose of their joints.
//!
//! Read from the JSON itself: the crate `gltf` panics on some files that lack what the standard demands.

mod accessor;
mod skin;

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::Path;

use glam::{DMat4, DQuat, DVec2, DVec3};
use serde_json::Value;

use super::{MAX_BYTES, MAX_COUNT, Model, Split};
use crate::io::read_bounded;
use tessuto_core::error::{Error, Result};
use tessuto_core::text::from_base64;

/// Deepest nesting of nodes.
const MAX_DEPTH: usize = 64;
/// Most nodes visited: a few lines can name each other's children over and over, twice as often at every depth.
const MAX_NODES: usize = 100_000;

/// What is wrong with a file, and the way out.
type Fault = (String, &'static str);
type Outcome<T> = std::result::Result<T, Fault>;

const AGAIN: &str = "export the mesh again as glTF 2.0 without compression, or as OBJ";

/// Reads the meshes in the bytes of the file at `path`.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Model> {
    let place = path.display().to_string();
    let fail = |(problem, hint): Fault| Error::input(&place, problem, hint);
    let (json, chunk) = open(bytes).map_err(fail)?;
    let document: Value =
        serde_json::from_slice(json).map_err(|e| fail((format!("is not valid JSON: {e}"), AGAIN)))?;
    let used = document["extensionsRequired"].as_array().into_iter().flatten().filter_map(Value::as_str);
    let known =
        |e: &&str| !matches!(*e, "KHR_texture_transform" | "KHR_materials_unlit" | "KHR_mesh_quantization");
    if let Some(extension) = used.into_iter().find(known) {
        return Err(fail((format!("needs the extension {extension}, which is not read"), AGAIN)));
    }
    let buffers = buffers(&document, chunk, path)?;
    let mut reader = Reader {
        document: &document,
        buffers,
        split: Split { positions: vec![], uvs: vec![], faces: vec![] },
        bare: false,
        visited: 0,
        parents: skin::parents(&document),
        shaped: [0; 2],
    };
    let scene = document["scene"].as_u64().unwrap_or(0) as usize;
    let mut roots: Vec<usize> = indices(&document["scenes"][scene]["nodes"]);
    if roots.is_empty() {
        // Without a scene, all nodes that are nobody's child.
        let nodes = document["nodes"].as_array().map_or(0, Vec::len);
        let children: HashSet<usize> =
            (0..nodes).flat_map(|n| indices(&document["nodes"][n]["children"])).collect();
        roots = (0..nodes).filter(|n| !children.contains(n)).collect();
    }
    roots.into_iter().try_for_each(|n| reader.node(n, axes(), 0)).map_err(fail)?;
    if reader.bare {
        reader.split.uvs.clear();
    }
    let [morphed, skinned] = reader.shaped;
    let mut model = reader.split.merged(&place)?;
    if morphed > 0 {
        model.notes.push(format!("{morphed} morph targets have a weight in the file, and count by it"));
    }
    if skinned > 0 {
        model
            .notes
            .push(format!("{skinned} meshes have a skin: they are posed as their joints are in the file"));
    }
    if document["animations"].as_array().is_some_and(|a| !a.is_empty()) {
        model.notes.push("animation is not read: the mesh is taken at rest".into());
    }
    Ok(model)
}

/// y up and looking along −z becomes y down and looking along z.
fn axes() -> DMat4 {
    DMat4::from_scale(DVec3::new(1.0, -1.0, -1.0))
}

/// The JSON text, and the binary chunk of a .glb.
fn open(bytes: &[u8]) -> Outcome<(&[u8], Option<&[u8]>)> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    let word =
        |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let truncated = || ("is a truncated .glb file".to_owned(), AGAIN);
    if word(4) != Some(2) {
        return Err((format!("is glTF version {:?}; 2 is read", word(4).unwrap_or(0)), AGAIN));
    }
    let length = word(12).ok_or_else(truncated)?;
    let json = bytes.get(20..20 + length).ok_or_else(truncated)?;
    let at = 20 + length;
    let chunk = match word(at) {
        Some(length) => Some(bytes.get(at + 8..at + 8 + length).ok_or_else(truncated)?),
        None => None,
    };
    Ok((json, chunk))
}

fn indices(list: &Value) -> Vec<usize> {
    list.as_array().into_iter().flatten().filter_map(|v| v.as_u64().map(|n| n as usize)).collect()
}

/// The bytes of every buffer: the chunk of a .glb, a data URI, or a file beside `path`.
fn buffers<'a>(document: &Value, chunk: Option<&'a [u8]>, path: &Path) -> Result<Vec<Cow<'a, [u8]>>> {
    let place = path.display().to_string();
    let list = document["buffers"].as_array().map_or(&[][..], Vec::as_slice);
    let one = |buffer: &Value| match buffer["uri"].as_str() {
        None => Ok(Cow::Borrowed(chunk.unwrap_or_default())),
        Some(uri) if uri.starts_with("data:") => {
            let text = uri.split_once(";base64,").map(|(_, text)| text);
            text.and_then(from_base64)
                .map(Cow::Owned)
                .ok_or_else(|| Error::input(&place, "holds a buffer that is not base64", AGAIN))
        }
        Some(uri) => {
            // A template must not make the program read files from elsewhere.
            let name = percent_decoded(uri);
            let plain = Path::new(&name).components().all(|c| matches!(c, std::path::Component::Normal(_)));
            if !plain || name.contains("://") {
                let problem = format!("its buffer \"{name}\" is not beside it");
                return Err(Error::input(&place, problem, "export as .glb, which is one file"));
            }
            read_bounded(&path.with_file_name("").join(name), MAX_BYTES).map(Cow::Owned)
        }
    };
    // The same file named a hundred times is a hundred times its memory.
    let mut total = 0;
    let mut read = Vec::new();
    for buffer in list {
        let bytes = one(buffer)?;
        total += if matches!(bytes, Cow::Owned(_)) { bytes.len() as u64 } else { 0 };
        if total > MAX_BYTES {
            let problem = format!("its buffers have more than {MAX_BYTES} bytes together");
            return Err(Error::input(&place, problem, "reduce the mesh"));
        }
        read.push(bytes);
    }
    Ok(read)
}

struct Reader<'a> {
    document: &'a Value,
    buffers: Vec<Cow<'a, [u8]>>,
    split: Split,
    /// Whether a primitive has no texture coordinates.
    bare: bool,
    /// Nodes so far.
    visited: usize,
    /// The parent of every node that has one.
    parents: Vec<Option<usize>>,
    /// How many morph targets and skins shaped the meshes.
    shaped: [usize; 2],
}

/// How a mesh stands in the scene.
enum Place {
    /// By the transform of its node and the nodes above.
    Node(DMat4),
    /// By its joints: the transform of each, which replace that of the node.
    Skin(Vec<DMat4>),
}

impl Reader<'_> {
    /// Adds the meshes of a node and its children, with positions multiplied by `parent` and the node's own transform.
    fn node(&mut self, index: usize, parent: DMat4, depth: usize) -> Outcome<()> {
        let node = &self.document["nodes"][index];
        if depth > MAX_DEPTH {
            return Err((format!("nests nodes deeper than {MAX_DEPTH}"), AGAIN));
        }
        self.visited += 1;
        if self.visited > MAX_NODES {
            return Err((
                format!("has more than {MAX_NODES} nodes, or nodes that are each other's children"),
                AGAIN,
            ));
        }
        let transform = parent * local(node);
        if let Some(mesh) = node["mesh"].as_u64() {
            let mesh = &self.document["meshes"][mesh as usize];
            // Weights of the node replace those of the mesh.
            let weights = if node["weights"].is_array() { &node["weights"] } else { &mesh["weights"] };
            let place = match node["skin"].as_u64() {
                Some(skin) => Place::Skin(self.joints(skin as usize, axes())?),
                None => Place::Node(transform),
            };
            self.shaped[1] += usize::from(matches!(place, Place::Skin(_)));
            for primitive in mesh["primitives"].as_array().into_iter().flatten() {
                self.primitive(primitive, weights, &place)?;
            }
        }
        indices(&node["children"]).into_iter().try_for_each(|child| self.node(child, transform, depth + 1))
    }

    fn primitive(&mut self, primitive: &Value, weights: &Value, place: &Place) -> Outcome<()> {
        let mode = primitive["mode"].as_u64().unwrap_or(4);
        if mode != 4 {
            return Err((format!("has a primitive of mode {mode}; triangles (mode 4) are read"), AGAIN));
        }
        let attributes = &primitive["attributes"];
        let mut positions = self.accessor(&attributes["POSITION"], 3)?;
        let count = positions.len() / 3;
        self.shaped[0] += self.morph(&mut positions, &primitive["targets"], weights)?;
        let uvs = if attributes["TEXCOORD_0"].is_null() {
            None
        } else {
            Some(self.accessor(&attributes["TEXCOORD_0"], 2)?)
        };
        let corners: Vec<u32> = match &primitive["indices"] {
            Value::Null => (0..count as u32).collect(),
            accessor => self.accessor(accessor, 1)?.into_iter().map(|v| v as u32).collect(),
        };
        if let Some(v) = corners.iter().find(|v| **v as usize >= count) {
            return Err((format!("names vertex {v} of {count}"), AGAIN));
        }
        if self.split.positions.len() + count > MAX_COUNT
            || self.split.faces.len() + corners.len() / 3 > MAX_COUNT
        {
            return Err((
                format!("has more than {MAX_COUNT} vertices or triangles in all"),
                "reduce the mesh",
            ));
        }
        let first = self.split.positions.len() as u32;
        let points = positions.chunks_exact(3).map(DVec3::from_slice);
        match place {
            Place::Node(transform) => {
                self.split.positions.extend(points.map(|p| transform.transform_point3(p)));
            }
            Place::Skin(joints) => {
                let posed = self.posed(points, attributes, joints)?;
                self.split.positions.extend(posed);
            }
        }
        self.bare |= uvs.as_ref().is_none_or(|uvs| uvs.len() != 2 * count);
        // Row 0 of a glTF texture is v = 0, here it is v = 1.
        let uvs = uvs.unwrap_or_else(|| vec![0.0; 2 * count]);
        self.split.uvs.extend(uvs.chunks_exact(2).take(count).map(|t| DVec2::new(t[0], 1.0 - t[1])));
        self.split.faces.extend(corners.chunks_exact(3).map(|c| c.iter().map(|v| first + v).collect()));
        Ok(())
    }
}

/// A node's own transform: its matrix (column-major), or translation · rotation · scale.
fn local(node: &Value) -> DMat4 {
    let numbers = |key: &str| -> Option<Vec<f64>> {
        node[key].as_array()?.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>()
    };
    if let Some(matrix) = numbers("matrix").and_then(|m| <[f64; 16]>::try_from(m).ok()) {
        return DMat4::from_cols_array(&matrix);
    }
    let three = |key: &str, default: DVec3| {
        numbers(key).and_then(|v| <[f64; 3]>::try_from(v).ok()).map_or(default, DVec3::from_array)
    };
    let rotation = numbers("rotation")
        .and_then(|v| <[f64; 4]>::try_from(v).ok())
        .map_or(DQuat::IDENTITY, DQuat::from_array);
    DMat4::from_scale_rotation_translation(
        three("scale", DVec3::ONE),
        rotation,
        three("translation", DVec3::ZERO),
    )
}

/// `%20` and the like as the bytes they stand for.
fn percent_decoded(uri: &str) -> String {
    let (bytes, mut out, mut k) = (uri.as_bytes(), Vec::new(), 0);
    while k < bytes.len() {
        let hex = uri.get(k + 1..k + 3).and_then(|h| u8::from_str_radix(h, 16).ok());
        match (bytes[k], hex) {
            (b'%', Some(byte)) => {
                out.push(byte);
                k += 3;
            }
            (byte, _) => {
                out.push(byte);
                k += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}
