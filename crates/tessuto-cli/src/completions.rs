//! `tessuto completions`.

use clap::CommandFactory as _;
use clap_complete::Shell;

use crate::say;

/// Print a script with which a shell completes commands and options at the Tab key.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tessuto completions bash > ~/.local/share/bash-completion/completions/tessuto
  tessuto completions zsh > ~/.zfunc/_tessuto
  tessuto completions fish > ~/.config/fish/completions/tessuto.fish")]
pub struct Arguments {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut crate::Arguments::command(), "tessuto", &mut script);
    say::output(format_args!("{}", String::from_utf8(script)?));
    Ok(())
}
