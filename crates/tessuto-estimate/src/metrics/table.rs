//! Errors as text.

use std::fmt::Write as _;

use super::{Evaluation, Metrics, QUANTITIES, Quantity};

/// Errors as text: one line per frame, the means, what the columns are; then one line per value of the maps and of
/// the causes.
pub fn table(evaluation: &Evaluation) -> String {
    let shown: Vec<usize> = (0..QUANTITIES.len())
        .filter(|k| evaluation.frames.iter().any(|f| f.metrics.values()[*k].is_some()))
        .collect();
    let mut out = if shown.is_empty() { String::new() } else { motion_table(evaluation, &shown) };
    if let Some(maps) = &evaluation.maps {
        out.push_str(if shown.is_empty() { "" } else { "\n" });
        for (key, value, label) in maps.rows() {
            let _ = writeln!(out, "{key:<20} {value:>10.4}  {label}");
        }
        if let Some(scale) = maps.diffuse_scale {
            let scale = scale.map(|s| format!("{s:.4}")).join(" ");
            let _ = writeln!(out, "diffuse_scale        {scale}  the factors, red green blue");
        }
    }
    if let Some(causes) = &evaluation.causes {
        out.push_str(if out.is_empty() { "" } else { "\n" });
        for (name, value, meaning) in causes.rows() {
            let _ = writeln!(out, "{name:<12} {value:>9}  {meaning}");
        }
    }
    out
}

fn motion_table(evaluation: &Evaluation, shown: &[usize]) -> String {
    let mut out = String::from("frame");
    for k in shown {
        let _ = write!(out, " {:>14}", QUANTITIES[*k].key);
    }
    let state = |frame: usize| evaluation.verdicts.iter().find(|v| v.frame == frame).map(|v| v.state.word());
    if !evaluation.verdicts.is_empty() {
        out.push_str("  verdict");
    }
    out.push_str("\n     ");
    for k in shown {
        let _ = write!(out, " {:>14}", format!("[{}]", QUANTITIES[*k].unit));
    }
    out.push('\n');
    let mut line = |name: &str, metrics: &Metrics, state: Option<&str>| {
        let _ = write!(out, "{name:>5}");
        for k in shown {
            let _ =
                write!(out, " {:>14}", metrics.values()[*k].map_or("-".to_string(), |v| format!("{v:.4e}")));
        }
        state.iter().for_each(|state| out.push_str(&format!("  {state}")));
        out.push('\n');
    };
    for frame in &evaluation.frames {
        line(&frame.frame.to_string(), &frame.metrics, state(frame.frame));
    }
    line("mean", &evaluation.mean, None);
    out.push('\n');
    for k in shown {
        let Quantity { key, label, unit } = QUANTITIES[*k];
        let (with, count) = (evaluation.frames_with(*k), evaluation.frame_count());
        let part = if with < count { format!(", in {with} of {count} frames") } else { String::new() };
        let _ = writeln!(out, "{key:<14}  {label} [{unit}]{part}");
    }
    let Metrics { track, track_p90, track_worst, .. } = evaluation.mean;
    if let (Some(mean), Some(p90), Some(worst)) = (track, track_p90, track_worst) {
        let [mean, p90, worst] = [mean, p90, worst].map(|d| 1e3 * d);
        let _ =
            writeln!(out, "tracked points: mean {mean:.2} mm, 90 % below {p90:.2} mm, largest {worst:.2} mm");
    }
    if let Some(part) = evaluation.partial_truth() {
        let _ = writeln!(out, "{part}");
    }
    out
}
