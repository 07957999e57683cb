//! Tables as spreadsheets and statistics programs save them: cells between commas, semicolons or tabs, in quotes where
//! they hold one of these.
//!
//! Source: RFC 4180; a first line `sep=;` as spreadsheets write it; semicolons, then, with decimal commas.

use std::path::Path;

use super::text::read_text;
use tessuto_core::error::{Error, Result};

/// A row that is not empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Its first line in the file, from 1.
    pub line: usize,
    /// Cells without quotes and spaces around them.
    pub cells: Vec<String>,
}

/// A table of text.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    place: String,
    separator: char,
    /// Rows, the heading first.
    pub rows: Vec<Row>,
}

impl Table {
    /// Reads the table in the file at `path`.
    ///
    /// # Errors
    /// [`Error::Input`] for files that are no text, and quotes that do not end.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(&read_text(path)?, &path.display().to_string())
    }

    /// Reads the table in `text`, that of the file `place`.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        let first = text.lines().next().unwrap_or_default();
        let told = first.trim_matches('"').strip_prefix("sep=").filter(|s| s.chars().count() == 1);
        let heading = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
        let count = |s: char| outside_quotes(heading).filter(|c| *c == s).count();
        // Between semicolons commas are decimal ones, or part of a name.
        let counted = match [',', ';', '\t'].map(count) {
            [_, semicolons, _] if semicolons > 0 => ';',
            [commas, _, tabs] if tabs > commas => '\t',
            _ => ',',
        };
        let separator = told.and_then(|s| s.chars().next()).unwrap_or(counted);
        let (skipped, body) = match told {
            Some(_) => (1, text.split_once('\n').map_or("", |(_, rest)| rest)),
            None => (0, text),
        };
        let rows = cells(body, separator).map_err(|line| {
            let hint = "end the cell with a quote; a quote within a cell is written twice";
            Error::input(
                format!("{place}, line {}", line + skipped),
                "a quote begins a cell that never ends",
                hint,
            )
        })?;
        let rows = rows.into_iter().map(|row| Row { line: row.line + skipped, ..row });
        let rows = rows.filter(|row| row.cells.iter().any(|cell| !cell.is_empty())).collect();
        Ok(Self { place: place.to_owned(), separator, rows })
    }

    /// The finite number in a cell: with a decimal point, or between semicolons or tabs with a decimal comma.
    pub fn number(&self, cell: &str) -> Option<f64> {
        let comma = self.separator != ',' && cell.matches(',').count() == 1 && !cell.contains('.');
        let value = if comma { cell.replace(',', ".").parse() } else { cell.parse() };
        value.ok().filter(|v: &f64| v.is_finite())
    }

    /// Refuses rows that have other numbers of cells than the heading: decimal commas between commas make more of them.
    /// Empty ones at the end do not count. Refuses, too, a table whose `columns` have both decimal commas and points,
    /// one of which stands for thousands.
    ///
    /// # Errors
    /// [`Error::Input`] naming the line.
    pub fn check(&self, columns: &[usize]) -> Result<()> {
        let fail = |row: &Row, problem: String, hint: &str| {
            Err(Error::input(format!("{}, line {}", self.place, row.line), problem, hint))
        };
        let length = |row: &Row| row.cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |k| k + 1);
        let most = self.rows.first().map_or(0, |heading| heading.cells.len());
        if let Some(row) = self.rows.iter().find(|row| length(row) > most) {
            let problem = format!("has {} cells where the heading has {most}", length(row));
            let hint = "numbers need a decimal point; or save the table with semicolons between its cells, \
                        and cells that hold a comma in quotes";
            return fail(row, problem, hint);
        }
        let with = |mark: char| {
            let of = |row: &&Row| columns.iter().any(|k| row.cells.get(*k).is_some_and(|c| c.contains(mark)));
            self.rows.iter().skip(1).find(of)
        };
        match (with(','), with('.')) {
            (Some(comma), Some(point)) => {
                let row = if comma.line > point.line { comma } else { point };
                let problem = "has numbers with commas and with points: which of them is the decimal one?";
                fail(row, problem.to_owned(), "write numbers without a mark for thousands")
            }
            _ => Ok(()),
        }
    }
}

