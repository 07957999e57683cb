//! PLY: ASCII and binary; texture coordinates per vertex (s t, u v, texture_u texture_v) or per corner (texcoord).

mod body;
mod header;

use glam::{DVec2, DVec3};

use self::body::Body;
use super::{MAX_COUNT, Model, Split};
use tessuto_core::error::{Error, Result};

/// A row of the element `vertex`.
#[derive(Clone)]
struct Vertex {
    position: DVec3,
    uv: [Option<f64>; 2],
}

/// A row of the element `face`.
#[derive(Clone, Default)]
struct Polygon {
    vertices: Vec<u32>,
    /// Two numbers a corner, or none.
    texcoord: Vec<f64>,
}

/// Reads a mesh from the bytes of a PLY file.
pub(super) fn parse(bytes: &[u8], place: &str) -> Result<Model> {
    let broken = |line: Option<usize>, problem: String| {
        let line = line.map(|l| format!(":{l}")).unwrap_or_default();
        Error::input(
            format!("{place}{line}"),
            problem,
            "export the mesh again as PLY (ASCII or binary) or OBJ",
        )
    };
    let header = header::read(bytes).map_err(|(line, problem)| broken(Some(line), problem))?;
    let (mut vertices, mut polygons) = (Vec::new(), Vec::new());
    let mut body = Body::new(&header);
    for element in &header.elements {
        if element.count > MAX_COUNT {
            let problem = format!(
                "promises {} of element \"{}\"; at most {MAX_COUNT} are read",
                element.count, element.name
            );
            return Err(Error::input(place, problem, "reduce the mesh"));
        }
        let read = match element.name.as_str() {
            "vertex" => body.read(element, |row, property, values| {
                vertices.resize(row + 1, Vertex { position: DVec3::NAN, uv: [None; 2] });
                vertices[row].set(&property.name, values);
            }),
            "face" => body.read(element, |row, property, values| {
                polygons.resize(row + 1, Polygon::default());
                polygons[row].set(&property.name, values);
            }),
            _ => body.read(element, |_, _, _| {}),
        };
        read.map_err(|(line, problem)| broken(line, problem))?;
    }
    for (k, polygon) in polygons.iter().enumerate() {
        let outside = polygon.vertices.iter().find(|v| **v as usize >= vertices.len());
        if polygon.vertices.len() < 3 || outside.is_some() {
            let problem = format!(
                "face {} of {} has the vertices {:?}; {} exist",
                k + 1,
                polygons.len(),
                polygon.vertices,
                vertices.len()
            );
            return Err(Error::input(place, problem, "remove this face or export the mesh again"));
        }
    }
    assemble(&vertices, &polygons).merged(place)
}

impl Vertex {
    fn set(&mut self, name: &str, values: &[f64]) {
        let &[value] = values else { return };
        match name {
            "x" => self.position.x = value,
            "y" => self.position.y = value,
            "z" => self.position.z = value,
            "s" | "u" | "texture_u" => self.uv[0] = Some(value),
            "t" | "v" | "texture_v" => self.uv[1] = Some(value),
            _ => {}
        }
    }
}

impl Polygon {
    fn set(&mut self, name: &str, values: &[f64]) {
        match name {
            "vertex_indices" | "vertex_index" => {
                // What is no index becomes one that does not exist.
                let whole = |v: f64| v >= 0.0 && v < f64::from(u32::MAX) && v.fract() == 0.0;
                self.vertices = values.iter().map(|v| if whole(*v) { *v as u32 } else { u32::MAX }).collect();
            }
            "texcoord" => self.texcoord = values.to_vec(),
            _ => {}
        }
    }
}

