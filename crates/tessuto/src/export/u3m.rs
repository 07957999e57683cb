//! U3M 1.1, the open material format of the fashion trade: the maps at the size of the flat panel, and the weight.
//!
//! Its physics is a weight, a thickness and a file of raw measurements of one device (FAB): stiffnesses have no place
//! there. They stand in `custom`, under `tessuto`, which other programs keep and do not read.
//!
//! Source: vizoogmbh/u3m, `u3m1.1/spec/u3m_schema.json` and `u3m_additional_spec_u3m.txt`.

use serde_json::{Value, json};

use super::row::{Output, Row};
use super::shell::terms;
use super::{Clip, Material};
use tessuto_core::image::Image;
use tessuto_estimate::io::image::encode_png;
use tessuto_sim::panel;

/// Millimetres of an inch.
const INCH: f64 = 25.4;

/// The row of the format.
pub(super) const FORMAT: Row = Row {
    key: "u3m",
    programs: "Browzwear, Vizoo",
    content: "U3M 1.1 material: maps at their size, weight, stiffnesses beside",
    files: &[("_u3m", "U3M 1.1 material: Browzwear, Vizoo")],
    feature: None,
    for_blender: false,
    outputs: |clip| {
        let mut files = maps(&clip.material);
        let text = serde_json::to_string_pretty(&encode(clip)).expect("plain data") + "\n";
        files.push((format!("{}.u3m", clip.name), text.into_bytes()));
        Ok(vec![Output::Folder(format!("{}_u3m", clip.name), files)])
    },
};

/// The images; all of them have three channels, which is what every reader must know.
fn maps(material: &Material) -> Vec<(String, Vec<u8>)> {
    let grey = |image: &Image| Image {
        channels: 3,
        data: image.data.iter().flat_map(|v| [*v; 3]).collect(),
        ..image.clone()
    };
    let mut files = vec![(material.file("basecolor"), encode_png(&material.base_colour))];
    for (kind, image) in ["roughness", "metallic"].iter().zip(material.roughness_metallic.iter().flatten()) {
        files.push((material.file(kind), encode_png(&grey(image))));
    }
    files
}

/// The document.
fn encode(clip: &Clip) -> Value {
    // Millimetres of one unit of the texture coordinates; unknown where they are no flat panel.
    let size = panel(&clip.mesh).and_then(|flat| size_of_unit(clip, &flat));
    let image = |file: String, of: &Image| {
        let [width, height] = size.unwrap_or([0.0; 2]);
        let dots = |pixels: usize, size: f64| if size > 0.0 { pixels as f64 * INCH / size } else { 0.0 };
        json!({
            "path": file, "width": width, "height": height,
            "dpi": {"x": dots(of.width, width), "y": dots(of.height, height)},
            "repeat": {"mode": "normal", "rotation": 0.0},
        })
    };
    let number = |constant: f64| json!({"constant": constant, "texture": null});
    let scalar = |kind: &str, of: Option<&Image>, constant: f64| match of {
        None => number(constant),
        Some(map) => json!({
            "constant": mean(map)[0],
            "texture": {"factor": 1.0, "offset": 0.0, "image": image(clip.material.file(kind), map)},
        }),
    };
    let colour = |[r, g, b]: [f64; 3]| json!({"r": r, "g": g, "b": b});
    let base = &clip.material.base_colour;
    let [roughness, metallic] = match &clip.material.roughness_metallic {
        Some([roughness, metallic]) => [Some(roughness), Some(metallic)],
        None => [None, None],
    };
    let normal = json!({"constant": {"x": 0.0, "y": 0.0, "z": 1.0}, "texture": null});
    let front = json!({
        "alpha": number(1.0), "anisotropy_rotation": number(0.0), "anisotropy_value": number(0.0),
        "basecolor": {
            "constant": colour(mean(base)),
            "texture": {
                "mode": "multiply", "factor": colour([1.0; 3]),
                "image": image(clip.material.file("basecolor"), base),
            },
        },
        "clearcoat_normal": normal, "clearcoat_roughness": number(0.0), "clearcoat_value": number(0.0),
        "displacement": number(0.0), "ior": number(1.5),
        "metalness": scalar("metallic", metallic, 0.0), "normal": normal,
        "roughness": scalar("roughness", roughness, 1.0), "sheen_tint": number(0.0), "sheen_value": number(0.0),
        "specular_tint": number(0.0), "specular_value": number(0.5),
        "subsurface_color": {"constant": colour([1.0; 3]), "texture": null},
        "subsurface_radius": number(0.0), "subsurface_value": number(0.0), "transmission": number(0.0),
        "shader": "principled", "preview": null,
    });
    let physics = clip.fabric.map(|fabric| {
        json!({
            "weight": 1e3 * fabric.per_width.area_density, "thickness": null,
            "composition": null, "construction": null, "material_type": null, "devices": {"fab": "null"},
        })
    });
    let custom = clip.fabric.map(|fabric| {
        json!({"tessuto": {
            "version": clip.version,
            "stiffness_per_width": fabric.per_width,
            "sd_of_ln_membrane_bending_shear": fabric.sd_of_ln,
            "informed_membrane_bending_shear": fabric.informed(),
            "constraint_membrane_bending_shear": fabric.constraints.map(|said| said.word()),
            "other_programs": terms(&fabric.per_width),
        }})
    });
    // A result has no date, and the same result makes the same bytes.
    const DATE: &str = "1970-01-01T00:00:00Z";
    json!({
        "schema": "1.1",
        "material": {
            "id": identity(&json!([clip.name, &front, &physics, &custom])),
            "name": clip.name, "description": "Recovered from a video by tessuto",
            "created": DATE, "modified": DATE,
            "front": front, "back": null, "side": null, "physics": physics, "metadata": null,
        },
        "custom": custom,
    })
}

/// Width and height `[mm]` of the unit square of texture coordinates.
fn size_of_unit(clip: &Clip, flat: &[glam::DVec3]) -> Option<[f64; 2]> {
    let uvs = tessuto_core::mesh::vertex_uvs(&clip.mesh, tessuto_core::mesh::SEAM)?;
    let span = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        high - low
    };
    let along = |k: usize| 1e3 * span(&mut flat.iter().map(|p| p[k])) / span(&mut uvs.iter().map(|uv| uv[k]));
    let size = [along(0), along(1)];
    size.iter().all(|v| v.is_finite()).then_some(size)
}

/// Mean of every channel.
fn mean(image: &Image) -> [f64; 3] {
    let count = (image.width * image.height).max(1) as f64;
    [0, 1, 2].map(|k| {
        let channel = k.min(image.channels - 1);
        let all = image.data.chunks_exact(image.channels).map(|pixel| f64::from(pixel[channel]));
        (all.sum::<f64>() / count).clamp(0.0, 1.0)
    })
}

/// A UUID that follows from the content: 128 bits of FNV-1a, marked as version 4.
fn identity(content: &Value) -> String {
    let hash =
        content.to_string().bytes().fold(0x6c62_272e_07bb_0142_62b8_2175_6295_c58d_u128, |hash, byte| {
            (hash ^ u128::from(byte)).wrapping_mul(0x0000_0000_0100_0000_0000_0000_0000_013b)
        });
    let marked = (hash & !(0xf << 76) & !(0x3 << 62)) | (0x4 << 76) | (0x2 << 62);
    let hex = format!("{marked:032x}");
    format!("{}-{}-{}-{}-{}", &hex[..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..])
}
