//! What `template.obj` remembers of the rectangle it was made of: a comment in its first line. The mesh does not say:
//! its border can lie on the mask's outline exactly and its depths be wrong.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use crate::io::{atomic_write, obj};
use tessuto_core::error::{Hint, Remedy, Result, Warning};
use tessuto_core::mesh::Mesh;

const BEFORE: &str = "# made of a rectangle, but no plane one has these corners: off by ";
const AFTER: &str = " px";
/// As far as this `[px]` corners are clicked or found beside the fabric's own: no reason to doubt its size or shape.
const NEAR: f64 = 2.0;
/// Longest comment read `[bytes]`.
const LONGEST: u64 = 256;

/// Writes a template; `misfit` is how far a plane rectangle's corners are from those seen `[px]`, root mean
/// square, where the template was made of one that does not fit.
///
/// # Errors
/// [`Error::Output`](tessuto_core::Error::Output).
pub fn write_template(path: &Path, mesh: &Mesh, misfit: Option<f64>) -> Result<()> {
    let comment = misfit.map_or_else(String::new, |off| format!("{BEFORE}{off:.1}{AFTER}\n"));
    atomic_write(path, (comment + &obj::encode(mesh, None)).as_bytes())
}

/// The misfit that [`write_template`] wrote into `path`; `None` too where there is no such file.
pub fn template_misfit(path: &Path) -> Option<f64> {
    let mut line = Vec::new();
    BufReader::new(File::open(path).ok()?.take(LONGEST)).read_until(b'\n', &mut line).ok()?;
    let off = std::str::from_utf8(&line)
        .ok()?
        .trim_start_matches('\u{feff}')
        .trim_end()
        .strip_prefix(BEFORE)?
        .strip_suffix(AFTER)?;
    off.parse().ok().filter(|off: &f64| off.is_finite())
}

/// The doubt about a template in `path` whose rectangle did not fit.
pub(super) fn warning(path: &Path) -> Option<Warning> {
    let off = template_misfit(path).filter(|off| *off >= NEAR)?;
    let found = format!("made of a rectangle, but no plane one has the corners seen: off by {off:.1} px");
    let hint = "the fabric is bent in this frame, or its size or corners are wrong: depths may be off by centimetres; \
                measure the size, begin with a frame in which the fabric is flat, or give a mesh of it";
    Some(Warning::new("template", found, Hint::from(hint).with(Remedy::Remesh)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_misfit_comes_back_and_the_mesh_is_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("template.obj");
        assert_eq!(template_misfit(&path), None);
        let mesh = tessuto_core::mesh::grid(3, 4, glam::DVec2::ONE, 1.5);
        for (misfit, doubted) in [(Some(6.8), true), (Some(2.0), true), (Some(1.9), false), (None, false)] {
            write_template(&path, &mesh, misfit).unwrap();
            assert_eq!(template_misfit(&path), misfit);
            assert_eq!(warning(&path).is_some(), doubted, "{misfit:?}");
            assert_eq!(obj::read(&path).unwrap(), mesh);
        }
        // What others wrote says nothing, and is no error.
        let long = [BEFORE.as_bytes(), &[b'9'; 1 << 16]].concat();
        for bytes in [b"".to_vec(), b"\xff\n".to_vec(), format!("{BEFORE}NaN{AFTER}\n").into_bytes(), long] {
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(template_misfit(&path), None);
        }
    }
}
