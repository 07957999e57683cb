//! How good recovered material maps and re-rendered frames are.
//!
//! A result holds `material/{diffuse,roughness,metallic}.png` and `rerendered/rgb_000.png …`; the scene
//! may hold the true maps in `gt/material/`. Maps are resized to the truth's size and compared where the
//! template's uv covers them.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::resample::bicubic;
use super::similarity::{best_scale, correlation, masked_psnr, psnr, scaled, ssim, taken};
use crate::io;
use tessuto_core::error::{Error, Result};
use tessuto_core::image::Image;
use tessuto_core::mesh::Mesh;
use tessuto_core::scene::Scene;
use tessuto_core::video::COVERED;
use tessuto_render::raster::coverage::fill_triangle;

/// Likeness of maps and frames to the truth. What cannot be compared is absent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct MapMetrics {
    /// PSNR `[dB]` of the diffuse map, sRGB-encoded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diffuse_psnr: Option<f64>,
    /// SSIM of the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diffuse_ssim: Option<f64>,
    /// PSNR `[dB]` of the diffuse map, sRGB-encoded, after the best factor per channel in linear space:
    /// brightness of light and cloth cannot be distinguished.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diffuse_psnr_scaled: Option<f64>,
    /// SSIM of the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diffuse_ssim_scaled: Option<f64>,
    /// The factors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diffuse_scale: Option<[f64; 3]>,
    /// PSNR `[dB]` of the roughness map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roughness_psnr: Option<f64>,
    /// SSIM of the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roughness_ssim: Option<f64>,
    /// Correlation of the same; absent where truth or estimate is constant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roughness_corr: Option<f64>,
    /// PSNR `[dB]` of the metallic map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub metallic_psnr: Option<f64>,
    /// SSIM of the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub metallic_ssim: Option<f64>,
    /// Correlation of the same; absent where truth or estimate is constant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub metallic_corr: Option<f64>,
    /// Mean over the re-rendered frames of the PSNR `[dB]` inside the observed mask and the crop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames_psnr: Option<f64>,
    /// PSNR `[dB]` of the cloth under another light, drawn with the maps, against the same with the true maps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relit_psnr: Option<f64>,
    /// The same after the best factor per channel of the linear colours.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relit_psnr_scaled: Option<f64>,
    /// Number of the re-rendered frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<usize>,
}

impl MapMetrics {
    /// Key, value and meaning of the scalars that are there, for people.
    pub fn rows(&self) -> Vec<(&'static str, f64, &'static str)> {
        let all = [
            ("diffuse_psnr", self.diffuse_psnr, "diffuse map, sRGB [dB]"),
            ("diffuse_ssim", self.diffuse_ssim, "diffuse map, structural similarity"),
            (
                "diffuse_psnr_scaled",
                self.diffuse_psnr_scaled,
                "diffuse map, sRGB, after the best factor per channel [dB]",
            ),
            (
                "diffuse_ssim_scaled",
                self.diffuse_ssim_scaled,
                "diffuse map, structural similarity, after the best factor per channel",
            ),
            ("roughness_psnr", self.roughness_psnr, "roughness map [dB]"),
            ("roughness_ssim", self.roughness_ssim, "roughness map, structural similarity"),
            ("roughness_corr", self.roughness_corr, "roughness map, correlation"),
            ("metallic_psnr", self.metallic_psnr, "metallic map [dB]"),
            ("metallic_ssim", self.metallic_ssim, "metallic map, structural similarity"),
            ("metallic_corr", self.metallic_corr, "metallic map, correlation"),
            ("frames_psnr", self.frames_psnr, "re-rendered frames inside the masks, mean [dB]"),
            ("relit_psnr", self.relit_psnr, "relit frames against the true maps' [dB]"),
            (
                "relit_psnr_scaled",
                self.relit_psnr_scaled,
                "relit frames against the true maps', after the best factor per channel [dB]",
            ),
        ];
        all.into_iter().filter_map(|(key, value, label)| value.map(|v| (key, v, label))).collect()
    }
}

