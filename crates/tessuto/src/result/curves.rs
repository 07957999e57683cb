//! Curves over the frames, besides the errors.

use std::path::Path;

use rayon::prelude::*;

use super::Folder;
use crate::report::chart::{Chart, Series, spans_decades};
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::mesh::Positions;
use tessuto_estimate::io;
use tessuto_estimate::metrics::names::{LIT, SILHOUETTE, TEXTURED};
use tessuto_estimate::metrics::{AgreementMeter, FrameAgreement};
use tessuto_sim::Accelerations;

/// What the motion and the other files of a result say about each frame. Results of older versions have no
/// `agreement`; their strain is measured anew.
pub(super) fn over_frames(
    saved: &Folder,
    motion: &[Positions],
    agreement: &[FrameAgreement],
) -> Result<Vec<Chart>> {
    let first = saved.run.frames[0];
    let chart = |title: &str, unit: &str, lines: Vec<(&str, Vec<f64>)>| {
        let line = |(name, values): (&str, Vec<f64>)| Series {
            name: name.to_owned(),
            values: values.into_iter().map(|v| Some(v).filter(|v| v.is_finite())).collect(),
        };
        Chart {
            title: title.to_owned(),
            x_label: "frame".to_owned(),
            unit: unit.to_owned(),
            by_frame: true,
            log: false,
            stacked: false,
            x: (first..first + motion.len()).map(|n| n as f64).collect(),
            series: lines.into_iter().map(line).collect(),
        }
    };
    let of = |value: &dyn Fn(&FrameAgreement) -> Option<f64>| -> Vec<f64> {
        agreement.iter().map(|f| value(f).unwrap_or(f64::NAN)).collect()
    };
    let mut charts = Vec::new();
    let measured = agreement.len() == motion.len();
    if measured {
        let silhouette = of(&|f| f.silhouette.map(|v| 100.0 * v));
        charts.push(chart("Silhouette overlap", "%", vec![(SILHOUETTE, silhouette)]));
    }
    let mut colours = Vec::new();
    let lit = read_psnr(&saved.path().join("rerendered/psnr.csv"))?.filter(|p| p.len() == motion.len());
    colours.extend(lit.map(|psnr| (LIT, psnr)));
    if measured {
        colours.push((TEXTURED, of(&|f| f.psnr)));
    }
    if !colours.is_empty() {
        charts.push(chart("Colours, PSNR", "dB", colours));
    }
    let strains: Vec<[f64; 2]> = if measured {
        agreement.iter().map(|f| [f.strain_mean, f.strain_p99]).collect()
    } else {
        let meter = AgreementMeter::new(&saved.mesh);
        motion.par_iter().map(|p| meter.strain(p)).map(|[mean, p99, _]| [mean, p99]).collect()
    };
    let percent = |k: usize| strains.iter().map(|s| 100.0 * s[k]).collect();
    let strain = vec![("mean", percent(0)), ("99 of 100 threads", percent(1))];
    charts.push(chart("Strain of the threads", "%", strain));
    let accelerations =
        force_magnitudes(&saved.parameters.accelerations, motion.len(), saved.mesh.positions.len());
    let mean = |f: &Vec<f32>| f.iter().map(|v| f64::from(*v)).sum::<f64>() / f.len().max(1) as f64;
    let most = |f: &Vec<f32>| f.iter().fold(f64::NAN, |m, v| m.max(f64::from(*v)));
    let lines = vec![
        ("mean", accelerations.iter().map(mean).collect()),
        ("largest", accelerations.iter().map(most).collect()),
    ];
    let force = chart("Force per mass", "m/s²", lines);
    charts.push(Chart { log: spans_decades(&force.series), ..force });
    Ok(charts)
}

/// Second column of rerendered/psnr.csv `[dB]`.
fn read_psnr(path: &Path) -> Result<Option<Vec<f64>>> {
    if !path.is_file() {
        return Ok(None);
    }
    let fail = |problem: String| {
        Error::input(
            path.display().to_string(),
            problem,
            Hint::from("estimate the appearance again").with(Remedy::Appearance),
        )
    };
    let text = io::read_text(path)?;
    let value = |line: &str| line.split(',').nth(1).and_then(|v| v.parse().ok());
    let read = |line| value(line).ok_or_else(|| fail(format!("“{line}” is no frame and its PSNR")));
    text.lines().skip(1).map(read).collect::<Result<_>>().map(Some)
}

/// ‖C + D‖ `[m/s²]` at every vertex, mean over the parts of the interval after each frame; the last frame repeats.
pub(super) fn force_magnitudes(
    accelerations: &Accelerations,
    frame_count: usize,
    vertex_count: usize,
) -> Vec<Vec<f32>> {
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
