//! How well a motion's causes predict what comes after the frames that they were found from.

use std::fmt::Write as _;

use serde::Serialize;

use crate::result::Folder;
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::{Motion, Positions};
use tessuto_core::scene::Scene;
use tessuto_estimate::metrics::causes::carried_on;
use tessuto_estimate::metrics::{self, Inputs};
use tessuto_estimate::motion::causes::{self, Otherwise};

/// Frames ahead that the table reports.
pub const HORIZONS: [usize; 4] = [1, 5, 10, 15];

/// One way to predict, and its error in every frame that it predicts `[m]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Prediction {
    /// Its name.
    pub name: &'static str,
    /// Mean distance of the vertices or, where they are not known, the L1 Chamfer distance; null without truth.
    pub errors: Vec<Option<f64>>,
}

impl Prediction {
    /// Mean error of the first `count` frames.
    pub fn mean(&self, count: usize) -> Option<f64> {
        let known: Vec<f64> = self.errors.iter().take(count).filter_map(|e| *e).collect();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    }

    /// Error of frame number `ahead`, counted from 1.
    pub fn at(&self, ahead: usize) -> Option<f64> {
        self.errors.get(ahead - 1).copied().flatten()
    }
}

/// The causes' forecast and four that need less.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Forecast {
    /// Number of the first frame that is predicted.
    pub first: usize,
    /// Frames per second.
    pub fps: f64,
    /// Key of what the errors are, of [`metrics::QUANTITIES`].
    pub quantity: &'static str,
    /// The causes' forecast first.
    pub predictions: Vec<Prediction>,
}

/// Goes on from `fitted`, the result of the first frames of `scene`, to its end, and compares with the truth.
///
/// # Errors
/// [`Error::Input`] if `fitted` has no causes, is of other frames, or the scene knows nothing of the frames after it;
/// [`Error::Numerical`] from a simulation.
pub fn forecast(scene: &Scene, fitted: &Folder, seed: u64) -> Result<Forecast> {
    let place = || fitted.path().display().to_string();
    let Some(found) = &fitted.found else {
        let hint = "reconstruct the first frames with the preset default";
        return Err(Error::input(place(), "its forces are not known by their causes", hint));
    };
    let known: Vec<Positions> = fitted.motion()?.iter().cloned().collect();
    let (all, fit) = (scene.frames.len(), known.len());
    if fitted.run.frames[0] != scene.first_frame || fit >= all {
        let problem = format!(
            "holds {fit} frames from frame {}, the scene {all} from {}",
            fitted.run.frames[0], scene.first_frame
        );
        return Err(Error::input(
            place(),
            problem,
            "fit the first part of the scene, and leave frames to predict",
        ));
    }
    let further = all - fit;
    let dynamics = fitted.run.settings.dynamics.at(fitted.fps);
    let cut = causes::cut_cloth(&fitted.mesh, &found.rest_lengths);
    let simulated = |changes: &causes::Changes, otherwise: Otherwise| -> Result<Vec<Positions>> {
        let guided = changes.simulate(&otherwise);
        guided.failure.map_or(Ok(()), Err)?;
        Ok(guided.frames[fit..].to_vec())
    };
    let plain = Otherwise { further, ..Otherwise::default() };
    let mut assumed = found.clone();
    let ln = |k: usize| dynamics.stiffness[k].start * std::f64::consts::LN_10;
    assumed.causes.ln_stiffness = [0, 1, 2].map(ln);
    let [by_found, by_assumed] =
        [found, &assumed].map(|found| causes::Changes::new(&cut, &dynamics, found, &known));
    let [still, straight]: [Vec<Positions>; 2] =
        carried_on(&known, further).try_into().expect("two ways without causes");
    let ways = [
        ("found causes", simulated(&by_found, plain)?),
        ("stiffnesses as assumed", simulated(&by_assumed, plain)?),
        ("last residual goes on", simulated(&by_found, Otherwise { carry: true, ..plain })?),
        ("held still", still),
        ("straight on", straight),
    ];
    let mut quantity = "vertex";
    let mut predictions = Vec::new();
    for (name, frames) in ways {
        let motion = Motion::new([known.clone(), frames].concat())?;
        let evaluation = metrics::evaluate(&Inputs::from(scene), &motion, fit..all, seed)?;
        let by_vertex = evaluation.frames.iter().any(|f| f.metrics.vertex.is_some());
        quantity = if by_vertex { "vertex" } else { "cd1" };
        let error = |k: usize| {
            let frame = evaluation.frames.iter().find(|f| f.frame == scene.first_frame + k)?;
            if by_vertex { frame.metrics.vertex } else { frame.metrics.cd1 }
        };
        predictions.push(Prediction { name, errors: (fit..all).map(error).collect() });
    }
    Ok(Forecast { first: scene.first_frame + fit, fps: fitted.fps, quantity, predictions })
}

