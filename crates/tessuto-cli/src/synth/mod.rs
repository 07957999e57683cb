//! `tessuto synth`.

mod arguments;

use std::path::Path;

use tessuto::output::{FolderKind, OutputFolder};
use tessuto::synth::write::write;
use tessuto::synth::{Settings, film};

use crate::say::say;
pub use arguments::Arguments;

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let settings = Settings::default().with(|s| arguments.put_into(s));
    synth_into(&arguments.out, &settings, arguments.force)?;
    say!("{}", arguments.out.display());
    Ok(())
}

/// Makes the scene and writes it; `force` replaces an unchanged scene of tessuto's, never anything else.
pub fn synth_into(out: &Path, settings: &Settings, force: bool) -> tessuto::Result<()> {
    settings.validate()?;
    let output = OutputFolder::prepare(out, FolderKind::Scene, force)?;
    let scene = film(settings)?;
    write(output.partial(), &scene, settings)?;
    crate::say_kept(output.publish()?);
    Ok(())
}
