//! What is written into the scene: masks, their record, the page; nothing of a user's is replaced.

use std::path::{Path, PathBuf};

use tessuto_core::parallel;

use super::{page, record};
use crate::io::{atomic_write, image};
use crate::output::manifest::{check_parts, record_or_begin};
use crate::output::{FolderKind, OutputFolder};
use tessuto_core::error::{Error, Result};
use tessuto_core::image::Image;

/// The given plate, as it is kept.
pub(super) const PLATE: &str = "plate.png";
/// The given mask of the first frame, as it is kept.
pub(super) const DRAWN: &str = "drawn.png";
const MASKS: &str = "masks";

/// Refuses to go on where masks that tessuto did not write would be lost.
pub(super) fn check(folder: &Path) -> Result<()> {
    check_parts(&[MASKS, record::NAME, page::NAME].map(|name| folder.join(name)), true)
}

/// Keeps what was given in the scene, as `name`.
pub(super) fn keep(folder: &Path, name: &'static str, given: &Image) -> Result<()> {
    let path = folder.join(name);
    let bytes = image::encode_png(given);
    if std::fs::read(&path).is_ok_and(|there| there == bytes) {
        return Ok(());
    }
    check_parts(&[&path], true)?;
    atomic_write(&path, &bytes)?;
    record_or_begin(folder, FolderKind::Scene, &[name])
}

/// Writes all files; their paths. `mask` gives each mask, shape [height · width].
pub(super) fn write(
    folder: &Path,
    record: &record::Record,
    page: &str,
    [width, height]: [usize; 2],
    count: usize,
    mask: &(dyn Fn(usize) -> Vec<f32> + Sync),
) -> Result<Vec<PathBuf>> {
    let masks = folder.join(MASKS);
    // An empty folder is in nobody's manifest.
    if masks.is_dir() {
        let _ = std::fs::remove_dir(&masks);
    }
    let output = OutputFolder::prepare_part(&masks)?;
    parallel::try_map(count, |n| {
        let bytes: Vec<u8> = mask(n).iter().map(|v| (255.0 * v.clamp(0.0, 1.0)).round() as u8).collect();
        let png = image::encode_png_bytes(&bytes, [width, height], 1);
        let path = output.partial().join(format!("mask_{n:03}.png"));
        std::fs::write(&path, png).map_err(|source| Error::Output { path, source })
    })?;
    output.publish()?;
    record.write(folder)?;
    atomic_write(&folder.join(page::NAME), page.as_bytes())?;
    let names = [MASKS, record::NAME, page::NAME];
    record_or_begin(folder, FolderKind::Scene, &names)?;
    Ok(names.iter().map(|name| folder.join(name)).collect())
}
