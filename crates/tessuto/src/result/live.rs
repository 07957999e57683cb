//! The live report page, and the updates that its script asks for.

use serde::Serialize;

use super::{OtherCamera, Run, page};
use crate::report::embed::Window;
use crate::report::film::{Film, Source};
use crate::report::{ClothData, EmbeddedMotion, ReportData, Surface, chart, page as report};
use tessuto_core::error::Result;
use tessuto_core::mesh::Positions;
use tessuto_core::scene::Scene;
use tessuto_estimate::io::image::rgb8;
use tessuto_estimate::session::Epoch;

/// Bytes for the video.
const FILM_BUDGET: usize = 4 << 20;

/// The page as it is before the first step: the video, the template and the settings.
///
/// # Errors
/// Those of reading the frames.
pub fn live_page(scene: &Scene, run: &Run, command: &str) -> Result<String> {
    let template = [scene.template.positions.clone()];
    let film = |v: usize| {
        let scene = scene.seen_by(v);
        let bytes = |n: usize| Ok(rgb8(&scene.frames.frame(n)?.rgb));
        let source = Source { key: "observed", label: "video", load: Box::new(bytes) };
        let shown = page::in_sight(&template, &scene.viewpoints()[..1]);
        Film::new(&[source], scene.frames.len(), &scene.camera, shown, FILM_BUDGET)
    };
    let cameras = OtherCamera::of(scene);
    let others = cameras.iter().zip(1..).map(|(other, v)| Ok(page::other_lens(other, scene.fps, film(v)?)));
    let data = ReportData {
        title: run.name(),
        subtitle: format!("{}, {} vertices", run.subtitle(), scene.template.positions.len()),
        command: command.to_owned(),
        cloth: Some(ClothData {
            fps: scene.fps,
            first_frame: scene.first_frame,
            frame_count: scene.frames.len(),
            camera: scene.camera,
            poses: page::poses(scene.poses.as_deref()),
            surface: Surface::new(&scene.template, Window::WHOLE),
            motion: EmbeddedMotion::new(&template),
            fields: Vec::new(),
            back: None,
        }),
        film: film(0)?,
        others: others.collect::<Result<_>>()?,
        config: serde_json::to_string_pretty(run).expect("plain data"),
        live: true,
        ..ReportData::default()
    };
    Ok(report::render(&data))
}

/// What the page's script reads while it runs.
#[derive(Serialize)]
struct State<'a> {
    stage: Option<&'a str>,
    step: usize,
    of: usize,
    charts: Vec<crate::report::Chart>,
    motion: Option<EmbeddedMotion>,
}

/// The curves so far and, if there is one, the motion so far, as JSON.
pub fn live_state(epochs: &[Epoch], motion: Option<&[Positions]>) -> String {
    let last = epochs.last();
    let state = State {
        stage: last.map(|e| &*e.stage),
        step: last.map_or(0, |e| e.step),
        of: last.map_or(1, |e| e.of),
        charts: chart::of_history(epochs, &[]),
        motion: motion.map(EmbeddedMotion::new),
    };
    serde_json::to_string(&state).expect("plain data")
}
