//! report.html, from nothing but the files of a result folder.

use std::path::{Path, PathBuf};

use glam::DVec3;
use rayon::prelude::*;

use super::UNCHANGED;
use super::{Folder, OtherCamera, cause_page, curves, light};
use crate::export::PlainBack;
use crate::report::chart;
use crate::report::embed::Window;
use crate::report::film::{Film, Load, Source};
use crate::report::scale;
use crate::report::{
    BackData, CauseData, ClothData, EmbeddedMotion, Field, KeyNumber, Map, OtherLens, Parameter, ReportData,
    Surface, embed, page,
};
use tessuto_core::camera::{Pose, Rect, Viewpoint};
use tessuto_core::error::{Error, Result};
use tessuto_core::image::srgb;
use tessuto_core::mesh::Positions;
use tessuto_core::scene::Back;
use tessuto_estimate::io::rgb8::Rgb8;
use tessuto_estimate::io::{self, jpeg};
use tessuto_estimate::metrics::names::{LIT, SILHOUETTE, TEXTURED};
use tessuto_estimate::metrics::{self, Evaluation, Verdict};
use tessuto_estimate::motion::parameters::Parameters;
use tessuto_sim::cloth::AREA_DENSITY;

/// Bytes that the film may have however large the rest is.
const LEAST_FILM: usize = 2 << 20;
/// Largest side of an embedded map `[px]`.
const MAP_SIDE: u32 = 1024;

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
    let agreement = evaluation.as_ref().map_or(&[][..], |e| &e.agreement);
    let forces = cause_page::forces(saved)?;
    let causes = cause_page::data(saved, forces.as_ref())?;
    let mut charts = curves::over_frames(saved, motion, agreement)?;
    charts.extend(forces.and_then(|forces| cause_page::shares(saved, &forces)));
    charts.extend(chart::of_history(steps, &parameters));
    let window = Window::of(&saved.mesh);
    let cloth = ClothData {
        fps: saved.fps,
        first_frame: saved.run.frames[0],
        frame_count: motion.len(),
        camera: saved.camera,
        poses: poses(saved.poses.as_deref()),
        surface: Surface::new(&saved.mesh, window),
        motion: EmbeddedMotion::new(motion),
        fields: fields(folder, saved, motion)?,
        back: back(saved)?,
    };
    let (maps, light) = (maps(folder, window)?, light::light(folder, &saved.mesh, motion)?);
    let sizes = maps.iter().map(|m| m.image.len()).sum::<usize>()
        + light.as_ref().map_or(0, |l| l.image.len() + l.radiance.len())
        + cloth.motion.steps.len()
        + cloth.fields.iter().map(|f| f.steps.len()).sum::<usize>()
        + cloth.surface.triangles.len() * 2
        + causes.as_ref().map_or(0, CauseData::size)
        // Tables, curves and configuration.
        + 100_000 + 100 * steps.len();
    let budget = page::BUDGET.saturating_sub(page::bare_size() + sizes).max(LEAST_FILM);
    // The cameras have one part of it each.
    let budget = budget / (1 + saved.others.len());
    let total: f64 = log.timings.iter().map(|(_, s)| s).sum();
    let mut subtitle = format!("{}, {} vertices", saved.run.subtitle(), saved.mesh.positions.len());
    if total > 0.0 {
        subtitle.push_str(&format!(", {total:.0} s of work"));
    }
    let verdict = metrics::judge(agreement, &saved.mesh);
    Ok(ReportData {
        title: saved.run.name(),
        subtitle,
        command: log.commands.join("\n"),
        key_numbers: key_numbers(verdict.as_ref(), evaluation.as_ref()),
        verdict,
        verdicts: evaluation.as_ref().map_or_else(Vec::new, |e| e.verdicts.clone()),
        film: film(saved, motion, None, budget)?,
        others: others(saved, motion, budget)?,
        cloth: Some(cloth),
        maps,
        light,
        charts,
        parameters,
        causes,
        evaluation,
        timings: log.timings,
        warnings: log.warnings,
        config: serde_json::to_string_pretty(&saved.run).expect("plain data"),
        live: false,
    })
}

