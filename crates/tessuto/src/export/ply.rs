//! One binary PLY file per frame, with normals and texture coordinates.

use tessuto_core::parallel;

use super::Clip;
use super::row::{Output, Row};
use super::sequence::{frame_name, gaps};
use tessuto_core::mesh::Positions;

/// The row of the format.
pub(super) const FORMAT: Row = Row {
    key: "ply",
    programs: "Mesh per frame",
    content: "one binary file per frame, with normals and uv (y up)",
    files: &[("_ply", "one mesh a frame")],
    feature: None,
    for_blender: false,
    outputs: |clip| Ok(vec![Output::Folder(format!("{}_ply", clip.name), encode(clip))]),
};

/// The files. Texture coordinates are per vertex in PLY: they are left out for a mesh with seams.
fn encode(clip: &Clip) -> Vec<(String, Vec<u8>)> {
    let uvs = clip.vertex_uvs();
    let vertices = clip.mesh.positions.len();
    let property = |names: &[&str]| names.iter().map(|n| format!("property float {n}\n")).collect::<String>();
    let header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment metres, y up\nelement vertex {vertices}\n{}{}element face {}\n\
         property list uchar uint vertex_indices\nend_header\n",
        property(&["x", "y", "z", "nx", "ny", "nz"]),
        if uvs.is_some() { property(&["s", "t"]) } else { String::new() },
        clip.mesh.faces.len()
    );
    let file = |(n, vertices): (usize, &Positions)| {
        let mut out = header.clone().into_bytes();
        for (k, (p, normal)) in Clip::y_up(vertices).iter().zip(clip.normals(vertices)).enumerate() {
            let uv = uvs.as_ref().map_or(vec![], |uvs| uvs[k].to_array().to_vec());
            p.to_array()
                .into_iter()
                .chain(normal.to_array())
                .chain(uv)
                .for_each(|v| out.extend(v.to_le_bytes()));
        }
        for face in &clip.mesh.faces {
            out.push(u8::try_from(face.vertices.len()).expect("a polygon of the template has few corners"));
            face.vertices.iter().for_each(|v| out.extend(v.to_le_bytes()));
        }
        (frame_name(clip, n, "ply"), out)
    };
    let mut files: Vec<(String, Vec<u8>)> = parallel::numbered(&clip.motion, file);
    files.extend(gaps(clip));
    files
}
