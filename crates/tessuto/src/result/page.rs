//! report.html, from nothing but the files of a result folder.

use std::path::{Path, PathBuf};

use glam::DVec3;
use rayon::prelude::*;

use super::Folder;
use super::folder::UNCHANGED;
use crate::camera::{Camera, Rect};
use crate::error::{Error, Result};
use crate::io::{self, jpeg};
use crate::mesh::Positions;
use crate::motion::parameters::Parameters;
use crate::report::chart::{self, Chart, Series};
use crate::report::embed::Window;
use crate::report::film::{Film, Load, Source};
use crate::report::{
    ClothData, Field, KeyNumber, LightData, Map, Motion, Parameter, ReportData, Surface, embed, page,
};
use crate::sim::Accelerations;

/// Bytes that the film may have however large the rest is.
const LEAST_FILM: usize = 2 << 20;
/// Largest side of an embedded map `[px]`, and JPEG quality of maps.
const MAP_SIDE: u32 = 1024;
const MAP_QUALITY: u8 = 86;

/// Writes report.html of a result. Everything it shows is read from the folder: it can be written anew whenever the
/// folder has changed.
///
/// # Errors
/// [`Error::Input`] naming the file that cannot be used; [`Error::Output`].
pub fn write_page(folder: &Folder) -> Result<()> {
    page::write(&folder.path().join("report.html"), &report_data(folder)?)
}

fn report_data(saved: &Folder) -> Result<ReportData> {
    let folder = saved.path();
    let log = saved.log()?.clone();
    let motion = saved.motion()?;
    let evaluation = saved.metrics()?.cloned();
    let parameters = parameter_rows(saved);
    let steps = saved.history()?;
    let mut charts = frame_charts(folder, saved, motion)?;
    charts.extend(chart::of_history(steps, &parameters));
    let window = Window::of(&saved.mesh);
    let cloth = ClothData {
        fps: saved.fps,
        first_frame: saved.run.frames[0],
        frame_count: motion.len(),
        camera: saved.camera,
        surface: Surface::new(&saved.mesh, window),
        motion: Motion::new(motion),
        fields: fields(folder, saved, motion)?,
    };
    let (maps, light) = (maps(folder, window)?, light(folder)?);
    let sizes = maps.iter().map(|m| m.picture.len()).sum::<usize>()
        + light.as_ref().map_or(0, |l| l.picture.len() + l.radiance.len())
        + cloth.motion.steps.len()
        + cloth.fields.iter().map(|f| f.steps.len()).sum::<usize>()
        + cloth.surface.triangles.len() * 2
        // Tables, curves and configuration.
        + 100_000 + 100 * steps.len();
    let budget = page::BUDGET.saturating_sub(page::bare_size() + sizes).max(LEAST_FILM);
    let total: f64 = log.timings.iter().map(|(_, s)| s).sum();
    let mut key_numbers = vec![
        KeyNumber::new("frames", motion.len().to_string(), ""),
        KeyNumber::new("vertices", saved.mesh.positions.len().to_string(), ""),
    ];
    if total > 0.0 {
        key_numbers.push(KeyNumber::new("time", format!("{total:.0}"), "s"));
    }
    Ok(ReportData {
        title: saved.run.name(),
        subtitle: saved.run.subtitle(),
        command: log.commands.join("\n"),
        key_numbers,
        film: film(folder, saved, motion, budget)?,
        cloth: Some(cloth),
        maps,
        light,
        charts,
        parameters,
        evaluation,
        timings: log.timings,
        warnings: log.warnings,
        config: serde_json::to_string_pretty(&saved.run).expect("plain data"),
        live: false,
    })
}