/// The characters of a line that do not stand in quotes.
fn outside_quotes(line: &str) -> impl Iterator<Item = char> {
    let mut quoted = false;
    line.chars().filter(move |c| {
        quoted ^= *c == '"';
        !quoted
    })
}

/// All rows of `text`; an error is the line where a quote begins that never ends.
fn cells(text: &str, separator: char) -> std::result::Result<Vec<Row>, usize> {
    let (mut rows, mut row) = (Vec::new(), Row { line: 1, cells: Vec::new() });
    let (mut cell, mut line) = (String::new(), 1);
    // Where the present cell's quote began, while it is open; whether the cell had one.
    let (mut open, mut had) = (None, false);
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        line += usize::from(letter == '\n');
        match letter {
            '"' if open.is_some() && letters.peek() == Some(&'"') => {
                letters.next();
                cell.push('"');
            }
            '"' if open.is_some() => open = None,
            '"' if !had && cell.trim().is_empty() => {
                cell.clear();
                (open, had) = (Some(line), true);
            }
            _ if open.is_some() => cell.push(letter),
            _ if letter == separator || letter == '\n' => {
                row.cells.push(std::mem::take(&mut cell).trim().to_owned());
                had = false;
                if letter == '\n' {
                    rows.push(std::mem::replace(&mut row, Row { line, cells: Vec::new() }));
                }
            }
            _ => cell.push(letter),
        }
    }
    row.cells.push(cell.trim().to_owned());
    rows.push(row);
    open.map_or(Ok(rows), Err)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Vec<Vec<String>> {
        Table::parse(text, "a.csv").unwrap().rows.into_iter().map(|row| row.cells).collect()
    }

    #[test]
    fn quotes_commas_and_lines_within_cells() {
        let expected = [["name", "warp"], ["Drill, \"raw\"", "1.5"], ["two\nlines", "2"]];
        for text in [
            "name,warp\n\"Drill, \"\"raw\"\"\",1.5\n\"two\nlines\",2\n",
            "\"name\", \"warp\"\r\n\"Drill, \"\"raw\"\"\" ,\"1.5\"\r\n\r\n,\r\n\"two\nlines\",2",
            "name;warp\n\"Drill, \"\"raw\"\"\";1.5\n\"two\nlines\";2\n",
            "sep=;\nname;warp\nDrill, \"raw\";1.5\n\"two\nlines\";2\n",
            "name\twarp\nDrill, \"raw\"\t1.5\n\"two\nlines\"\t2\n",
        ] {
            assert_eq!(table(text), expected, "{text}");
        }
        let lines: Vec<usize> =
            Table::parse("sep=,\na\n\n\"b\nc\"\nd", "").unwrap().rows.iter().map(|r| r.line).collect();
        assert_eq!(lines, [2, 4, 6]);
        let message = Table::parse("a,b\n1,\"2\n3,4\n", "a.csv").unwrap_err().to_string();
        assert!(message.contains("a.csv, line 2: a quote begins"), "{message}");
    }

    #[test]
    fn decimal_commas_are_read_between_semicolons_and_doubted_elsewhere() {
        let semicolons = Table::parse("a;b\n0,125;3\n1;\n", "a.csv").unwrap();
        semicolons.check(&[0, 1]).unwrap();
        assert_eq!(semicolons.number("0,125"), Some(0.125));
        assert_eq!(semicolons.number("0.125"), Some(0.125));
        assert_eq!(semicolons.number("1.000,5"), None);
        let commas = Table::parse("a,b\n1,2,,\n0,125,3\n", "a.csv").unwrap();
        assert_eq!(commas.number("0,125"), None);
        let message = commas.check(&[0, 1]).unwrap_err().to_string();
        assert!(message.contains("a.csv, line 3: has 3 cells where the heading has 2"), "{message}");
        // 1.000 may be a thousand there.
        let mixed = Table::parse("a;b\n0,125;3\n1.000;2\n", "a.csv").unwrap();
        let message = mixed.check(&[0, 1]).unwrap_err().to_string();
        assert!(message.contains("a.csv, line 3: has numbers with commas and with points"), "{message}");
    }
}
