//! PNG, by the crate `png`.

use std::io::Cursor;

use ::png::{BitDepth, ColorType, Compression, Decoder, Encoder, Filter, Limits, Transformations};

use super::orientation::{of_exif, upright};
use super::{Decoded, Pixels, Refusal, Samples, expect_size};

/// Decodes `bytes`, the right way up.
pub(super) fn decode(bytes: &[u8], most: u64) -> Result<Decoded, Refusal> {
    let (pixels, orientation) = read(bytes, most)?;
    Ok(Decoded { pixels: upright(pixels, orientation), turned: orientation != 1, inks: false })
}

/// The pixels of `bytes` as they are stored, whatever the file says of how its camera was held.
pub(in crate::io) fn stored(bytes: &[u8], most: u64) -> Result<Pixels, Refusal> {
    Ok(read(bytes, most)?.0)
}

/// The pixels of `bytes`, and how the camera was held: few bits and palettes become 8 bits and colours. The decoder's
/// own buffers take at most twice `most`.
fn read(bytes: &[u8], most: u64) -> Result<(Pixels, u8), Refusal> {
    let limits = Limits { bytes: usize::try_from(2 * most).unwrap_or(usize::MAX) };
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
    let info = decoder.read_header_info().map_err(Refusal::broken)?;
    let size = [info.width, info.height].map(|side| side as usize);
    // One byte a pixel at least; what the numbers really take is known further down.
    expect_size(size, 1, u64::MAX)?;
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(Refusal::broken)?;
    let (color, depth) = reader.output_color_type();
    let channels = color.samples();
    let sample = match depth {
        BitDepth::Eight => 1,
        BitDepth::Sixteen => 2,
        depth => return Err(Refusal::Broken(format!("has numbers of {} bits", depth as u8))),
    };
    expect_size(size, channels * sample, most)?;
    let mut data = vec![0; size[0] * size[1] * channels * sample];
    reader.next_frame(&mut data).map_err(Refusal::broken)?;
    let samples = match sample {
        1 => Samples::Bytes(data),
        _ => Samples::Words(data.as_chunks().0.iter().map(|word| u16::from_be_bytes(*word)).collect()),
    };
    let orientation = reader.info().exif_metadata.as_deref().and_then(of_exif).unwrap_or(1);
    Ok((Pixels { width: size[0], height: size[1], channels, samples }, orientation))
}

/// The bytes of an 8-bit PNG of `pixels`, shape [height, width, channels] with 1 or 3 channels.
pub(in crate::io) fn encode(pixels: &[u8], [width, height]: [usize; 2], channels: usize) -> Vec<u8> {
    let color = match channels {
        1 => ColorType::Grayscale,
        3 => ColorType::Rgb,
        n => panic!("an image of {n} channels cannot be written as PNG"),
    };
    let mut png = Vec::new();
    let mut encoder = Encoder::new(&mut png, width as u32, height as u32);
    encoder.set_color(color);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Fast);
    encoder.set_filter(Filter::Adaptive);
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(pixels));
    written.expect("a vector takes every byte");
    png
}
