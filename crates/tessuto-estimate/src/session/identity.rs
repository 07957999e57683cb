//! What a computation's result depends on, in one number.

use sha2::{Digest, Sha256};

use tessuto_core::error::Result;
use tessuto_core::scene::Scene;
use tessuto_core::text::hex;

/// SHA-256 of everything that is computed with: `settings` as text, every camera and its poses, the template, what is
/// known of causes, and all pixels.
///
/// # Errors
/// Those of reading the frames.
pub fn identity(scene: &Scene, settings: &str) -> Result<String> {
    let mut hash = Sha256::new();
    hash.update(settings);
    hash.update([0]);
    let template = &scene.template;
    hash.update(format!("{} {}", scene.fps, scene.first_frame));
    hash.update(bytemuck::cast_slice::<_, u8>(&template.positions));
    hash.update(bytemuck::cast_slice::<_, u8>(&template.uvs));
    hash.update(format!("{:?}", template.faces));
    hash.update(format!("{:?}", scene.known));
    scene.more.iter().for_each(|view| hash.update(view.late.to_le_bytes()));
    for v in 0..scene.view_count() {
        add_view(&scene.seen_by(v), &mut hash)?;
    }
    Ok(hex(&hash.finalize()))
}

/// Adds what the scene's only camera saw, and where it was.
fn add_view(scene: &Scene, hash: &mut Sha256) -> Result<()> {
    hash.update(format!("{:?} {:?}", scene.camera, scene.crop));
    for map in scene.depths.iter().flat_map(|depths| &depths.maps) {
        hash.update(bytemuck::cast_slice::<_, u8>(map));
    }
    for pose in scene.poses.iter().flatten() {
        hash.update(bytemuck::cast_slice::<_, u8>(&pose.rows()));
    }
    let frame_hash = |(): &mut (), n| {
        let frame = scene.frames.frame(n)?;
        let mut hash = Sha256::new();
        [&frame.rgb, &frame.mask].iter().for_each(|i| hash.update(bytemuck::cast_slice::<_, u8>(&i.data)));
        Ok(hash.finalize())
    };
    let frames = scene.frames.map(0..scene.frames.len(), || (), frame_hash)?;
    frames.iter().for_each(|frame| hash.update(frame));
    Ok(())
}
