//! The page: one file that needs nothing else. Styles, scripts, images and numbers are inside it.

use std::path::Path;

use askama::Template;
use serde::Serialize;

use super::{Chart, ClothData, Film, KeyNumber, LightData, Parameter, ReportData, chart};
use crate::error::Result;
use crate::io;
use crate::metrics::{Evaluation, Metrics, QUANTITIES};

/// Size `[bytes]` that the page keeps to by choosing the size of its images.
pub const BUDGET: usize = 14 << 20;

/// Styles, in the order of the page.
const STYLES: [&str; 2] =
    [include_str!("../../assets/vendor/uPlot.min.css"), include_str!("../../assets/report/page.css")];

/// Scripts, in the order of the page.
const SCRIPTS: [&str; 10] = [
    include_str!("../../assets/vendor/three.min.js"),
    include_str!("../../assets/vendor/uPlot.min.js"),
    include_str!("../../assets/report/data.js"),
    include_str!("../../assets/report/player.js"),
    include_str!("../../assets/report/colours.js"),
    include_str!("../../assets/report/cloth.js"),
    include_str!("../../assets/report/wipe.js"),
    include_str!("../../assets/report/charts.js"),
    include_str!("../../assets/report/main.js"),
    include_str!("../../assets/report/live.js"),
];

/// What the template reads; it escapes every text that is not marked safe.
#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    data: &'a ReportData,
    styles: [&'static str; 2],
    scripts: [&'static str; 10],
    key_numbers: Vec<KeyNumber>,
    parameters: Vec<Row>,
    errors: Vec<Row>,
    /// Name, time, fraction of the longest in percent.
    timings: Vec<(String, String, String)>,
    total: String,
    /// JSON for the script.
    embedded: String,
    has_truth: bool,
    has_published: bool,
}

/// What the script reads.
#[derive(Serialize)]
struct Embedded<'a> {
    live: bool,
    cloth: &'a Option<ClothData>,
    film: &'a Film,
    light: &'a Option<LightData>,
    charts: Vec<Chart>,
}

/// One line of a table.
struct Row {
    name: String,
    value: String,
    unit: String,
    note: String,
}

/// Writes the page to `path`.
///
/// # Errors
/// [`Error::Output`](crate::Error::Output).
pub fn write(path: &Path, data: &ReportData) -> Result<()> {
    io::atomic_write(path, render(data).as_bytes())
}

/// The page's text.
pub fn render(data: &ReportData) -> String {
    page(data).render().expect("a string takes every text")
}

/// Bytes of the page without its numbers and images.
pub fn bare_size() -> usize {
    STYLES.iter().chain(&SCRIPTS).map(|s| s.len()).sum()
}

fn page(data: &ReportData) -> Page<'_> {
    let mut key_numbers = data.key_numbers.clone();
    if let Some(evaluation) = &data.evaluation {
        key_numbers.extend(key_errors(&evaluation.mean));
        let psnr = evaluation.maps.as_ref().and_then(|m| m.frames_psnr);
        key_numbers.extend(psnr.map(|v| KeyNumber::new("drawn again, PSNR", format!("{v:.1}"), "dB")));
    }
    let longest = data.timings.iter().map(|t| t.1).fold(1e-9, f64::max);
    let percent = |s: f64| format!("{:.1}", 100.0 * s / longest);
    let timings = data.timings.iter().map(|(name, s)| (name.clone(), duration(*s), percent(*s)));
    let mut charts: Vec<Chart> = data.evaluation.as_ref().and_then(chart::of_errors).into_iter().collect();
    charts.extend(data.charts.iter().cloned());
    let errors = data.evaluation.as_ref().map(error_rows).unwrap_or_default();
    let embedded =
        Embedded { live: data.live, cloth: &data.cloth, film: &data.film, light: &data.light, charts };
    Page {
        data,
        styles: STYLES,
        scripts: SCRIPTS,
        key_numbers,
        parameters: data.parameters.iter().map(parameter_row).collect(),
        has_published: errors.iter().any(|e| e.name.contains("published")),
        has_truth: !errors.is_empty(),
        errors,
        timings: timings.collect(),
        total: duration(data.timings.iter().map(|t| t.1).sum()),
        embedded: script_safe(&serde_json::to_string(&embedded).expect("plain data")),
    }
}

/// JSON that may stand in a script element: nothing in it ends the element or opens a comment.
pub fn script_safe(json: &str) -> String {
    json.replace('<', "\\u003c")
}

fn key_errors(mean: &Metrics) -> Vec<KeyNumber> {
    let millimetres = |label: &str, value: Option<f64>| {
        value.map(|v| KeyNumber::new(label, format!("{:.1}", v * 1e3), "mm"))
    };
    let squared = mean.cd2.map(|v| KeyNumber::new("Chamfer, L2", format!("{:.2}", v * 1e4), "10⁻⁴ m²"));
    [
        millimetres("depth difference", mean.depth),
        millimetres("Chamfer, L1", mean.cd1),
        squared,
        millimetres("vertex distance", mean.vertex),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn parameter_row(p: &Parameter) -> Row {
    let value = if p.value != 0.0 && !(1e-3..1e5).contains(&p.value.abs()) {
        format!("{:.3e}", p.value)
    } else {
        format!("{:.4}", p.value)
    };
    Row { name: p.label.clone(), value, unit: p.unit.clone(), note: p.note.clone() }
}

fn error_rows(evaluation: &Evaluation) -> Vec<Row> {
    let rows = QUANTITIES.iter().zip(evaluation.mean.values()).enumerate();
    let of_motion = rows.filter_map(|(k, (quantity, mean))| {
        let worst = evaluation
            .frames
            .iter()
            .filter_map(|f| f.metrics.values()[k].map(|v| (f.frame, v)))
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(Row {
            name: quantity.label.to_string(),
            value: mean.map_or_else(|| "–".to_string(), |m| format!("{m:.3e}")),
            unit: quantity.unit.to_string(),
            note: format!("{:.3e} in frame {}", worst.1, worst.0),
        })
    });
    let of_maps = evaluation.maps.iter().flat_map(|m| m.rows()).map(|(_, value, label)| Row {
        name: label.to_string(),
        value: format!("{value:.3}"),
        unit: String::new(),
        note: String::new(),
    });
    of_motion.chain(of_maps).collect()
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 60.0 => format!("{s:.1} s"),
        s if s < 3600.0 => format!("{} min {:02.0} s", (s / 60.0) as u64, (s % 60.0).floor()),
        s => format!("{} h {:02} min", (s / 3600.0) as u64, (s % 3600.0 / 60.0) as u64),
    }
}
