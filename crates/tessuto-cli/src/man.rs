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
        // Examples keep their lines; the next heading fills again.
        std::fs::write(page, text.replace(".SH EXTRA\n", ".SH NOTES\n.nf\n"))?;
    }
    Ok(())
}
