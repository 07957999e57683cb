//! The findings of a check as a table.

use std::fmt::Write as _;

use tessuto::check::{Finding, Level};

use crate::{remedy, say};

/// Widest line [characters] where there is no terminal, and the least and the most that a terminal's width may make it.
const WIDTH: usize = 100;
const WIDTHS: [usize; 2] = [60, 140];
/// Widest topic that shares its line with what was found; places of errors are long paths.
const TOPIC: usize = 14;

/// Level and topic in columns, what was found and the way out beside them, wrapped.
pub fn table(findings: &[Finding]) -> String {
    let width = say::width().map_or(WIDTH, |width| width.clamp(WIDTHS[0], WIDTHS[1]));
    let colour = say::coloured();
    let mut text = String::new();
    for finding in findings {
        let (level, code) = match finding.level {
            Level::Ok => ("ok", 32),
            Level::Warning => ("warning", 33),
            Level::Error => ("error", 31),
        };
        let level = if colour { format!("\x1b[{code}m{level:<7}\x1b[0m") } else { format!("{level:<7}") };
        let _ = write!(text, "{level}  ");
        if finding.what.chars().count() > TOPIC {
            let _ = write!(text, "{}\n{:9}", finding.what, "");
        }
        let topic = if finding.what.chars().count() > TOPIC { "" } else { &finding.what };
        let _ = write!(text, "{topic:<TOPIC$}  ");
        wrap(&mut text, &finding.detail, width, TOPIC + 11);
        if let Some(hint) = &finding.hint {
            let _ = write!(text, "{:1$}hint: ", "", TOPIC + 11);
            wrap(&mut text, &remedy::hint(hint), width, TOPIC + 11);
        }
    }
    let count = |level| findings.iter().filter(|f| f.level == level).count();
    let _ = writeln!(
        text,
        "{} ok, {} warnings, {} errors",
        count(Level::Ok),
        count(Level::Warning),
        count(Level::Error)
    );
    text
}

/// `words` as the terminal's lines, the later ones indented; one line where there is no terminal.
pub fn wrapped(words: &str) -> String {
    let width = say::width().map_or(usize::MAX, |width| width.clamp(WIDTHS[0], WIDTHS[1]));
    let mut text = String::new();
    wrap(&mut text, words, width, 2);
    text.truncate(text.trim_end().len());
    text
}

/// Adds `words` after what stands in the last line of `text`, in lines of at most `width` characters, the later ones
/// indented by `indent`.
fn wrap(text: &mut String, words: &str, width: usize, indent: usize) {
    let escapes = |line: &str| line.matches('\x1b').count() / 2 * 9;
    let last = text.rsplit('\n').next().unwrap_or_default();
    let mut column = last.chars().count() - escapes(last);
    let mut first = true;
    for word in words.split_whitespace() {
        let length = word.chars().count();
        if !first && column + 1 + length > width {
            let _ = write!(text, "\n{:indent$}", "");
            column = indent;
        } else if !first {
            text.push(' ');
            column += 1;
        }
        text.push_str(word);
        column += length;
        first = false;
    }
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_where_the_terminal_does() {
        let words = "word ".repeat(60);
        for width in [60, 100] {
            let mut text = String::from("ok       scale           ");
            wrap(&mut text, &words, width, TOPIC + 11);
            assert!(text.lines().all(|line| line.chars().count() <= width), "{text}");
            assert!(text.lines().skip(1).all(|line| line.starts_with(&" ".repeat(TOPIC + 11))), "{text}");
            assert_eq!(text.matches("word").count(), 60);
        }
    }
}
