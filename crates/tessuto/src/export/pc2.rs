//! Point cache, version 2 of PC2: what Blender's Mesh Cache modifier and 3ds Max read.

use super::Clip;

/// Header and positions `[m]`, y up, frame after frame, little-endian.
pub(super) fn encode(clip: &Clip) -> Vec<u8> {
    let mut out = b"POINTCACHE2\0".to_vec();
    out.extend(1i32.to_le_bytes());
    out.extend((clip.mesh.positions.len() as i32).to_le_bytes());
    // First frame, and frames per sample.
    out.extend(0f32.to_le_bytes());
    out.extend(1f32.to_le_bytes());
    out.extend((clip.motion.len() as i32).to_le_bytes());
    for positions in clip.motion.iter() {
        for p in Clip::y_up(positions) {
            p.to_array().iter().for_each(|v| out.extend(v.to_le_bytes()));
        }
    }
    out
}