/// What was recovered besides the motion.
fn parameter_rows(saved: &Folder) -> Vec<Parameter> {
    let Parameters { log_stiffness, accelerations } = &saved.parameters;
    let [stretch, bend, shear] = saved.parameters.stiffness();
    let d = &saved.run.settings.dynamics;
    let note = |k: usize| {
        let range = [d.stretch, d.bend, d.shear][k];
        let [low, high] = [range.low, range.high].map(|k| 10f64.powf(k));
        match range.bound_at(log_stiffness[k]) {
            Some(bound) => format!("at its {bound} bound, of {low:.0e} to {high:.0e}: no measurement"),
            None => "effective value of the replay".to_owned(),
        }
    };
    let parameter = |name: &str, label: &str, value, unit: &str, note| Parameter {
        name: name.to_owned(),
        label: label.to_owned(),
        value,
        unit: unit.to_owned(),
        note,
    };
    let c = accelerations.constant;
    vec![
        parameter("stretch", "stretch stiffness", stretch, "N/m", note(0)),
        parameter("bend", "bend stiffness", bend, "J/rad²", note(1)),
        parameter("shear", "shear stiffness", shear, "J/rad²", note(2)),
        parameter("constant_x", "constant force per mass, x (right)", c.x, "m/s²", String::new()),
        parameter("constant_y", "constant force per mass, y (down)", c.y, "m/s²", String::new()),
        parameter("constant_z", "constant force per mass, z (away)", c.z, "m/s²", String::new()),
    ]
}

/// ‖C + D‖ [m/s²] at every vertex, mean over the parts of the interval after each frame; the last frame repeats.
fn force_magnitudes(accelerations: &Accelerations, frame_count: usize, vertex_count: usize) -> Vec<Vec<f32>> {
    let intervals: Vec<&[Positions]> =
        accelerations.dynamic.chunks_exact(accelerations.entries_per_frame).collect();
    let of = |n: usize| -> Vec<f32> {
        let Some(parts) = intervals.get(n.min(intervals.len().saturating_sub(1))) else {
            return vec![f32::NAN; vertex_count];
        };
        let mean = |v: usize| parts.iter().map(|d| (accelerations.constant + d[v]).length()).sum::<f64>();
        (0..vertex_count).map(|v| (mean(v) / accelerations.entries_per_frame as f64) as f32).collect()
    };
    (0..frame_count).map(of).collect()
}

/// What the fabric can be coloured by; strain is left to the script, which has all it needs.
fn fields(folder: &Path, saved: &Folder, motion: &[Positions]) -> Result<Vec<Field>> {
    let vertex_count = saved.mesh.positions.len();
    let from_file = |name: &str, texts: [&'static str; 3], diverging| -> Result<Option<Field>> {
        let path = folder.join(name);
        if !path.is_file() {
            return Ok(None);
        }
        let array = io::npy::read(&path)?;
        if array.shape != [motion.len(), vertex_count] {
            return Err(Error::input(
                path.display().to_string(),
                format!("has shape {:?}, expected [{}, {vertex_count}]", array.shape, motion.len()),
                UNCHANGED,
            ));
        }
        let values: Vec<Vec<f32>> = array
            .data
            .chunks_exact(vertex_count)
            .map(|v| v.iter().map(|m| (1e3 * m) as f32).collect())
            .collect();
        Ok(Field::new(texts, diverging, &values))
    };
    let accelerations = force_magnitudes(&saved.parameters.accelerations, motion.len(), vertex_count);
    Ok([
        from_file("depth_error.npy", ["depth_error", "depth − measured depth", "mm"], true)?,
        from_file("vertex_error.npy", ["vertex_error", "distance from the true vertex", "mm"], false)?,
        Field::new(["force", "force per mass", "m/s²"], false, &accelerations),
    ]
    .into_iter()
    .flatten()
    .collect())
}

