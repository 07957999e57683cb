//! Where an imported scene may go.

use std::path::{Path, PathBuf};

use crate::error::{Error, Hint, Remedy, Result};

/// Refuses to write a scene to `out` where that would cost the user something: a scene that is there, without leave to
/// `replace` it, or one of the `sources` that lies inside of it.
///
/// # Errors
/// [`Error::Input`] naming what would be lost.
pub fn check_target(out: &Path, replace: bool, sources: [Option<&PathBuf>; 4]) -> Result<()> {
    let there = out.join("scene.json").is_file();
    if there && !replace {
        return Err(Error::input(
            out.display().to_string(),
            "a scene already exists here and would be replaced",
            Hint::from("choose another folder, or allow to replace it").with(Remedy::Replace),
        ));
    }
    let inside = |path: &Path| match (path.canonicalize(), out.canonicalize()) {
        (Ok(path), Ok(out)) => path.starts_with(out),
        _ => false,
    };
    if let Some(source) = sources.into_iter().flatten().find(|path| there && inside(path)) {
        return Err(Error::input(
            source.display().to_string(),
            format!("lies in {}, which would be replaced", out.display()),
            "choose another folder for the scene",
        ));
    }
    Ok(())
}
