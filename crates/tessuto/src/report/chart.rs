//! What the page's line charts show.

use serde::Serialize;

use super::Parameter;
use tessuto_estimate::metrics::{Evaluation, FrameMetrics, QUANTITIES};
use tessuto_estimate::session::{Epoch, Name};

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
    /// Whether the lines are parts of a whole, drawn one upon the other.
    pub stacked: bool,
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
        ("track", "tracked points"),
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
        stacked: false,
        x: evaluation.frames.iter().map(|f| f.frame as f64).collect(),
        series,
    })
}

/// The losses of every stage over its steps, and those of `parameters` that changed with them.
pub fn of_history(history: &[Epoch], parameters: &[Parameter]) -> Vec<Chart> {
    let mut charts = Vec::new();
    for rows in history.chunk_by(|a, b| a.stage == b.stage) {
        let x: Vec<f64> = rows.iter().map(|r| r.step as f64).collect();
        let chart = |title: String, unit: &str, series| Chart {
            title,
            x_label: "step".to_owned(),
            unit: unit.to_owned(),
            by_frame: false,
            log: false,
            stacked: false,
            x: x.clone(),
            series,
        };
        let losses = series(rows, |row| &row.losses);
        if !losses.is_empty() {
            charts.push(of_losses(rows, losses));
        }
        // Others, such as learning rates, say nothing about the fabric.
        for line in series(rows, |row| &row.parameters) {
            if let Some(known) = parameters.iter().find(|p| p.name == line.name) {
                charts.push(chart(known.label.clone(), &known.unit, vec![line]));
            }
        }
    }
    charts
}

/// The losses of one stage. Where each step adds a frame, they are that frame's. Where a stage goes through levels of
/// detail, whose sums are over different pixels, those of a level are given as fractions of its first total.
fn of_losses(rows: &[Epoch], mut losses: Vec<Series>) -> Chart {
    let stage = &rows[0].stage;
    let mut x: Vec<f64> = rows.iter().map(|r| r.step as f64).collect();
    let adds_a_frame =
        rows.len() > 1 && rows.windows(2).all(|w| w[1].active_frames == w[0].active_frames + 1);
    let level = |row: &Epoch| row.parameters.iter().find(|(name, _)| *name == "level").map(|(_, v)| *v);
    let levels: Vec<usize> = rows.chunk_by(|a, b| level(a) == level(b)).map(<[_]>::len).collect();
    let total = losses.iter().position(|s| s.name == "total");
    let (title, x_label) = match total {
        _ if adds_a_frame => {
            (format!("Loss of each frame in stage “{stage}”"), "frame, counted from the first")
        }
        Some(total) if levels.len() > 1 => {
            relative_to_levels(&mut x, &mut losses, total, &levels);
            (format!("Losses of stage “{stage}”, total at the start of each level = 1"), "step")
        }
        _ => (format!("Losses of stage “{stage}”"), "step"),
    };
    let log = !adds_a_frame && spans_decades(&losses);
    let unit = String::new();
    Chart {
        title,
        x_label: x_label.to_owned(),
        unit,
        by_frame: false,
        log,
        stacked: false,
        x,
        series: losses,
    }
}

/// Divides the values of each level by its first one of series `total`, and puts a gap between levels.
fn relative_to_levels(x: &mut Vec<f64>, losses: &mut [Series], total: usize, lengths: &[usize]) {
    let mut start = 0;
    for (k, length) in lengths.iter().enumerate() {
        let end = start + length;
        let scale = losses[total].values[start].filter(|v| *v > 0.0).unwrap_or(1.0);
        for series in losses.iter_mut() {
            series.values[start..end].iter_mut().flatten().for_each(|v| *v /= scale);
        }
        start = end;
        if k + 1 < lengths.len() {
            x.insert(start, x[start - 1] + 0.5);
            losses.iter_mut().for_each(|s| s.values.insert(start, None));
            start += 1;
        }
    }
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
    use tessuto_estimate::session::named;

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

    #[test]
    fn curves_of_stages_that_go_well_do_not_rise() {
        let row = |stage: &'static str, step, active_frames, total: f64, level: Option<f64>| Epoch {
            stage: stage.into(),
            step,
            of: step,
            active_frames,
            losses: vec![("total".into(), total), ("bend".into(), 0.1 * total)],
            parameters: level.map(|l| ("level".into(), l)).into_iter().collect(),
        };
        let history = [
            row("track", 1, 2, 5.0, None),
            row("track", 2, 3, 9.0, None),
            row("refine", 1, 3, 4.0, Some(1.0)),
            row("refine", 2, 3, 3.0, Some(1.0)),
            row("refine", 3, 3, 20.0, Some(0.0)),
            row("refine", 4, 3, 15.0, Some(0.0)),
        ];
        let [track, refine] = &of_history(&history, &[])[..] else { panic!() };
        assert!(track.title.contains("each frame") && track.x_label.starts_with("frame"), "{track:?}");
        assert_eq!(track.series[0].values, [Some(5.0), Some(9.0)]);
        assert_eq!(refine.x, [1.0, 2.0, 2.5, 3.0, 4.0]);
        assert_eq!(refine.series[0].values, [Some(1.0), Some(0.75), None, Some(1.0), Some(0.75)]);
        assert_eq!(refine.series[1].values[3], Some(0.1));
    }
}
