//! A clip as a person films it, made up, to try the whole way with.

use std::path::Path;
use std::process::{Command, Stdio};

use tessuto::io::image::write_png;
use tessuto::output::{FolderKind, OutputFolder};
use tessuto::synth::{Mover, SHEET, Settings, filmed, make as make_scene};
use tessuto::text::quoted;
use tessuto::{Camera, Error, Mesh};

use crate::say::say;

/// The clip of `seed`, in the new `folder`.
pub fn make(folder: &Path, seed: u64) -> anyhow::Result<()> {
    let settings = Settings::default().with(|s| {
        (s.mover, s.frames, s.size, s.seed) = (Mover::Paper, 30, 480, seed);
    });
    let output = OutputFolder::prepare(folder, FolderKind::Export, false)?;
    let scene = make_scene(&settings)?;
    let frames = output.partial().join("frames");
    std::fs::create_dir_all(&frames).map_err(|source| Error::Output { path: frames.clone(), source })?;
    for (n, image) in filmed(&scene, seed)?.iter().enumerate() {
        write_png(&frames.join(format!("frame_{n:03}.png")), image)?;
    }
    let input = match encode(output.partial(), settings.fps, &scene.camera) {
        Ok(()) => {
            std::fs::remove_dir_all(&frames).map_err(|source| Error::Output { path: frames, source })?;
            "clip.mp4"
        }
        Err(problem) => {
            say!("note: no video, its frames instead: {problem}");
            "frames"
        }
    };
    let fps = settings.fps;
    let text = readme(input, fps, &scene.camera, corners(&scene.template, &scene.camera, settings.grid));
    let path = output.partial().join("README.md");
    std::fs::write(&path, &text).map_err(|source| Error::Output { path, source })?;
    crate::say_kept(output.publish()?);
    say!("{text}");
    say!("next: tessuto studio {}", quoted(&folder.join(input)));
    Ok(())
}

/// Where the corners of the sheet are in the first frame `[px]`, clockwise from the upper left.
fn corners(mesh: &Mesh, camera: &Camera, [columns, rows]: [usize; 2]) -> [[f64; 2]; 4] {
    let last = columns * rows - 1;
    [0, columns - 1, last, last + 1 - columns].map(|v| {
        let p = camera.project(mesh.positions[v]);
        [p.x, p.y]
    })
}

/// `frames/frame_*.png` to `clip.mp4` as a phone writes it, with its focal length in 35 mm terms.
fn encode(folder: &Path, fps: f64, camera: &Camera) -> std::result::Result<(), String> {
    let diagonal = (camera.width as f64).hypot(camera.height as f64);
    let film = camera.fx * 36f64.hypot(24.0) / diagonal;
    let status = Command::new(crate::ffmpeg::ffmpeg())
        .current_dir(folder)
        .args(["-v", "error", "-nostdin", "-framerate", &fps.to_string(), "-i", "frames/frame_%03d.png"])
        .args(["-c:v", "libx264", "-crf", "20", "-pix_fmt", "yuv420p", "-movflags", "use_metadata_tags"])
        .args([
            "-metadata",
            &format!("com.apple.quicktime.camera.focal_length.35mm_equivalent={film:.0}"),
            "clip.mp4",
        ])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    match status {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("ffmpeg ended with {status}")),
        Err(_) => Err("the program ffmpeg is not installed; TESSUTO_FFMPEG may name it".to_owned()),
    }
}

fn readme(input: &str, fps: f64, camera: &Camera, corners: [[f64; 2]; 4]) -> String {
    let points = corners.map(|[x, y]| format!("{x:.0},{y:.0}"));
    let (cm, spaced) = (SHEET * 100.0, points.join(" "));
    // Images have no rate of their own.
    let rate = if input == "frames" { format!(" --fps {fps}") } else { String::new() };
    format!(
        "# A made-up clip\n\n\
         A patterned sheet that bends in front of a wall, with sensor noise{}: to try the whole way with, \
         from a phone's video to a mesh.\n\n\
         - Size of the sheet: {:.0} × {:.0} cm\n\
         - Corners in frame 0, clockwise from the upper left (column, row): {spaced}\n\
         - Camera: focal length {:.0} px, {}×{} px, {fps} frames a second{}\n\n\
         ```sh\n\
         tessuto import {input} scene --outline \"{spaced}\" --fx {:.0}{rate}\n\
         tessuto template scene --flat {:.0}x{:.0}cm --corners {spaced}\n\
         tessuto check scene --picture check.png\n\
         tessuto reconstruct scene --out result\n\
         ```\n",
        if input == "frames" { "" } else { " and H.264 compression" },
        cm.x,
        cm.y,
        camera.fx,
        camera.width,
        camera.height,
        if input == "frames" {
            ""
        } else {
            "; the file says it, too, as phones do, rounded to a millimetre in 35 mm terms"
        },
        camera.fx,
        cm.x,
        cm.y,
    )
}
