//! Depth maps: the distance along the camera's axis of what each pixel sees.

use std::path::Path;

use super::codec::{self, Format, Pixels, Refusal, Samples};
use super::depth_unit::Unit;
use super::{exr_depth, hdr, image, npy, read_bounded};
use tessuto_core::error::{Error, Hint, Remedy, Result};

/// Largest file read `[bytes]`.
const MAX_BYTES: u64 = 1 << 30;
/// Median depths `[m]` that a film of cloth has; others are another unit.
const USUAL: std::ops::RangeInclusive<f64> = 0.1..=30.0;

/// The largest number of 16 bits: sensors write it where they measured nothing.
const FULL: f64 = 65535.0;

/// A depth map.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthMap {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// z in the camera's axes `[m]`, shape [height, width]; NaN where nothing was measured.
    pub z: Vec<f64>,
    /// What a unit of the file is.
    pub unit: Unit,
    /// The channel that was taken, of files that have several.
    pub channel: Option<String>,
}

/// The numbers of a file, and what they usually are `[m]`.
struct Raw {
    width: usize,
    height: usize,
    values: Vec<f64>,
    usual: f64,
    channel: Option<String>,
}

impl DepthMap {
    /// Leaves out what the lowest level, 0, was given to in the confidence map at `path`, a grey image of the same
    /// size, where any pixel has a higher one.
    ///
    /// # Errors
    /// [`Error::Input`] naming that file.
    pub fn leave_out(&mut self, path: &Path) -> Result<()> {
        let levels = image::read_grey(path)?;
        if [levels.width, levels.height] != [self.width, self.height] {
            let problem = format!(
                "is {}×{} pixels, but the depth map {}×{}",
                levels.width, levels.height, self.width, self.height
            );
            let hint = "give the confidence of this depth map, or remove it";
            return Err(Error::input(path.display().to_string(), problem, hint));
        }
        if levels.data.iter().any(|level| *level > 0.0) {
            let pairs = self.z.iter_mut().zip(&levels.data);
            pairs.filter(|(_, level)| **level <= 0.0).for_each(|(z, _)| *z = f64::NAN);
        }
        Ok(())
    }

    /// Reads a PNG of 16 bits in millimetres, an array [H, W] of NumPy (floats in metres, integers in millimetres), or
    /// an OpenEXR image in metres, whose channel of depth counts (Z, depth, V, Y, the only one, or equal colours).
    /// `scale` says another unit `[m]`. Nothing was measured where values are 0, below, no number or infinite, and
    /// where whole numbers are 65535.
    ///
    /// # Errors
    /// [`Error::Input`] naming the file.
    pub fn read(path: &Path, scale: Option<f64>) -> Result<Self> {
        let hint = "give a PNG of 16 bits in millimetres, a .npy array [height, width] of floats in metres or \
                    integers in millimetres, or an OpenEXR image in metres with a channel Z, or say what its unit is";
        let broken = |problem: String| {
            Error::input(path.display().to_string(), problem, Hint::from(hint).with(Remedy::DepthScale))
        };
        let raw = raw(path)?.map_err(broken)?;
        let Raw { width, height, values, usual, channel } = raw;
        let unit = Unit { metres: scale.unwrap_or(usual), told: scale.is_some() };
        let z: Vec<f64> = values
            .iter()
            .map(|v| if v.is_finite() && *v > 0.0 { v * unit.metres } else { f64::NAN })
            .collect();
        let mut known: Vec<f64> = z.iter().copied().filter(|z| !z.is_nan()).collect();
        if known.is_empty() || width < 4 || height < 4 {
            return Err(broken(format!("{width}×{height} pixels hold no depth")));
        }
        known.sort_by(f64::total_cmp);
        let median = known[known.len() / 2];
        if !USUAL.contains(&median) {
            let others = match unit.others(median, &USUAL) {
                others if others.is_empty() => String::new(),
                others => format!(" ({others})"),
            };
            let taken = unit.name();
            let problem =
                format!("its median depth is {median:.4} m with {taken}: the unit is another{others}");
            return Err(broken(problem));
        }
        Ok(Self { width, height, z, unit, channel })
    }
}

/// The numbers in the file at `path`; the inner error is what is wrong with them.
fn raw(path: &Path) -> Result<std::result::Result<Raw, String>> {
    let bytes = read_bounded(path, MAX_BYTES)?;
    if bytes.starts_with(b"\x93NUMPY") {
        return Ok(of_array(&bytes));
    }
    let plain = |width, height, values, usual| Raw { width, height, values, usual, channel: None };
    Ok(match Format::of(&bytes) {
        Some(Format::Png) => match codec::png::stored(&bytes, MAX_BYTES) {
            Ok(Pixels { width, height, channels: 1, samples: Samples::Words(map) }) => {
                let values = map.into_iter().map(|v| whole(f64::from(v))).collect();
                Ok(plain(width, height, values, 1e-3))
            }
            Ok(other) => Err(format!("is an image of {}, no depth map of 16 bits", other.kind())),
            Err(Refusal::Broken(problem)) => Err(format!("cannot be decoded: {problem}")),
            Err(Refusal::Large { size: [width, height], bytes }) => {
                Err(format!("{width}×{height} pixels take {bytes} bytes; at most {MAX_BYTES} are read"))
            }
        },
        Some(Format::OpenExr) => exr_depth::read_depth(&bytes).map(|found| {
            let exr_depth::Channel { width, height, values, name } = found;
            Raw { channel: Some(name), ..plain(width, height, values, 1.0) }
        }),
        _ => {
            let map = hdr::read_linear(path)?;
            let values = map.data.iter().step_by(map.channels).map(|v| f64::from(*v)).collect();
            Ok(plain(map.width, map.height, values, 1.0))
        }
    })
}

