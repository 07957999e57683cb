//! Point cache, version 2 of PC2: what Blender's Mesh Cache modifier and 3ds Max read.

use super::row::{Output, Row};
use super::{Clip, obj};
use tessuto_core::mesh::Positions;

/// The row of the format.
pub(super) const FORMAT: Row = Row {
    key: "pc2",
    programs: "Point cache",
    content: "point cache, and the mesh it belongs to (y up)",
    files: &[
        (".pc2", "point cache: Blender, Maya, Cinema 4D"),
        ("_pc2.obj", "the mesh that the point cache moves"),
    ],
    feature: None,
    for_blender: false,
    outputs: |clip| {
        Ok(vec![
            Output::File(format!("{}_pc2.obj", clip.name), obj::still(clip)),
            Output::File(format!("{}.pc2", clip.name), encode(clip)),
        ])
    },
};

/// Header and positions `[m]`, y up, frame after frame, little-endian. A cache has a sample in every frame: one
/// that was left out lies on the straight line between its neighbours in time, before the first and after the last
/// it is as these are.
fn encode(clip: &Clip) -> Vec<u8> {
    let mut out = b"POINTCACHE2\0".to_vec();
    out.extend(1i32.to_le_bytes());
    out.extend((clip.mesh.positions.len() as i32).to_le_bytes());
    // First frame, and frames per sample.
    out.extend(0f32.to_le_bytes());
    out.extend(1f32.to_le_bytes());
    out.extend((clip.frame_count as i32).to_le_bytes());
    for n in 0..clip.frame_count {
        for p in Clip::y_up(&at(clip, n)) {
            p.to_array().iter().for_each(|v| out.extend(v.to_le_bytes()));
        }
    }
    out
}

/// Positions at frame `n` of the whole clip.
fn at(clip: &Clip, n: usize) -> Positions {
    let after = clip.frames.partition_point(|frame| *frame < n).min(clip.frames.len() - 1);
    if clip.frames[after] <= n || after == 0 {
        return clip.motion[after].clone();
    }
    let [before, later] = [after - 1, after].map(|k| clip.frames[k] as f64);
    let part = (n as f64 - before) / (later - before);
    clip.motion[after - 1].iter().zip(&clip.motion[after]).map(|(p, q)| p.lerp(*q, part)).collect()
}
