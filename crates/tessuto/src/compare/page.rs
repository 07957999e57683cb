//! The page: all tables, and the results side by side, frame by frame, without any other file.

use std::fmt::Write as _;
use std::path::Path;

use super::table::{failures, shown};
use super::{Entry, Table, csv, tables, text};
use crate::report::colour::diverging;
use crate::report::film::{Film, Source};
use crate::report::images::measured_depth_image;
use crate::report::page::script_safe;
use crate::result::Folder;
use crate::view::{draw_shaded, draw_texture};
use tessuto_core::camera::{Camera, Viewpoint};
use tessuto_core::error::Result;
use tessuto_core::image::Image;
use tessuto_core::mesh::Positions;
use tessuto_core::scene::Scene;
use tessuto_estimate::io::rgb8::Rgb8;
use tessuto_estimate::io::scene::{LoadOptions, load};
use tessuto_estimate::io::{self, atomic_write};
use tessuto_estimate::output::{FolderKind, OutputFolder};
use tessuto_render::pbr::Geometry;
use tessuto_render::raster::{Rasterizer, Rendering, Texture};

/// Base64 of all images of a scene together, at most `[bytes]`.
const BUDGET: usize = 9 << 20;
/// Largest side of an image before it is shrunk further `[px]`.
const SIDE: usize = 560;
/// Where the novel view is from: degrees to the left, as in \[SAFT\] Figure 3.
const LEFT: f64 = 45.0;
/// Depth differences of this size have the full colour `[m]`.
const FULL_COLOUR: f64 = 0.03;

const PAGE: &str = include_str!("../../assets/compare/page.html");

/// A result, opened, with what is drawn of it.
struct Shown<'a> {
    entry: &'a Entry,
    folder: Folder,
    texture: Texture,
    rasterizer: Rasterizer,
}

/// Writes `compare.txt`, `compare.csv` and `compare.html` of `entries` into the folder `out`, in place of earlier
/// ones; the text.
///
/// # Errors
/// [`Error::Input`](tessuto_core::Error::Input) if `out` holds anything but unchanged tables of tessuto's, or for
/// results that cannot be read; [`Error::Output`](tessuto_core::Error::Output).
pub fn write_page(out: &Path, entries: &[Entry]) -> Result<String> {
    let output = OutputFolder::prepare(out, FolderKind::Comparison, true)?;
    let tables = tables(entries);
    let text = text(&tables, entries);
    let write = |name: &str, text: &str| atomic_write(&output.partial().join(name), text.as_bytes());
    write("compare.txt", &text)?;
    write("compare.csv", &csv(&tables))?;
    write("compare.html", &page(&tables, entries)?)?;
    output.publish()?;
    Ok(text)
}

fn page(tables: &[Table], entries: &[Entry]) -> Result<String> {
    let mut body = String::new();
    let mut films = Vec::new();
    for of_scene in entries.chunk_by(|a, b| a.scene == b.scene) {
        let shown: Vec<Shown> =
            of_scene.iter().filter_map(|e| Shown::new(e).transpose()).collect::<Result<_>>()?;
        let Some(first) = shown.first() else { continue };
        let frames = first.folder.run.frames;
        let films_of_scene = films_of(&shown)?;
        let _ = write!(
            body,
            "<section data-first=\"{}\"><h2>{}</h2><div class=\"views\"></div></section>",
            frames[0],
            escaped(&of_scene[0].scene)
        );
        films.push(films_of_scene);
    }
    let failed: String = failures(entries)
        .map(|(e, why)| {
            format!("<li>{}, {}: {}</li>", escaped(&e.scene), escaped(e.method.key), escaped(why))
        })
        .collect();
    let data = serde_json::to_string(&films).expect("plain data");
    Ok(PAGE
        .replace("{{tables}}", &tables.iter().map(html_of).collect::<String>())
        .replace("{{failures}}", &failed)
        .replace("{{scenes}}", &body)
        .replace("{{films}}", &script_safe(&data)))
}

fn html_of(table: &Table) -> String {
    let mut out =
        format!("<table><caption>{} [{}]</caption><tr><th></th>", escaped(&table.title), table.unit);
    for scene in &table.scenes {
        let _ = write!(out, "<th>{}</th>", escaped(scene));
    }
    let has_mean = table.scenes.len() > 1;
    out.push_str(if has_mean { "<th>mean</th></tr>" } else { "</tr>" });
    for row in &table.rows {
        let class = if row.is_published { " class=\"published\"" } else { "" };
        let _ = write!(out, "<tr{class}><th>{}</th>", escaped(&row.label));
        for value in row.values.iter().copied().chain(has_mean.then(|| row.mean())) {
            let _ = write!(out, "<td>{}</td>", shown(value));
        }
        out.push_str("</tr>");
    }
    out + "</table>"
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

impl<'a> Shown<'a> {
    fn new(entry: &'a Entry) -> Result<Option<Self>> {
        let Some(folder) = entry.result() else { return Ok(None) };
        let texture = Texture::from_image(&io::image::read(&folder.path().join("texture.png"))?);
        let rasterizer = folder.rasterizer(false)?;
        Ok(Some(Self { entry, folder, texture, rasterizer }))
    }

    fn motion(&self) -> Result<&[Positions]> {
        Ok(self.folder.motion()?)
    }

    fn source<'b>(&self, load: impl Fn(usize) -> Result<Image> + Sync + 'b) -> Source<'b> {
        let method = self.entry.method;
        Source { key: method.key, label: method.label, load: Box::new(move |n| Ok(to_rgb(&load(n)?))) }
    }
}