impl Forecast {
    /// As text: errors this many frames ahead, and their mean, in millimetres.
    pub fn table(&self) -> String {
        let count = self.predictions.first().map_or(0, |p| p.errors.len());
        let mut out = format!("{:<24}", "frames ahead");
        let shown: Vec<usize> = HORIZONS.into_iter().filter(|h| *h <= count).collect();
        shown.iter().for_each(|h| out += &format!("{h:>8}"));
        let _ = writeln!(out, "{:>8}", format!("1–{count}"));
        let of = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{:.1}", 1e3 * v));
        for p in &self.predictions {
            let _ = write!(out, "{:<24}", p.name);
            shown.iter().for_each(|h| out += &format!("{:>8}", of(p.at(*h))));
            let _ = writeln!(out, "{:>8}", of(p.mean(count)));
        }
        let what = match self.quantity {
            "vertex" => "mean distance of the vertices",
            _ => "L1 Chamfer distance",
        };
        let _ = writeln!(out, "{what} [mm], from frame {} on", self.first);
        out
    }

    /// As lines `ahead,name,…` with errors in metres.
    pub fn csv(&self) -> String {
        let names: Vec<&str> = self.predictions.iter().map(|p| p.name).collect();
        let mut out = format!("frames_ahead,{}\n", names.join(","));
        for k in 1..=self.predictions.first().map_or(0, |p| p.errors.len()) {
            let values: Vec<String> = self
                .predictions
                .iter()
                .map(|p| p.at(k).map_or_else(String::new, |e| e.to_string()))
                .collect();
            let _ = writeln!(out, "{k},{}", values.join(","));
        }
        out
    }

    /// As curves, an image in SVG of its own size.
    pub fn svg(&self) -> String {
        const SIZE: [f64; 2] = [720.0, 420.0];
        const EDGE: [f64; 2] = [60.0, 40.0];
        const COLOURS: [&str; 5] = ["#c2410c", "#64748b", "#7c3aed", "#0f766e", "#1d4ed8"];
        let count = self.predictions.first().map_or(0, |p| p.errors.len()).max(1);
        let all = || self.predictions.iter().flat_map(|p| p.errors.iter().filter_map(|e| *e));
        let top = 1e3 * all().fold(1e-6, f64::max);
        let x = |ahead: f64| EDGE[0] + ahead / count as f64 * (SIZE[0] - EDGE[0] - 180.0);
        let y = |mm: f64| SIZE[1] - EDGE[1] - mm / top * (SIZE[1] - 2.0 * EDGE[1]);
        let [width, height] = SIZE;
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"sans-serif\" font-size=\"12\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n\
             <path d=\"M{0} {1}V{2}H{3}\" fill=\"none\" stroke=\"#94a3b8\"/>\n",
            x(0.0),
            y(top),
            y(0.0),
            x(count as f64)
        );
        for part in 0..=4 {
            let (mm, ahead) = (top * f64::from(part) / 4.0, count as f64 * f64::from(part) / 4.0);
            let _ = writeln!(
                out,
                "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{mm:.0}</text>",
                x(0.0) - 6.0,
                y(mm) + 4.0
            );
            let _ = writeln!(
                out,
                "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{ahead:.0}</text>",
                x(ahead),
                y(0.0) + 16.0
            );
        }
        let _ = writeln!(out, "<text x=\"{}\" y=\"20\">error [mm] by frames ahead</text>", x(0.0));
        for (k, (p, colour)) in self.predictions.iter().zip(COLOURS).enumerate() {
            let points: Vec<String> = (1..=count)
                .filter_map(|n| p.at(n).map(|e| format!("{:.1},{:.1}", x(n as f64), y(1e3 * e))))
                .collect();
            let _ = writeln!(
                out,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
                points.join(" ")
            );
            let at = 60.0 + 20.0 * k as f64;
            let _ = writeln!(
                out,
                "<text x=\"{}\" y=\"{at}\" fill=\"{colour}\">{}</text>",
                x(count as f64) + 12.0,
                p.name
            );
        }
        out + "</svg>\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_tell_what_is_known_ahead() {
        let of = |name, scale: f64| Prediction {
            name,
            errors: (1..=6).map(|n| (n != 3).then_some(1e-3 * scale * f64::from(n))).collect(),
        };
        let forecast = Forecast {
            first: 10,
            fps: 50.0,
            quantity: "vertex",
            predictions: vec![of("found causes", 1.0), of("held still", 2.0)],
        };
        let table = forecast.table();
        let still: Vec<&str> = table.lines().nth(2).unwrap().split_whitespace().collect();
        // 1 and 5 frames ahead, and the mean of the five that are known.
        assert_eq!(still, ["held", "still", "2.0", "10.0", "7.2"], "{table}");
        assert!(forecast.csv().contains("\n3,,\n") && forecast.csv().contains("\n2,0.002,0.004\n"));
        assert_eq!(forecast.svg().matches("<polyline").count(), 2);
    }
}
