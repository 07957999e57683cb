//! `tessuto man`, of builds with the feature `man`.

use std::path::{Path, PathBuf};

use clap::CommandFactory as _;

use crate::say::say;

/// Write the manual pages, one of each command, for `man`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Folder to write to, such as man/man1; it must exist. Earlier pages in it are replaced.
    folder: PathBuf,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let folder = &arguments.folder;
    write(folder).map_err(|source| tessuto::Error::Output { path: folder.clone(), source })?;
    say!("manual pages are in {}", folder.display());
    Ok(())
}

fn write(folder: &Path) -> std::io::Result<()> {
    let command = crate::Arguments::command().disable_help_subcommand(true);
    let mut pages = vec!["tessuto.1".to_owned()];
    pages.extend(command.get_subcommands().map(|sub| format!("tessuto-{}.1", sub.get_name())));
    clap_mangen::generate_to(command, folder)?;
    for page in pages.iter().map(|name| folder.join(name)) {
        let text = std::fs::read_to_string(&page)?;
        std::fs::write(page, with_notes(&text))?;
    }
    Ok(())
}

/// A page whose notes keep the lines of examples and tables; paragraphs, which are one long line each, are filled.
fn with_notes(page: &str) -> String {
    let Some((before, notes)) = page.split_once(".SH EXTRA\n") else { return page.to_owned() };
    let end = notes.find("\n.SH ").map_or(notes.len(), |at| at + 1);
    let line = |line: &str| match line.len() > 80 && !line.starts_with(' ') {
        true => format!(".fi\n{line}\n.nf\n"),
        false => format!("{line}\n"),
    };
    let lines: String = notes[..end].lines().map(line).collect();
    format!("{before}.SH NOTES\n.nf\n{lines}.fi\n{}", &notes[end..])
}

#[cfg(test)]
mod tests {
    use super::with_notes;

    #[test]
    fn paragraphs_are_filled_and_examples_keep_their_lines() {
        let long = "word ".repeat(20);
        let page = format!("a\n.SH EXTRA\nExamples:\n  tessuto {long}\n\n{long}\n.SH VERSION\nv1\n");
        let expected = format!(
            "a\n.SH NOTES\n.nf\nExamples:\n  tessuto {long}\n\n.fi\n{long}\n.nf\n.fi\n.SH VERSION\nv1\n"
        );
        assert_eq!(with_notes(&page), expected);
        assert_eq!(with_notes("a\n"), "a\n");
    }
}