/// What the 3D view shows of the other side.
fn back(saved: &Folder) -> Result<Option<BackData>> {
    let [filmed, lit] = [false, true].map(|lit| PlainBack::of(saved, lit));
    let (filmed, lit) = (filmed?, lit?);
    let name = |back: PlainBack| io::scene::back::name(Back::Plain(Some(back.colour.map(srgb::encode))));
    Ok(filmed.or(lit).zip(lit.or(filmed)).map(|(filmed, lit)| BackData {
        outward: filmed.outward,
        texture: name(filmed),
        diffuse: name(lit),
    }))
}

/// The three numbers that say most: likeness to the video, and distance from the truth or else strain.
fn key_numbers(verdict: Option<&Verdict>, evaluation: Option<&Evaluation>) -> Vec<KeyNumber> {
    let mean = evaluation.map(|e| e.mean).unwrap_or_default();
    let lit = evaluation.and_then(|e| e.maps.as_ref()).and_then(|m| m.frames_psnr);
    let number = |label: &str, value: Option<f64>, scale: f64, unit: &str| {
        value.map(|v| KeyNumber::new(label, format!("{:.1}", scale * v), unit))
    };
    let silhouette = verdict.and_then(|v| v.silhouette).map(|o| o.mean);
    let textured = verdict.and_then(|v| v.psnr).map(|o| o.mean);
    let strain = verdict.map(|v| v.strain_p99.worst);
    let colours = number(if lit.is_some() { LIT } else { TEXTURED }, lit.or(textured), 1.0, "dB");
    [
        number(SILHOUETTE, silhouette, 100.0, "%")
            .zip(silhouette)
            .map(|(n, v)| n.graded(&scale::SILHOUETTES, v)),
        colours.zip(lit.or(textured)).map(|(n, v)| n.graded(&scale::COLOURS, v)),
        number("from the true vertices", mean.vertex, 1e3, "mm"),
        number("from the tracked points", mean.track, 1e3, "mm"),
        number("from the measured depth", mean.depth, 1e3, "mm"),
        number("strain, 99 of 100 threads", strain, 100.0, "%")
            .zip(strain)
            .map(|(n, v)| n.graded(&scale::STRAINS, v)),
        number("Chamfer distance", mean.cd1, 1e3, "mm"),
    ]
    .into_iter()
    .flatten()
    .take(3)
    .collect()
}

