//! What a computation's result depends on, in one number.

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::checkpoint::hex;
use crate::scene::Scene;

/// SHA-256 of everything that is computed with: `settings` as text, the camera, the template and all pixels.
pub fn identity(scene: &Scene, settings: &str) -> String {
    let mut hash = Sha256::new();
    hash.update(settings);
    hash.update([0]);
    let template = &scene.template;
    hash.update(format!("{:?} {:?} {} {}", scene.camera, scene.crop, scene.fps, scene.first_frame));
    hash.update(bytemuck::cast_slice::<_, u8>(&template.positions));
    hash.update(bytemuck::cast_slice::<_, u8>(&template.uvs));
    hash.update(format!("{:?}", template.faces));
    let frames: Vec<_> = scene
        .frames
        .par_iter()
        .map(|frame| {
            let mut hash = Sha256::new();
            [&frame.rgb, &frame.mask]
                .iter()
                .for_each(|i| hash.update(bytemuck::cast_slice::<_, u8>(&i.data)));
            hash.finalize()
        })
        .collect();
    frames.iter().for_each(|frame| hash.update(frame));
    hex(&hash.finalize())
}
