//! Arguments of `tessuto template`.

use std::path::PathBuf;

use clap::Args;
use tessuto::template::remesh::Resolution;

use crate::lens::Lens;
use crate::masks::Choice;
use crate::values::{self, Pair, Tilt};

/// Make or repair the template, the mesh of the fabric in the first frame.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto template scenes/towel --flat 70x50cm --from-mask
  tessuto template scenes/towel --flat 0.7x0.5m \\
    --corners 312,208 930,215 941,640 305,622 --camera estimate

  # depth of Stray Scanner or Polycam, or a depth map
  tessuto template scenes/flag --depth capture/ --from-mask
  tessuto template scenes/flag --depth first.png --depth-scale 0.00025 \\
    --from-mask

  # a garment that lies on a table, and a sheet of paper beside it
  tessuto template scenes/shirt --on-table --paper A4 \\
    --paper-corners 812,410 1020,402 1051,551 829,562

  # any mesh: as a grid, as triangles, with other axes and units
  tessuto template scenes/flag --remesh 32 --from flag.glb
  tessuto template scenes/flag --remesh 400 --irregular --force
  tessuto template scenes/flag --flip yz --scale 0.001 --force

  # for an image, without a scene
  tessuto template first.png --mask mask.png --fov 63 --flat 70x50cm \\
    --from-mask --out towel.obj

The size is width along the upper side times height, measured on the fabric laid flat. \
Corners are clockwise from the upper left as seen in the image. tessuto check SCENE \
--picture check.png shows the template on the first frame.")]
pub struct Arguments {
    /// Scene folder; or an image of the fabric, with --mask, a camera and --out.
    pub target: PathBuf,
    /// A flat or nearly flat rectangle of this size, such as 0.7x0.5m, 70x50cm or 700x500mm.
    #[arg(long, value_name = "WxH", value_parser = values::lengths,
          conflicts_with_all = ["remesh", "from", "scale", "flip", "swap", "weld"])]
    pub flat: Option<Pair>,
    /// A depth map of the first frame: PNG of 16 bits in mm, .npy or OpenEXR (channel Z, depth, V, Y or the only one)
    /// in m; or a capture folder of Stray Scanner or of Polycam's raw data, with its camera.
    #[arg(long, value_name = "FILE|DIR",
          conflicts_with_all = ["flat", "remesh", "from", "scale", "flip", "swap", "weld"])]
    pub depth: Option<PathBuf>,
    /// Unit of the depth map [m]: 0.00025 for a RealSense L515, 0.0001 for a D405, 0.0002 for TUM RGB-D
    /// [default: 0.001 for integers, else 1].
    #[arg(long, value_name = "METRES", value_parser = values::positive, allow_negative_numbers = true,
          requires = "depth", conflicts_with_all = ["flat", "remesh", "from", "scale", "flip", "swap", "weld"])]
    pub depth_scale: Option<f64>,
    /// The camera of the colour images recorded with the depth map (JSON as apps write it) [default: the scene's].
    #[arg(long, value_name = "FILE", requires = "depth",
          conflicts_with_all = ["flat", "remesh", "from", "scale", "flip", "swap", "weld"])]
    pub depth_camera: Option<PathBuf>,
    /// Where its corners are in the first frame [px].
    #[arg(long, value_name = "X,Y X,Y X,Y X,Y", value_parser = values::corners, allow_hyphen_values = true)]
    pub corners: Option<[Pair; 4]>,
    /// Find the corners in the mask of the first frame, and let the sides follow the mask's outline.
    #[arg(long, conflicts_with = "corners")]
    pub from_mask: bool,
    /// Keep the sides straight between the corners.
    #[arg(long)]
    pub straight: bool,
    /// Vertices along the longer side, or columns x rows.
    #[arg(long, value_name = "N|CxR", value_parser = values::resolution, default_value = "32")]
    pub grid: Resolution,
    /// Re-sample a mesh as a regular grid of quads: vertices along the longer side, or columns x rows.
    #[arg(long, value_name = "N|CxR", value_parser = values::resolution)]
    pub remesh: Option<Resolution>,
    /// Re-sample it as irregular triangles instead; --remesh then gives the number of vertices, such as 400.
    #[arg(long, requires = "remesh")]
    pub irregular: bool,
    /// The mesh to start from: OBJ, PLY or glTF [default: the scene's template.obj].
    #[arg(long, value_name = "FILE")]
    pub from: Option<PathBuf>,
    /// Multiply all coordinates, e.g. 0.001 for millimetres.
    #[arg(long, value_name = "FACTOR")]
    pub scale: Option<f64>,
    /// Negate these coordinates, such as yz.
    #[arg(long, value_name = "AXES", value_parser = values::axes)]
    pub flip: Option<[bool; 3]>,
    /// Swap two coordinates before --flip, such as xy.
    #[arg(long, value_name = "AXES", value_parser = values::axes)]
    pub swap: Option<[bool; 3]>,
    /// Merge vertices that lie at the same place, or within this part of the mesh's size.
    #[arg(long, value_name = "PART", value_parser = values::part, num_args = 0..=1, require_equals = true,
          default_missing_value = "1e-6")]
    pub weld: Option<f64>,
    /// Mask of the image, where the first argument is an image.
    #[arg(long, value_name = "FILE")]
    pub mask: Option<PathBuf>,
    #[command(flatten)]
    pub table: Table,
    #[command(flatten)]
    pub choice: Choice,
    /// File to write [default: the scene's template.obj].
    #[arg(long, value_name = "FILE.obj")]
    pub out: Option<PathBuf>,
    /// Replace an existing file; one that tessuto did not write is kept under another name.
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub lens: Lens,
}

