//! PLY: ASCII and binary; texture coordinates per vertex (s t, u v, texture_u texture_v) or per corner (texcoord).

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

use glam::{DVec2, DVec3};

use super::{MAX_COUNT, Model, Split};
use crate::error::{Error, Result};

/// A line of the element `vertex`.
struct Vertex {
    position: DVec3,
    uv: [Option<f64>; 2],
}

/// A line of the element `face`.
struct Polygon {
    vertices: Vec<u32>,
    /// Two numbers a corner, or none.
    texcoord: Vec<f64>,
}

/// A line of any other element.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self { position: DVec3::NAN, uv: [None; 2] }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let Some(value) = scalar(&property) else { return PropertyAccessResult::Ignored };
        match name {
            "x" => self.position.x = value,
            "y" => self.position.y = value,
            "z" => self.position.z = value,
            "s" | "u" | "texture_u" => self.uv[0] = Some(value),
            "t" | "v" | "texture_v" => self.uv[1] = Some(value),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Polygon {
    fn new() -> Self {
        Self { vertices: Vec::new(), texcoord: Vec::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        match name {
            "vertex_indices" | "vertex_index" => {
                // A negative index becomes one that does not exist.
                let index = |v: f64| if v >= 0.0 && v < f64::from(u32::MAX) { v as u32 } else { u32::MAX };
                self.vertices = list(&property).into_iter().map(index).collect();
            }
            "texcoord" => self.texcoord = list(&property),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

fn scalar(property: &Property) -> Option<f64> {
    Some(match *property {
        Property::Char(v) => v.into(),
        Property::UChar(v) => v.into(),
        Property::Short(v) => v.into(),
        Property::UShort(v) => v.into(),
        Property::Int(v) => v.into(),
        Property::UInt(v) => v.into(),
        Property::Float(v) => v.into(),
        Property::Double(v) => v,
        _ => return None,
    })
}

fn list(property: &Property) -> Vec<f64> {
    fn convert<T: Copy + Into<f64>>(values: &[T]) -> Vec<f64> {
        values.iter().map(|v| (*v).into()).collect()
    }
    match property {
        Property::ListChar(v) => convert(v),
        Property::ListUChar(v) => convert(v),
        Property::ListShort(v) => convert(v),
        Property::ListUShort(v) => convert(v),
        Property::ListInt(v) => convert(v),
        Property::ListUInt(v) => convert(v),
        Property::ListFloat(v) => convert(v),
        Property::ListDouble(v) => v.clone(),
        _ => Vec::new(),
    }
}

/// Reads a mesh from the bytes of a PLY file.
pub(super) fn parse(bytes: &[u8], place: &str) -> Result<Model> {
    let broken = |e: ParseError| {
        let text = e.to_string();
        let line = e.line().map(|l| format!(":{l}")).unwrap_or_default();
        let first: String = text.split_whitespace().collect::<Vec<_>>().join(" ").chars().take(200).collect();
        Error::input(format!("{place}{line}"), first, "export the mesh again as PLY (ASCII or binary) or OBJ")
    };
    let mut reader = Reader::new(bytes);
    let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(broken)?;
    let (mut vertices, mut polygons) = (Vec::new(), Vec::new());
    for element in header.elements.values() {
        if element.count > MAX_COUNT {
            let problem = format!(
                "promises {} of element \"{}\"; at most {MAX_COUNT} are read",
                element.count, element.name
            );
            return Err(Error::input(place, problem, "reduce the mesh"));
        }
        match element.name.as_str() {
            "vertex" => {
                vertices = Parser::<Vertex>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(broken)?
            }
            "face" => {
                polygons = Parser::<Polygon>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(broken)?
            }
            _ => drop(
                Parser::<Skipped>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(broken)?,
            ),
        }
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
