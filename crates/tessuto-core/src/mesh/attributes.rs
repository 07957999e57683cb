//! Per-vertex attributes from the faces: normals and texture coordinates.

use glam::{DVec2, DVec3};

use super::Mesh;

/// Unit normal of every vertex, the mean of its triangles' normals weighted by area, with vertices at `positions`
/// `[m]`; zero where there is none. Shape `[V]`.
pub fn vertex_normals(triangles: &[[u32; 3]], positions: &[DVec3]) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|v| positions[v as usize]);
        let normal = (b - a).cross(c - a);
        triangle.iter().for_each(|&v| sums[v as usize] += normal);
    }
    sums.into_iter().map(DVec3::normalize_or_zero).collect()
}

/// Texture coordinates of one vertex that differ by more than this belong to a seam.
pub const SEAM: f64 = 1e-3;

/// The texture coordinate of every vertex, shape `[V]`; zero at a vertex of no face. `None` if two corners of one
/// vertex differ by more than `tolerance`, as at a seam.
pub fn vertex_uvs(mesh: &Mesh, tolerance: f64) -> Option<Vec<DVec2>> {
    let mut found: Vec<Option<DVec2>> = vec![None; mesh.positions.len()];
    for face in &mesh.faces {
        for (vertex, uv) in face.vertices.iter().zip(&face.uvs) {
            let uv = mesh.uvs[*uv as usize];
            if found[*vertex as usize].get_or_insert(uv).distance(uv) > tolerance {
                return None;
            }
        }
    }
    Some(found.into_iter().map(Option::unwrap_or_default).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::grid;

    #[test]
    fn normals_are_weighted_by_area() {
        let positions = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::NEG_Z * 2.0, DVec3::ONE];
        // Half the unit square in the plane z = 0, and twice as much in the plane x = 0.
        let normals = vertex_normals(&[[0, 1, 2], [0, 2, 3]], &positions);
        let expected = DVec3::new(-2.0, 0.0, 1.0).normalize();
        assert!((normals[0] - expected).length() < 1e-15, "{}", normals[0]);
        assert_eq!((normals[1], normals[4]), (DVec3::Z, DVec3::ZERO));
    }

    #[test]
    fn a_seam_has_no_single_texture_coordinate() {
        let mut mesh = grid(3, 2, DVec2::ONE, 1.0);
        assert_eq!(vertex_uvs(&mesh, 0.0).unwrap(), mesh.uvs);
        mesh.uvs.push(mesh.uvs[1] + 1e-3);
        mesh.faces[1].uvs[0] = mesh.uvs.len() as u32 - 1;
        assert_eq!(vertex_uvs(&mesh, 0.0), None);
        assert!(vertex_uvs(&mesh, 1e-2).is_some());
    }
}
