//! Meshes of other programs for use as a template: OBJ, PLY and glTF, distinguished by their content.
//!
//! glTF and PLY split vertices where texture coordinates differ; such vertices are merged again, or the
//! fabric would come apart there.

mod gltf;
mod ply;

use std::path::Path;

use glam::{DVec2, DVec3};

use super::text::without_mark;
use super::{obj, read_bounded};
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::{Face, Mesh, weld};

/// Largest file `[bytes]`.
const MAX_BYTES: u64 = 1 << 30;
/// Most vertices and faces, each.
const MAX_COUNT: usize = 5_000_000;
/// Largest coordinate taken seriously; a kilometre in millimetres.
const MAX_COORDINATE: f64 = 1e6;

/// A mesh as its file has it.
#[derive(Debug, Clone)]
pub struct Model {
    /// The mesh, in the file's unit and axes (except for glTF, see [`read`]).
    pub mesh: Mesh,
    /// Whether every corner has a texture coordinate; where not, all share one that means nothing.
    pub has_uv: bool,
    /// What was changed while reading.
    pub notes: Vec<String>,
}

/// Reads OBJ, PLY (ASCII, binary), glTF (.gltf, .glb).
///
/// glTF has y up and looks along −z: its (x, y, z) becomes (x, −y, −z), camera axes as everywhere here, so that an
/// export of this program comes back as it was.
///
/// # Errors
/// [`Error::Input`] naming the file and the place in it.
pub fn read(path: &Path) -> Result<Model> {
    let place = path.display().to_string();
    let file = read_bounded(path, MAX_BYTES)?;
    let bytes = without_mark(&file, &place)?;
    let start = bytes.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(0);
    let mut model = if bytes.starts_with(b"ply") {
        ply::parse(&bytes, &place)?
    } else if bytes.starts_with(b"glTF") || bytes.get(start) == Some(&b'{') {
        gltf::parse(&bytes, path)?
    } else {
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if ending != "obj" {
            return Err(Error::input(
                place,
                format!("is not an OBJ, PLY or glTF file (its ending is \"{ending}\")"),
                "export the mesh from its program as OBJ (quads stay quads), PLY, .glb or .gltf",
            ));
        }
        let mesh = obj::parse_with(&bytes, &place, false)?;
        let has_uv = !mesh.uvs.is_empty();
        Model { mesh, has_uv, notes: Vec::new() }
    };
    if !model.has_uv {
        model.mesh.uvs = vec![DVec2::ZERO];
        model.mesh.faces.iter_mut().for_each(|f| f.uvs = vec![0; f.vertices.len()]);
    }
    Ok(model)
}

/// A mesh whose vertices have one texture coordinate each, before vertices at the same place are merged.
struct Split {
    positions: Vec<DVec3>,
    /// As many as `positions`, or none.
    uvs: Vec<DVec2>,
    faces: Vec<Vec<u32>>,
}

impl Split {
    /// The mesh with vertices at the same place merged, and numbers checked.
    fn merged(self, place: &str) -> Result<Model> {
        let bad = |v: f64| v.is_nan() || v.abs() > MAX_COORDINATE;
        if let Some(k) = self.positions.iter().position(|p| p.to_array().into_iter().any(bad)) {
            return Err(Error::input(
                place,
                format!("vertex {} of {} is {:?}", k + 1, self.positions.len(), self.positions[k].to_array()),
                "coordinates must be numbers between -1e6 and 1e6; export the mesh again",
            ));
        }
        if let Some(k) = self.uvs.iter().position(|p| p.to_array().into_iter().any(bad)) {
            let problem = format!("texture coordinate {} is {:?}", k + 1, self.uvs[k].to_array());
            return Err(Error::input(place, problem, "unwrap the mesh again"));
        }
        if self.faces.is_empty() {
            let problem = format!("has {} vertices but no face", self.positions.len());
            return Err(Error::input(
                place,
                problem,
                "export the mesh with its faces; a point cloud is not a template",
            ));
        }
        let has_uv = !self.uvs.is_empty();
        let faces = self.faces.into_iter().map(|f| Face { vertices: f.clone(), uvs: f }).collect();
        let mut mesh = Mesh { positions: self.positions, uvs: self.uvs, faces };
        let [vertices, faces] = weld(&mut mesh, 0.0);
        let mut notes = Vec::new();
        if vertices > 0 {
            notes.push(format!("{vertices} vertices split at seams were merged again"));
        }
        if faces > 0 {
            notes.push(format!("{faces} faces that name one place twice were left out"));
        }
        Ok(Model { mesh, has_uv, notes })
    }
}
