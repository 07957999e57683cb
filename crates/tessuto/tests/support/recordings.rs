//! The recorded and rendered scenes, which lie beside the workspace and not in it, and a smooth, made-up motion.

use std::path::{Path, PathBuf};

use glam::DVec3;
use tessuto::io::scene::{LoadOptions, load};
use tessuto::{Positions, Scene};

use super::missing::not_tested;

/// The file or folder `name` among the recordings. Where it is not there, `None` and a line on stderr that names the
/// test; with `CI=true` in the environment that is a failure.
pub fn recorded(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    assert!(std::env::var("CI").as_deref() != Ok("true"), "{} is missing", path.display());
    not_tested(&format!("../shared/data/{name}"));
    None
}

/// The recorded scene `name`, as [`recorded`].
pub fn scene(name: &str) -> Option<Scene> {
    Some(load(&recorded(name)?, &LoadOptions::default()).unwrap().scene)
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
