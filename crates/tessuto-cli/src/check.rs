//! `tessuto check`: what is right and wrong with a scene, before anything is computed.

use std::path::PathBuf;

/// Arguments of `tessuto check`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Scene folder (holds scene.json, template.obj, rgbs/, masks/).
    scene: PathBuf,
    /// Write the first frame with the template's edges and the mask's outline drawn over it to this PNG file.
    #[arg(long, value_name = "FILE.png")]
    picture: Option<PathBuf>,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let _ = &arguments.picture;
    anyhow::bail!("cannot check {} yet", arguments.scene.display())
}
