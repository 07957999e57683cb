//! Colours of OpenEXR files, by the crate `exr`.

use std::io::Cursor;

use exr::prelude::{
    Image, IntegerBounds, ReadChannels as _, ReadLayers as _, SpecificChannels, Text, Vec2,
    WritableImage as _, read,
};

use super::{Refusal, expect_size};

/// Width, height, and linear colours of the display window, shape [height, width, 3]; of at most `most` bytes.
/// Black where the file has no pixels.
pub(in crate::io) fn decode(bytes: &[u8], most: u64) -> Result<([usize; 2], Vec<f32>), Refusal> {
    let file = exr::block::read(Cursor::new(bytes), false).map_err(Refusal::broken)?;
    let header = file.headers().iter().find(|header| {
        let has = |name: &str| header.channels.find_index_of_channel(&Text::from(name)).is_some();
        !header.deep && ["R", "G", "B"].into_iter().all(has)
    });
    let header = header.ok_or_else(|| Refusal::Broken("it has no channels R, G, B".into()))?;
    let window: IntegerBounds = header.shared_attributes.display_window;
    let offset = header.own_attributes.layer_position - window.position;
    let alpha = header.channels.find_index_of_channel(&Text::from("A")).is_some();
    let size = [window.size.width(), window.size.height()];
    expect_size(size, (3 + usize::from(alpha)) * size_of::<f32>(), most)?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            move |_, _| vec![0.0; 3 * size[0] * size[1]],
            move |out: &mut Vec<f32>, at, (r, g, b): (f32, f32, f32)| {
                let at = at.to_i32() + offset;
                let inside = |v: i32, side: usize| usize::try_from(v).ok().filter(|v| *v < side);
                if let (Some(x), Some(y)) = (inside(at.x(), size[0]), inside(at.y(), size[1])) {
                    out[3 * (y * size[0] + x)..][..3].copy_from_slice(&[r, g, b]);
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_chunks(file)
        .map_err(Refusal::broken)?;
    Ok((size, image.layer_data.channel_data.pixels))
}

/// The bytes of an OpenEXR file of 32-bit floats: linear colour, shape [height, width, 3].
pub(in crate::io) fn encode(data: &[f32], [width, height]: [usize; 2]) -> Result<Vec<u8>, exr::error::Error> {
    let pixel = |at: Vec2<usize>| {
        let at = 3 * (at.y() * width + at.x());
        (data[at], data[at + 1], data[at + 2])
    };
    let mut file = Cursor::new(Vec::new());
    Image::from_channels((width, height), SpecificChannels::rgb(pixel)).write().to_buffered(&mut file)?;
    Ok(file.into_inner())
}