/// Curves over the frames besides the errors.
fn frame_charts(folder: &Path, saved: &Folder, motion: &[Positions]) -> Result<Vec<Chart>> {
    let first = saved.run.frames[0];
    let chart = |title: &str, unit: &str, lines: Vec<(&str, Vec<f64>)>| {
        let line = |(name, values): (&str, Vec<f64>)| Series {
            name: name.to_owned(),
            values: values.into_iter().map(|v| Some(v).filter(|v| v.is_finite())).collect(),
        };
        let series: Vec<Series> = lines.into_iter().map(line).collect();
        Chart {
            title: title.to_owned(),
            x_label: "frame".to_owned(),
            unit: unit.to_owned(),
            by_frame: true,
            log: series.len() > 1 && chart::spans_decades(&series),
            x: (first..first + motion.len()).map(|n| n as f64).collect(),
            series,
        }
    };
    let mut charts = Vec::new();
    if let Some(psnr) = read_psnr(&folder.join("rerendered/psnr.csv"))?.filter(|p| p.len() == motion.len()) {
        charts.push(chart("PSNR of the frames drawn again", "dB", vec![("PSNR", psnr)]));
    }
    let edges = saved.mesh.edges();
    let rest = &saved.mesh.positions;
    let strain = |shape: &Positions| {
        let of = |[a, b]: &[u32; 2]| {
            let [a, b] = [*a as usize, *b as usize];
            (shape[a].distance(shape[b]) / rest[a].distance(rest[b]) - 1.0).abs()
        };
        100.0 * edges.iter().map(of).sum::<f64>() / edges.len().max(1) as f64
    };
    charts.push(chart(
        "Mean strain of the threads",
        "%",
        vec![("strain", motion.par_iter().map(strain).collect())],
    ));
    let accelerations = force_magnitudes(&saved.parameters.accelerations, motion.len(), rest.len());
    let mean = |f: &Vec<f32>| f.iter().map(|v| f64::from(*v)).sum::<f64>() / f.len().max(1) as f64;
    let most = |f: &Vec<f32>| f.iter().fold(f64::NAN, |m, v| m.max(f64::from(*v)));
    charts.push(chart(
        "Force per mass",
        "m/s²",
        vec![
            ("mean", accelerations.iter().map(mean).collect()),
            ("largest", accelerations.iter().map(most).collect()),
        ],
    ));
    Ok(charts)
}

/// Second column of rerendered/psnr.csv `[dB]`.
fn read_psnr(path: &Path) -> Result<Option<Vec<f64>>> {
    if !path.is_file() {
        return Ok(None);
    }
    let fail =
        |problem: String| Error::input(path.display().to_string(), problem, "run `tessuto appearance` again");
    let text = io::read_text(path)?;
    let value = |line: &str| line.split(',').nth(1).and_then(|v| v.parse().ok());
    let read = |line| value(line).ok_or_else(|| fail(format!("“{line}” is not a frame number and its PSNR")));
    text.lines().skip(1).map(read).collect::<Result<_>>().map(Some)
}

/// The recovered texture and, where they were estimated, the material maps; of each the part that `window` shows.
fn maps(folder: &Path, window: Window) -> Result<Vec<Map>> {
    let all = [
        ("texture", "recovered texture, with the first frame's light", "texture.png"),
        ("diffuse", "diffuse", "material/diffuse.png"),
        ("roughness", "roughness: black is smooth, white is matt", "material/roughness.png"),
        ("metallic", "metallic: black is none, white is metal", "material/metallic.png"),
    ];
    let read = |(key, label, file): &(&'static str, &'static str, &str)| {
        let picture = io::image::read_bytes(&folder.join(file))?;
        let [x, y, width, height] = window.pixels(picture.width(), picture.height());
        let picture = ::image::imageops::crop_imm(&picture, x, y, width, height).to_image();
        let scale = (f64::from(MAP_SIDE) / f64::from(width.max(height))).min(1.0);
        let side = |s: u32| ((f64::from(s) * scale).round() as u32).max(1);
        let small = ::image::imageops::thumbnail(&picture, side(width), side(height));
        Ok(Map { key, label, picture: embed::base64(&jpeg::encode(&small, MAP_QUALITY)) })
    };
    all.par_iter().filter(|(_, _, file)| folder.join(file).is_file()).map(read).collect()
}

