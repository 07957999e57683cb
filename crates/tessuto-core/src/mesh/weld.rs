//! Merges vertices at the same place: other programs split them where texture coordinates differ, or write them
//! rounded.

use std::collections::HashMap;

use glam::DVec3;

use super::Mesh;

/// Merges vertices within `tolerance` of one another, in the mesh's unit, 0 for exactly the same place, keeping the
/// first of each; faces that name one twice then are removed, and vertices that no face names any more. The number of
/// vertices that were merged and of faces that went.
pub fn weld(mesh: &mut Mesh, tolerance: f64) -> [usize; 2] {
    let (merged, positions) = match tolerance > 0.0 {
        true => near(&mesh.positions, tolerance),
        false => same(&mesh.positions),
    };
    let gone = mesh.positions.len() - positions.len();
    mesh.positions = positions;
    for face in &mut mesh.faces {
        face.vertices.iter_mut().for_each(|v| *v = merged[*v as usize]);
    }
    let faces = mesh.faces.len();
    let mut left = vec![false; mesh.positions.len()];
    mesh.faces.retain(|face| {
        let mut sorted = face.vertices.clone();
        sorted.sort_unstable();
        let whole = sorted.windows(2).all(|pair| pair[0] != pair[1]);
        if !whole {
            face.vertices.iter().for_each(|v| left[*v as usize] = true);
        }
        whole
    });
    // Those that only such faces named; what no face named before is the file's own.
    mesh.faces.iter().flat_map(|face| &face.vertices).for_each(|v| left[*v as usize] = false);
    drop_vertices(mesh, &left);
    [gone, faces - mesh.faces.len()]
}

/// Removes the vertices that are marked, which no face names.
fn drop_vertices(mesh: &mut Mesh, marked: &[bool]) {
    if !marked.contains(&true) {
        return;
    }
    let mut next = 0;
    let places: Vec<u32> = marked
        .iter()
        .map(|gone| {
            let own = next;
            next += u32::from(!gone);
            own
        })
        .collect();
    let mut gone = marked.iter();
    mesh.positions.retain(|_| !gone.next().expect("one for each"));
    for face in &mut mesh.faces {
        face.vertices.iter_mut().for_each(|v| *v = places[*v as usize]);
    }
}

/// For every vertex the number of its place, and the places, each that of its first vertex.
type Merged = (Vec<u32>, Vec<DVec3>);

/// Vertices at exactly the same place.
fn same(all: &[DVec3]) -> Merged {
    let (mut index, mut positions) = (HashMap::new(), Vec::new());
    let of = |p: &DVec3| {
        // −0 and 0 are one place.
        *index.entry(p.to_array().map(|v| (v + 0.0).to_bits())).or_insert_with(|| {
            positions.push(*p);
            positions.len() as u32 - 1
        })
    };
    (all.iter().map(of).collect(), positions)
}

/// Vertices within `tolerance` of the first vertex of a place, the nearest such place.
fn near(all: &[DVec3], tolerance: f64) -> Merged {
    // Places by cubes of twice that side: only the neighbours of a cube can hold one that is near enough.
    let cube = |p: DVec3| (p / (2.0 * tolerance)).floor().to_array().map(|v| v as i64);
    let (mut places, mut positions): (HashMap<[i64; 3], Vec<u32>>, Vec<DVec3>) = (HashMap::new(), Vec::new());
    let merged = all.iter().map(|p| {
        let [x, y, z] = cube(*p);
        let around = (0..27).map(|k| [x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1]);
        let known = around.filter_map(|c| places.get(&c)).flatten().copied();
        let off = |v: &u32| positions[*v as usize].distance(*p);
        let nearest = known.filter(|v| off(v) <= tolerance).min_by(|a, b| off(a).total_cmp(&off(b)));
        nearest.unwrap_or_else(|| {
            positions.push(*p);
            let own = positions.len() as u32 - 1;
            places.entry([x, y, z]).or_default().push(own);
            own
        })
    });
    (merged.collect(), positions)
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::mesh::{Face, grid, pieces};

    /// A grid whose faces share no vertex; corners are moved by up to `off`.
    fn apart(off: f64) -> Mesh {
        let whole = grid(5, 4, DVec2::new(0.4, 0.3), 1.0);
        let mut mesh = Mesh { positions: Vec::new(), uvs: whole.uvs.clone(), faces: Vec::new() };
        for (k, face) in whole.faces.iter().enumerate() {
            let first = mesh.positions.len() as u32;
            let by = |n: usize| DVec3::new((k % 3) as f64 - 1.0, (n % 2) as f64, 0.0) * off / 2.5;
            let corners = face.vertices.iter().enumerate().map(|(n, v)| whole.positions[*v as usize] + by(n));
            mesh.positions.extend(corners);
            mesh.faces.push(Face { vertices: (first..first + 4).collect(), uvs: face.uvs.clone() });
        }
        mesh
    }

    #[test]
    fn vertices_within_the_tolerance_are_one() {
        for (off, tolerance, left) in
            [(0.0, 0.0, 20), (0.0, 1e-9, 20), (1e-7, 1e-7, 20), (1e-7, 0.0, 48), (1e-3, 1e-4, 48)]
        {
            let mut mesh = apart(off);
            let [gone, faces] = weld(&mut mesh, tolerance);
            if left == 20 {
                assert_eq!((mesh.positions.len(), gone, faces), (20, 28, 0), "{off} {tolerance}");
                assert_eq!(pieces(&mesh).len(), 1);
            } else {
                assert!(mesh.positions.len() > 20 && pieces(&mesh).len() > 1, "{off} {tolerance}");
            }
            assert!(
                mesh.faces.iter().flat_map(|f| &f.vertices).all(|v| (*v as usize) < mesh.positions.len())
            );
        }
    }

    #[test]
    fn a_vertex_whose_faces_go_goes_with_them() {
        // A quad with a thin triangle on it, two of whose corners are one place within the tolerance.
        let at = |x: f64, y: f64| DVec3::new(x, y, 1.0);
        let face = |vertices: &[u32]| Face { vertices: vertices.to_vec(), uvs: vec![0; vertices.len()] };
        let mut mesh = Mesh {
            positions: vec![
                at(5.0, 5.0),
                at(0.0, 0.0),
                at(1.0, 0.0),
                at(1.0, 1.0),
                at(0.0, 1.0),
                at(1.0, 1e-9),
            ],
            uvs: vec![DVec2::ZERO],
            faces: vec![face(&[2, 5, 0]), face(&[1, 2, 3, 4])],
        };
        assert_eq!(weld(&mut mesh, 1e-6), [1, 1]);
        assert_eq!(mesh.positions, [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]);
        assert_eq!(mesh.faces, [face(&[0, 1, 2, 3])]);
    }
}
