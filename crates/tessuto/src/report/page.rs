//! The page: one file that needs nothing else. Styles, scripts, images and numbers are inside it.

use std::path::Path;

use askama::Template;
use serde::Serialize;

use super::causes::{CauseRow, CauseSpread, bar};
use super::{
    CauseData, Chart, ClothData, Film, LightData, OtherLens, Parameter, ReportData, chart, scale, scripts,
};
use tessuto_core::error::Result;
use tessuto_estimate::io;
use tessuto_estimate::metrics::names::{LIT, SILHOUETTE, TEXTURED};
use tessuto_estimate::metrics::{Evaluation, FrameVerdict, OverFrames, QUANTITIES, State, Verdict};

/// Size `[bytes]` that the page keeps to by choosing the size of its images.
pub const BUDGET: usize = 14 << 20;

/// Most stretches of doubtful or lost frames that are listed.
const DOUBTS: usize = 20;

/// Styles, in the order of the page.
const STYLES: [&str; 2] =
    [include_str!("../../assets/vendor/uPlot.min.css"), include_str!("../../assets/report/page.css")];

/// What the template reads; it escapes every text that is not marked safe.
#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    data: &'a ReportData,
    styles: [&'static str; 2],
    scripts: Vec<&'static str>,
    /// Whether there is more to say of cameras than that one stood still.
    has_cameras: bool,
    parameters: Vec<Row>,
    causes: Vec<CauseLine>,
    agreement: Vec<Row>,
    doubts: Vec<Doubt>,
    /// Stretches that are not in `doubts`.
    more_doubts: usize,
    /// How many warnings there are, and of what.
    warned: String,
    /// What is good of the numbers.
    scales: String,
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
    #[serde(skip_serializing_if = "<[OtherLens]>::is_empty")]
    others: &'a [OtherLens],
    light: &'a Option<LightData>,
    causes: &'a Option<CauseData>,
    verdicts: &'a [FrameVerdict],
    charts: Vec<Chart>,
}

/// One line of a table.
struct Row {
    name: String,
    value: String,
    unit: String,
    note: String,
    /// Worst value, with its unit, and its frame.
    worst: Option<(String, usize)>,
}

/// One line of the table of causes.
struct CauseLine {
    name: String,
    note: String,
    value: String,
    unit: &'static str,
    spread: String,
    /// What the video says of it, and whether it is a value.
    said: Option<(String, bool)>,
    known: String,
    /// Percent along a bar: see [`bar`].
    bar: Option<[String; 4]>,
}

/// Frames one after another that are doubtful or lost.
struct Doubt {
    frames: String,
    state: &'static str,
    reason: String,
}

/// A length `[m]` or an area `[m²]` in the unit that people measure cloth in; other units stay.
fn readable(value: f64, unit: &str) -> (String, &str) {
    match unit {
        "m" => (significant(1e3 * value), "mm"),
        "m²" => (significant(1e6 * value), "mm²"),
        _ => (significant(value), unit),
    }
}

/// Three digits, or a whole number.
fn significant(value: f64) -> String {
    let size = value.abs();
    let digits = if size > 0.0 { 2 - size.log10().floor().clamp(-3.0, 2.0) as i32 } else { 0 };
    format!("{value:.*}", digits.max(0) as usize)
}

/// Writes the page to `path`.
///
/// # Errors
/// [`Error::Output`](tessuto_core::Error::Output).
pub fn write(path: &Path, data: &ReportData) -> Result<()> {
    io::atomic_write(path, render(data).as_bytes())
}

/// The page's text.
pub fn render(data: &ReportData) -> String {
    page(data).render().expect("a string takes every text")
}

/// Bytes of the page without its numbers and images.
pub fn bare_size() -> usize {
    STYLES.into_iter().chain(scripts::common()).map(str::len).sum()
}

