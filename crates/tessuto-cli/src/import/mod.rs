//! `tessuto import`.

mod arguments;
mod views;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use tessuto::Error;
use tessuto::import::{
    CARRIED_OVER, CameraMotion, Masks, Settings, check_target, copy_template, expect_files, import,
    read_capture, read_path, read_rig,
};
use tessuto::masks::{EmptyPlace, Request};
use tessuto::output::{FolderKind, OutputFolder};
use tessuto::text::quoted;

pub use arguments::Arguments;
use arguments::Motion;

use crate::ffmpeg::ffmpeg;
use crate::masks::make_masks;
use crate::say::say;

/// Runs the command: writes the scene, prints what was changed and what `check` finds.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.threads.start()?;
    let Some(out) = &arguments.out else { return Err(without_scene(&arguments.input).into()) };
    expect_files(&[
        Some(&arguments.input),
        arguments.masks.as_deref(),
        arguments.template.as_deref(),
        arguments.source.plate.as_deref(),
    ])?;
    check_target(
        out,
        arguments.force,
        [
            Some(&arguments.input),
            arguments.masks.as_ref(),
            arguments.template.as_ref(),
            arguments.source.plate.as_ref(),
        ],
    )?;
    let kept = Some(out.join("template.obj")).filter(|kept| arguments.template.is_none() && kept.is_file());
    let rig = (!arguments.rig.is_empty()).then(|| read_rig(&arguments.rig)).transpose()?;
    let capture = read_capture(&arguments.input)?;
    let input = capture.as_ref().map_or(&arguments.input, |capture| &capture.clip);
    let recorded =
        capture.as_ref().map(|capture| &capture.poses).filter(|_| arguments.camera_motion.is_none());
    let in_rig = rig.as_ref().and_then(|rig| rig.cameras[0].clone());
    let mut settings = Settings {
        input: input.clone(),
        masks: match &arguments.masks {
            Some(path) => Masks::Path(path.clone()),
            None if arguments.alpha => Masks::Alpha,
            None => Masks::Later,
        },
        plate: arguments.source.plate.clone(),
        object: arguments.source.choice.object,
        invert_masks: arguments.invert_masks,
        largest_piece: arguments.source.largest_piece,
        calibration: match in_rig.or_else(|| capture.as_ref()?.calibration.clone()) {
            Some(found) if !arguments.lens.is_given() => found,
            _ => arguments.lens.calibration_of(input)?,
        },
        poses: arguments.poses.as_ref().or(recorded).map(|path| read_path(path)).transpose()?,
        refine_poses: arguments.refine_poses,
        camera_motion: arguments.camera_motion.map(|motion| match motion {
            Motion::Estimate => CameraMotion::Estimate,
            Motion::Colmap => CameraMotion::Colmap(PathBuf::from("colmap")),
        }),
        pose_scale: arguments.pose_scale,
        depths: arguments.depths.clone().or_else(|| capture.as_ref()?.depths.clone()),
        depth_scale: arguments.depth_scale,
        fps: arguments.fps.or(capture.as_ref().and_then(|capture| capture.fps)),
        rate: arguments.rate,
        frames: arguments.frames.clone(),
        stride: arguments.stride,
        downscale: arguments.downscale,
        allow_gaps: arguments.allow_gaps,
        template: arguments.template.clone().or_else(|| kept.clone()),
        ffmpeg: ffmpeg(),
        views: Vec::new(),
    };
    settings.views = views::asked(arguments, rig.as_ref(), &settings)?;
    if arguments.refine_poses
        && settings.poses.is_none()
        && !settings.views.iter().any(|v| v.settings.refine_poses)
    {
        let hint = "add --poses PATH, or have them found: --camera-motion estimate";
        return Err(Error::usage("no poses are given that could be refined", hint).into());
    }
    let name = out.canonicalize().unwrap_or_else(|_| out.clone());
    let name = name.file_name().map_or_else(|| "scene".to_owned(), |n| n.to_string_lossy().into_owned());
    let carried_over: &[&str] = if kept.is_some() { &CARRIED_OVER } else { &[] };
    let output = OutputFolder::prepare_keeping(out, FolderKind::Scene, arguments.force, carried_over)?;
    let imported = {
        let (bar, count) = (crate::progress::spinner(), AtomicUsize::new(0));
        import(&settings, &name, output.partial(), &|written| {
            let count = count.fetch_add(1, Ordering::Relaxed) + 1;
            bar.set_message(format!("{count} files, {written}"));
        })?
    };
    if let Some(kept) = &kept {
        copy_template(kept, output.partial())?;
    }
    if arguments.source.outline.is_some() {
        let plate = output.partial().join("plate.png");
        let plate = arguments.source.plate.is_some().then_some(EmptyPlace::File(plate));
        make_masks(output.partial(), out, &Request { plate, ..arguments.source.request() })?;
    }
    crate::say_kept(output.publish()?);
    if let Some(capture) = &capture {
        let more = if capture.depths.is_some() { ", poses and depth" } else { " and poses" };
        say!("note: a capture of {}: its camera{more} are taken", capture.app);
    }
    imported.notes.iter().for_each(|note| say!("note: {note}"));
    say!(
        "{}: {} frames of {}×{} px, {} per second",
        out.display(),
        imported.frames,
        imported.camera.width,
        imported.camera.height,
        (imported.fps * 1e4).round() / 1e4
    );
    if settings.masks == Masks::Later && arguments.source.outline.is_none() {
        say!("next: masks, from the fabric's corners in the first frame:");
        say!("  {}", crate::remedy::make_masks(&quoted(out)));
        return Ok(());
    }
    if settings.template.is_some() {
        return crate::check::check(out, None);
    }
    crate::check::check_without_template(out)
}

/// The answer to a clip without a name for its scene: the finished commands.
fn without_scene(input: &Path) -> Error {
    let stem = input.file_stem().unwrap_or(input.as_os_str());
    let [studio, import] = crate::remedy::import(&quoted(input), &quoted(&Path::new("scenes").join(stem)));
    Error::usage(
        "the folder of the scene is not named",
        format!("{import}, with what you know of the camera; or by clicks: {studio}"),
    )
}