/// One film for each way to look: novel view, surface, and, where there is truth, depth differences. Each has one
/// layer for each method.
fn films_of(shown: &[Shown]) -> Result<Vec<(String, Film)>> {
    let motions: Vec<&[Positions]> = shown.iter().map(Shown::motion).collect::<Result<_>>()?;
    let frame_count = motions.iter().map(|m| m.len()).min().unwrap_or(0);
    let folder = &shown[0].folder;
    let camera = folder.camera.cropped(folder.crop);
    let scale = (SIDE as f64 / camera.width.max(camera.height) as f64).min(1.0);
    let size = [camera.width, camera.height].map(|n| ((n as f64 * scale) as usize).max(1));
    let together: Vec<Positions> = motions.iter().flat_map(|m| m[..frame_count].iter().cloned()).collect();
    let novel = Viewpoint::about(&together, camera, LEFT.to_radians(), 0.0)?.sized(size);
    let originals: Vec<Viewpoint> =
        folder.viewpoints().iter().map(|view| view.with_camera(camera).sized(size)).collect();
    let original = originals[0].camera;
    let film =
        |sources: &[Source], camera: &Camera| Film::new(sources, frame_count, camera, None, BUDGET / 3);

    let from_left: Vec<Source> = shown
        .iter()
        .zip(&motions)
        .map(|(s, motion)| {
            let (rasterizer, texture) = (&s.rasterizer, &s.texture);
            s.source(move |n| {
                Ok(draw_texture(
                    rasterizer,
                    &novel.camera,
                    &novel.all_in_camera(&motion[n]).into_owned(),
                    texture,
                ))
            })
        })
        .collect();
    // In the camera's frame.
    let seen: Vec<Vec<Positions>> = motions
        .iter()
        .map(|m| {
            m[..frame_count]
                .iter()
                .zip(&originals)
                .map(|(x, view)| view.all_in_camera(x).into_owned())
                .collect()
        })
        .collect();
    let geometries: Vec<Geometry> =
        shown.iter().zip(&seen).map(|(s, m)| Geometry::new(&s.folder.mesh, m)).collect();
    let surface: Vec<Source> = shown
        .iter()
        .zip(&seen)
        .zip(&geometries)
        .map(|((s, seen), geometry)| {
            let rasterizer = &s.rasterizer;
            s.source(move |n| Ok(draw_shaded(rasterizer, &original, geometry, (n, &seen[n]))))
        })
        .collect();
    let mut out = vec![
        (format!("from {LEFT}° to the left"), film(&from_left, &novel.camera)?),
        ("surface".to_owned(), film(&surface, &original)?),
    ];
    let scene = truth(folder);
    if let Some(scene) = scene.as_ref().filter(|s| (0..frame_count).any(|n| s.truth.points_in(n).is_some())) {
        let difference: Vec<Source> = shown
            .iter()
            .zip(&seen)
            .map(|(s, seen)| {
                let (rasterizer, originals) = (&s.rasterizer, &originals);
                s.source(move |n| Ok(depth_difference(rasterizer, scene, &originals[n], (n, &seen[n]))))
            })
            .collect();
        let label =
            format!("depth − measured depth, ±{} mm (blue: too near, red: too far)", 1e3 * FULL_COLOUR);
        out.push((label, film(&difference, &original)?));
    }
    Ok(out)
}

/// The scene of a result, if it is still there.
fn truth(folder: &Folder) -> Option<Scene> {
    let [first, end] = folder.run.frames;
    let options = LoadOptions { frames: Some(first..end), ..LoadOptions::default() };
    Some(load(&folder.run.scene, &options).ok()?.scene)
}

/// On black; grey where nothing was measured. `x` is in the camera's frame.
fn depth_difference(
    rasterizer: &Rasterizer,
    scene: &Scene,
    view: &Viewpoint,
    (n, x): (usize, &Positions),
) -> Image {
    let camera = &view.camera;
    let mut rendering = Rendering::new();
    rasterizer.render(camera, x, &Texture::uniform(1, 1, [0.0; 3]), &mut rendering);
    let measured = scene.truth.points_in(n).map(|points| measured_depth_image(points, view));
    let mut image = Image::new(camera.width, camera.height, 3);
    for row in 0..camera.height {
        for column in 0..camera.width {
            let Some(z) = rendering.depth(column, row) else { continue };
            let known = measured.as_ref().map(|m| f64::from(m.pixel(column, row)[0])).filter(|m| *m > 0.0);
            let colour =
                known.map_or([0.5; 3], |m| diverging(((z - m) / FULL_COLOUR).clamp(-1.0, 1.0) as f32));
            image.pixel_mut(column, row).copy_from_slice(&colour);
        }
    }
    image
}

fn to_rgb(image: &Image) -> Rgb8 {
    let bytes = image.data.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
    Rgb8::new([image.width, image.height], bytes)
}