fn page(data: &ReportData) -> Page<'_> {
    let longest = data.timings.iter().map(|t| t.1).fold(1e-9, f64::max);
    let percent = |s: f64| format!("{:.1}", 100.0 * s / longest);
    let timings = data.timings.iter().map(|(name, s)| (name.clone(), duration(*s), percent(*s)));
    let mut charts: Vec<Chart> = data.evaluation.as_ref().and_then(chart::of_errors).into_iter().collect();
    charts.extend(data.charts.iter().cloned());
    let errors = data.evaluation.as_ref().map(error_rows).unwrap_or_default();
    let embedded = Embedded {
        live: data.live,
        cloth: &data.cloth,
        film: &data.film,
        others: &data.others,
        light: &data.light,
        causes: &data.causes,
        verdicts: &data.verdicts,
        charts,
    };
    let has_cameras = data.cloth.as_ref().is_some_and(|c| !c.poses.is_empty() || !data.others.is_empty());
    let mut doubts = doubts(&data.verdicts);
    let more_doubts = doubts.len().saturating_sub(DOUBTS);
    doubts.truncate(DOUBTS);
    Page {
        data,
        styles: STYLES,
        scripts: scripts::common().chain(has_cameras.then_some(scripts::CAMERAS)).collect(),
        has_cameras,
        agreement: data
            .verdict
            .as_ref()
            .map(|v| agreement_rows(v, data.evaluation.as_ref()))
            .unwrap_or_default(),
        doubts,
        more_doubts,
        warned: warned(&data.warnings),
        scales: scale::sentences(),
        parameters: data.parameters.iter().map(parameter_row).collect(),
        causes: data.causes.iter().flat_map(|causes| &causes.rows).map(cause_line).collect(),
        has_published: errors.iter().any(|e| e.name.contains("published")),
        has_truth: !errors.is_empty(),
        errors,
        timings: timings.collect(),
        total: duration(data.timings.iter().map(|t| t.1).sum()),
        embedded: script_safe(&serde_json::to_string(&embedded).expect("plain data")),
    }
}

/// The line that stands for all warnings: their number and topics, which are what they begin with.
fn warned(warnings: &[String]) -> String {
    let mut topics: Vec<&str> = warnings.iter().filter_map(|w| Some(w.split_once(": ")?.0)).collect();
    topics.retain(|topic| topic.chars().count() <= 24);
    topics.dedup();
    let several = if warnings.len() == 1 { "" } else { "s" };
    let colon = if topics.is_empty() { "" } else { ": " };
    format!("{} warning{several}{colon}{}", warnings.len(), topics.join(", "))
}

/// JSON that may stand in a script element: nothing in it ends the element or opens a comment.
pub fn script_safe(json: &str) -> String {
    json.replace('<', "\\u003c")
}

/// Three digits, with a power of ten where the number is very small or large.
fn shown(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e5).contains(&value.abs()) {
        format!("{value:.2e}")
    } else if value.fract() == 0.0 {
        format!("{value}")
    } else {
        significant(value)
    }
}

fn parameter_row(p: &Parameter) -> Row {
    Row {
        name: p.label.clone(),
        value: shown(p.value),
        unit: p.unit.clone(),
        note: p.note.clone(),
        worst: None,
    }
}

fn cause_line(row: &CauseRow) -> CauseLine {
    let spread = match row.spread {
        Some(CauseSpread::Factor(factor)) if factor < 10.0 => format!("× or ÷ {factor:.2}"),
        Some(CauseSpread::Factor(_)) => "more than × or ÷ 10".to_owned(),
        Some(CauseSpread::Margin(margin)) => format!("± {} {}", significant(margin), row.unit),
        None => String::new(),
    };
    let factor = match row.spread {
        Some(CauseSpread::Factor(factor)) => factor,
        _ => 1.0,
    };
    CauseLine {
        name: row.label.clone(),
        note: row.note.clone(),
        value: shown(row.value),
        unit: row.unit,
        spread,
        said: row.constraint.map(|said| (said.text(row.value, shown), said.is_constrained())),
        known: row.known.map_or_else(String::new, |[low, high]| match low < 1e-3 {
            true => format!("{low:e} to {high:e}"),
            false => format!("{} to {}", significant(low), significant(high)),
        }),
        bar: row.known.map(|known| bar(row.value, factor, known).map(|v| format!("{v:.1}"))),
    }
}

/// Stretches of frames that are doubtful or lost.
fn doubts(verdicts: &[FrameVerdict]) -> Vec<Doubt> {
    let runs = verdicts.chunk_by(|a, b| a.state == b.state).filter(|run| run[0].state != State::Found);
    let doubt = |run: &[FrameVerdict]| {
        let (first, last) = (run[0].frame, run[run.len() - 1].frame);
        let frames =
            if first == last { format!("frame {first}") } else { format!("frame {first} to {last}") };
        Doubt { frames, state: run[0].state.word(), reason: run[0].reason.clone() }
    };
    runs.map(doubt).collect()
}

