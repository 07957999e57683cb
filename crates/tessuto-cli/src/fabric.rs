//! `tessuto fabric`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use tessuto::Error;
use tessuto::card::{self, Answer, Card, Clip, combine};
use tessuto::motion::causes::Constraint;
use tessuto::output::manifest;
use tessuto::result::Folder;
use tessuto::run::fabric::{Fabric, bending_length, measured, nearest, read_table};
use tessuto::sim::per_width::PerWidth;

use crate::say;
use crate::threads::Threads;
use crate::values;

/// How many fabrics are named.
const NAMED: usize = 5;

/// Print a fabric's stiffness per width from one or more results, and measured fabrics that bend alike; make its card.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tessuto fabric results/curtain --table fabrics.csv
  tessuto fabric results/towel1 results/towel2 --weight 310g/m2 --out towel.html

Needs results with estimated physics (preset default). A video shows stiffness only \
in proportion to area density. Fabrics are therefore compared by bending length, \
the cube root of D/(density × gravity).

Several results are clips of one fabric. Each counts where its video constrains a \
stiffness. Clips that contradict each other are named.

The card is one HTML page: stiffnesses with their bands, a strip that bends over the \
edge of a table (ASTM D1388, ISO 9073-7) and a disc over a plate (Cusick), both \
simulated, and how to check them with a ruler.

The table is comma-separated. It has the columns of published measurements: \
density[kg.m-2], linear warp[SI*1e9] and linear weft[SI*1e9], the bending stiffness \
in 1e-9 N·m.")]
pub struct Arguments {
    /// Result folders, each of a clip of the same fabric.
    #[arg(required = true, value_name = "RESULT")]
    results: Vec<PathBuf>,
    /// Measured fabrics.
    #[arg(long, value_name = "FILE.csv")]
    table: Option<PathBuf>,
    /// What the fabric weighs, such as 142g/m2 or 0.142kg/m2 [default: assumed, 100g/m2].
    #[arg(long, value_parser = values::weight)]
    weight: Option<f64>,
    /// Write the card to this file.
    #[arg(long, value_name = "FILE.html")]
    out: Option<PathBuf>,
    /// Replace the file if it is an earlier card.
    #[arg(long, requires = "out")]
    force: bool,
    #[command(flatten)]
    threads: Threads,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.threads.start()?;
    // Everything that can be refused is refused before the work.
    if let Some(out) = &arguments.out {
        check_target(out, arguments.force)?;
    }
    let table = arguments.table.as_deref().map(read_table).transpose()?;
    let clips = clips(&arguments.results)?;
    let assumed = combine(&clips);
    let answer = arguments.weight.map_or_else(|| assumed.clone(), |weight| assumed.clone().weighing(weight));
    let alike: Vec<(&Fabric, f64)> =
        table.as_ref().map_or_else(Vec::new, |table| nearest(table, &answer.per_width, NAMED));
    let among = table.as_ref().map_or(0, Vec::len);
    say::output(format_args!(
        "{}{}{}",
        numbers(&answer, arguments.weight.is_some()),
        together(&clips, &answer),
        named(&alike, among)
    ));
    if let Some(out) = &arguments.out {
        let tested = card::simulate(&answer)?;
        let weighed = arguments.weight.is_some();
        let (clips, answer) = (&clips[..], &answer);
        card::write(out, &Card { clips, answer, weighed, tested: &tested, alike: &alike, among })?;
        manifest::record(&[out])?;
        say::output(format_args!("{}\n", out.display()));
    }
    Ok(())
}

/// Opens the results, and names each by its folder.
fn clips(results: &[PathBuf]) -> anyhow::Result<Vec<Clip>> {
    let name = |path: &Path| path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let places: Vec<PathBuf> =
        results.iter().map(|path| path.canonicalize().unwrap_or_else(|_| path.clone())).collect();
    let mut clips = Vec::new();
    for (k, (path, place)) in results.iter().zip(&places).enumerate() {
        if places[..k].contains(place) {
            let problem = format!("{} is given twice", path.display());
            Err(Error::usage(problem, "name every clip once: a clip does not confirm itself"))?;
        }
        let unique = places.iter().filter(|other| name(other) == name(place)).count() == 1;
        let name = if unique { name(place) } else { path.display().to_string() };
        clips.push(Clip { name, measured: measured(&Folder::open(path)?)? });
    }
    Ok(clips)
}