/// A garment or cloth of any outline, on a table.
#[derive(Args)]
#[command(next_help_heading = "On a table")]
pub struct Table {
    /// The fabric lies flat on a table: a mesh of triangles from the outline and the holes of the first mask. The plane
    /// of the table comes from --paper, --plane, --distance, or else from --depth or the scene's own depth maps. Layers
    /// that lie on one another are treated as one sheet. With --flat the rectangle lies there. Either way scene.json
    /// gets the plane, behind which nothing is found.
    #[arg(long, conflicts_with_all = ["remesh", "irregular", "from", "scale", "flip", "swap", "weld"])]
    pub on_table: bool,
    /// A sheet of paper lies on the table: A3, A4, A5, letter, legal, tabloid or WxH, such as 210x297mm.
    #[arg(long, value_name = "SIZE", value_parser = values::paper, requires = "on_table", requires = "paper_corners",
          conflicts_with_all = ["plane", "distance", "depth", "flat"])]
    pub paper: Option<Pair>,
    /// Where the paper's corners are in the first frame [px], in any order.
    #[arg(long, value_name = "X,Y X,Y X,Y X,Y", value_parser = values::corners, allow_hyphen_values = true,
          requires = "paper")]
    pub paper_corners: Option<[Pair; 4]>,
    /// The plane of the table: a point in the scene's unit and the normal, in the camera's frame of the first frame (x
    /// right, y down, z forward).
    #[arg(long, value_name = "X,Y,Z,NX,NY,NZ", value_parser = values::plane, allow_hyphen_values = true,
          requires = "on_table", conflicts_with_all = ["distance", "depth", "flat"])]
    pub plane: Option<[f64; 6]>,
    /// A distance measured on the table, such as 62cm, between the points of --between.
    #[arg(long, value_name = "LENGTH", value_parser = values::length, requires = "on_table", requires = "between",
          requires = "tilt", conflicts_with_all = ["depth", "flat"])]
    pub distance: Option<f64>,
    /// Two points on the table in the first frame [px].
    #[arg(long, value_name = "X,Y X,Y", value_parser = values::two_points, allow_hyphen_values = true,
          requires = "distance")]
    pub between: Option<[Pair; 2]>,
    /// How the table is tilted: level (scene.json knows gravity), facing (the camera looks straight down on it), or its
    /// normal in the camera's frame.
    #[arg(long, value_name = "level|facing|X,Y,Z", value_parser = values::tilt, allow_hyphen_values = true,
          requires = "distance")]
    pub tilt: Option<Tilt>,
    /// Length of a triangle's side, such as 20mm [default: by --grid, vertices along the longer side].
    #[arg(long, value_name = "LENGTH", value_parser = values::length, requires = "on_table", conflicts_with = "flat")]
    pub side: Option<f64>,
}
