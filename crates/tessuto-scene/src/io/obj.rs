//! Wavefront OBJ: polygons with texture coordinates, nothing else. Groups, materials, normals,
//! lines and points are skipped; polygons stay whole, since their edges are the threads of the cloth.

use std::fmt::Write as _;
use std::path::Path;

use glam::{DVec2, DVec3};

use crate::io::text::without_mark;
use crate::io::{atomic_write, read_bounded};
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::mesh::{Face, Mesh};

/// Most vertices, texture coordinates and faces read, each.
const MAX_COUNT: usize = 5_000_000;
/// Longest line `[bytes]`, continuation lines included.
const MAX_LINE: usize = 64 << 10;
/// Largest file `[bytes]`.
const MAX_BYTES: u64 = 2 << 30;
/// Largest coordinate taken seriously; a kilometre in millimetres.
const MAX_COORDINATE: f64 = 1e6;

/// Reads a mesh. Every face corner must have a texture coordinate.
pub fn read(path: &Path) -> Result<Mesh> {
    let bytes = read_bounded(path, MAX_BYTES)?;
    parse(&bytes, &path.display().to_string())
}

/// Reads a mesh from the bytes of an OBJ file; `name` stands in error messages.
pub fn parse(bytes: &[u8], name: &str) -> Result<Mesh> {
    parse_with(bytes, name, true)
}

/// [`parse`]; unless `uv_needed`, corners may lack texture coordinates: if one does, `uvs` is empty and no index
/// into it means anything.
pub(crate) fn parse_with(bytes: &[u8], name: &str, uv_needed: bool) -> Result<Mesh> {
    let mut mesh = Mesh { positions: Vec::new(), uvs: Vec::new(), faces: Vec::new() };
    let mut bare = None;
    let mut joined = Vec::new();
    let bytes = &without_mark(bytes, name)?;
    for (index, raw) in bytes.split(|b| *b == b'\n').enumerate() {
        let fail = |fault: Fault| Error::input(format!("{name}:{}", index + 1), fault.problem, fault.hint);
        if joined.len() + raw.len() > MAX_LINE {
            return Err(fail(Fault::new("the line is longer than 64 KiB", "check that this is an OBJ file")));
        }
        let raw = raw.strip_suffix(b"\r").unwrap_or(raw);
        // A backslash at the end continues the line.
        if let Some(start) = raw.strip_suffix(b"\\") {
            joined.extend_from_slice(start);
            joined.push(b' ');
            continue;
        }
        if joined.is_empty() {
            statement(raw, &mut mesh, &mut bare).map_err(fail)?;
        } else {
            joined.extend_from_slice(raw);
            statement(&joined, &mut mesh, &mut bare).map_err(fail)?;
            joined.clear();
        }
        if let (true, Some(corner)) = (uv_needed, &bare) {
            return Err(fail(Fault::new(
                format!("corner \"{corner}\" has no texture coordinate"),
                Hint::from(
                    "unwrap the mesh and export it with its texture coordinates (uv), or have them made",
                )
                .with(Remedy::Remesh),
            )));
        }
    }
    if mesh.faces.is_empty() {
        let problem = format!("has {} vertices but no face", mesh.positions.len());
        return Err(Error::input(name, problem, "export the mesh with its faces as Wavefront OBJ"));
    }
    if bare.is_some() {
        mesh.uvs.clear();
    }
    Ok(mesh)
}

/// What is wrong with a line, and the way out.
struct Fault {
    problem: String,
    hint: Hint,
}

impl Fault {
    fn new(problem: impl Into<String>, hint: impl Into<Hint>) -> Self {
        Self { problem: problem.into(), hint: hint.into() }
    }
}

/// Adds what one line states to `mesh`, and its first corner without texture
/// coordinate to `bare`. Comments may be in any encoding.
fn statement(line: &[u8], mesh: &mut Mesh, bare: &mut Option<String>) -> std::result::Result<(), Fault> {
    let line = line.split(|b| *b == b'#').next().unwrap_or_default();
    let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
    match words.next() {
        Some(b"v") => {
            // Colour or weight after the position is skipped.
            let [x, y, z] = numbers(words)?;
            push(&mut mesh.positions, DVec3::new(x, y, z), "vertices")
        }
        Some(b"vt") => {
            let [u, v] = numbers(words)?;
            push(&mut mesh.uvs, DVec2::new(u, v), "texture coordinates")
        }
        Some(b"f") => {
            let face = face(words, mesh.positions.len(), mesh.uvs.len(), bare)?;
            push(&mut mesh.faces, face, "faces")
        }
        _ => Ok(()),
    }
}

