//! Depth maps: the distance along the camera's axis of what each pixel sees.

use std::path::Path;

use ::image::{DynamicImage, ImageFormat};

use super::{hdr, image, npy, read_bounded};
use crate::error::{Error, Result};

/// Largest file read `[bytes]`.
const MAX_BYTES: u64 = 1 << 30;
/// Median depths `[m]` that a film of cloth has; others are another unit.
const USUAL: std::ops::RangeInclusive<f64> = 0.1..=30.0;

/// A depth map.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthMap {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// z in the camera's axes `[m]`, shape [height, width]; NaN where nothing was measured.
    pub z: Vec<f64>,
}

impl DepthMap {
    /// Reads a PNG of 16 bits in millimetres (0: nothing), an array [H, W] of NumPy (floats in metres, integers in millimetres),
    /// or an OpenEXR image in metres, of which the first channel counts. Apple's and Intel's sensors write these.
    ///
    /// # Errors
    /// [`Error::Input`] naming the file.
    pub fn read(path: &Path) -> Result<Self> {
        let broken = |problem: String| {
            let hint = "give a PNG of 16 bits in millimetres, a .npy array [height, width] of floats in metres or integers in millimetres, or an OpenEXR image in metres";
            Error::input(path.display().to_string(), problem, hint)
        };
        let bytes = read_bounded(path, MAX_BYTES)?;
        let (width, height, values, unit) = if bytes.starts_with(b"\x93NUMPY") {
            let (array, unit) = match npy::decode(&bytes, false) {
                Ok(array) => (array, 1.0),
                Err(_) => (npy::decode(&bytes, true).map_err(broken)?, 1e-3),
            };
            let [height, width] = array.shape[..] else {
                return Err(broken(format!("has shape {:?}, expected [height, width]", array.shape)));
            };
            (width, height, array.data, unit)
        } else if ::image::guess_format(&bytes).is_ok_and(|f| f == ImageFormat::Png) {
            let decoder = image::decoder(&bytes, ImageFormat::Png, MAX_BYTES);
            let decoded = decoder.and_then(DynamicImage::from_decoder);
            match decoded.map_err(|e| broken(format!("cannot be decoded: {e}")))? {
                DynamicImage::ImageLuma16(map) => {
                    let (width, height) = map.dimensions();
                    let values = map.into_raw().into_iter().map(f64::from).collect();
                    (width as usize, height as usize, values, 1e-3)
                }
                other => {
                    let problem = format!("is an image of {:?}, no depth map of 16 bits", other.color());
                    return Err(broken(problem));
                }
            }
        } else {
            let map = hdr::read_linear(path)?;
            let values = map.data.iter().step_by(map.channels).map(|v| f64::from(*v)).collect();
            (map.width, map.height, values, 1.0)
        };
        let z: Vec<f64> =
            values.iter().map(|v| if v.is_finite() && *v > 0.0 { v * unit } else { f64::NAN }).collect();
        let mut known: Vec<f64> = z.iter().copied().filter(|z| !z.is_nan()).collect();
        if known.is_empty() || width < 4 || height < 4 {
            return Err(broken(format!("{width}×{height} pixels hold no depth")));
        }
        known.sort_by(f64::total_cmp);
        let median = known[known.len() / 2];
        if !USUAL.contains(&median) {
            return Err(broken(format!("its median depth is {median:.4} m: the unit is another")));
        }
        Ok(Self { width, height, z })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn millimetres_and_metres_come_out_alike() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let mm: Vec<u16> = (0..20).map(|k| if k == 3 { 0 } else { 1200 + 10 * k }).collect();
        ::image::ImageBuffer::<::image::Luma<u16>, _>::from_raw(5, 4, mm.clone())
            .unwrap()
            .save(at("a.png"))
            .unwrap();
        let metres: Vec<f32> = mm.iter().map(|v| f32::from(*v) / 1000.0).collect();
        npy::write(&at("b.npy"), &[4, 5], &metres).unwrap();
        let data = metres.iter().flat_map(|v| [*v; 3]).collect();
        hdr::write_exr(&at("c.exr"), &crate::image::Image { width: 5, height: 4, channels: 3, data })
            .unwrap();
        for name in ["a.png", "b.npy", "c.exr"] {
            let map = DepthMap::read(&at(name)).unwrap();
            assert_eq!((map.width, map.height), (5, 4), "{name}");
            assert!(map.z[3].is_nan() && (map.z[19] - 1.39).abs() < 1e-6, "{name}: {:?}", map.z);
        }
        // Metres where millimetres belong, and images that are none.
        npy::write(&at("d.npy"), &[4, 5], &metres.iter().map(|v| v * 1000.0).collect::<Vec<f32>>()).unwrap();
        assert!(DepthMap::read(&at("d.npy")).unwrap_err().to_string().contains("the unit is another"));
        image::write_png(&at("e.png"), &crate::image::Image::new(5, 4, 3)).unwrap();
        assert!(DepthMap::read(&at("e.png")).unwrap_err().to_string().contains("no depth map of 16 bits"));
        npy::write(&at("f.npy"), &[20], &metres).unwrap();
        assert!(DepthMap::read(&at("f.npy")).unwrap_err().to_string().contains("expected [height, width]"));
    }
}
