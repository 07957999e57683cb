//! Merges vertices at the same place: other programs split them where texture coordinates differ.

use std::collections::HashMap;

use super::Mesh;

/// Merges vertices at exactly the same place, keeping the first of each; faces that name one twice then are removed.
/// The number of vertices and of faces that went.
pub fn weld(mesh: &mut Mesh) -> [usize; 2] {
    let mut index = HashMap::new();
    let mut positions = Vec::new();
    let merged: Vec<u32> = mesh
        .positions
        .iter()
        .map(|p| {
            // −0 and 0 are one place.
            *index.entry(p.to_array().map(|v| (v + 0.0).to_bits())).or_insert_with(|| {
                positions.push(*p);
                positions.len() as u32 - 1
            })
        })
        .collect();
    let gone = mesh.positions.len() - positions.len();
    mesh.positions = positions;
    for face in &mut mesh.faces {
        face.vertices.iter_mut().for_each(|v| *v = merged[*v as usize]);
    }
    let faces = mesh.faces.len();
    mesh.faces.retain(|face| {
        let mut sorted = face.vertices.clone();
        sorted.sort_unstable();
        sorted.windows(2).all(|pair| pair[0] != pair[1])
    });
    [gone, faces - mesh.faces.len()]
}
