//! Templates that no fabric can be, refused before they are written.

use glam::DVec2;

use tessuto_core::camera::Camera;
use tessuto_core::error::{Error, Hint, Result};
use tessuto_core::image::Image;
use tessuto_core::mesh::Mesh;

/// Nearer than this `[m]` no camera films cloth.
pub const NEAREST: f64 = 0.1;
/// A rectangle whose corners are farther than this from those seen [fraction of its mean side in the image] is not that
/// of the fabric, however it bends: R1, a bent sheet, is off by 1.6 %.
pub const MISFIT: f64 = 0.05;
/// Least overlap with the mask, as when a scene is loaded.
const OVERLAP: f64 = 0.3;

/// Refuses a rectangle that is `off` `[px]` from the corners seen.
///
/// # Errors
/// [`Error::Input`].
pub(super) fn check_misfit(off: f64, corners: [DVec2; 4]) -> Result<()> {
    let side = (0..4).map(|k| corners[k].distance(corners[(k + 1) % 4])).sum::<f64>() / 4.0;
    if off <= MISFIT * side {
        return Ok(());
    }
    let found = format!(
        "no rectangle of this size looks like this: the best one is off by {off:.1} px, {:.0} % of its side, \
         {:.0} % at most",
        100.0 * off / side,
        100.0 * MISFIT
    );
    Err(refusal(
        found,
        "see whether the four corners are those of the fabric, width and height are not exchanged, and the \
         camera is right",
    ))
}

/// Refuses a template `[m]` partly behind or on the lens, or far from the `mask` of the first frame; their overlap
/// (intersection over union).
///
/// # Errors
/// [`Error::Input`].
pub fn check_place(mesh: &Mesh, camera: &Camera, mask: Option<&Image>) -> Result<Option<f64>> {
    let nearest = mesh.positions.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    if nearest < NEAREST {
        let found = format!("its nearest vertex is {:.0} mm from the camera", 1e3 * nearest);
        let hint = "nothing is filmed from so near: give sizes in metres, the fabric's own corners, and masks \
                    that hold no floor or table";
        return Err(refusal(found, hint));
    }
    let Some(mask) = mask else { return Ok(None) };
    let overlap = super::overlap_with_mask(mesh, camera, mask);
    if overlap < OVERLAP {
        let fabric = mask.data.iter().filter(|m| **m >= 0.5).count();
        let found = format!(
            "its overlap with the mask of the first frame, {fabric} pixels, is {overlap:.2} (intersection \
             over union), {OVERLAP} at least"
        );
        return Err(refusal(
            found,
            "see whether corners and mask are those of the fabric in the first frame",
        ));
    }
    Ok(Some(overlap))
}

fn refusal(problem: String, hint: &str) -> Error {
    Error::input("the template", problem, Hint::from(hint))
}
