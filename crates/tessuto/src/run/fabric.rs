//! What fabric a result may be of: its stiffness per width among measured ones.
//!
//! A video constrains stiffness in proportion to density only, so fabrics are compared by that: by the bending length
//! c = (D/(ρ g))^⅓, the length of a strip that bends under its own weight by a fixed angle (as in BS 3356), of
//! warp and weft.

use std::path::Path;

use crate::result::Folder;
pub use crate::result::Measured;
use tessuto_core::error::{Error, Result};
use tessuto_estimate::io::table::Table;
use tessuto_sim::per_width::PerWidth;
pub use tessuto_sim::per_width::bending_length;

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

/// Of a result with causes.
///
/// # Errors
/// [`Error::Input`] for other results, and for meshes whose texture coordinates are no flat panel.
pub fn measured(result: &Folder) -> Result<Measured> {
    let fail = |problem: &str, hint: &str| {
        Err(Error::input(result.path().display().to_string(), problem.to_owned(), hint.to_owned()))
    };
    if result.found.is_none() {
        return fail(
            "its stiffnesses only replay the motion",
            "reconstruct the scene with the preset default",
        );
    }
    match result.measured() {
        Some(measured) => Ok(measured),
        None => fail(
            "its texture coordinates are no flat panel to scale",
            "use a template whose texture coordinates are the sheet as it was cut",
        ),
    }
}

/// Reads a table of fabrics: CSV with commas, semicolons or tabs, cells in quotes or without, and a heading that names
/// `density[kg.m-2]` and, in units of 1e-9 N·m, `linear warp[SI*1e9]` and `linear weft[SI*1e9]`.
///
/// # Errors
/// [`Error::Input`] naming the line that cannot be read.
pub fn read_table(path: &Path) -> Result<Vec<Fabric>> {
    const COLUMNS: [(&str, f64); 3] =
        [("density[kg.m-2]", 1.0), ("linear warp[SI*1e9]", 1e-9), ("linear weft[SI*1e9]", 1e-9)];
    let table = Table::read(path)?;
    let fail = |line: usize, problem: String| {
        let hint =
            "give a table with the columns density[kg.m-2], linear warp[SI*1e9] and linear weft[SI*1e9]";
        Error::input(format!("{}, line {line}", path.display()), problem, hint)
    };
    let heading = table.rows.first();
    let mut places = [0; 3];
    for (place, (name, _)) in places.iter_mut().zip(COLUMNS) {
        *place = heading.and_then(|row| row.cells.iter().position(|h| h == name)).ok_or_else(|| {
            let found = heading.map_or_else(String::new, |row| row.cells.join(" | "));
            fail(heading.map_or(1, |row| row.line), format!("there is no column {name} among: {found}"))
        })?;
    }
    table.check(&places)?;
    let mut out = Vec::new();
    for row in table.rows.iter().skip(1) {
        let mut numbers = [0.0; 3];
        for ((number, place), (name, unit)) in numbers.iter_mut().zip(places).zip(COLUMNS) {
            let cell = row.cells.get(place).map_or("", String::as_str);
            let value = table.number(cell).filter(|v| *v > 0.0);
            *number = value
                .ok_or_else(|| fail(row.line, format!("{name} is {cell:?}, not a positive number")))?
                * unit;
        }
        let [density, warp, weft] = numbers;
        out.push(Fabric { row: out.len() + 1, density, bending: [warp, weft] });
    }
    Ok(out)
}

/// The `count` fabrics that bend most alike, each with its mean difference of ln(D/ρ), the nearest first. A sheet
/// lies either way round; of fabrics with the same numbers the first stands for all.
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
    let mut out: Vec<(&Fabric, f64)> = Vec::new();
    for (f, off) in all {
        if out.len() == count {
            break;
        }
        if !out.iter().any(|(g, _)| g.density == f.density && g.bending == f.bending) {
            out.push((f, off));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_read_and_the_nearest_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fabrics.csv");
        let text = "density[kg.m-2], linear warp[SI*1e9], linear weft[SI*1e9]\n0.1, 1000, 2000\n0.2, 9000, \
                    4000\n\n0.05, 500.5, 900\n";
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
        // The same measurement twice is one fabric.
        let twice = [table.clone(), table.clone()].concat();
        let rows: Vec<usize> = nearest(&twice, &sheet, 9).iter().map(|(f, _)| f.row).collect();
        assert_eq!((rows.len(), rows[0]), (3, 2));
        assert!((bending_length(9.81e-7, 0.1) - 0.01).abs() < 1e-12);
        // As spreadsheets and statistics programs write the same table, with names that hold commas.
        let named = "\u{feff}\"name\",\"density[kg.m-2]\",\"linear warp[SI*1e9]\",\"linear weft[SI*1e9]\"\r\n\
                     \"Denim, 11 oz\",0.1,1000,2000\r\n\"b\",\"0.2\",\"9000\",\"4000\"\r\n\"c\",0.05,500.5,900\r\n";
        let commas = "sep=;\nname;density[kg.m-2];linear warp[SI*1e9];linear weft[SI*1e9]\n\
                      Denim, 11 oz;0,1;1000;2000\nb;0,2;9000;4000\nc;0,05;500,5;900\n;;;\n";
        for text in [named, commas, &commas.replace(';', "\t").replace("sep=\t\n", "")] {
            std::fs::write(&path, text).unwrap();
            assert_eq!(read_table(&path).unwrap(), table, "{text}");
        }
        std::fs::write(&path, "a;density[kg.m-2]\n").unwrap();
        let message = read_table(&path).unwrap_err().to_string();
        assert!(message.contains("no column linear warp[SI*1e9] among: a | density[kg.m-2]"), "{message}");
        std::fs::write(&path, text.replace("9000", "-9")).unwrap();
        let message = read_table(&path).unwrap_err().to_string();
        assert!(message.contains("line 3") && message.contains("-9"), "{message}");
    }
}
