//! NumPy archive: a zip file of .npy files, stored without compression.

use super::Clip;
use super::row::{Output, Row};
use tessuto_core::camera::Pose;
use tessuto_estimate::io::npy::{archive, encode as array};
use tessuto_sim::cloth::AREA_DENSITY;

/// The row of the format.
pub(super) const FORMAT: Row = Row {
    key: "npz",
    programs: "NumPy",
    content: "motion, faces, uv, camera, forces, parameters (camera axes)",
    files: &[(".npz", "arrays for NumPy")],
    feature: None,
    for_blender: false,
    outputs: |clip| Ok(vec![Output::File(format!("{}.npz", clip.name), encode(clip))]),
};

/// Everything numeric, in the frame of the camera in the first frame of the video (x right, y down, z forward), SI
/// units. U uvs, F faces, T triangles:
///
/// `motion` [N, V, 3], `frames` `[N]` (numbers in the video), `states` `[N]` (0 found, 1 doubtful, 2 lost; where
/// they are known), `uv` [U, 2], `triangles` and `triangle_uvs` [T, 3], `face_sizes` `[F]`, `face_vertices` and
/// `face_uvs` [Σ face_sizes], `fps`, `first_frame`, `camera` [fx, fy, cx, cy, width, height], the properties of
/// the elastic model (`stretch`, `bend`, `shear` of springs), `area_density`, `constant_force` `[3]`,
/// `dynamic_force` [(M − 1)·parts, V, 3] of the whole clip of M frames, `dynamic_parts`; where there is air `wind`
/// `[3]` (velocity); where they are known `seen_vertices` `[V]` (frames that show each), `seen_texels` [S, S]
/// (pixels) and `seen_directions` [24, 48] (fraction of the pixels that face each); of a camera that moved
/// `camera_from_world` [M, 4, 4]; of C further cameras `view_cameras` [C, 6], `view_camera_from_world` [C, M, 4, 4].
fn encode(clip: &Clip) -> Vec<u8> {
    let mesh = &clip.mesh;
    let vectors = |motion: &[tessuto_core::Positions]| -> Vec<f32> {
        motion.iter().flatten().flat_map(|p| p.as_vec3().to_array()).collect()
    };
    let (frames, vertices) = (clip.motion.len(), mesh.positions.len());
    let triples = |t: Vec<[u32; 3]>| array(&[t.len(), 3], &t.concat());
    let uv: Vec<f64> = mesh.uvs.iter().flat_map(|uv| uv.to_array()).collect();
    let sizes: Vec<u32> = mesh.faces.iter().map(|f| f.vertices.len() as u32).collect();
    let corners = |of: fn(&tessuto_core::mesh::Face) -> &Vec<u32>| -> Vec<u32> {
        mesh.faces.iter().flat_map(of).copied().collect()
    };
    let (face_vertices, face_uvs) = (corners(|f| &f.vertices), corners(|f| &f.uvs));
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
        ("area_density", scalar(AREA_DENSITY)),
        ("constant_force", array(&[3], &accelerations.constant.to_array())),
        (
            "dynamic_force",
            array(&[accelerations.dynamic.len(), vertices, 3], &vectors(&accelerations.dynamic)),
        ),
        ("dynamic_parts", array(&[], &[accelerations.entries_per_frame as u32])),
    ];
    files.extend(clip.parameters.properties().map(|(property, value)| (property.key, scalar(value))));
    files.extend(accelerations.wind.map(|wind| ("wind", array(&[3], &wind.to_array()))));
    let numbers: Vec<u32> = clip.frames.iter().map(|n| (clip.first_frame + n) as u32).collect();
    files.push(("frames", array(&[frames], &numbers)));
    let state =
        |number: &u32| clip.verdicts.iter().find(|v| v.frame == *number as usize).map(|v| v.state as u32);
    if let Some(states) = numbers.iter().map(state).collect::<Option<Vec<u32>>>() {
        files.push(("states", array(&[frames], &states)));
    }
    let c = &clip.camera;
    let values = [c.fx, c.fy, c.cx, c.cy, c.width as f64, c.height as f64];
    files.push(("camera", array(&[6], &values)));
    if let Some(poses) = &clip.poses {
        let rows: Vec<f64> = poses.iter().flat_map(Pose::rows).collect();
        files.push(("camera_from_world", array(&[poses.len(), 4, 4], &rows)));
    }
    if !clip.others.is_empty() {
        let all = || clip.others.iter();
        let intrinsics = all().flat_map(|o| {
            let c = &o.camera;
            [c.fx, c.fy, c.cx, c.cy, c.width as f64, c.height as f64]
        });
        files.push(("view_cameras", array(&[clip.others.len(), 6], &intrinsics.collect::<Vec<_>>())));
        let rows: Vec<f64> = all().flat_map(|o| o.poses.iter().flat_map(Pose::rows)).collect();
        let shape = [clip.others.len(), clip.frame_count, 4, 4];
        files.push(("view_camera_from_world", array(&shape, &rows)));
    }
    files.extend(clip.seen.iter().map(|(name, shape, numbers)| (*name, array(shape, numbers))));
    archive(&files)
}