/// Those of an array of NumPy.
fn of_array(bytes: &[u8]) -> std::result::Result<Raw, String> {
    let (array, usual) = match npy::decode(bytes, false) {
        Ok(array) => (array, 1.0),
        Err(_) => (npy::decode(bytes, true)?, 1e-3),
    };
    let [height, width] = array.shape[..] else {
        return Err(format!("has shape {:?}, expected [height, width]", array.shape));
    };
    let values = array.data.into_iter().map(|v| if usual < 1.0 { whole(v) } else { v }).collect();
    Ok(Raw { width, height, values, usual, channel: None })
}

/// A whole number; NaN where it stands for nothing.
fn whole(value: f64) -> f64 {
    if value == FULL { f64::NAN } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::image;

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
        hdr::write_exr(&at("c.exr"), &tessuto_core::image::Image { width: 5, height: 4, channels: 3, data })
            .unwrap();
        for name in ["a.png", "b.npy", "c.exr"] {
            let map = DepthMap::read(&at(name), None).unwrap();
            assert_eq!((map.width, map.height), (5, 4), "{name}");
            assert!(map.z[3].is_nan() && (map.z[19] - 1.39).abs() < 1e-6, "{name}: {:?}", map.z);
        }
        // Metres where millimetres belong, and images that are none.
        npy::write(&at("d.npy"), &[4, 5], &metres.iter().map(|v| v * 1000.0).collect::<Vec<f32>>()).unwrap();
        assert!(DepthMap::read(&at("d.npy"), None).unwrap_err().to_string().contains("the unit is another"));
        image::write_png(&at("e.png"), &tessuto_core::image::Image::new(5, 4, 3)).unwrap();
        assert!(
            DepthMap::read(&at("e.png"), None).unwrap_err().to_string().contains("no depth map of 16 bits")
        );
        npy::write(&at("f.npy"), &[20], &metres).unwrap();
        assert!(
            DepthMap::read(&at("f.npy"), None).unwrap_err().to_string().contains("expected [height, width]")
        );
    }
    /// The value of a pixel by its number.
    type Values = fn(usize) -> f32;

    /// An OpenEXR file of 8×6 pixels with these channels.
    fn write_channels(path: &Path, channels: &[(&str, Values)]) {
        use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, WritableImage as _};
        let list = channels
            .iter()
            .map(|(name, f)| AnyChannel::new(*name, FlatSamples::F32((0..48).map(*f).collect())))
            .collect();
        Image::from_channels((8, 6), AnyChannels::sort(list)).write().to_file(path).unwrap();
    }

    #[test]
    fn the_channel_called_depth_counts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let depth: Values = |k| if k == 5 { 1e10 } else { 1.0 + k as f32 / 100.0 };
        let (red, half): (Values, Values) = (|k| 0.8 - k as f32 / 1000.0, |_| 0.5);
        for (channels, name) in [
            (&[("Z", depth)][..], "Z"),
            (&[("V", depth)], "V"),
            (&[("Y", depth), ("A", half)], "Y"),
            (&[("Depth.V", depth), ("Image.R", red), ("Image.G", half)], "Depth.V"),
            (&[("R", red), ("G", half), ("B", half), ("Z", depth)], "Z"),
            (&[("R", depth), ("G", depth), ("B", depth)], "R"),
        ] {
            write_channels(&path, channels);
            let map = DepthMap::read(&path, None).unwrap();
            assert_eq!((map.width, map.height, map.channel.as_deref()), (8, 6, Some(name)), "{name}");
            assert!(map.z[5].is_nan() && (map.z[40] - 1.4).abs() < 1e-6, "{name}: {:?}", map.z);
        }
        write_channels(&path, &[("R", red), ("G", half), ("B", half)]);
        let message = DepthMap::read(&path, None).unwrap_err().to_string();
        assert!(message.contains("is a colour image: its channels R, G differ"), "{message}");
    }

    #[test]
    fn a_unit_is_told_or_taken_and_the_full_number_is_a_hole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let values: Vec<u16> = (0..20).map(|k| if k < 4 { u16::MAX } else { 4000 + k }).collect();
        let image = ::image::ImageBuffer::<::image::Luma<u16>, _>::from_raw(5, 4, values).unwrap();
        image.save(&path).unwrap();
        let read = |scale| DepthMap::read(&path, scale).unwrap();
        for (scale, metres) in [(None, 4.019), (Some(2.5e-4), 1.00475), (Some(2e-4), 0.8038)] {
            let map = read(scale);
            assert!(
                map.z[..4].iter().all(|z| z.is_nan()) && (map.z[19] - metres).abs() < 1e-9,
                "{:?}",
                map.z
            );
            assert_eq!(map.unit.told, scale.is_some());
        }
        let message = DepthMap::read(&path, Some(1.0)).unwrap_err().to_string();
        assert!(
            message.contains("with 1 m") && message.contains("1.00 m with 0.25 mm (RealSense L515)"),
            "{message}"
        );
    }
}