/// Likeness of the maps and re-rendered frames in the folder `result` to what `scene` has of them;
/// None where there is nothing to compare.
///
/// # Errors
/// [`Error::Input`] naming the file.
pub fn evaluate(scene: &Scene, result: &Path) -> Result<Option<MapMetrics>> {
    let mut metrics = MapMetrics::default();
    if let Some((estimate, truth, covered)) = pair(scene, result, "diffuse")? {
        let likeness =
            |e: &Image| (psnr(&taken(e, &covered), &taken(&truth, &covered)), ssim(e, &truth, &covered));
        let (ratio, similarity) = likeness(&estimate);
        (metrics.diffuse_psnr, metrics.diffuse_ssim) = (Some(ratio), similarity);
        let scale = best_scale(&taken(&estimate, &covered), &taken(&truth, &covered));
        let (ratio, similarity) = likeness(&Image { data: scaled(&estimate.data, scale), ..estimate });
        (metrics.diffuse_psnr_scaled, metrics.diffuse_ssim_scaled) = (Some(ratio), similarity);
        metrics.diffuse_scale = Some(scale);
    }
    let scalar = |name: &str| -> Result<[Option<f64>; 3]> {
        let Some((estimate, truth, covered)) = pair(scene, result, name)? else { return Ok([None; 3]) };
        let (e, t) = (taken(&estimate, &covered), taken(&truth, &covered));
        Ok([Some(psnr(&e, &t)), ssim(&estimate, &truth, &covered), correlation(&means(&e), &means(&t))])
    };
    [metrics.roughness_psnr, metrics.roughness_ssim, metrics.roughness_corr] = scalar("roughness")?;
    [metrics.metallic_psnr, metrics.metallic_ssim, metrics.metallic_corr] = scalar("metallic")?;
    if let Some((ratio, count)) = frames(scene, result)? {
        (metrics.frames_psnr, metrics.frames) = (Some(ratio), Some(count));
    }
    Ok((metrics != MapMetrics::default()).then_some(metrics))
}

/// Estimate at the truth's size, truth, and which texels count; None unless both files exist.
fn pair(scene: &Scene, result: &Path, name: &str) -> Result<Option<(Image, Image, Vec<bool>)>> {
    let file = format!("material/{name}.png");
    let (estimate, truth) = (result.join(&file), scene.folder.join("gt").join(&file));
    if !estimate.is_file() || !truth.is_file() {
        return Ok(None);
    }
    let truth_map = io::image::read(&truth)?;
    let covered = uv_coverage(&scene.template, truth_map.width, truth_map.height);
    if !covered.contains(&true) {
        return Err(Error::input(
            truth.display().to_string(),
            "the template's uv covers none of its pixels",
            "uv must lie in [0, 1]: correct template.obj",
        ));
    }
    let estimate_map = bicubic(&io::image::read(&estimate)?, truth_map.width, truth_map.height);
    Ok(Some((estimate_map, truth_map, covered)))
}

/// Which texels of a map of `width`×`height` the template uses, shape `[height · width]`; row 0 is v = 1.
pub(crate) fn uv_coverage(template: &Mesh, width: usize, height: usize) -> Vec<bool> {
    let mut covered = vec![false; width * height];
    // The corners of the image are the centres of its corner texels.
    let scale = glam::DVec2::new(width as f64 - 1.0, height as f64 - 1.0);
    for triangle in template.triangle_uvs() {
        let corners = triangle.map(|k| {
            let uv = template.uvs[k as usize];
            glam::DVec2::new(uv.x, 1.0 - uv.y) * scale
        });
        fill_triangle(corners, [width, height], true, |x, y| covered[y * width + x] = true);
    }
    covered
}

/// Means of three channels each.
fn means(values: &[f32]) -> Vec<f32> {
    values.chunks_exact(3).map(|p| (p[0] + p[1] + p[2]) / 3.0).collect()
}

/// Mean PSNR `[dB]` of the re-rendered frames and their number.
fn frames(scene: &Scene, result: &Path) -> Result<Option<(f64, usize)>> {
    let ratio = |(): &mut (), k: usize| -> Result<Option<f64>> {
        let path = result.join(format!("rerendered/rgb_{:03}.png", scene.first_frame + k));
        if !path.is_file() {
            return Ok(None);
        }
        let rerendered = io::image::read_region(&path, scene.full_size, scene.crop)?;
        let observed = scene.frames.frame(k)?;
        let covered: Vec<bool> = observed.mask.data.iter().map(|m| *m >= COVERED).collect();
        Ok(masked_psnr(&rerendered, &observed.rgb, &covered))
    };
    let ratios = scene.frames.map(0..scene.frames.len(), || (), ratio)?;
    let found: Vec<f64> = ratios.into_iter().flatten().collect();
    Ok((!found.is_empty()).then(|| (found.iter().sum::<f64>() / found.len() as f64, found.len())))
}