/// The polygons with one vertex for each pair of vertex and texture coordinate.
fn assemble(vertices: &[Vertex], polygons: &[Polygon]) -> Split {
    let per_corner = polygons.iter().all(|p| p.texcoord.len() == 2 * p.vertices.len());
    if per_corner && !polygons.is_empty() {
        let mut split = Split { positions: Vec::new(), uvs: Vec::new(), faces: Vec::new() };
        for polygon in polygons {
            let first = split.positions.len() as u32;
            split.faces.push((0..polygon.vertices.len() as u32).map(|k| first + k).collect());
            split.positions.extend(polygon.vertices.iter().map(|v| vertices[*v as usize].position));
            split.uvs.extend(polygon.texcoord.chunks_exact(2).map(|t| DVec2::new(t[0], t[1])));
        }
        return split;
    }
    let uvs: Option<Vec<DVec2>> = vertices.iter().map(|v| Some(DVec2::new(v.uv[0]?, v.uv[1]?))).collect();
    Split {
        positions: vertices.iter().map(|v| v.position).collect(),
        uvs: uvs.unwrap_or_default(),
        faces: polygons.iter().map(|p| p.vertices.clone()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "element vertex 3\nproperty float x\nproperty double y\nproperty short z\nelement edge 1\n\
        property list ushort char ends\nproperty int mark\nelement face 1\nproperty uint group\n\
        property list int uint vertex_index\nend_header\n";

    /// The same triangle and an element that is passed over, in each encoding.
    fn files() -> [Vec<u8>; 3] {
        let ascii = "0 0 1\n\n 1 0.5 1\r\n0 1 -2\n2 0 -1 7\n9 3 0 1 2";
        let mut bodies = [ascii.as_bytes().to_vec(), Vec::new(), Vec::new()];
        let mut push = |little: &[u8]| {
            bodies[1].extend(little);
            bodies[2].extend(little.iter().rev());
        };
        for (x, y, z) in [(0f32, 0f64, 1i16), (1.0, 0.5, 1), (0.0, 1.0, -2)] {
            push(&x.to_le_bytes());
            push(&y.to_le_bytes());
            push(&z.to_le_bytes());
        }
        push(&2u16.to_le_bytes());
        push(&0i8.to_le_bytes());
        push(&(-1i8).to_le_bytes());
        push(&7i32.to_le_bytes());
        for word in [9u32, 3, 0, 1, 2] {
            push(&word.to_le_bytes());
        }
        let names = ["ascii", "binary_little_endian", "binary_big_endian"];
        std::array::from_fn(|k| {
            [format!("ply\nformat {} 1.0\n{HEADER}", names[k]).as_bytes(), &bodies[k]].concat()
        })
    }

    #[test]
    fn the_encodings_hold_the_same_mesh() {
        for file in files() {
            let mesh = parse(&file, "a.ply").unwrap().mesh;
            let expected = [[0.0, 0.0, 1.0], [1.0, 0.5, 1.0], [0.0, 1.0, -2.0]].map(DVec3::from_array);
            assert_eq!(mesh.positions, expected);
            assert_eq!(mesh.faces[0].vertices, [0, 1, 2]);
        }
    }

    #[test]
    fn files_that_end_too_early_or_hold_other_values_are_refused() {
        let [ascii, little, _] = files();
        let said = |file: &[u8]| parse(file, "a.ply").unwrap_err().to_string();
        assert!(said(&little[..little.len() - 1]).contains("face 1 of 1: the file ends in \"vertex_index\""));
        let ascii = String::from_utf8(ascii).unwrap();
        for (from, to, fragment) in [
            ("1 0.5 1", "1 0.5", "a.ply:16: vertex 2 of 3: \"z\" is not there"),
            ("1 0.5 1", "1 0.5 1 4", "\"4\" stands behind"),
            ("1 0.5 1", "1 half 1", "\"half\" is not a number"),
            ("2 0 -1 7", "-2 0 -1 7", "the length of \"ends\" is -2"),
            ("9 3 0 1 2", "", "a.ply:18: face 1 of 1: the file ends before it"),
            ("9 3 0 1 2", "9 3 0 1 -2", "has the vertices [0, 1, 4294967295]; 3 exist"),
        ] {
            let message = said(ascii.replace(from, to).as_bytes());
            assert!(message.contains(fragment), "{message}");
        }
    }
}