/// What was recovered besides the motion.
fn parameter_rows(saved: &Folder) -> Vec<Parameter> {
    let Parameters { log_stiffness, accelerations, .. } = &saved.parameters;
    let ranges = saved.run.settings.dynamics.ranges();
    let note = |k: usize| {
        let range = ranges[k].1;
        let [low, high] = [range.low, range.high].map(|b| format!("{}", (10f64.powf(b) * 1e9).round() / 1e9));
        match range.bound_at(log_stiffness[k]) {
            Some(bound) => {
                format!("at its {bound} bound, searched from {low} to {high}: not a measurement")
            }
            None => format!("searched from {low} to {high}"),
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
    let properties = saved.parameters.properties().enumerate();
    let mut rows: Vec<Parameter> =
        properties.map(|(k, (p, value))| parameter(p.key, p.label, value, p.unit, note(k))).collect();
    rows.extend([
        parameter("constant_x", "constant force per mass, x (right)", c.x, "m/s²", String::new()),
        parameter("constant_y", "constant force per mass, y (down)", c.y, "m/s²", String::new()),
        parameter("constant_z", "constant force per mass, z (away)", c.z, "m/s²", String::new()),
        parameter(
            "area_density",
            "mass per area",
            AREA_DENSITY,
            "kg/m²",
            "assumed, not recovered".to_owned(),
        ),
    ]);
    if let Some(wind) = accelerations.wind {
        let axes = [("x", "right", wind.x), ("y", "down", wind.y), ("z", "away", wind.z)];
        rows.extend(axes.map(|(axis, to, value)| {
            parameter(&format!("wind_{axis}"), &format!("wind, {axis} ({to})"), value, "m/s", String::new())
        }));
    }
    rows
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
    let accelerations = curves::force_magnitudes(&saved.parameters.accelerations, motion.len(), vertex_count);
    let often = match io::npy::read_if_there(&folder.join("seen_vertices.npy"), &[vertex_count])? {
        Some(often) => {
            let frames: Vec<Vec<f32>> = vec![often.iter().map(|n| *n as f32).collect(); motion.len()];
            Field::new(["seen", "frames that show the vertex", "frames"], false, &frames)
        }
        None => None,
    };
    Ok([
        from_file("depth_error.npy", ["depth_error", "depth − measured depth", "mm"], true)?,
        from_file("vertex_error.npy", ["vertex_error", "distance from the true vertex", "mm"], false)?,
        from_file("deviation.npy", ["deviation", "standard deviation of the position", "mm"], false)?,
        Field::new(["force", "force per mass", "m/s²"], false, &accelerations),
        often,
    ]
    .into_iter()
    .flatten()
    .collect())
}

/// The recovered texture and, where they were estimated, the material maps; of each the part that `window` shows.
fn maps(folder: &Path, window: Window) -> Result<Vec<Map>> {
    let all = [
        (
            "texture",
            "recovered texture: all frames' colours, in the first one's light; hatched: never seen",
            "texture.png",
        ),
        ("diffuse", "albedo: the diffuse colour, without the light", "material/diffuse.png"),
        ("roughness", "roughness: black is smooth, white is matt", "material/roughness.png"),
        ("metallic", "metallic: black is none, white is metal", "material/metallic.png"),
    ];
    let read = |(key, label, file): &(&'static str, &'static str, &str)| {
        let mut image = io::image::read_bytes(&folder.join(file))?;
        let size = [image.height, image.width];
        let seen = match *key {
            "texture" => io::npy::read_if_there(&folder.join("seen_texels.npy"), &size)?,
            _ => None,
        };
        if let Some(seen) = seen {
            hatch(&mut image, &seen);
        }
        let [x, y, width, height] =
            window.pixels(image.width as u32, image.height as u32).map(|v| v as usize);
        let (x0, y0) = (x.min(image.width - 1), y.min(image.height - 1));
        let (x1, y1) = ((x + width).min(image.width), (y + height).min(image.height));
        let part = Rect { x0, y0, x1, y1 };
        let small = jpeg::encode_part(&image, part, MAP_SIDE, light::MAP_QUALITY);
        Ok(Map { key, label, image: embed::base64(&small) })
    };
    all.par_iter().filter(|(_, _, file)| folder.join(file).is_file()).map(read).collect()
}

/// Strikes out the pixels of which `seen` holds 0.
fn hatch(image: &mut Rgb8, seen: &[f64]) {
    let spacing = (image.width / 64).max(4);
    for ((x, y, colour), seen) in image.pixels_mut().zip(seen) {
        if *seen == 0.0 && (x + y) % spacing < spacing / 2 {
            *colour = colour.map(|v| (0.4 * f32::from(v) + 0.6 * 245.0) as u8);
        }
    }
}

/// The frames that the folder has images of: of the scene's own camera, or of further camera `other`.
fn film(saved: &Folder, motion: &[Positions], other: Option<usize>, budget: usize) -> Result<Film> {
    let (folder, first) = (saved.path(), saved.run.frames[0]);
    let pictures = other.map_or_else(|| folder.join("pictures"), |k| folder.join(super::of_other(k)));
    let path = |name: &str, n: usize| match name {
        "rerendered" => folder.join(format!("rerendered/rgb_{:03}.png", first + n)),
        _ => pictures.join(format!("{name}/frame_{:03}.png", first + n)),
    };
    let observed = path("observed", 0);
    if !observed.is_file() {
        return Ok(Film::default());
    }
    let size = io::image::size(&observed)?;
    let (whole, crop, views) = match other.map(|k| &saved.others[k]) {
        Some(other) => {
            (other.camera, other.crop, (0..motion.len()).map(|n| other.viewpoint(n)).collect::<Vec<_>>())
        }
        None => (saved.camera, saved.crop, saved.viewpoints()),
    };
    let camera = whole.cropped(crop);
    let views: Vec<Viewpoint> = views.iter().map(|view| view.with_camera(camera)).collect();
    let shown = in_sight(motion, &views);
    let layers = [
        ("observed", "video"),
        ("render", "re-rendered: recovered texture"),
        ("rerendered", "re-rendered: recovered material and light"),
    ];
    let source = |(key, label): (&'static str, &'static str)| {
        let load: Load = Box::new(move |n| load(path(key, n), size, crop));
        Source { key, label, load }
    };
    // Material and light are drawn for the scene's own camera only.
    let drawn = |key: &str| key != "rerendered" || other.is_none();
    let there = |(key, _): &(&str, &str)| drawn(key) && path(key, 0).is_file();
    let sources: Vec<Source> = layers.into_iter().filter(there).map(source).collect();
    Film::new(&sources, motion.len(), &camera, shown, budget)
}

/// The further cameras, with films of at most `budget` bytes each.
fn others(saved: &Folder, motion: &[Positions], budget: usize) -> Result<Vec<OtherLens>> {
    let lens = |(k, other): (usize, &OtherCamera)| {
        let film = film(saved, motion, Some(k), budget)?;
        Ok(other_lens(other, saved.fps, film))
    };
    saved.others.iter().enumerate().map(lens).collect()
}

/// As the page's script reads it.
pub(super) fn other_lens(other: &OtherCamera, fps: f64, film: Film) -> OtherLens {
    let still = other.poses.iter().all(|pose| *pose == other.poses[0]);
    let listed = &other.poses[..if still { 1 } else { other.poses.len() }];
    let (name, late) = (other.name.clone(), other.late * fps);
    OtherLens { name, camera: other.camera, poses: poses(Some(listed)), late, film }
}

/// An image of size `size`, or that part of a whole frame.
fn load(path: PathBuf, size: [usize; 2], crop: Rect) -> Result<Rgb8> {
    let image = io::image::read_bytes(&path)?;
    let [width, height] = [image.width, image.height];
    if [width, height] == size {
        return Ok(image);
    }
    if crop.x1 > width || crop.y1 > height || [crop.width(), crop.height()] != size {
        return Err(Error::input(
            path.display().to_string(),
            format!("is {width}×{height} pixels, the first frame is {}×{}", size[0], size[1]),
            UNCHANGED,
        ));
    }
    Ok(image.cropped(crop))
}

/// As the page's script reads them.
pub(super) fn poses(poses: Option<&[Pose]>) -> Vec<[f64; 12]> {
    let rows = |pose: &Pose| std::array::from_fn(|k| pose.rows()[k]);
    poses.unwrap_or_default().iter().map(rows).collect()
}

/// The pixels that the moving fabric comes over, seen from `views`, one of each frame; None if it is never in sight.
pub(super) fn in_sight(motion: &[Positions], views: &[Viewpoint]) -> Option<Rect> {
    let pixel = |(view, p): (&Viewpoint, &DVec3)| {
        let (width, height) = (view.camera.width as f64, view.camera.height as f64);
        let p_pixel = view.project_in_front(*p)?.round();
        let inside = p_pixel.min_element() >= 0.0 && p_pixel.x < width && p_pixel.y < height;
        inside.then_some((p_pixel.x as usize, p_pixel.y as usize))
    };
    let seen = views.iter().zip(motion).flat_map(|(view, x)| x.iter().map(move |p| (view, p)));
    Rect::around(seen.filter_map(pixel))
}