/// The stiffnesses.
fn numbers(answer: &Answer, weighed: bool) -> String {
    let sheet = &answer.per_width;
    let mut out = String::new();
    let mut line = |name: &str, values: &[f64], unit: &str, k: usize| {
        let constraint = answer.parameters[k].constraint;
        let shown: Vec<String> =
            values.iter().map(|v| format!("{:.3e}", constraint.bound(*v).unwrap_or(*v))).collect();
        let (shown, spread) = (shown.join(" · "), answer.parameters[k].sd_of_ln.exp());
        let _ = match constraint {
            Constraint::Constrained => {
                writeln!(out, "{name:<18} {shown:<22} {unit:<4} constrained, within a factor {spread:.2}")
            }
            Constraint::AtLeast { .. } => writeln!(out, "{name:<18} at least {shown} {unit}"),
            Constraint::AtMost { .. } => writeln!(out, "{name:<18} at most {shown} {unit}"),
            Constraint::TradedOff { .. } | Constraint::Unconstrained => {
                let said = constraint.text(0.0, |v| v.to_string());
                writeln!(out, "{name:<18} {shown:<22} {unit:<4} {said}, assumed within a factor {spread:.2}")
            }
        };
    };
    line("bending, warp·weft", &sheet.bending, "N·m", 1);
    line("shear", &[sheet.shear], "N/m", 2);
    line("membrane", &sheet.membrane, "N/m", 0);
    let lengths = lengths(sheet).map(|l| format!("{l:.1}"));
    let bent = sheet.bent.to_degrees();
    let source = if weighed { "as weighed" } else { "which is assumed" };
    let _ = writeln!(
        out,
        "bending length     {} mm\nat {} kg/m², {source}, and bent by {bent:.1}° from edge to edge",
        lengths.join(" · "),
        (sheet.area_density * 1e6).round() / 1e6
    );
    out
}

/// Of warp and weft [mm].
fn lengths(sheet: &PerWidth) -> [f64; 2] {
    sheet.bending.map(|d| 1e3 * bending_length(d, sheet.area_density))
}

/// Whether several clips agree, and what a further one should show.
fn together(clips: &[Clip], answer: &Answer) -> String {
    let mut out = String::new();
    if clips.len() > 1 {
        let _ = writeln!(out, "\nFrom {} clips, treated as one fabric:", clips.len());
        for k in [1, 2, 0] {
            let parameter = &answer.parameters[k];
            let name = card::combine::NAMES[k];
            let used: Vec<&str> = parameter.clips.iter().map(|i| clips[*i].name.as_str()).collect();
            let verdict = match (&parameter.contradiction, used.len()) {
                (_, 0) => "no clip constrains it".to_owned(),
                (_, 1) => format!("only {} constrains it", used[0]),
                (None, _) => format!("{} agree, χ² {:.2}", used.join(", "), parameter.chi_square),
                (Some(c), _) => {
                    let [a, b] = c.clips.map(|i| &clips[i].name);
                    format!(
                        "contradiction: {b} is {:.2} times as stiff as {a}, {:.1} standard deviations; widened",
                        c.factor, c.deviations
                    )
                }
            };
            let _ = writeln!(out, "{name:<18} {verdict}");
        }
    }
    let _ = writeln!(out, "A further clip should show {}.", answer.next_clip());
    out
}

/// The fabrics that bend alike, of as many as the table has.
fn named(alike: &[(&Fabric, f64)], among: usize) -> String {
    let mut out = String::new();
    if among > 0 {
        let _ = writeln!(out, "\nOf {among} fabrics these bend most alike:");
    }
    for (f, off) in alike {
        let [warp, weft] = f.bending.map(|d| 1e3 * bending_length(d, f.density));
        let _ = writeln!(
            out,
            "row {:<4} {:.3} kg/m², bending {:.2e} · {:.2e} N·m, bending length {warp:.1} · {weft:.1} mm, \
             off by a factor {:.2}",
            f.row,
            f.density,
            f.bending[0],
            f.bending[1],
            off.exp()
        );
    }
    out
}

/// Refuses to replace a file that is not an earlier card. One outside of folders with a manifest is replaced if it has
/// the card's mark, and if `replace` is set.
fn check_target(out: &Path, replace: bool) -> Result<(), Error> {
    let loose = out.symlink_metadata().is_ok_and(|found| found.is_file()) && !manifest::is_within_ours(out);
    let is_card = || std::fs::read_to_string(out).is_ok_and(|text| text.contains(card::page::MARK));
    match loose && replace && is_card() {
        true => Ok(()),
        false if loose && !replace => Err(Error::input(
            out.display().to_string(),
            "already exists and would be replaced",
            "add --force if it is an earlier card, or choose another file",
        )),
        false => manifest::check_parts(&[out], replace),
    }
}
