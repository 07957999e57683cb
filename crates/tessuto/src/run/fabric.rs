//! What fabric a result may be of: its stiffness per width among measured ones.
//!
//! A video tells stiffness in proportion to density only, so fabrics are compared by that: by the bending length c = (D/(ρ g))^⅓, the length
//! of a strip that bends under its own weight by a fixed angle (as in BS 3356), of warp and weft.

use std::path::Path;

use crate::error::{Error, Result};
use crate::io;
use crate::motion::causes::GRAVITY;
use crate::result::Folder;
use crate::sim::per_width::PerWidth;

/// A measured fabric.
#[derive(Debug, Clone, PartialEq)]
pub struct Fabric {
    /// Its row in the table, the first after the heading is 1.
    pub row: usize,
    /// Area density [kg/m²].
    pub density: f64,
    /// Bending stiffness of warp and weft [N·m].
    pub bending: [f64; 2],
}

/// What a result says of its fabric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Its stiffnesses.
    pub per_width: PerWidth,
    /// Standard deviations of the logarithms of membrane, bending and shear stiffness.
    pub sd_of_ln: [f64; 3],
    /// Whether the video tells them.
    pub informed: [bool; 3],
}

/// Bending length of a stiffness [N·m] at a density [kg/m²] `[m]`.
pub fn bending_length(bending: f64, density: f64) -> f64 {
    (bending / (density * GRAVITY)).cbrt()
}

/// Of a result of the preset physics.
///
/// # Errors
/// [`Error::Input`] for other results, and for meshes whose texture coordinates are no flat panel.
pub fn measured(result: &Folder) -> Result<Measured> {
    let fail = |problem: &str, hint: &str| {
        Err(Error::input(result.path().display().to_string(), problem.to_owned(), hint.to_owned()))
    };
    let Some(found) = &result.found else {
        return fail(
            "its stiffnesses only replay the motion",
            "reconstruct the scene with the preset physics",
        );
    };
    let Some(per_width) = result.per_width else {
        return fail(
            "its texture coordinates are no flat panel to scale",
            "use a template whose texture coordinates are the sheet as it was cut",
        );
    };
    let informed =
        [0, 1, 2].map(|k| found.is_informed(found.spread.ln_stiffness[k], found.prior.ln_stiffness[k]));
    Ok(Measured { per_width, sd_of_ln: found.spread.ln_stiffness, informed })
}

/// Reads a table of fabrics: comma-separated, with a heading that names `density[kg.m-2]` and, in units of 1e-9 N·m, `linear
/// warp[SI*1e9]` and `linear weft[SI*1e9]`.
///
/// # Errors
/// [`Error::Input`] naming the line that cannot be read.
pub fn read_table(path: &Path) -> Result<Vec<Fabric>> {
    const COLUMNS: [(&str, f64); 3] =
        [("density[kg.m-2]", 1.0), ("linear warp[SI*1e9]", 1e-9), ("linear weft[SI*1e9]", 1e-9)];
    let text = io::read_text(path)?;
    let fail = |line: usize, problem: String| {
        let hint =
            "give a table with the columns density[kg.m-2], linear warp[SI*1e9] and linear weft[SI*1e9]";
        Error::input(format!("{}, line {}", path.display(), line + 1), problem, hint)
    };
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let heading: Vec<&str> = lines.next().map_or("", |(_, line)| line).split(',').map(str::trim).collect();
    let mut places = [0; 3];
    for (place, (name, _)) in places.iter_mut().zip(COLUMNS) {
        *place = heading
            .iter()
            .position(|h| *h == name)
            .ok_or_else(|| fail(0, format!("there is no column {name}")))?;
    }
    let mut out = Vec::new();
    for (n, line) in lines {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let mut numbers = [0.0; 3];
        for ((number, place), (name, unit)) in numbers.iter_mut().zip(places).zip(COLUMNS) {
            let cell = cells.get(place).copied().unwrap_or("");
            let value: Option<f64> = cell.parse().ok().filter(|v: &f64| *v > 0.0 && v.is_finite());
            *number =
                value.ok_or_else(|| fail(n, format!("{name} is {cell:?}, not a positive number")))? * unit;
        }
        let [density, warp, weft] = numbers;
        out.push(Fabric { row: out.len() + 1, density, bending: [warp, weft] });
    }
    Ok(out)
}

/// The `count` fabrics that bend most alike, each with its mean difference of ln(D/ρ), the nearest first. A sheet lies either way round.
pub fn nearest<'a>(table: &'a [Fabric], sheet: &PerWidth, count: usize) -> Vec<(&'a Fabric, f64)> {
    let ln = |bending: f64, density: f64| (bending / density).ln();
    let own = sheet.bending.map(|d| ln(d, sheet.area_density));
    let off = |f: &Fabric| {
        let [warp, weft] = f.bending.map(|d| ln(d, f.density));
        let mean = |a: f64, b: f64| 0.5 * ((a - own[0]).abs() + (b - own[1]).abs());
        mean(warp, weft).min(mean(weft, warp))
    };
    let mut all: Vec<(&Fabric, f64)> = table.iter().map(|f| (f, off(f))).collect();
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    all.truncate(count);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_read_and_the_nearest_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fabrics.csv");
        let text = "density[kg.m-2], linear warp[SI*1e9], linear weft[SI*1e9]\n0.1, 1000, 2000\n0.2, 9000, 4000\n\n0.05, 500.5, 900\n";
        std::fs::write(&path, text).unwrap();
        let table = read_table(&path).unwrap();
        assert_eq!(table.len(), 3);
        assert_eq!((table[2].row, table[2].density), (3, 0.05));
        assert!((table[2].bending[0] - 500.5e-9).abs() < 1e-15);
        // The second one, turned round: 2e-5 and 4.5e-5 m⁴/s² and a bit.
        let sheet = PerWidth {
            bending: [2.1e-6, 4.4e-6],
            shear: 1.0,
            membrane: [1.0; 2],
            bent: 0.1,
            area_density: 0.1,
        };
        let found = nearest(&table, &sheet, 2);
        assert_eq!(found[0].0.row, 2);
        assert!(found[0].1 < 0.06 && found[1].1 > found[0].1);
        assert!((bending_length(9.81e-7, 0.1) - 0.01).abs() < 1e-12);
        std::fs::write(&path, text.replace("9000", "-9")).unwrap();
        let message = read_table(&path).unwrap_err().to_string();
        assert!(message.contains("line 3") && message.contains("-9"), "{message}");
    }
}
