//! Arguments of `tessuto import`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::lens::Lens;
use crate::masks::Source;
use crate::threads::Threads;

/// Make a scene folder from a video or images and a camera, with masks or with the fabric's outline, and check it.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto import clip.mp4 scenes/towel --fov 63 \\
    --outline \"312,208 930,215 941,640 305,622\"
  tessuto import clip.mp4 scenes/curtain --masks masks.mp4 --fov 63 \\
    --template curtain.obj
  tessuto import frames/ scenes/flag --fps 25 --alpha \\
    --camera colmap/cameras.txt --downscale 2
  tessuto import clip.mov scenes/towel --masks masks/ \\
    --camera calibration.yml --frames 120..180
  tessuto import frames/ scenes/held --fps 30 --masks masks/ \\
    --camera scan/transforms.json --poses scan/transforms.json

  tessuto import left.mp4 scenes/stereo --masks left_masks/ \\
    --view right=right.mp4 --view-masks right=right_masks/ \\
    --rig camchain.yaml

  # a phone's recording with depth
  tessuto import capture/ scenes/scarf --masks masks/

  # afterwards, if there is no template yet
  tessuto template scenes/towel --flat 0.7x0.5m --from-mask

With --outline the masks are made from the clip, as by tessuto masks. Its corners are \
in pixels of the scene's first frame.

H.264 and HEVC in MP4, MOV and MKV need no other program. Other videos need ffmpeg, in \
the search path or named by TESSUTO_FFMPEG.

White in a mask is fabric. So is the opaque part of a cut-out, or the object chosen by \
--object. Masks pair with frames by name, else by number; a video of masks pairs frame \
by frame. Images named by their times give the frame rate.")]
pub struct Arguments {
    /// Video file, folder of PNG or JPEG images, or capture of Stray Scanner, Polycam or Record3D (.r3d): of that,
    /// camera, poses and depth are taken too, where no others are given.
    pub input: PathBuf,
    /// Scene folder to write.
    pub out: Option<PathBuf>,
    /// Masks: folder of images, or a video; white is fabric.
    #[arg(long, value_name = "PATH", conflicts_with_all = ["alpha", "outline"])]
    pub masks: Option<PathBuf>,
    /// Take the masks from the alpha channel of the images.
    #[arg(long, conflicts_with = "outline")]
    pub alpha: bool,
    #[command(flatten)]
    pub source: Source,
    /// Black is fabric in the masks.
    #[arg(long)]
    pub invert_masks: bool,
    /// The fabric in the first frame: OBJ, PLY or glTF, camera axes, metres, with uv.
    #[arg(long, value_name = "FILE")]
    pub template: Option<PathBuf>,
    /// Frames per second; required for images unless their names are times. A video of another rate is resampled.
    #[arg(long, value_name = "FPS", value_parser = crate::frames::per_second)]
    pub fps: Option<f64>,
    /// Frames per second at which the video was filmed; overrules its time stamps. For raw streams, which have
    /// none, and slow motion. Interlaced film: frames as stored, before each becomes two.
    #[arg(long, value_name = "FPS", value_parser = crate::frames::per_second)]
    pub rate: Option<f64>,
    /// Only frames A to B − 1 of the input.
    #[arg(long, value_name = "A..B", value_parser = crate::frames::parse)]
    pub frames: Option<std::ops::Range<usize>>,
    /// Use every N-th frame.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub stride: usize,
    /// Shrink frames by this integer factor.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub downscale: usize,
    /// Where the camera was, if it moved: COLMAP's images.txt or images.bin, transforms.json (nerfstudio), odometry.csv
    /// (Stray Scanner), metadata (Record3D), keyframes (Polycam), poses.json; or a folder that holds one.
    #[arg(long, value_name = "PATH")]
    pub poses: Option<PathBuf>,
    /// Refine these poses, or those of a capture or of further cameras, by what stands still around the fabric; needs
    /// masks. Those of --camera-motion colmap always are.
    #[arg(long, conflicts_with = "camera_motion")]
    pub refine_poses: bool,
    /// Find where the camera was, from what stands still around the fabric; needs masks.
    #[arg(long, value_enum, value_name = "HOW", conflicts_with = "poses")]
    pub camera_motion: Option<Motion>,
    /// Metres in one unit of the lengths of poses and rig; those of COLMAP have none, and it is found with the motion.
    #[arg(long, value_name = "METRES")]
    pub pose_scale: Option<f64>,
    /// Depth maps of the frames, aligned with them: a folder of them, or a capture of Stray Scanner or Polycam.
    #[arg(long, value_name = "PATH")]
    pub depths: Option<PathBuf>,
    /// Metres in one unit of the depth maps [default: mm of whole numbers, m of others].
    #[arg(long, value_name = "METRES", requires = "depths")]
    pub depth_scale: Option<f64>,
    /// A further camera that filmed the same moments: its name, and its video or folder of images.
    #[arg(long, value_name = "NAME=CLIP", value_parser = crate::values::named_path, help_heading = "Further cameras")]
    pub view: Vec<(String, PathBuf)>,
    /// Masks of a further camera: folder of images, or a video.
    #[arg(
        long, value_name = "NAME=PATH", value_parser = crate::values::named_path, help_heading = "Further cameras"
    )]
    pub view_masks: Vec<(String, PathBuf)>,
    /// Camera file of a further camera, where the rig does not have it.
    #[arg(
        long, value_name = "NAME=FILE", value_parser = crate::values::named_path, help_heading = "Further cameras"
    )]
    pub view_camera: Vec<(String, PathBuf)>,
    /// Where a further camera is, in the world of --poses, or of the first camera.
    #[arg(
        long, value_name = "NAME=PATH", value_parser = crate::values::named_path, help_heading = "Further cameras"
    )]
    pub view_poses: Vec<(String, PathBuf)>,
    /// How much later than the first camera a further one took its frames [s].
    #[arg(
        long, value_name = "NAME=S", value_parser = crate::values::named_number, help_heading = "Further cameras"
    )]
    pub view_late: Vec<(String, f64)>,
    /// How the cameras are fixed to each other, the first one's own clip first: OpenCV's stereo calibration (R, T; M1,
    /// D1, M2, D2), in one file or two, or Kalibr's camchain.
    #[arg(long, value_name = "FILE", help_heading = "Further cameras")]
    pub rig: Vec<PathBuf>,
    /// Treat numbered images with gaps as evenly spaced in time.
    #[arg(long)]
    pub allow_gaps: bool,
    /// Replace a scene by tessuto that was not changed since; keeps its template unless another is given.
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub threads: Threads,
    #[command(flatten)]
    pub lens: Lens,
}

/// What finds the camera's motion.
#[derive(Clone, Copy, ValueEnum)]
pub enum Motion {
    /// By the frames alone; also for a hand that hardly moves.
    Estimate,
    /// By COLMAP, `colmap` in the search path.
    Colmap,
}
