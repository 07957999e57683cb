//! Which methods, and what the scenes are called.

use std::path::{Path, PathBuf};

use tessuto::compare::{ABLATIONS, Method};
use tessuto::{Error, Result};

/// The methods called `names`, each once, and the ablations.
///
/// # Errors
/// [`Error::Usage`] for a name that no method has.
pub fn methods(names: &[String], ablations: bool) -> Result<Vec<Method>> {
    let mut methods = Vec::new();
    for name in names {
        let method = Method::named(name.trim())?;
        if !methods.contains(&method) {
            methods.push(method);
        }
    }
    methods.extend(if ablations { &ABLATIONS[..] } else { &[] });
    Ok(methods)
}

/// The scenes' names: of their folders.
///
/// # Errors
/// [`Error::Input`] for a folder that is not there; [`Error::Usage`] if two have the same name.
pub fn names(scenes: &[PathBuf]) -> Result<Vec<String>> {
    let name =
        |scene: &Path| scene.canonicalize().ok()?.file_name().map(|n| n.to_string_lossy().into_owned());
    let mut names: Vec<String> = Vec::new();
    for scene in scenes {
        let name = name(scene).ok_or_else(|| {
            Error::input(scene.display().to_string(), "there is no such folder", "give the scene's folder")
        })?;
        if name == "comparison" || names.contains(&name) {
            let problem = format!("scene {}: the results of another go to {name}, too", scene.display());
            return Err(Error::usage(problem, "give its folder another name"));
        }
        names.push(name);
    }
    Ok(names)
}
