//! `tessuto fabric`.

use std::path::PathBuf;

use tessuto::result::Folder;
use tessuto::run::fabric::{bending_length, measured, nearest, read_table};

use crate::say;

/// How many fabrics are named.
const NAMED: usize = 5;

/// Print a result's stiffnesses per width, and the measured fabrics that bend alike.
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  tessuto fabric results/curtain --table fabrics.csv

Needs a result with estimated physics (preset default). A video shows stiffness only \
in proportion to area density. Fabrics are therefore compared by bending length, \
the cube root of D/(density × gravity).

The table is comma-separated. It has the columns of published measurements: \
density[kg.m-2], linear warp[SI*1e9] and linear weft[SI*1e9], the bending stiffness \
in 1e-9 N·m.")]
pub struct Arguments {
    /// Result folder.
    result: PathBuf,
    /// Measured fabrics.
    #[arg(long, value_name = "FILE.csv")]
    table: Option<PathBuf>,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let table = arguments.table.as_deref().map(read_table).transpose()?;
    let fabric = measured(&Folder::open(&arguments.result)?)?;
    let sheet = fabric.per_width;
    let mut out = String::new();
    let mut line = |name: &str, values: &[f64], unit: &str, k: usize| {
        let shown: Vec<String> = values.iter().map(|v| format!("{v:.3e}")).collect();
        let informed = if fabric.informed[k] { "" } else { "; the video says little of it" };
        let spread = fabric.sd_of_ln[k].exp();
        out += &format!(
            "{name:<18} {:<22} {unit:<4} within a factor {spread:.2}{informed}\n",
            shown.join(" · ")
        );
    };
    line("bending, warp·weft", &sheet.bending, "N·m", 1);
    line("shear", &[sheet.shear], "N/m", 2);
    line("membrane", &sheet.membrane, "N/m", 0);
    let lengths = sheet.bending.map(|d| format!("{:.1}", 1e3 * bending_length(d, sheet.area_density)));
    out += &format!("bending length     {} mm\n", lengths.join(" · "));
    let bent = sheet.bent.to_degrees();
    out += &format!(
        "at {} kg/m², which is assumed, and bent by {bent:.1}° from edge to edge\n",
        sheet.area_density
    );
    if let Some(table) = &table {
        out += &format!("\nOf {} fabrics these bend most alike:\n", table.len());
        for (f, off) in nearest(table, &sheet, NAMED) {
            let [warp, weft] = f.bending.map(|d| 1e3 * bending_length(d, f.density));
            out += &format!(
                "row {:<4} {:.3} kg/m², bending {:.2e} · {:.2e} N·m, bending length {warp:.1} · {weft:.1} mm, \
                 off by a factor {:.2}\n",
                f.row,
                f.density,
                f.bending[0],
                f.bending[1],
                off.exp()
            );
        }
    }
    say::output(format_args!("{out}"));
    Ok(())
}
