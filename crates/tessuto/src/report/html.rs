//! The page: one file without scripts, styles or fonts from elsewhere; it links the pictures beside it.

use std::path::Path;

use askama::Template;

use super::curves::{Chart, Series};
use super::{HistoryRow, KeyNumber, Kind, Parameter, ReportData};
use crate::error::{Error, Result};
use crate::io;
use crate::metrics::{Evaluation, Metrics, QUANTITIES};

/// What the template reads; every text is escaped by it, `charts` are SVG already.
#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    data: &'a ReportData,
    figures: Vec<Figure>,
    first: usize,
    key_numbers: Vec<KeyNumber>,
    charts: Vec<String>,
    parameters: Vec<Row>,
    errors: Vec<Row>,
    /// Name, time, share of the total in percent.
    timings: Vec<(String, String, String)>,
    total: String,
}

/// One picture above the slider.
struct Figure {
    folder: &'static str,
    label: &'static str,
    /// Its picture of the first frame.
    first: String,
}

/// One line of a table.
struct Row {
    name: String,
    value: String,
    unit: String,
    note: String,
}

/// Write the page to `path`; the pictures it links are written by [`super::FramePictures`].
pub fn write(path: &Path, data: &ReportData) -> Result<()> {
    let fail =
        |e: askama::Error| Error::Output { path: path.to_path_buf(), source: std::io::Error::other(e) };
    io::atomic_write(path, page(data).render().map_err(fail)?.as_bytes())
}

fn page(data: &ReportData) -> Page<'_> {
    let shown = if data.pictures.is_empty() || data.frames.is_empty() { &[][..] } else { &data.kinds[..] };
    let mut key_numbers = data.key_numbers.clone();
    if let Some(evaluation) = &data.evaluation {
        key_numbers.extend(key_errors(&evaluation.mean));
    }
    let total: f64 = data.timings.iter().map(|t| t.1).sum();
    let share = |s: f64| format!("{:.1}", 100.0 * s / total.max(1e-9));
    let timings = data.timings.iter().map(|(name, s)| (name.clone(), duration(*s), share(*s)));
    let first = data.frames.first().copied().unwrap_or(0);
    Page {
        data,
        figures: Kind::ALL
            .into_iter()
            .filter(|k| shown.contains(k))
            .map(|k| Figure {
                folder: k.folder(),
                label: k.label(),
                first: format!("{}/{}", data.pictures, k.path(first)),
            })
            .collect(),
        first,
        key_numbers,
        charts: charts(data).iter().map(Chart::svg).collect(),
        parameters: data.parameters.iter().map(parameter_row).collect(),
        errors: data.evaluation.as_ref().map(error_rows).unwrap_or_default(),
        timings: timings.collect(),
        total: duration(total),
    }
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
    rows.filter_map(|(k, (quantity, mean))| {
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
    })
    .collect()
}

fn charts(data: &ReportData) -> Vec<Chart> {
    let mut charts = Vec::new();
    if let Some(evaluation) = &data.evaluation {
        charts.extend(error_charts(evaluation));
    }
    let by_epoch = |title: &str, y_label: &str, series: Vec<Series>| Chart {
        title: title.to_string(),
        x_label: "epoch".to_string(),
        y_label: y_label.to_string(),
        series,
    };
    let losses = curves(&data.history, |row| &row.losses);
    if !losses.is_empty() {
        charts.push(by_epoch("Losses", "loss (no unit)", losses));
        let active = data.history.iter().map(|r| (r.epoch as f64, r.active_frames as f64)).collect();
        let active = Series { name: "active frames".to_string(), points: active };
        charts.push(by_epoch("Frames in the optimisation", "frames", vec![active]));
    }
    for series in curves(&data.history, |row| &row.parameters) {
        let known = data.parameters.iter().find(|p| p.name == series.name);
        let title = known.map_or(series.name.clone(), |p| p.label.clone());
        let unit = known.map(|p| p.unit.clone()).filter(|u| !u.is_empty());
        let y_label = unit.map_or(series.name.clone(), |u| format!("{} [{u}]", series.name));
        charts.push(by_epoch(&title, &y_label, vec![series]));
    }
    charts
}

/// One chart for the distances, in millimetres, over the frames.
fn error_charts(evaluation: &Evaluation) -> Option<Chart> {
    let shown = ["depth", "cd1", "p2s1", "vertex"];
    let names = ["depth difference", "Chamfer L1", "point to surface L1", "vertices"];
    let series: Vec<Series> = shown
        .iter()
        .zip(names)
        .filter_map(|(key, name)| {
            let k = QUANTITIES.iter().position(|q| q.key == *key)?;
            let value =
                |f: &crate::metrics::FrameMetrics| Some((f.frame as f64, 1e3 * f.metrics.values()[k]?));
            let points: Vec<(f64, f64)> = evaluation.frames.iter().filter_map(value).collect();
            (!points.is_empty()).then(|| Series { name: name.to_string(), points })
        })
        .collect();
    (!series.is_empty()).then(|| Chart {
        title: "Errors".to_string(),
        x_label: "frame".to_string(),
        y_label: "error [mm]".to_string(),
        series,
    })
}

/// The named values of `pick` over the epochs, in the order of their first appearance.
fn curves(history: &[HistoryRow], pick: impl Fn(&HistoryRow) -> &Vec<(String, f64)>) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for row in history {
        for (name, value) in pick(row) {
            let point = (row.epoch as f64, *value);
            match all.iter_mut().find(|s| s.name == *name) {
                Some(series) => series.points.push(point),
                None => all.push(Series { name: name.clone(), points: vec![point] }),
            }
        }
    }
    all
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 60.0 => format!("{s:.1} s"),
        s if s < 3600.0 => format!("{} min {:02.0} s", (s / 60.0) as u64, (s % 60.0).floor()),
        s => format!("{} h {:02} min", (s / 3600.0) as u64, (s % 3600.0 / 60.0) as u64),
    }
}