fn push<T>(list: &mut Vec<T>, item: T, what: &str) -> std::result::Result<(), Fault> {
    if list.len() == MAX_COUNT {
        return Err(Fault::new(format!("more than {MAX_COUNT} {what}"), "reduce the mesh"));
    }
    list.push(item);
    Ok(())
}

/// The first `N` words as finite numbers.
fn numbers<'a, const N: usize>(
    mut words: impl Iterator<Item = &'a [u8]>,
) -> std::result::Result<[f64; N], Fault> {
    let mut values = [0.0; N];
    for (k, value) in values.iter_mut().enumerate() {
        let Some(word) = words.next() else {
            return Err(Fault::new(format!("{k} numbers where {N} are needed"), "export the mesh again"));
        };
        *value = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok()).unwrap_or(f64::NAN);
        if value.is_nan() || value.abs() > MAX_COORDINATE {
            return Err(Fault::new(
                format!("\"{}\" is not a number between -1e6 and 1e6", show(word)),
                "numbers need a decimal point, not a comma; remove the vertex if it is not valid",
            ));
        }
    }
    Ok(values)
}

/// A face of the forms `v/vt`, `v/vt/vn`, `v` and `v//vn`, given the numbers of vertices and uvs defined so far.
fn face<'a>(
    words: impl Iterator<Item = &'a [u8]>,
    vertex_count: usize,
    uv_count: usize,
    bare: &mut Option<String>,
) -> std::result::Result<Face, Fault> {
    let mut face = Face { vertices: Vec::new(), uvs: Vec::new() };
    for word in words {
        let mut parts = word.split(|b| *b == b'/');
        face.vertices.push(index(parts.next().unwrap_or_default(), vertex_count, "vertex")?);
        match parts.next() {
            Some(uv) if !uv.is_empty() => face.uvs.push(index(uv, uv_count, "texture coordinate")?),
            _ => {
                face.uvs.push(0);
                bare.get_or_insert_with(|| show(word));
            }
        }
    }
    if face.vertices.len() < 3 {
        return Err(Fault::new(
            format!("a face with {} corners", face.vertices.len()),
            "a face needs 3 or more corners; remove it",
        ));
    }
    let mut sorted = face.vertices.clone();
    sorted.sort_unstable();
    if let Some(pair) = sorted.windows(2).find(|p| p[0] == p[1]) {
        return Err(Fault::new(
            format!("the face names vertex {} twice", pair[0] + 1),
            "remove the degenerate face or the repeated corner",
        ));
    }
    Ok(face)
}

/// A 1-based or negative (relative to the end) index, as 0-based.
fn index(word: &[u8], count: usize, what: &str) -> std::result::Result<u32, Fault> {
    let number = std::str::from_utf8(word).ok().and_then(|w| w.parse::<i64>().ok());
    let position = match number {
        Some(n) if n > 0 => Some(n - 1),
        Some(n) if n < 0 => Some(count as i64 + n),
        _ => None,
    };
    match position {
        Some(p) if p >= 0 && p < count as i64 => Ok(p as u32),
        _ => Err(Fault::new(
            format!("{what} {} does not exist; {count} are defined before this line", show(word)),
            "indices start at 1 (or at -1, the latest); define what a face uses before the face",
        )),
    }
}

/// A word of the file, made safe and short for a message.
fn show(word: &[u8]) -> String {
    String::from_utf8_lossy(&word[..word.len().min(40)]).escape_debug().to_string()
}

/// Reference to a material in an .mtl file beside the OBJ file.
#[derive(Debug, Clone, Copy)]
pub struct Material<'a> {
    /// File name of the library, e.g. `cloth.mtl`.
    pub library: &'a str,
    /// Name of the material in it.
    pub name: &'a str,
}

/// Writes a mesh; numbers are written so that reading gives the same bits back.
pub fn write(path: &Path, mesh: &Mesh, material: Option<Material<'_>>) -> Result<()> {
    atomic_write(path, encode(mesh, material).as_bytes())
}

/// The text that [`write()`] writes.
pub fn encode(mesh: &Mesh, material: Option<Material<'_>>) -> String {
    let mut text = String::new();
    if let Some(material) = material {
        let _ = writeln!(text, "mtllib {}", material.library);
    }
    for p in &mesh.positions {
        let _ = writeln!(text, "v {} {} {}", p.x, p.y, p.z);
    }
    for uv in &mesh.uvs {
        let _ = writeln!(text, "vt {} {}", uv.x, uv.y);
    }
    if let Some(material) = material {
        let _ = writeln!(text, "usemtl {}", material.name);
    }
    for face in &mesh.faces {
        text.push('f');
        for (vertex, uv) in face.vertices.iter().zip(&face.uvs) {
            let _ = write!(text, " {}/{}", vertex + 1, uv + 1);
        }
        text.push('\n');
    }
    text
}
