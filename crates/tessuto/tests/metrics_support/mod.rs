//! What the metrics tests share: the recorded scenes and a smooth, made-up motion.
#![allow(dead_code, reason = "each test file uses its part")]

use std::path::Path;

use glam::DVec3;
use tessuto::io::scene::{LoadOptions, load};
use tessuto::{Positions, Scene};

/// The recorded scene `name`; None, with a printed line, where the data is not there.
pub fn scene(name: &str) -> Option<Scene> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if !folder.exists() {
        assert!(std::env::var("CI").is_err(), "{} is missing", folder.display());
        println!("skipped: {} is missing", folder.display());
        return None;
    }
    Some(load(&folder, &LoadOptions::default()).unwrap().scene)
}

/// `template` with a travelling wave of 3 cm in each direction.
pub fn wave(template: &[DVec3], frames: usize) -> Vec<Positions> {
    let moved = |f: usize| {
        let t = f as f64;
        template
            .iter()
            .map(|p| {
                *p + 0.03
                    * DVec3::new(
                        (7.0 * p.x + 0.1 * t).sin(),
                        (9.0 * p.y - 0.2 * t).sin(),
                        (5.0 * p.x + 6.0 * p.y + 0.15 * t).sin(),
                    )
            })
            .collect()
    };
    (0..frames).map(moved).collect()
}