/// How the result agrees with the video and with what cloth does.
fn agreement_rows(verdict: &Verdict, evaluation: Option<&Evaluation>) -> Vec<Row> {
    let row = |name: &str, over: &OverFrames, unit: &str, scale: f64, digits: usize| {
        let text = |v: f64| format!("{:.digits$}", scale * v);
        Row {
            name: name.to_owned(),
            value: text(over.mean),
            unit: unit.to_owned(),
            note: String::new(),
            worst: Some((format!("{} {unit}", text(over.worst)), over.frame)),
        }
    };
    let v = verdict;
    let mut rows = Vec::new();
    let noted = |row: Row, note: &str| Row { note: note.to_owned(), ..row };
    let silhouette = |o| noted(row(SILHOUETTE, &o, "%", 100.0, 1), "intersection over union with the mask");
    rows.extend(v.silhouette.map(silhouette));
    rows.extend(v.uncovered.map(|o| row("part of the mask that is not covered", &o, "%", 100.0, 1)));
    let textured = |o| noted(row(TEXTURED, &o, "dB", 1.0, 1), "PSNR, in the first frame's light");
    rows.extend(v.psnr.map(textured));
    let lit = evaluation.and_then(|e| e.maps.as_ref()).and_then(|m| m.frames_psnr);
    rows.extend(lit.map(|value| Row {
        name: LIT.to_owned(),
        value: format!("{value:.1}"),
        unit: "dB".to_owned(),
        note: "PSNR, with material and light".to_owned(),
        worst: None,
    }));
    rows.extend(v.correlation.map(|o| row("texture, correlation with the video", &o, "", 1.0, 2)));
    rows.push(row("strain of the threads, mean", &v.strain_mean, "%", 100.0, 1));
    rows.push(row("strain, 99 of 100 threads", &v.strain_p99, "%", 100.0, 1));
    rows.push(row("strain, largest", &v.strain_max, "%", 100.0, 0));
    rows.push(row("creased edges", &v.creased, "%", 100.0, 1));
    rows.push(row("area in flipped triangles", &v.flipped, "%", 100.0, 1));
    rows.extend(v.deviation.map(|o| row("standard deviation of the positions", &o, "mm", 1e3, 1)));
    rows
}

fn error_rows(evaluation: &Evaluation) -> Vec<Row> {
    let rows = QUANTITIES.iter().zip(evaluation.mean.values()).enumerate();
    let of_motion = rows.filter_map(|(k, (quantity, mean))| {
        let worst = evaluation
            .frames
            .iter()
            .filter_map(|f| f.metrics.values()[k].map(|v| (f.frame, v)))
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        let (value, unit) = readable(worst.1, quantity.unit);
        let (with, count) = (evaluation.frames_with(k), evaluation.frame_count());
        let part = if with < count { format!(", in {with} of {count} frames") } else { String::new() };
        Some(Row {
            name: format!("{}{part}", quantity.label),
            value: mean.map_or_else(|| "–".to_string(), |m| readable(m, quantity.unit).0),
            unit: unit.to_string(),
            note: String::new(),
            worst: Some((format!("{value} {unit}"), worst.0)),
        })
    });
    let of_maps = evaluation.maps.iter().flat_map(|m| m.rows()).map(|(_, value, label)| {
        let (name, unit) = label.strip_suffix(" [dB]").map_or((label, ""), |name| (name, "dB"));
        Row {
            name: name.to_string(),
            value: if unit.is_empty() { format!("{value:.3}") } else { format!("{value:.1}") },
            unit: unit.to_string(),
            note: String::new(),
            worst: None,
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_told_in_millimetres() {
        assert_eq!(readable(5.4417e-3, "m"), ("5.44".to_owned(), "mm"));
        assert_eq!(readable(1.0874e-4, "m²"), ("109".to_owned(), "mm²"));
        assert_eq!(readable(3.8e-8, "m").0, "0.00004");
        assert_eq!([0.0, 2.0, 12345.6, -0.3064].map(significant), ["0", "2.00", "12346", "-0.306"]);
    }
}
