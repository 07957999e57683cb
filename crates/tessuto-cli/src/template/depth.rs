//! A template from a depth map.

use std::path::Path;

use tessuto::import::{Captured, read_depth};
use tessuto::io::scene::{CameraRecord, DepthRecord, TemplateKind, TemplateRecord};
use tessuto::template::depth;
use tessuto::{Camera, Error, Result};

use super::mesh::{corners, place_of};
use super::{Arguments, Made, View};
use crate::say::say;

/// A map is of another shape than the video if their proportions differ by more than this fraction.
const SKEW: f64 = 0.02;

/// A depth map of the first frame, with the camera in its pixels.
pub(super) struct Measured {
    pub captured: Captured,
    pub sensor: Camera,
    /// The camera that came with the map.
    pub record: Option<CameraRecord>,
}

/// The depth map at `path`; the camera that comes with it replaces the scene's.
pub(super) fn measured(arguments: &Arguments, view: &mut View, path: &Path) -> Result<Measured> {
    let mut captured = read_depth(path, arguments.depth_camera.as_deref(), arguments.depth_scale)?;
    let size = [view.camera.width, view.camera.height];
    let mut notes = Vec::new();
    let found = captured.calibration.take().map(|calibration| {
        let camera = calibration.scaled_to(size, &mut notes)?;
        Ok::<_, tessuto::Error>((camera, calibration.place))
    });
    let found = found.transpose()?;
    notes.iter().for_each(|note| say!("note: {note}"));
    let record = found.map(|(camera, place)| {
        let Camera { fx, fy, cx, cy, .. } = camera;
        say!(
            "camera of the depth map: fx {fx:.1}, fy {fy:.1}, centre ({cx:.1}, {cy:.1}); it is the scene's \
             from now on"
        );
        view.camera = camera;
        let name = Path::new(&place).file_name().unwrap_or_default().to_string_lossy().into_owned();
        CameraRecord { source: format!("of the depth map, {name}"), fx, fy, interval: None }
    });
    // The map shows what the video shows, at its own size.
    let map = &captured.map;
    let skew = (map.width * size[1]).abs_diff(map.height * size[0]) as f64 / (map.width * size[1]) as f64;
    if skew > SKEW {
        let problem = format!(
            "is {}×{} pixels, another shape than the video's {}×{}",
            map.width, map.height, size[0], size[1]
        );
        let hint = "give the map as the camera recorded it with the video: turned alike, and not cut";
        return Err(Error::input(captured.file.display().to_string(), problem, hint));
    }
    let sensor = view.camera.resized([map.width as u32, map.height as u32]);
    Ok(Measured { captured, sensor, record })
}

/// The fabric as the depth map at `path` has it; the camera that comes with the map replaces the scene's.
pub(super) fn from_depth(arguments: &Arguments, view: &mut View, path: &Path) -> Result<Made> {
    let Measured { captured, sensor, record } = measured(arguments, view, path)?;
    let map = &captured.map;
    let mask = view.mask.take();
    let place = place_of(mask.as_ref());
    let from = corners(arguments, mask.as_ref(), &place)?;
    let image = mask.as_ref().map(|(mask, _)| mask);
    let made = depth::from_depth(&view.camera, (map, &sensor), image, from, arguments.grid)?;
    say!("corners: {}", made.corners.map(|p| format!("{:.1},{:.1}", p.x, p.y)).join(" "));
    say!(
        "depth map of {}×{} px: noise {:.1} mm, {:.0} % of the fabric filled in",
        map.width,
        map.height,
        1e3 * made.noise,
        100.0 * made.filled
    );
    let unit = map.unit;
    if let Some(channel) = &map.channel {
        say!("depth is the channel {channel}");
    }
    match unit.told {
        true => say!("a unit of the depth map is {}", unit.name()),
        false => say!(
            "a unit of the depth map is assumed to be {}; --depth-scale METRES sets another one",
            unit.name()
        ),
    }
    if let Some(why) = unit.doubt(&made.mesh.positions) {
        say!("warning: {why}");
        say!("  hint: measure the fabric; say which it is with --depth-scale METRES");
    }
    let file = captured.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let record = TemplateRecord {
        corners: Some(made.corners.map(Into::into)),
        camera: record,
        depth: Some(DepthRecord {
            file,
            noise: made.noise,
            filled: made.filled,
            unit: Some(unit.metres),
            unit_told: unit.told,
        }),
        ..TemplateRecord::new(TemplateKind::Depth)
    };
    view.mask = mask;
    Ok(Made { mesh: made.mesh, record, misfit: None, table: None, raw: false })
}
