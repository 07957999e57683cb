//! The arguments of `tessuto synth`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use tessuto::synth::lattice::MeshKind;
use tessuto::synth::{Mover, Settings};

/// Strength of the gust where hands carry the cloth [m/s²]: their motion shall be seen.
const HANDS_WIND: f64 = 2.0;

/// On a table, where hands take their time.
const TABLE_FPS: f64 = 10.0;

/// Velocity of the wind, where it is one [m/s].
const AIR_WIND: f64 = 1.0;

/// Make a synthetic scene with complete ground truth: a textured cloth in a gust of wind, carried by hands, or paper.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto synth scenes/cloth
  tessuto synth scenes/storm --wind 20 --frames 48 --seed 3
  tessuto synth scenes/canvas --grid 25x31 --size 640 --bend 1e-3
  tessuto synth scenes/carried --hands --blur --fps 15
  tessuto synth scenes/sheet --paper --occluders
  tessuto synth scenes/table --table
  tessuto synth scenes/folded --fold --grid 25x25 --bend 1e-4
  tessuto synth scenes/lined --fold --two-sided
  tessuto synth scenes/held --orbit 25 --shake 5
  tessuto synth scenes/two --views 2 --apart 40

  # with the true physics, for evaluate to compare with
  tessuto synth scenes/physics --air --hands --frames 40")]
pub struct Arguments {
    /// Scene folder to write.
    pub out: PathBuf,
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
    /// Two hands carry, turn and shake the cloth; gt/physics.json names the vertices they hold.
    #[arg(long)]
    hands: bool,
    /// A flat sheet of paper, bent about turning axes without stretch; has no wind and no stiffness.
    #[arg(long, conflicts_with_all = ["hands", "wind", "stretch", "bend", "shear"])]
    paper: bool,
    /// It lies on a table, and two hands lift one side of it and lay it down; scene.json has the table.
    #[arg(long, conflicts_with_all = ["hands", "paper", "air", "wind"])]
    table: bool,
    /// On a table, the side is laid over the sheet.
    #[arg(long, conflicts_with_all = ["hands", "paper", "air", "wind"])]
    fold: bool,
    /// The other side of the cloth or paper has one colour; gt/back.json names it [#7a1f3d if not given].
    #[arg(long, value_name = "#RRGGBB", num_args = 0..=1, require_equals = true, default_missing_value = "#7a1f3d")]
    #[arg(value_parser = crate::values::colour)]
    two_sided: Option<[f32; 3]>,
    /// The wind is moving air that presses on the sheet, and gravity is tilted against the camera. The true
    /// physics is written to gt/physics.json, the same cloth in still air and ten times stiffer to gt/calm.npy and
    /// gt/stiffer.npy.
    #[arg(long, conflicts_with = "paper")]
    air: bool,
    /// Strength of the gust [m/s²], with --air of the wind [m/s] [default: 9, with --hands 2, with --air 1].
    #[arg(long)]
    wind: Option<f64>,
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
    /// Frames per second; the motion in time stays the same, but on a table it takes the whole clip [default: 50, with
    /// --table and --fold 10].
    #[arg(long)]
    fps: Option<f64>,
    /// Motion blur: how long the shutter is open, as a fraction of the time from frame to frame [0.5 if not given].
    #[arg(long, value_name = "FRACTION", num_args = 0..=1, require_equals = true, default_missing_value = "0.5")]
    blur: Option<f64>,
    /// Number of opaque things, each about a tenth of the cloth, that move in front of it [1 if not given]; masks
    /// exclude them.
    #[arg(long, value_name = "N", num_args = 0..=1, require_equals = true, default_missing_value = "1")]
    occluders: Option<usize>,
    /// Masks show the whole cloth, with what is hidden behind occluders.
    #[arg(long, requires = "occluders")]
    amodal: bool,
    /// The camera goes around the cloth by this angle, to its right; its poses are in poses.json [°].
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    orbit: f64,
    /// The camera is held in a hand that shakes by so much, and turns by 1° for each cm [mm].
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    shake: f64,
    /// This many cameras film the cloth; all but the first stand still.
    #[arg(long, value_name = "N", default_value_t = 1)]
    views: usize,
    /// Angle around the cloth from each camera to the next, to its right [°].
    #[arg(long, value_name = "DEG", default_value_t = 40.0, allow_negative_numbers = true)]
    apart: f64,
    /// The further cameras take their frames this much later than the first [ms].
    #[arg(long, value_name = "MS", default_value_t = 0.0)]
    late: f64,
    /// A depth sensor beside the camera measures the cloth with this noise [% of the depth].
    #[arg(long, value_name = "PERCENT", default_value_t = 0.0)]
    depth_noise: f64,
    /// Show a room around the cloth, with the sensor's noise, in place of black.
    #[arg(long)]
    surroundings: bool,
    /// Seed of texture, wind, mesh and all that is drawn at random.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Replace a scene folder by tessuto that was not changed since.
    #[arg(long)]
    pub force: bool,
}

/// Kinds of meshes.
#[derive(Clone, Copy, ValueEnum)]
enum Kind {
    Quads,
    Triangles,
    Irregular,
}

impl Arguments {
    /// Writes what was asked for into `s`.
    pub fn put_into(&self, s: &mut Settings) {
        s.frames = self.frames;
        let table = self.table || self.fold;
        s.fps = self.fps.unwrap_or(if table { TABLE_FPS } else { s.fps });
        s.size = self.size;
        s.grid = self.grid;
        s.mesh = match self.mesh {
            Kind::Quads => MeshKind::Quads,
            Kind::Triangles => MeshKind::Triangles,
            Kind::Irregular => MeshKind::Irregular,
        };
        s.wind = self.wind.unwrap_or(match (self.air, self.hands) {
            (true, _) => AIR_WIND,
            (_, true) => HANDS_WIND,
            _ => s.wind,
        });
        s.air = self.air;
        s.stretch = self.stretch;
        s.bend = self.bend;
        s.shear = self.shear;
        s.shading = self.shading;
        s.seed = self.seed;
        s.mover = match (self.hands, self.paper, table) {
            (true, ..) => Mover::Hands,
            (_, true, _) => Mover::Paper,
            (.., true) => Mover::Table,
            _ => Mover::Wind,
        };
        s.fold = self.fold;
        s.back = self.two_sided;
        s.occluders = self.occluders.unwrap_or(0);
        s.amodal = self.amodal;
        s.blur = self.blur.unwrap_or(0.0);
        s.depth_noise = 0.01 * self.depth_noise;
        s.surroundings = self.surroundings;
        (s.orbit, s.shake) = (self.orbit, 1e-3 * self.shake);
        (s.views, s.apart) = (self.views, if self.views > 1 { self.apart } else { 0.0 });
        s.late = 1e-3 * self.late;
    }
}
