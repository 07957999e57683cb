//! One OBJ file per frame, with material.

use tessuto_core::parallel;

use super::Clip;
use super::row::{Output, Row};
use super::sequence::{frame_name, gaps};
use tessuto_core::mesh::{Mesh, Positions};
use tessuto_estimate::io::obj;

/// The row of the format.
pub(super) const FORMAT: Row = Row {
    key: "obj",
    programs: "Mesh per frame",
    content: "one file per frame, with material (y up)",
    files: &[("_obj", "one mesh a frame")],
    feature: None,
    for_blender: false,
    outputs: |clip| Ok(vec![Output::Folder(format!("{}_obj", clip.name), encode(clip))]),
};

/// The files: meshes, material, image.
fn encode(clip: &Clip) -> Vec<(String, Vec<u8>)> {
    let name = &clip.name;
    let library = format!("{name}.mtl");
    let mut files: Vec<(String, Vec<u8>)> = parallel::numbered(&clip.motion, |(n, vertices)| {
        (frame_name(clip, n, "obj"), text(clip, vertices, Some(&library)))
    });
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

fn text(clip: &Clip, vertices: &Positions, library: Option<&str>) -> Vec<u8> {
    let positions = Clip::y_up(vertices).iter().map(|p| p.as_dvec3()).collect();
    let mesh = Mesh { positions, ..clip.mesh.clone() };
    let material = library.map(|library| obj::Material { library, name: &clip.name });
    obj::encode(&mesh, material).into_bytes()
}
