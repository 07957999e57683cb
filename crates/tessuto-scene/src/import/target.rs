//! Where an imported scene may go.

use std::path::{Path, PathBuf};

use crate::io::scene::TemplateRecord;
use tessuto_core::error::{Error, Hint, Remedy, Result};

/// Files of a scene that outlive its being imported anew.
pub const CARRIED_OVER: [&str; 2] = ["template.obj", TemplateRecord::NAME];

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

/// Copies the `template` of a scene into another's `folder`, and what is known of it.
///
/// # Errors
/// [`Error::Output`]; [`Error::Input`] if the copy cannot be read.
pub fn copy_template(template: &Path, folder: &Path) -> Result<()> {
    std::fs::copy(template, folder.join("template.obj"))
        .map_err(|source| Error::Output { path: template.to_path_buf(), source })?;
    template.parent().and_then(TemplateRecord::read).map_or(Ok(()), |record| record.write(folder))
}
