//! `tessuto synth`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use tessuto::output::{FolderKind, OutputFolder};
use tessuto::synth::lattice::MeshKind;
use tessuto::synth::write::write;
use tessuto::synth::{Settings, make};

use crate::say::say;

/// Make a synthetic scene: a textured cloth in a gust of wind, with complete ground truth.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto synth scenes/cloth
  tessuto synth scenes/storm --wind 20 --frames 48 --seed 3
  tessuto synth scenes/canvas --grid 25x31 --size 640 --bend 1e-3")]
pub struct Arguments {
    /// Scene folder to write.
    out: PathBuf,
    /// Number of frames.
    #[arg(long, default_value_t = Settings::default().frames)]
    frames: usize,
    /// Width and height of the images [px].
    #[arg(long, value_name = "PX", default_value_t = Settings::default().size)]
    size: usize,
    /// Columns and rows of vertices.
    #[arg(long, value_name = "CxR", value_parser = crate::values::grid, default_value = "21x21")]
    grid: [usize; 2],
    /// Faces: a regular grid of quads, the same grid cut into triangles, or irregular triangles.
    #[arg(long, value_enum, default_value_t = Kind::Quads)]
    mesh: Kind,
    /// Strength of the gust [m/s²].
    #[arg(long, default_value_t = Settings::default().wind)]
    wind: f64,
    /// Stretch stiffness [N/m].
    #[arg(long, default_value_t = Settings::default().stretch)]
    stretch: f64,
    /// Bend stiffness [J/rad²].
    #[arg(long, default_value_t = Settings::default().bend)]
    bend: f64,
    /// Shear stiffness [J/rad²].
    #[arg(long, default_value_t = Settings::default().shear)]
    shear: f64,
    /// Darkening where the cloth turns away from the light, 0 to 1.
    #[arg(long, default_value_t = Settings::default().shading)]
    shading: f64,
    /// Frames per second.
    #[arg(long, default_value_t = Settings::default().fps)]
    fps: f64,
    /// Seed of texture, wind and mesh.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Replace a scene folder that tessuto wrote and nobody changed since.
    #[arg(long)]
    force: bool,
}

/// Kinds of meshes.
#[derive(Clone, Copy, ValueEnum)]
enum Kind {
    Quads,
    Triangles,
    Irregular,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let settings = Settings {
        frames: arguments.frames,
        fps: arguments.fps,
        size: arguments.size,
        grid: arguments.grid,
        mesh: match arguments.mesh {
            Kind::Quads => MeshKind::Quads,
            Kind::Triangles => MeshKind::Triangles,
            Kind::Irregular => MeshKind::Irregular,
        },
        wind: arguments.wind,
        stretch: arguments.stretch,
        bend: arguments.bend,
        shear: arguments.shear,
        shading: arguments.shading,
        seed: arguments.seed,
    };
    synth_into(&arguments.out, &settings, arguments.force)?;
    say!("{}", arguments.out.display());
    Ok(())
}

/// Makes the scene and writes it; `force` replaces an unchanged scene of tessuto's, never anything else.
pub fn synth_into(out: &Path, settings: &Settings, force: bool) -> tessuto::Result<()> {
    settings.validate()?;
    let output = OutputFolder::prepare(out, FolderKind::Scene, force)?;
    let scene = make(settings)?;
    write(output.partial(), &scene, settings)?;
    crate::say_kept(output.publish()?);
    Ok(())
}
