//! Images of linear radiance: OpenEXR (half or float RGB) and Radiance .hdr, distinguished by their
//! content, to linear float images, and EXR back. Colours are linear Rec.709; nothing is encoded.

use std::path::Path;

use super::codec::{Format, Refusal, exr, radiance};
use crate::io::{atomic_write, read_bounded};
use tessuto_core::error::{Error, Result};
use tessuto_core::image::Image;

/// Largest file, and largest decoded image `[bytes]`: 8192×4096 pixels of 4 floats have 512 MiB.
const MAX_BYTES: u64 = 640 << 20;
/// Decoded bytes beyond these that each byte of the file may stand for: a few bytes of a header must not take the
/// memory of the largest image. Compression of a uniform sky reaches a little more, of any other far less.
const MAX_RATIO: u64 = 500;
/// Decoded bytes that any file may have.
const ALWAYS_BYTES: u64 = 64 << 20;
/// Largest side of a tile `[px]`; usual are 32 to 1024.
const MAX_TILE: u32 = 4096;
/// Largest radiance accepted. The sun in an image of half floats ends at 65504; beyond this bound
/// a single pixel would drown the rest in the noise of f32.
pub const MAX_RADIANCE: f32 = 1e6;

/// Linear colour, shape [height, width, 3]. Values are whatever the file holds, NaN included, of a Radiance file
/// divided by the exposure that its header says; alpha is dropped.
///
/// # Errors
/// [`Error::Input`] naming the file.
pub fn read_linear(path: &Path) -> Result<Image> {
    let bytes = with_usual_name(read_bounded(path, MAX_BYTES)?);
    let broken = |problem: String| {
        Error::input(
            path.display().to_string(),
            format!("{problem} (file of {} bytes)", bytes.len()),
            "give an OpenEXR file with channels R, G, B, or a Radiance .hdr file",
        )
    };
    let format = Format::of(&bytes).filter(|format| matches!(format, Format::OpenExr | Format::Radiance));
    let format = format.ok_or_else(|| broken("is neither OpenEXR nor Radiance .hdr".to_owned()))?;
    if let Some([width, height]) = huge_tile(&bytes) {
        return Err(broken(format!("has tiles of {width}×{height} pixels; {MAX_TILE} a side are read")));
    }
    let most = most(bytes.len());
    let (factors, decoded) = match format {
        Format::Radiance => (multiplied(&bytes).map_err(broken)?, radiance::decode(&bytes, most)),
        _ => ([1.0; 3], exr::decode(&bytes, most)),
    };
    let ([width, height], mut data) = decoded.map_err(|refusal| match refusal {
        Refusal::Broken(problem) => broken(format!("cannot be decoded: {problem}")),
        Refusal::Large { size: [width, height], bytes: decoded } => Error::input(
            path.display().to_string(),
            format!(
                "{width}×{height} pixels take {decoded} bytes; at most {most} are read from a file of {}",
                bytes.len()
            ),
            "scale the image down; 1024×512 pixels are plenty for a light",
        ),
    })?;
    if factors != [1.0; 3] {
        for (k, value) in data.iter_mut().enumerate() {
            *value = (f64::from(*value) / factors[k % 3]) as f32;
        }
    }
    Ok(Image { width, height, channels: 3, data })
}

/// Most bytes that are decoded from a file of `length`.
pub(super) fn most(length: usize) -> u64 {
    MAX_BYTES.min(ALWAYS_BYTES + MAX_RATIO * length as u64)
}

/// What the radiance was multiplied by before it was stored, red, green and blue: the product of all lines EXPOSURE
/// and COLORCORR in the header of a Radiance file; an error is what is wrong with one. Lines that are indented belong
/// to the files that this one was made of.
///
/// Source: G. Ward, *File formats* of Radiance: EXPOSURE, COLORCORR. PIXASPECT changes no value.
fn multiplied(bytes: &[u8]) -> std::result::Result<[f64; 3], String> {
    let mut factors = [1.0; 3];
    for line in bytes.split(|b| *b == b'\n').take_while(|line| !line.trim_ascii().is_empty()) {
        let line = String::from_utf8_lossy(line);
        let Some((key @ ("EXPOSURE" | "COLORCORR"), value)) = line.split_once('=') else { continue };
        let numbers: Option<Vec<f64>> = value.split_whitespace().map(|word| word.parse().ok()).collect();
        let own = match (key, numbers.as_deref()) {
            ("EXPOSURE", Some(&[factor])) => [factor; 3],
            ("COLORCORR", Some(&[r, g, b])) => [r, g, b],
            _ => [f64::NAN; 3],
        };
        if !own.iter().all(|factor| factor.is_finite() && *factor > 0.0) {
            return Err(format!("its header says {}, which is nothing to divide by", line.trim()));
        }
        (0..3).for_each(|k| factors[k] *= own[k]);
    }
    Ok(factors)
}

/// `bytes` with the first line of a Radiance .hdr file as most programs write it: others name themselves or the
/// format there.
fn with_usual_name(mut bytes: Vec<u8>) -> Vec<u8> {
    const USUAL: &[u8] = b"#?RADIANCE";
    if bytes.starts_with(b"#?")
        && let Some(end) = bytes.iter().take(64).position(|b| *b == b'\n')
    {
        bytes.splice(..end, USUAL.iter().copied());
    }
    bytes
}

