//! history.csv: losses and parameters of every step of every stage.

use std::fmt::Write as _;
use std::path::Path;

use crate::error::{Error, Result};
use crate::report::HistoryRow;
use crate::session::Epoch;

/// Columns that are parameters in any stage, and those that are in stage `rollout` but losses elsewhere.
const PARAMETERS: [&str; 7] =
    ["constant_x", "constant_y", "constant_z", "rate", "level", "light_rows", "light_colour"];
const STIFFNESSES: [&str; 3] = ["stretch", "bend", "shear"];

/// One row per step; columns are the union of all names.
pub fn history_csv(history: &[Epoch]) -> String {
    let mut columns: Vec<&str> = Vec::new();
    for epoch in history {
        for (name, _) in epoch.losses.iter().chain(&epoch.parameters) {
            if !columns.contains(name) {
                columns.push(name);
            }
        }
    }
    let mut out = format!("stage,step,active_frames,{}\n", columns.join(","));
    for epoch in history {
        let _ = write!(out, "{},{},{}", epoch.stage, epoch.step, epoch.active_frames);
        for column in &columns {
            let value = epoch.losses.iter().chain(&epoch.parameters).find(|(name, _)| name == column);
            let _ = match value {
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
pub(super) fn read(path: &Path) -> Result<Vec<HistoryRow>> {
    if !path.is_file() {
        return Ok(Vec::new());
    }
    let fail = |line: usize, problem: String| {
        Error::input(format!("{}:{line}", path.display()), problem, "use the file as tessuto wrote it")
    };
    let text = crate::io::read_text(path)?;
    let columns: Vec<&str> = text.lines().next().unwrap_or_default().split(',').skip(3).collect();
    let row = |(n, line): (usize, &str)| {
        let cells: Vec<&str> = line.split(',').collect();
        let count = |k: usize| cells.get(k).and_then(|c| c.parse().ok());
        let (Some(step), Some(active_frames)) = (count(1), count(2)) else {
            return Err(fail(n + 1, format!("“{line}” is not a step")));
        };
        let mut row = HistoryRow { stage: cells[0].to_owned(), step, active_frames, ..HistoryRow::default() };
        for (name, cell) in columns.iter().zip(&cells[3..]).filter(|(_, cell)| !cell.is_empty()) {
            let value = cell.parse().map_err(|_| fail(n + 1, format!("{name} is “{cell}”")))?;
            let values = if is_parameter(cells[0], name) { &mut row.parameters } else { &mut row.losses };
            values.push(((*name).to_owned(), value));
        }
        Ok(row)
    };
    text.lines().enumerate().skip(1).map(row).collect()
}

fn is_parameter(stage: &str, name: &str) -> bool {
    PARAMETERS.contains(&name) || stage == "rollout" && STIFFNESSES.contains(&name)
}

/// The row of a step in memory.
pub(super) fn row(epoch: &Epoch) -> HistoryRow {
    let named = |values: &[(&str, f64)]| values.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect();
    HistoryRow {
        stage: epoch.stage.to_owned(),
        step: epoch.step,
        active_frames: epoch.active_frames,
        losses: named(&epoch.losses),
        parameters: named(&epoch.parameters),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_read_as_they_were_written() {
        let epoch = |stage, losses: &[(&'static str, f64)], parameters: &[(&'static str, f64)]| Epoch {
            stage,
            step: 1,
            of: 1,
            active_frames: 4,
            losses: losses.to_vec(),
            parameters: parameters.to_vec(),
        };
        let history = [
            epoch("refine", &[("total", 1.25), ("bend", 0.1)], &[("level", 2.0)]),
            epoch("rollout", &[("total", f64::NAN)], &[("bend", 1e-3), ("constant_x", -0.5)]),
        ];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.csv");
        assert!(read(&path).unwrap().is_empty());
        std::fs::write(&path, history_csv(&history)).unwrap();
        let rows = read(&path).unwrap();
        assert_eq!(rows[0], row(&history[0]));
        assert_eq!(rows[1].parameters, row(&history[1]).parameters);
        assert!(rows[1].losses[0].1.is_nan());
        std::fs::write(&path, "stage,step,active_frames,total\nrefine,1,2,3\nrefine,x,2,3\n").unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("history.csv:3"));
    }
}
