//! Files of the estimate.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Appearance;
use crate::io::{self, atomic_write};
use tessuto_core::error::Result;
use tessuto_core::image::Image;
use tessuto_core::image::srgb;

/// What a reader of the maps needs to know.
const NOTE: &str = "\
Estimated material, in the template's uv space (row 0 of each image is v = 1), and light.
diffuse.png      base colour, sRGB-encoded
roughness.png    linear; GGX with alpha = roughness squared
metallic.png     linear; F0 = 0.04 (1 - metallic) + base colour * metallic, diffuse albedo = base colour (1 - metallic)
environment.exr  radiance from each direction, linear Rec.709, 32-bit float. Column i, row j of W x H is
                 lon = ((i + 0.5)/W - 0.5) * 2 pi, lat = (0.5 - (j + 0.5)/H) * pi, and the direction to the light is
                 (cos lat * sin lon, -sin lat, cos lat * cos lon) in the camera's frame (x right, y down, z forward):
                 the middle of the image is where the camera looks, the top row is up, the border is behind it.
scale.json       reference of the brightness of diffuse.png and of the light: the images constrain almost only \
                 the product of
                 cloth and light; the rest follows from the usual brightness and tint of fabrics and lights.
                 brightest: albedo of the brightest twentieth that is not metal, by channel. log_deviation: \
                 all maps' common
                 factor is uncertain by this standard deviation of its natural logarithm; tint_log_deviation: \
                 each channel's
                 beyond that. undyed: probability that the brightest part is not dyed.
";

/// The file of the other side.
pub(super) const BACK: &str = "back.json";

/// What it holds.
#[derive(Serialize, Deserialize)]
pub(super) struct OfBack {
    /// Linear red, green and blue.
    pub albedo: [f32; 3],
}

/// What is added where the other side has a colour of its own.
const NOTE_OF_BACK: &str = "\
back.json        the fabric's other side, which is matt and has one colour: albedo, linear red, green and blue
";

/// Writes maps, light and a note about them into the existing `folder`.
///
/// # Errors
/// [`Error::Output`](tessuto_core::Error::Output).
pub fn write_material(folder: &Path, appearance: &Appearance) -> Result<()> {
    let material = appearance.maps();
    let (width, height) = (material.width, material.height);
    let map = |channels: usize, value: &dyn Fn(&[f32; 8], usize) -> f32| Image {
        width,
        height,
        channels,
        data: material.texels.iter().flat_map(|t| (0..channels).map(|c| value(t, c))).collect(),
    };
    io::image::write_png(&folder.join("diffuse.png"), &map(3, &|t, c| srgb::encode(t[c])))?;
    io::image::write_png(&folder.join("roughness.png"), &map(1, &|t, _| t[3]))?;
    io::image::write_png(&folder.join("metallic.png"), &map(1, &|t, _| t[4]))?;
    let e = &appearance.environment;
    let data = e.texels.concat();
    let light = Image { width: e.width, height: e.height, channels: 3, data };
    io::hdr::write_exr(&folder.join("environment.exr"), &light)?;
    if let Some(scale) = &appearance.scale {
        let mut text = serde_json::to_string_pretty(scale).expect("plain data");
        text.push('\n');
        atomic_write(&folder.join("scale.json"), text.as_bytes())?;
    }
    let mut note = NOTE.to_owned();
    if let Some(albedo) = material.back {
        let mut text = serde_json::to_string_pretty(&OfBack { albedo }).expect("plain data");
        text.push('\n');
        atomic_write(&folder.join(BACK), text.as_bytes())?;
        note.push_str(NOTE_OF_BACK);
    }
    atomic_write(&folder.join("README.txt"), note.as_bytes())
}