/// The size of a tile in an OpenEXR file that is larger than [`MAX_TILE`]. The decoder takes memory for a whole
/// tile, however small the image is.
pub(super) fn huge_tile(bytes: &[u8]) -> Option<[u32; 2]> {
    // Name, type and length of the attribute; two sizes and a mode follow.
    const ATTRIBUTE: &[u8] = b"tiles\0tiledesc\0\x09\0\0\0";
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    bytes.windows(ATTRIBUTE.len()).enumerate().filter(|(_, w)| *w == ATTRIBUTE).find_map(|(at, _)| {
        let start = at + ATTRIBUTE.len();
        let size = [word(start)?, word(start + 4)?];
        size.iter().any(|n| *n > MAX_TILE).then_some(size)
    })
}

/// An environment map: lat-long image of linear radiance, shape [H, 2 H, 3], every value finite,
/// not negative and at most [`MAX_RADIANCE`].
///
/// # Errors
/// [`Error::Input`] naming the file and the first pixel that breaks a rule.
pub fn read_environment(path: &Path) -> Result<Image> {
    let image = read_linear(path)?;
    check_environment(&image, &path.display().to_string())?;
    Ok(image)
}

/// The rules of [`read_environment`] for `image` from `place`.
///
/// # Errors
/// [`Error::Input`].
pub(crate) fn check_environment(image: &Image, place: &str) -> Result<()> {
    let (width, height) = (image.width, image.height);
    if width != 2 * height || height == 0 {
        return Err(Error::input(
            place,
            format!("is {width}×{height} pixels; an environment map is twice as wide as high"),
            "give a lat-long (equirectangular) image of the whole sphere; crop or resize it to 2:1",
        ));
    }
    let wrong = |v: &f32| !(v.is_finite() && (0.0..=MAX_RADIANCE).contains(v));
    let Some(at) = image.data.iter().position(wrong) else { return Ok(()) };
    let count = image.data.iter().filter(|v| wrong(v)).count();
    let (value, pixel) = (image.data[at], at / 3);
    let (problem, hint) = if !value.is_finite() {
        ("not finite", "repair the image: replace NaN and infinity by the pixels around them")
    } else if value < 0.0 {
        ("negative", "radiance cannot be negative: clamp the image at 0, or look for a wrong colour space")
    } else {
        ("too large", "clamp or scale the image: at most 1e6 per channel")
    };
    Err(Error::input(
        place,
        format!(
            "{count} of {} values cannot be used; the first, column {}, row {}, channel {}, is {problem}: {value}",
            image.data.len(),
            pixel % width,
            pixel / width,
            ["R", "G", "B"][at % 3]
        ),
        hint,
    ))
}

/// Writes linear colour, shape [height, width, 3], as OpenEXR of 32-bit floats.
///
/// # Errors
/// [`Error::Output`].
pub fn write_exr(path: &Path, image: &Image) -> Result<()> {
    assert_eq!(image.channels, 3, "EXR files are written with the channels R, G, B");
    let bytes = exr::encode(&image.data, [image.width, image.height])
        .map_err(|e| Error::Output { path: path.to_path_buf(), source: std::io::Error::other(e) })?;
    atomic_write(path, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radiance_files_are_read_whatever_their_first_line_names() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("light.hdr");
        for name in ["RADIANCE", "RGBE", "some program 1.2"] {
            let mut bytes = format!("#?{name}\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n").into_bytes();
            // 128/256 · 2^(129 − 128) = 1.
            bytes.extend([128, 64, 0, 129, 0, 0, 128, 128]);
            std::fs::write(&path, bytes).unwrap();
            let image = read_linear(&path).unwrap();
            assert_eq!((image.width, image.height), (2, 1));
            assert_eq!(image.data, [1.0, 0.5, 0.0, 0.0, 0.0, 0.5], "{name}");
        }
        std::fs::write(&path, "#?RADIANCE").unwrap();
        assert!(read_linear(&path).is_err());
    }

    #[test]
    fn radiance_is_divided_by_the_exposure_of_the_header() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("light.hdr");
        let read = |header: &str| {
            let mut bytes = format!("#?RADIANCE\n{header}FORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n").into_bytes();
            bytes.extend([128, 64, 0, 129, 0, 0, 128, 128]);
            std::fs::write(&path, bytes).unwrap();
            read_linear(&path).map(|image| image.data)
        };
        let stored = read("").unwrap();
        for (header, factors) in [
            ("EXPOSURE=2\n", [2.0; 3]),
            ("EXPOSURE= 2.0\r\npfilt -e 2\nEXPOSURE=2.5e-1\n", [0.5; 3]),
            ("COLORCORR= 1 2 4\nEXPOSURE=2\nPIXASPECT=0.5\n", [2.0, 4.0, 8.0]),
            // What another file, of which this was made, was multiplied by.
            ("pcomb\n\tEXPOSURE=8\nSOFTWARE=a = b\n", [1.0; 3]),
        ] {
            let expected: Vec<f32> =
                stored.iter().enumerate().map(|(k, v)| v / factors[k % 3] as f32).collect();
            assert_eq!(read(header).unwrap(), expected, "{header}");
        }
        for wrong in ["EXPOSURE=0", "EXPOSURE=-1", "EXPOSURE=nan", "EXPOSURE=bright", "COLORCORR=1 1"] {
            let message = read(&format!("{wrong}\n")).unwrap_err().to_string();
            assert!(message.contains("light.hdr") && message.contains(wrong), "{message}");
        }
    }
}
