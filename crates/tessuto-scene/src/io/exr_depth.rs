//! The channel of an OpenEXR file that is its depth map: renderers, cameras and tools give it many names, and colours
//! beside it.

use std::io::Cursor;

use exr::prelude::{ReadChannels as _, ReadLayers as _, ReadSpecificChannel as _, Text, read};

use super::hdr;

/// What a channel or a layer of depth is called, in small letters. Blender writes `ViewLayer.Depth.Z` or `Depth.V`,
/// OpenCV `Y`.
const NAMES: [&str; 3] = ["z", "depth", "distance"];
/// Values from here on are what renderers write where nothing is: Blender 1e10, half floats their largest.
const NOTHING: f32 = 65504.0;

/// A channel as the file has it.
pub(super) struct Channel {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Values, shape [height, width]; NaN where nothing is.
    pub values: Vec<f64>,
    /// Its name, with that of its layer.
    pub name: String,
}

/// Decodes the channel of depth in `bytes`; an error is what is wrong.
///
/// One channel beside an alpha is depth whatever its name. Of several the one that is called so counts; colours alone
/// are a depth map if they say the same, or if only the red one says anything.
pub(super) fn read_depth(bytes: &[u8]) -> Result<Channel, String> {
    if let Some([width, height]) = hdr::huge_tile(bytes) {
        return Err(format!("has tiles of {width}×{height} pixels, too large to be read"));
    }
    let file = exr::block::read(Cursor::new(bytes), false).map_err(|e| format!("cannot be decoded: {e}"))?;
    let parts = file.headers().iter().filter(|header| !header.deep);
    let all: Vec<(String, String)> = parts
        .flat_map(|header| {
            let part = header.own_attributes.layer_name.as_ref().map(Text::to_string).unwrap_or_default();
            header.channels.list.iter().map(move |c| (part.clone(), c.name.to_string()))
        })
        .collect();
    let chosen = choose(&all)?;
    let (part, own) = &all[chosen];
    let red = own == "R" || own.ends_with(".R");
    let channel = decode(bytes, own)?;
    if red {
        // A colour image is no depth map: its red would pass for metres.
        let stem = own.strip_suffix('R').unwrap_or_default();
        for other in ["G", "B"].map(|letter| format!("{stem}{letter}")) {
            if all.iter().any(|(p, c)| p == part && *c == other) {
                let other = decode(bytes, &other)?;
                let same = |(a, b): (&f64, &f64)| a == b || *b == 0.0 || a.is_nan() && b.is_nan();
                if !channel.values.iter().zip(&other.values).all(same) {
                    return Err(format!(
                        "is a colour image: its channels {own}, {} differ, and none is called Z",
                        other.name
                    ));
                }
            }
        }
    }
    Ok(channel)
}

/// Which of the channels, each a part of the file and a name, is the depth.
fn choose(all: &[(String, String)]) -> Result<usize, String> {
    let words = |k: usize| -> Vec<String> {
        let (part, name) = &all[k];
        part.split('.').chain(name.split('.')).map(str::to_lowercase).filter(|w| !w.is_empty()).collect()
    };
    let last = |k: usize| words(k).pop().unwrap_or_default();
    let called = |word: &String| NAMES.contains(&word.as_str());
    let values: Vec<usize> = (0..all.len()).filter(|k| last(*k) != "a").collect();
    // By its own name, by its layer's, as the only one, by that of luminance, as a colour.
    let own = values.iter().copied().find(|k| called(&last(*k)));
    let layer = || values.iter().copied().find(|k| words(*k).iter().any(called));
    let only = || Some(*values.first()?).filter(|_| values.len() == 1);
    let of = |name: &'static str| values.iter().copied().find(|k| all[*k].1 == name);
    let found = own.or_else(layer).or_else(only).or_else(|| of("V")).or_else(|| of("Y")).or_else(|| of("R"));
    found.ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|(_, name)| name.as_str()).take(20).collect();
        format!("has the channels {}, none of which is called Z, depth, V, Y or R", names.join(", "))
    })
}

/// The values of the channel `name` of the first part of the file that has it, within the display window.
fn decode(bytes: &[u8], name: &str) -> Result<Channel, String> {
    let broken = |e: exr::error::Error| format!("its channel {name} cannot be decoded: {e}");
    let file = exr::block::read(Cursor::new(bytes), false).map_err(broken)?;
    let text = Text::new_or_none(name).ok_or_else(|| format!("its channel {name} has no usual name"))?;
    let has = |header: &&exr::meta::header::Header| {
        !header.deep && header.channels.find_index_of_channel(&text).is_some()
    };
    let header = file.headers().iter().find(has).ok_or_else(|| format!("has no channel {name}"))?;
    let window = header.shared_attributes.display_window;
    let (width, height) = (window.size.width(), window.size.height());
    let needed = [window.size, header.layer_size].map(|s| 4 * s.width() as u64 * s.height() as u64);
    let most = hdr::most(bytes.len());
    if needed.iter().any(|n| *n > most) {
        return Err(format!(
            "{width}×{height} pixels take more than the {most} bytes that are read from such a file"
        ));
    }
    let offset = header.own_attributes.layer_position - window.position;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required::<f32>(text)
        .collect_pixels(
            move |_, _| vec![f64::NAN; width * height],
            move |values: &mut Vec<f64>, at, (value,): (f32,)| {
                let at = at.to_i32() + offset;
                let (x, y) = (usize::try_from(at.x()), usize::try_from(at.y()));
                if let (Ok(x), Ok(y)) = (x, y)
                    && x < width
                    && y < height
                    && value.abs() < NOTHING
                {
                    values[y * width + x] = f64::from(value);
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_chunks(file)
        .map_err(broken)?;
    Ok(Channel { width, height, values: image.layer_data.channel_data.pixels, name: name.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_channel_of_depth_is_found_by_its_name() {
        let chosen = |names: &[&str]| {
            let all: Vec<(String, String)> = names
                .iter()
                .map(|n| n.split_once('/').unwrap_or(("", n)))
                .map(|(p, n)| (p.into(), n.into()))
                .collect();
            choose(&all).map(|k| all[k].1.clone())
        };
        for (names, expected) in [
            (&["Z"][..], "Z"),
            (&["depth"], "depth"),
            (&["R", "G", "B", "Z"], "Z"),
            (&["B", "G", "R", "View.Combined.A", "ViewLayer.Depth.Z"], "ViewLayer.Depth.Z"),
            (&["Depth.V", "Image.R", "Image.G", "Image.B", "Image.A"], "Depth.V"),
            (&["beauty/R", "beauty/G", "ViewLayer.Depth/V"], "V"),
            (&["A", "Whatever"], "Whatever"),
            (&["Y", "A"], "Y"),
            (&["B", "G", "R", "A"], "R"),
            (&["RY", "BY", "Y"], "Y"),
        ] {
            assert_eq!(chosen(names).as_deref(), Ok(expected), "{names:?}");
        }
        assert!(chosen(&["N.X", "N.Y"]).unwrap_err().contains("N.X, N.Y, none of which"));
    }
}
