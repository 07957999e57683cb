//! The tables, as text and as CSV.

use std::fmt::Write as _;

use super::{Entry, PUBLISHED};
use tessuto_estimate::metrics::QUANTITIES;

/// Digits of a value in a text table.
const WIDTH: usize = 10;

/// One quantity: methods in rows, scenes in columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Key, for the CSV.
    pub key: String,
    /// What it is, for people.
    pub title: String,
    /// Unit of the values.
    pub unit: &'static str,
    /// Scenes.
    pub scenes: Vec<String>,
    /// Rows.
    pub rows: Vec<Row>,
}

/// One method in a [`Table`].
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Name of the method.
    pub label: String,
    /// Whether it was printed elsewhere, and not measured here.
    pub is_published: bool,
    /// Value of each scene.
    pub values: Vec<Option<f64>>,
}

impl Row {
    /// Mean over the scenes, if every scene has a value.
    pub fn mean(&self) -> Option<f64> {
        let sum = self.values.iter().copied().sum::<Option<f64>>()?;
        (!self.values.is_empty()).then(|| sum / self.values.len() as f64)
    }
}

/// Unit to print a quantity in, and its factor from SI units.
fn shown_in(key: &str, unit: &str) -> (&'static str, f64) {
    match (key, unit) {
        ("p2s1_published", _) => ("10⁻³ m", 1e3),
        ("p2s2_published", _) => ("10⁻⁵ m²", 1e5),
        (_, "m²") => ("10⁻⁴ m²", 1e4),
        _ => ("10⁻² m", 1e2),
    }
}

/// All tables that have a value, of `entries` in the order of their scenes and methods.
pub fn tables(entries: &[Entry]) -> Vec<Table> {
    let mut scenes: Vec<String> = Vec::new();
    let mut methods = Vec::new();
    for entry in entries {
        if !scenes.contains(&entry.scene) {
            scenes.push(entry.scene.clone());
        }
        if !methods.contains(&entry.method) {
            methods.push(entry.method);
        }
    }
    let errors: Vec<_> = entries.iter().map(Entry::errors).collect();
    let measured = |of: &dyn Fn(usize) -> Option<f64>| -> Vec<Row> {
        let value = |scene: &String, key: &str| {
            of(entries.iter().position(|e| &e.scene == scene && e.method.key == key)?)
        };
        let row = |m: &super::Method| Row {
            label: m.label.to_owned(),
            is_published: false,
            values: scenes.iter().map(|scene| value(scene, m.key)).collect(),
        };
        methods.iter().map(row).collect()
    };
    let mut out = Vec::new();
    for (k, quantity) in QUANTITIES.iter().enumerate() {
        let (unit, factor) = shown_in(quantity.key, quantity.unit);
        let mut rows = measured(&|e| Some(errors[e].as_ref()?.values()[k]? * factor));
        for printed in PUBLISHED.iter().filter(|p| p.quantity == quantity.key) {
            let wanted = printed.ablation.is_none_or(|key| methods.iter().any(|m| m.key == key));
            let values: Vec<_> =
                scenes.iter().map(|scene| printed.value(scene).map(|v| v * factor)).collect();
            if wanted && values.iter().any(Option::is_some) {
                rows.push(Row { label: printed.label.to_owned(), is_published: true, values });
            }
        }
        out.push(table(quantity.key, quantity.label, unit, &scenes, rows));
    }
    let of_record = |of: fn(&super::Record) -> Option<f64>| {
        measured(&|e| of(entries[e].record.as_ref().filter(|r| r.failure.is_none())?))
    };
    out.push(table("time", "wall time", "s", &scenes, of_record(|r| Some(r.seconds))));
    let memory = of_record(|r| r.memory.map(|bytes| bytes as f64 / 1e6));
    out.push(table("memory", "largest memory", "MB", &scenes, memory));
    let energy = of_record(|r| r.energy.map(|joules| joules / 1e3));
    out.push(table("energy", "energy of the processors, everything else included", "kJ", &scenes, energy));
    out.retain(|t| t.rows.iter().any(|row| !row.is_published && row.values.iter().any(Option::is_some)));
    out
}

fn table(key: &str, title: &str, unit: &'static str, scenes: &[String], rows: Vec<Row>) -> Table {
    Table { key: key.to_owned(), title: title.to_owned(), unit, scenes: scenes.to_vec(), rows }
}

