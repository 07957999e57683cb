//! A video of rendered frames.

use std::path::Path;
use std::process::{Command, Stdio};

/// `frame_*.png` in `folder` to `video.mp4`, by the program ffmpeg.
pub fn encode(folder: &Path, first: usize, fps: f64) -> Result<(), String> {
    let status = Command::new(crate::ffmpeg::ffmpeg())
        .current_dir(folder)
        .args(["-v", "error", "-y", "-framerate", &fps.to_string(), "-start_number", &first.to_string()])
        .args(["-i", "frame_%03d.png"])
        // H.264 wants even sides.
        .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "video.mp4"])
        .stdin(Stdio::null())
        .status();
    match status {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("ffmpeg ended with {status}")),
        Err(_) => Err("the program ffmpeg is not installed; TESSUTO_FFMPEG may name it".to_owned()),
    }
}
