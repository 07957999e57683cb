//! One file per frame: OBJ with material, binary PLY with normals and colour coordinates.

use rayon::prelude::*;

use super::Clip;
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_estimate::io::obj;

/// Files of the OBJ sequence: meshes, material, image.
pub(super) fn obj(clip: &Clip) -> Vec<(String, Vec<u8>)> {
    let name = &clip.name;
    let library = format!("{name}.mtl");
    let mut files: Vec<(String, Vec<u8>)> = clip
        .motion
        .par_iter()
        .enumerate()
        .map(|(n, vertices)| (frame_name(clip, n, "obj"), text(clip, vertices, Some(&library))))
        .collect();
    let mut mtl =
        format!("newmtl {name}\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nmap_Kd {}\n", clip.material.file("basecolor"));
    if clip.material.roughness_metallic.is_some() {
        let [roughness, metallic] = ["roughness", "metallic"].map(|kind| clip.material.file(kind));
        mtl.push_str(&format!("map_Pr {roughness}\nmap_Pm {metallic}\n"));
    }
    files.push((library, mtl.into_bytes()));
    files.extend(clip.material.files());
    files.extend(gaps(clip));
    files
}

/// Which frames were left out and why, for whoever misses them.
fn gaps(clip: &Clip) -> Option<(String, Vec<u8>)> {
    let left_out = clip.left_out();
    let value = serde_json::json!({
        "frames_per_second": clip.fps,
        "first_frame": clip.first_frame,
        "frame_count": clip.frame_count,
        "frames_left_out": left_out,
        "verdicts": clip.verdicts,
    });
    let text = serde_json::to_string_pretty(&value).expect("plain data") + "\n";
    (!left_out.is_empty()).then(|| (format!("{}_frames.json", clip.name), text.into_bytes()))
}

/// The mesh of the first frame, without material, for a point cache.
pub(super) fn still(clip: &Clip) -> Vec<u8> {
    let left_out = clip.left_out();
    let mut out = match left_out.is_empty() {
        true => Vec::new(),
        false => format!("# lost frames, interpolated in the cache: {left_out:?}\n").into_bytes(),
    };
    out.extend(text(clip, &clip.motion[0], None));
    out
}

fn frame_name(clip: &Clip, n: usize, ending: &str) -> String {
    format!("{}_{:04}.{ending}", clip.name, clip.first_frame + clip.frames[n])
}

fn text(clip: &Clip, vertices: &Positions, library: Option<&str>) -> Vec<u8> {
    let positions = Clip::y_up(vertices).iter().map(|p| p.as_dvec3()).collect();
    let mesh = Mesh { positions, ..clip.mesh.clone() };
    let material = library.map(|library| obj::Material { library, name: &clip.name });
    obj::encode(&mesh, material).into_bytes()
}

/// Files of the PLY sequence. Texture coordinates are per vertex in PLY: they are left out for a mesh with seams.
pub(super) fn ply(clip: &Clip) -> Vec<(String, Vec<u8>)> {
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
    let mut files: Vec<(String, Vec<u8>)> = clip.motion.par_iter().enumerate().map(file).collect();
    files.extend(gaps(clip));
    files
}