/// `tables` for a terminal, and under them what went wrong.
pub fn text(tables: &[Table], entries: &[Entry]) -> String {
    let mut out = String::new();
    for table in tables {
        let label = table.rows.iter().map(|row| row.label.chars().count()).max().unwrap_or(0);
        let has_mean = table.scenes.len() > 1;
        let _ = writeln!(out, "{} [{}]", table.title, table.unit);
        let _ = write!(out, "{:label$}", "");
        let mean = has_mean.then_some("mean");
        for column in table.scenes.iter().map(String::as_str).chain(mean) {
            let _ = write!(out, "  {column:>WIDTH$}");
        }
        out.push('\n');
        for row in &table.rows {
            let _ = write!(out, "{:label$}", row.label);
            let mean = has_mean.then(|| row.mean());
            for value in row.values.iter().copied().chain(mean) {
                let _ = write!(out, "  {:>WIDTH$}", shown(value));
            }
            out.push('\n');
        }
        out.push('\n');
    }
    if tables.iter().flat_map(|t| &t.rows).any(|row| row.is_published) {
        out.push_str("Published figures are means over whole clips.\n");
    }
    for (entry, failure) in failures(entries) {
        let _ = writeln!(out, "{}, {}: {failure}", entry.scene, entry.method.key);
    }
    out
}

/// Three or four digits; a dash where there is nothing.
pub(super) fn shown(value: Option<f64>) -> String {
    match value {
        None => "–".to_owned(),
        Some(v) if v.abs() >= 100.0 => format!("{v:.0}"),
        Some(v) if v.abs() >= 10.0 => format!("{v:.1}"),
        Some(v) if v.abs() >= 0.1 || v == 0.0 => format!("{v:.2}"),
        Some(v) => format!("{v:.2e}"),
    }
}

/// The entries that failed, and why.
pub(super) fn failures(entries: &[Entry]) -> impl Iterator<Item = (&Entry, &str)> {
    entries.iter().filter_map(|e| Some((e, e.record.as_ref()?.failure.as_deref()?)))
}

/// `tables` as CSV, one line per value: quantity, unit, method, source, scene, value.
pub fn csv(tables: &[Table]) -> String {
    let quoted = |text: &str| match text.contains([',', '"', '\n']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    };
    let mut out = String::from("quantity,unit,method,source,scene,value\n");
    for table in tables {
        for row in &table.rows {
            let source = if row.is_published { "published" } else { "measured" };
            for (scene, value) in table.scenes.iter().zip(&row.values) {
                let Some(value) = value else { continue };
                let [key, unit, label, scene] = [&table.key, table.unit, &row.label, scene].map(quoted);
                let _ = writeln!(out, "{key},{unit},{label},{source},{scene},{value}");
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{ABLATIONS, METHODS, Record};
    use super::*;

    fn entries(scenes: &[&str]) -> Vec<Entry> {
        let methods = [METHODS[1], ABLATIONS[0]];
        let entry = |scene: &&str, method| {
            let record = Record { seconds: 12.5, memory: Some(3_000_000), ..Record::default() };
            Entry { record: Some(record), ..Entry::at(Path::new("nowhere"), scene, method) }
        };
        scenes.iter().flat_map(|scene| methods.map(|m| entry(scene, m))).collect()
    }

    #[test]
    fn costs_are_shown_for_runs_that_ended_well_and_failures_are_told() {
        let mut entries = entries(&["curtain", "a, b"]);
        entries[1].record.as_mut().unwrap().failure = Some("out of memory".into());
        let tables = tables(&entries);
        assert_eq!(tables.iter().map(|t| t.key.as_str()).collect::<Vec<_>>(), ["time", "memory"]);
        assert_eq!(tables[0].rows[0].values, [Some(12.5), Some(12.5)]);
        assert_eq!((tables[0].rows[1].values[0], tables[0].rows[1].mean()), (None, None));
        let report = text(&tables, &entries);
        assert!(!report.contains("Published"), "{report}");
        let published = Row { is_published: true, ..tables[0].rows[0].clone() };
        let beside = Table { rows: vec![published], ..tables[0].clone() };
        assert!(text(&[beside], &entries).contains("means over whole clips"));
        assert!(report.contains("wall time [s]") && report.contains("curtain, saft-fixed: out of memory"));
        let csv = csv(&tables);
        assert_eq!(csv.lines().count(), 1 + 3 + 3);
        assert!(csv.contains("time,s,\"SAFT, this program's\",measured,\"a, b\",12.5\n"), "{csv}");
    }
}
