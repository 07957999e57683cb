//! `tessuto settings`.

use std::fmt::Write as _;

use clap::Args;
use serde_json::{Value, json};
use tessuto::config::Preset;
use tessuto::settings::{Setting, Values};
use tessuto::{Config, Error};

use crate::say::{self, say};

/// List the settings: key, default, range, unit, meaning.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto settings spacetime
  tessuto settings rate
  tessuto settings --json --preset saft

Change one with `tessuto reconstruct SCENE --set KEY=VALUE`, many with `--config FILE`. \
A spread σ is the size that is normal for a term: a larger spread makes the term \
weaker.")]
pub struct Arguments {
    /// Only settings whose key contains this.
    filter: Option<String>,
    /// The preset whose defaults are shown.
    #[arg(long, value_parser = crate::frames::preset, default_value = "default")]
    preset: Preset,
    /// Print JSON instead of a table.
    #[arg(long, conflicts_with = "markdown")]
    json: bool,
    /// Print docs/settings.md, for the presets default, saft, phi-sft and pg-sft.
    #[arg(long, conflicts_with_all = ["filter", "preset"])]
    markdown: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    if arguments.markdown {
        say::output(format_args!("{}", markdown()));
        return Ok(());
    }
    let filter = arguments.filter.as_deref().unwrap_or_default();
    let mut rows = Config::preset(arguments.preset).table();
    rows.retain(|(setting, _)| setting.key.contains(filter));
    if rows.is_empty() {
        let problem = format!("no setting's key contains {filter}");
        return Err(Error::usage(problem, "`tessuto settings` lists all of them").into());
    }
    if arguments.json {
        let rows: Vec<Value> = rows.iter().map(|(setting, value)| as_json(setting, value)).collect();
        say!("{}", serde_json::to_string_pretty(&rows)?);
        return Ok(());
    }
    for (Setting { key, meaning, values, .. }, value) in rows {
        let [space, unit] = if values.unit().is_empty() { ["", ""] } else { [" ", values.unit()] };
        say!("{key} = {value}{space}{unit}    [{values}]\n    {meaning}");
    }
    Ok(())
}

fn as_json(setting: &Setting, value: &str) -> Value {
    let default: Value = serde_json::from_str(value).unwrap_or_else(|_| value.into());
    let mut row = json!({ "key": setting.key, "meaning": setting.meaning, "default": default });
    match &setting.values {
        Values::Number { range, unit } => {
            row["range"] = json!([range.start(), range.end()]);
            row["unit"] = json!(unit);
        }
        Values::Choice(words) => row["values"] = json!(words),
        _ => row["values"] = json!([true, false]),
    }
    row
}

/// docs/settings.md.
fn markdown() -> String {
    let mut text = String::from(
        "\
# Settings

Made by `tessuto settings --markdown`; a test compares. Change a setting with `--set KEY=VALUE`, which may be repeated,
or many with `--config FILE`: `config.json` of a result, or a file such as `{\"texture\": {\"size\": 256}}`.

A spread σ is the normal size of a residual: a term with spread σ contributes ½ (residual/σ)², so the larger it is,
the weaker the term. Units are in brackets; pure numbers and counts have none.
",
    );
    let others = [Preset::Motion, Preset::Saft, Preset::PhiSft, Preset::PgSft]
        .map(|preset| (preset.name(), Config::preset(preset).table()));
    let mut section = "";
    let default = Config::preset(Preset::Default).table();
    for (row, (setting, value)) in default.iter().enumerate() {
        let group = setting.key.split_once('.').map_or("", |(group, _)| group);
        if group != section || setting.key == "preset" {
            section = group;
            let title = if group.is_empty() { "The run" } else { group };
            let _ = write!(text, "\n## {title}\n\n| key | default | range | meaning |\n|---|---|---|---|\n");
        }
        let differs = others.iter().filter(|(_, table)| table[row].1 != *value);
        let differs: String = differs.map(|(name, table)| format!("; {name}: {}", table[row].1)).collect();
        let unit = setting.values.unit();
        let unit = if unit.is_empty() { String::new() } else { format!(" [{unit}]") };
        let _ = writeln!(
            text,
            "| `{}` | {value}{differs} | {}{unit} | {} |",
            setting.key, setting.values, setting.meaning
        );
    }
    text
}
