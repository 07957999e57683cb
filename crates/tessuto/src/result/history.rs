//! history.csv: losses and parameters of every step of every stage.
//!
//! Its columns are `stage,step,active_frames` and then `loss.NAME` and `parameter.NAME`, empty where a step has no such
//! value.

use std::fmt::Write as _;
use std::path::Path;

use tessuto_core::error::{Error, Result};
use tessuto_estimate::session::Epoch;

/// The two kinds of columns.
const LOSS: &str = "loss.";
const PARAMETER: &str = "parameter.";

/// One row per step; columns are the union of all names.
pub(crate) fn history_csv(history: &[Epoch]) -> String {
    let mut columns: Vec<String> = Vec::new();
    let cells = |epoch: &Epoch| -> Vec<(String, f64)> {
        let of = |kind: &str, values: &[(_, f64)]| -> Vec<_> {
            values.iter().map(|(name, value)| (format!("{kind}{name}"), *value)).collect()
        };
        [of(LOSS, &epoch.losses), of(PARAMETER, &epoch.parameters)].concat()
    };
    for (name, _) in history.iter().flat_map(cells) {
        if !columns.contains(&name) {
            columns.push(name);
        }
    }
    let mut out = format!("stage,step,active_frames,{}\n", columns.join(","));
    for epoch in history {
        let _ = write!(out, "{},{},{}", epoch.stage, epoch.step, epoch.active_frames);
        let cells = cells(epoch);
        for column in &columns {
            let _ = match cells.iter().find(|(name, _)| name == column) {
                Some((_, value)) => write!(out, ",{value:e}"),
                None => write!(out, ","),
            };
        }
        out.push('\n');
    }
    out
}

/// Reads what [`history_csv`] made; nothing if there is no such file.
///
/// # Errors
/// [`Error::Input`] naming the line.
pub(super) fn read(path: &Path) -> Result<Vec<Epoch>> {
    if !path.is_file() {
        return Ok(Vec::new());
    }
    let fail = |line: usize, problem: String| {
        Error::input(format!("{}:{line}", path.display()), problem, "use the file as tessuto wrote it")
    };
    let text = tessuto_estimate::io::read_text(path)?;
    let columns: Vec<&str> = text.lines().next().unwrap_or_default().split(',').skip(3).collect();
    let epoch = |(n, line): (usize, &str)| {
        let cells: Vec<&str> = line.split(',').collect();
        let count = |k: usize| cells.get(k).and_then(|c| c.parse().ok());
        let (Some(step), Some(active_frames)) = (count(1), count(2)) else {
            return Err(fail(n + 1, format!("“{line}” is not a step")));
        };
        let stage = cells[0].to_owned().into();
        let mut epoch = Epoch { stage, step, of: step, active_frames, ..Epoch::default() };
        for (column, cell) in columns.iter().zip(&cells[3..]).filter(|(_, cell)| !cell.is_empty()) {
            let value = cell.parse().map_err(|_| fail(n + 1, format!("{column} is “{cell}”")))?;
            let (values, name) = match (column.strip_prefix(LOSS), column.strip_prefix(PARAMETER)) {
                (Some(name), _) => (&mut epoch.losses, name),
                (None, Some(name)) => (&mut epoch.parameters, name),
                (None, None) => return Err(fail(1, format!("“{column}” is neither a loss nor a parameter"))),
            };
            values.push((name.to_owned().into(), value));
        }
        Ok(epoch)
    };
    text.lines().enumerate().skip(1).map(epoch).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_estimate::session::named;

    #[test]
    fn steps_are_read_as_they_were_written() {
        let epoch =
            |stage: &'static str, losses: &[(&'static str, f64)], parameters: &[(&'static str, f64)]| Epoch {
                stage: stage.into(),
                step: 1,
                of: 1,
                active_frames: 4,
                losses: named(losses.iter().copied()),
                parameters: named(parameters.iter().copied()),
            };
        let history = [
            epoch("refine", &[("total", 1.25), ("bend", 0.1)], &[("level", 2.0)]),
            epoch("rollout", &[("total", f64::NAN)], &[("bend", 1e-3), ("constant_x", -0.5)]),
        ];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.csv");
        assert!(read(&path).unwrap().is_empty());
        let text = history_csv(&history);
        assert!(
            text.starts_with("stage,step,active_frames,loss.total,loss.bend,parameter.level,parameter.bend")
        );
        std::fs::write(&path, text).unwrap();
        let read_back = read(&path).unwrap();
        assert_eq!(read_back[0], history[0]);
        assert_eq!(read_back[1].parameters, history[1].parameters);
        assert!(read_back[1].losses[0].1.is_nan());
        for (text, place) in [
            ("stage,step,active_frames,loss.total\nrefine,1,2,3\nrefine,x,2,3\n", "history.csv:3"),
            ("stage,step,active_frames,total\nrefine,1,2,3\n", "history.csv:1"),
        ] {
            std::fs::write(&path, text).unwrap();
            assert!(read(&path).unwrap_err().to_string().contains(place));
        }
    }
}
