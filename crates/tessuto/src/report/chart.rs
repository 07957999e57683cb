//! What the page's line charts show.

use serde::Serialize;

use super::Parameter;
use crate::metrics::{Evaluation, FrameMetrics, QUANTITIES};
use crate::session::{Epoch, Name};

/// One line of a chart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// One value per place of [`Chart::x`]; a gap where there is none.
    pub values: Vec<Option<f64>>,
}

/// A line chart.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Chart {
    /// Heading.
    pub title: String,
    /// Name of the horizontal axis.
    pub x_label: String,
    /// Unit of the values; may be empty.
    pub unit: String,
    /// Whether x is a frame's number, so that the page's slider moves a mark on it.
    pub by_frame: bool,
    /// Whether the values are drawn on a logarithmic axis.
    pub log: bool,
    /// Ascending places on the horizontal axis.
    pub x: Vec<f64>,
    /// The lines.
    pub series: Vec<Series>,
}

/// The distances of `evaluation` over the frames, in millimetres; None if there are none.
pub fn of_errors(evaluation: &Evaluation) -> Option<Chart> {
    let shown = [
        ("depth", "depth difference"),
        ("vertex", "vertices"),
        ("cd1", "Chamfer L1"),
        ("p2s1", "point to surface L1"),
    ];
    let series = shown.iter().filter_map(|(key, name)| {
        let k = QUANTITIES.iter().position(|q| q.key == *key)?;
        let value = |f: &FrameMetrics| f.metrics.values()[k].map(|v| 1e3 * v);
        let values: Vec<Option<f64>> = evaluation.frames.iter().map(value).collect();
        values.iter().any(Option::is_some).then(|| Series { name: (*name).to_owned(), values })
    });
    let series: Vec<Series> = series.collect();
    (!series.is_empty()).then(|| Chart {
        title: "Distance from the truth".to_owned(),
        x_label: "frame".to_owned(),
        unit: "mm".to_owned(),
        by_frame: true,
        log: false,
        x: evaluation.frames.iter().map(|f| f.frame as f64).collect(),
        series,
    })
}

/// The losses of every stage over its steps, and those of `parameters` that changed with them.
pub fn of_history(history: &[Epoch], parameters: &[Parameter]) -> Vec<Chart> {
    let mut charts = Vec::new();
    for rows in history.chunk_by(|a, b| a.stage == b.stage) {
        let x: Vec<f64> = rows.iter().map(|r| r.step as f64).collect();
        let chart = |title: String, unit: &str, log, series| Chart {
            title,
            x_label: "step".to_owned(),
            unit: unit.to_owned(),
            by_frame: false,
            log,
            x: x.clone(),
            series,
        };
        let losses = series(rows, |row| &row.losses);
        if !losses.is_empty() {
            let log = spans_decades(&losses);
            charts.push(chart(format!("Losses of stage “{}”", rows[0].stage), "", log, losses));
        }
        // Others, such as learning rates, tell nothing about the fabric.
        for line in series(rows, |row| &row.parameters) {
            if let Some(known) = parameters.iter().find(|p| p.name == line.name) {
                charts.push(chart(known.label.clone(), &known.unit, false, vec![line]));
            }
        }
    }
    charts
}

/// Whether no value is negative and the largest is a hundred times the smallest positive one.
pub(crate) fn spans_decades(series: &[Series]) -> bool {
    let values = || series.iter().flat_map(|s| s.values.iter().flatten().copied());
    let low = values().filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min);
    values().all(|v| v >= 0.0) && values().fold(0.0, f64::max) >= 100.0 * low
}

/// The named values of `pick` over `rows`, in the order of their first appearance.
fn series(rows: &[Epoch], pick: impl Fn(&Epoch) -> &Vec<(Name, f64)>) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for (k, row) in rows.iter().enumerate() {
        for (name, value) in pick(row) {
            let value = Some(*value).filter(|v| v.is_finite());
            let at = all.iter().position(|s| s.name == *name).unwrap_or_else(|| {
                all.push(Series { name: name.to_string(), values: vec![None; rows.len()] });
                all.len() - 1
            });
            all[at].values[k] = value;
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::named;

    #[test]
    fn stages_have_charts_of_their_own_and_missing_values_are_gaps() {
        let row = |stage: &'static str, step, losses: &[(&'static str, f64)]| Epoch {
            stage: stage.into(),
            step,
            active_frames: 2,
            losses: named(losses.iter().copied()),
            ..Epoch::default()
        };
        let history = [
            row("texture", 1, &[("colour", 1.0)]),
            row("texture", 2, &[("colour", 1e-3)]),
            row("refine", 1, &[("total", 3.0)]),
            row("refine", 2, &[("total", f64::NAN), ("bend", 2.0)]),
        ];
        let charts = of_history(&history, &[]);
        assert_eq!(charts.len(), 2);
        assert!(charts[0].log && !charts[1].log);
        assert_eq!(charts[1].series[0].values, [Some(3.0), None]);
        assert_eq!(charts[1].series[1].values, [None, Some(2.0)]);
    }
}