/// The light, where it was estimated.
fn light(folder: &Path) -> Result<Option<LightData>> {
    let path = folder.join("material/environment.exr");
    if !path.is_file() {
        return Ok(None);
    }
    let environment = io::hdr::read_environment(&path)?;
    let shrunk = |most: usize| environment.downsampled((environment.height / most).max(1));
    let (data, shown) = (shrunk(64), shrunk(256));
    // The mean becomes middle grey; x / (1 + x) keeps the brightest parts from being cut off.
    let mean = shown.data.iter().map(|v| f64::from(*v)).sum::<f64>() / shown.data.len().max(1) as f64;
    let tone = |v: &f32| {
        let x = v / (2.0 * mean.max(1e-9)) as f32;
        (255.0 * crate::image::srgb::encode(x / (1.0 + x)).clamp(0.0, 1.0)).round() as u8
    };
    let bytes = shown.data.iter().map(tone).collect();
    let picture =
        ::image::RgbImage::from_raw(shown.width as u32, shown.height as u32, bytes).expect("three channels");
    Ok(Some(LightData {
        width: data.width,
        height: data.height,
        radiance: embed::base64_of(&data.data),
        picture: embed::base64(&jpeg::encode(&picture, MAP_QUALITY)),
    }))
}

/// The frames that the folder has images of.
fn film(folder: &Path, saved: &Folder, motion: &[Positions], budget: usize) -> Result<Film> {
    let first = saved.run.frames[0];
    let path = |name: &str, n: usize| match name {
        "rerendered" => folder.join(format!("rerendered/rgb_{:03}.png", first + n)),
        _ => folder.join(format!("pictures/{name}/frame_{:03}.png", first + n)),
    };
    let observed = path("observed", 0);
    if !observed.is_file() {
        return Ok(Film::default());
    }
    let size = io::image::read_bytes(&observed)?.dimensions();
    let size = [size.0 as usize, size.1 as usize];
    let crop = saved.crop;
    let camera = saved.camera.cropped(crop);
    let shown = in_sight(motion, &camera);
    let layers = [
        ("observed", "video"),
        ("render", "drawn with the recovered texture"),
        ("rerendered", "drawn with the recovered material and light"),
    ];
    let source = |(key, label): (&'static str, &'static str)| {
        let load: Load = Box::new(move |n| load(path(key, n), size, crop));
        Source { key, label, load }
    };
    let there = |(key, _): &(&str, &str)| path(key, 0).is_file();
    let sources: Vec<Source> = layers.into_iter().filter(there).map(source).collect();
    Film::new(&sources, motion.len(), &camera, shown, budget)
}

/// An image of size `size`, or that part of a whole frame.
fn load(path: PathBuf, size: [usize; 2], crop: Rect) -> Result<::image::RgbImage> {
    let picture = io::image::read_bytes(&path)?;
    let [width, height] = [picture.width() as usize, picture.height() as usize];
    if [width, height] == size {
        return Ok(picture);
    }
    if crop.x1 > width || crop.y1 > height || [crop.width(), crop.height()] != size {
        return Err(Error::input(
            path.display().to_string(),
            format!("is {width}×{height} pixels, the first frame is {}×{}", size[0], size[1]),
            UNCHANGED,
        ));
    }
    let [x, y, w, h] = [crop.x0, crop.y0, size[0], size[1]].map(|v| v as u32);
    Ok(::image::imageops::crop_imm(&picture, x, y, w, h).to_image())
}

/// The pixels that the moving fabric comes over; None if it is never in sight.
pub(super) fn in_sight(motion: &[Positions], camera: &Camera) -> Option<Rect> {
    let (width, height) = (camera.width, camera.height);
    let pixel = |p: &DVec3| {
        let p_pixel = camera.project(*p).round();
        let inside = p_pixel.min_element() >= 0.0 && p_pixel.x < width as f64 && p_pixel.y < height as f64;
        inside.then_some((p_pixel.x as usize, p_pixel.y as usize))
    };
    Rect::around(motion.iter().flatten().filter(|p| p.z > 1e-6).filter_map(pixel))
}
