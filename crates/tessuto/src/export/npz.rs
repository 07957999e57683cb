//! NumPy archive: a zip file of .npy files, stored without compression.

use super::Clip;
use crate::io::npy::encode as array;
use crate::sim::cloth::AREA_DENSITY;

/// Everything numeric, in the camera frame (x right, y down, z forward), SI units. U uvs, F faces, T triangles:
///
/// `motion` [N, V, 3], `uv` [U, 2], `triangles` and `triangle_uvs` [T, 3], `face_sizes` `[F]`, `face_vertices` and
/// `face_uvs` [Σ face_sizes], `fps`, `first_frame`, `camera` [fx, fy, cx, cy, width, height], `stretch`, `bend`,
/// `shear`, `area_density`, `constant_force` `[3]`, `dynamic_force` [(N − 1)·parts, V, 3], `dynamic_parts`.
pub(super) fn encode(clip: &Clip) -> Vec<u8> {
    let mesh = &clip.mesh;
    let vectors = |motion: &[crate::Positions]| -> Vec<f32> {
        motion.iter().flatten().flat_map(|p| p.as_vec3().to_array()).collect()
    };
    let (frames, vertices) = (clip.motion.len(), mesh.positions.len());
    let triples = |t: Vec<[u32; 3]>| array(&[t.len(), 3], &t.concat());
    let uv: Vec<f64> = mesh.uvs.iter().flat_map(|uv| uv.to_array()).collect();
    let sizes: Vec<u32> = mesh.faces.iter().map(|f| f.vertices.len() as u32).collect();
    let corners = |of: fn(&crate::mesh::Face) -> &Vec<u32>| -> Vec<u32> {
        mesh.faces.iter().flat_map(of).copied().collect()
    };
    let (face_vertices, face_uvs) = (corners(|f| &f.vertices), corners(|f| &f.uvs));
    let [stretch, bend, shear] = clip.parameters.stiffness();
    let accelerations = &clip.parameters.accelerations;
    let scalar = |v: f64| array(&[], &[v]);
    let mut files = vec![
        ("motion", array(&[frames, vertices, 3], &vectors(&clip.motion))),
        ("uv", array(&[mesh.uvs.len(), 2], &uv)),
        ("triangles", triples(mesh.triangles())),
        ("triangle_uvs", triples(mesh.triangle_uvs())),
        ("face_sizes", array(&[sizes.len()], &sizes)),
        ("face_vertices", array(&[face_vertices.len()], &face_vertices)),
        ("face_uvs", array(&[face_uvs.len()], &face_uvs)),
        ("fps", scalar(clip.fps)),
        ("first_frame", array(&[], &[clip.first_frame as u32])),
        ("stretch", scalar(stretch)),
        ("bend", scalar(bend)),
        ("shear", scalar(shear)),
        ("area_density", scalar(AREA_DENSITY)),
        ("constant_force", array(&[3], &accelerations.constant.to_array())),
        (
            "dynamic_force",
            array(&[accelerations.dynamic.len(), vertices, 3], &vectors(&accelerations.dynamic)),
        ),
        ("dynamic_parts", array(&[], &[accelerations.entries_per_frame as u32])),
    ];
    let c = &clip.camera;
    let values = [c.fx, c.fy, c.cx, c.cy, c.width as f64, c.height as f64];
    files.push(("camera", array(&[6], &values)));
    zip(&files)
}

/// A zip file of stored entries `<name>.npy`. No entry is near the 4 GiB that would need the format's 64-bit variant.
///
/// Source: PKWARE, "APPNOTE.TXT", 6.3.10, §4.3.
fn zip(files: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in files {
        let name = format!("{name}.npy");
        let size = u32::try_from(bytes.len()).expect("an array below 4 GiB").to_le_bytes();
        let offset = u32::try_from(out.len()).expect("an archive below 4 GiB").to_le_bytes();
        // Version 2.0, no flags, stored, 1980-01-01 (so that the same result gives the same bytes), checksum, sizes.
        let mut common = vec![20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
        common.extend(crc32(bytes).to_le_bytes());
        common.extend([size, size].concat());
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        out.extend(b"PK\x03\x04");
        out.extend(&common);
        out.extend(name.as_bytes());
        out.extend(bytes);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        // No comment, disk 0, no attributes.
        directory.extend([0; 10]);
        directory.extend(offset);
        directory.extend(name.as_bytes());
    }
    let (start, count) = (out.len() as u32, files.len() as u16);
    out.extend(&directory);
    out.extend(b"PK\x05\x06\0\0\0\0");
    out.extend([count.to_le_bytes(), count.to_le_bytes()].concat());
    out.extend((directory.len() as u32).to_le_bytes());
    out.extend(start.to_le_bytes());
    out.extend([0, 0]);
    out
}

/// Checksum of ISO 3309, as zip wants it.
fn crc32(bytes: &[u8]) -> u32 {
    let table: [u32; 256] = std::array::from_fn(|k| {
        (0..8).fold(k as u32, |c, _| if c & 1 == 1 { (c >> 1) ^ 0xEDB8_8320 } else { c >> 1 })
    });
    !bytes.iter().fold(!0, |crc, b| (crc >> 8) ^ table[((crc ^ u32::from(*b)) & 0xFF) as usize])
}

#[cfg(test)]
mod tests {
    #[test]
    fn checksum_of_the_standard_text() {
        assert_eq!(super::crc32(b"123456789"), 0xCBF4_3926);
    }
}
