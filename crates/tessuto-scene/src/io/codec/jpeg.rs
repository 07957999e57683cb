//! Decoding of JPEG, by the crate `zune-jpeg`.

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::orientation::{of_exif, upright};
use super::{Decoded, Pixels, Refusal, Samples, expect_size};

/// Decodes `bytes`: grey stays grey, everything else becomes RGB.
pub(super) fn decode(bytes: &[u8], most: u64) -> Result<Decoded, Refusal> {
    // Cameras' and phones' files break some rule now and then.
    let options =
        DecoderOptions::default().set_strict_mode(false).set_max_width(usize::MAX).set_max_height(usize::MAX);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(Refusal::broken)?;
    let (Some((width, height)), Some(stored)) = (decoder.dimensions(), decoder.input_colorspace()) else {
        return Err(Refusal::Broken("its header tells no size".into()));
    };
    let (color, channels) = match stored {
        ColorSpace::Luma => (ColorSpace::Luma, 1),
        _ => (ColorSpace::RGB, 3),
    };
    expect_size([width, height], channels, most)?;
    decoder.set_options(options.jpeg_set_out_colorspace(color));
    let data = decoder.decode().map_err(Refusal::broken)?;
    if data.len() != width * height * channels {
        return Err(Refusal::Broken(format!("{} bytes were decoded of {width}×{height} pixels", data.len())));
    }
    let orientation = decoder.exif().and_then(|exif| of_exif(exif)).unwrap_or(1);
    let pixels = upright(Pixels { width, height, channels, samples: Samples::Bytes(data) }, orientation);
    let inks = matches!(stored, ColorSpace::CMYK | ColorSpace::YCCK);
    Ok(Decoded { pixels, turned: orientation != 1, inks })
}
