//! The measurements of a check, one function per topic.

use std::borrow::Cow;

use super::masks::{self, MaskShape};
use super::{Finding, Level, outline, repeats};
use tessuto_core::error::{Hint, Remedy, Repair, Result, Warning};
use tessuto_core::image::Image;
use tessuto_core::mesh::diagonal;
use tessuto_core::scene::Scene;
use tessuto_core::video::Frame;
use tessuto_estimate::io::depth_unit::Unit;
use tessuto_estimate::io::scene::template::DIAGONAL;
use tessuto_estimate::io::scene::{TemplateRecord, template_misfit};
use tessuto_estimate::template::gate::{MISFIT, NEAREST};
use tessuto_render::raster::coverage::{VARIANT_GAIN, axis_variants, best_variant, fill_triangle};

/// Columns and rows of the raster on which overlapping uv is measured.
const UV_RASTER: usize = 512;

/// Findings about frames, masks, camera and truth.
///
/// # Errors
/// Those of reading the frames.
pub(super) fn of_video(scene: &Scene) -> Result<Vec<Finding>> {
    let looked_at = scene.frames.map(0..scene.frames.len(), || None, |last, n| Glance::at(scene, n, last))?;
    let shapes: Vec<MaskShape> = looked_at.iter().map(|glance| glance.mask).collect();
    let rest = [motion(scene, &looked_at), intrinsics(scene), truth(scene)];
    Ok(std::iter::once(frames(scene)).chain(masks::findings(scene, &shapes)).chain(rest).collect())
}

/// What is kept of a frame to compare it with others.
struct Glance {
    mask: MaskShape,
    /// Whether it shows what the frame before shows.
    repeats: bool,
    /// How much it differs from it.
    change: Option<f64>,
}

impl Glance {
    /// Of frame `n`; `last` holds the frame that was looked at before, and then this one.
    fn at<'a>(scene: &'a Scene, n: usize, last: &mut Option<(usize, Cow<'a, Frame>)>) -> Result<Self> {
        let frame = scene.frames.frame(n)?;
        let before = match last.take() {
            Some((number, before)) if number + 1 == n => Some(before),
            _ => n.checked_sub(1).map(|before| scene.frames.frame(before)).transpose()?,
        };
        let mask = MaskShape::of(&frame.mask);
        let repeats = before.as_ref().is_some_and(|before| repeats::is_repeated(before, &frame));
        let change = before.and_then(|before| repeats::difference(&before, &frame));
        *last = Some((n, frame));
        Ok(Self { mask, repeats, change })
    }
}

/// Findings about the template, which covers the pixels `covered`; `mask` is that of the first frame, `iou` their
/// overlap.
pub(super) fn of_template(scene: &Scene, mask: &Image, covered: &[bool], iou: f64) -> Vec<Finding> {
    let rows = vec![
        scale(scene),
        template_overlap(scene, iou),
        outline::finding(scene, covered, mask),
        orientation(scene, mask, iou),
        uv(scene),
    ];
    origin(scene, mask).into_iter().chain(rows).collect()
}

/// What is known of the template's making. Loading doubts a rectangle that does not fit.
fn origin(scene: &Scene, mask: &Image) -> Option<Finding> {
    let size = (mask.data.iter().filter(|m| **m >= 0.5).count().max(1) as f64).sqrt();
    let misfit = template_misfit(&scene.folder.join("template.obj"));
    if let Some(off) = misfit.filter(|off| *off > MISFIT * size) {
        let detail = format!(
            "made of a rectangle that is off by {off:.1} px, {:.0} % of the fabric's size: it is not the fabric's",
            100.0 * off / size
        );
        let hint = "make it anew, of the fabric's own corners and size";
        return Some(Finding {
            level: Level::Error,
            what: "rectangle".into(),
            detail,
            hint: Some(hint.into()),
        });
    }
    let record = TemplateRecord::read(&scene.folder);
    let known = record.as_ref().map(TemplateRecord::sentence);
    let bent = misfit
        .map(|off| format!("no plane rectangle has the corners seen, but one is off by {off:.1} px only"));
    let told: Vec<String> = known.into_iter().chain(bent).collect();
    (!told.is_empty()).then(|| ok("template", told.join("; ")))
}

/// The findings and what loading already doubted, which replaces the good word on the same topic.
pub(super) fn with_warnings(mut findings: Vec<Finding>, warnings: &[Warning]) -> Vec<Finding> {
    let warnings: Vec<Finding> = warnings.iter().map(from_warning).collect();
    findings.retain(|f| f.level != Level::Ok || warnings.iter().all(|w| w.what != f.what));
    findings.extend(warnings);
    findings
}

pub(super) fn ok(what: &str, detail: String) -> Finding {
    Finding { level: Level::Ok, what: what.into(), detail, hint: None }
}

pub(super) fn doubt(what: &str, detail: String, hint: impl Into<Hint>) -> Finding {
    Finding { level: Level::Warning, what: what.into(), detail, hint: Some(hint.into()) }
}

fn from_warning(warning: &Warning) -> Finding {
    let Warning { topic, found, hint } = warning.clone();
    Finding { level: Level::Warning, what: topic, detail: found, hint }
}

fn frames(scene: &Scene) -> Finding {
    let n = scene.frames.len();
    let detail = format!(
        "{n} from frame {}, {}×{} pixels, crop {}×{} at ({}, {}), {} per second",
        scene.first_frame,
        scene.full_size[0],
        scene.full_size[1],
        scene.crop.width(),
        scene.crop.height(),
        scene.crop.x0,
        scene.crop.y0,
        scene.fps
    );
    if n == 1 {
        doubt("frames", detail, "one frame shows no motion; only its look can be found")
    } else {
        ok("frames", detail)
    }
}

fn motion(scene: &Scene, looked_at: &[Glance]) -> Finding {
    let repeats: Vec<usize> = (0..looked_at.len()).filter(|n| looked_at[*n].repeats).collect();
    match repeats.first() {
        Some(n) => {
            let frame = scene.first_frame + n;
            let detail = format!("{} frames repeat the one before, first frame {frame}", repeats.len());
            doubt("motion", detail, "remove repeated frames and correct fps, or the fabric stops and jumps")
        }
        None => copies(scene, looked_at),
    }
}

/// What compression left of copies.
fn copies(scene: &Scene, looked_at: &[Glance]) -> Finding {
    let changes: Vec<Option<f64>> = looked_at.iter().map(|glance| glance.change).collect();
    let Some(found) = repeats::copies(&changes) else {
        return ok("motion", "no frame repeats the one before".into());
    };
    let (count, every, first) = (found.count, found.every, scene.first_frame + found.first);
    let detail = format!(
        "{count} frames hardly differ from the one before, every {every} frames from frame {first}: copies, \
         as of film whose rate was raised"
    );
    let hint = match every {
        2 => "import every second frame (stride 2), at half the rate, or the film as the camera wrote it",
        _ => {
            "import the film as the camera wrote it, or at its own rate: copies make the fabric stop and jump"
        }
    };
    doubt("motion", detail, hint)
}

fn intrinsics(scene: &Scene) -> Finding {
    let (camera, width) = (&scene.camera, scene.full_size[0] as f64);
    let angle = 2.0 * (width / (2.0 * camera.fx)).atan().to_degrees();
    let (cx, cy) = (camera.cx + scene.crop.x0 as f64, camera.cy + scene.crop.y0 as f64);
    ok(
        "intrinsics",
        format!("fx {:.1}, fy {:.1}, centre ({cx:.1}, {cy:.1}), {angle:.0}° wide", camera.fx, camera.fy),
    )
}

fn scale(scene: &Scene) -> Finding {
    let (mesh, view) = (&scene.template, scene.viewpoint(0));
    let edges = mesh.edges();
    let length = |e: &[u32; 2]| mesh.positions[e[0] as usize].distance(mesh.positions[e[1] as usize]);
    let mean = edges.iter().map(length).sum::<f64>() / edges.len() as f64;
    let depths = || mesh.positions.iter().map(|p| view.depth(*p));
    let nearest = depths().fold(f64::INFINITY, f64::min);
    let finding = ok(
        "scale",
        format!(
            "diagonal {:.3} m, area {:.3} m², {} vertices, {} edges of {:.1} mm on average, depth {:.2} to {:.2} m",
            diagonal(&mesh.positions),
            mesh.area(),
            mesh.positions.len(),
            edges.len(),
            mean * 1000.0,
            nearest,
            depths().fold(f64::NEG_INFINITY, f64::max)
        ),
    );
    if nearest >= NEAREST {
        return match doubtful_unit(scene) {
            None => finding,
            Some(why) => doubt("scale", format!("{why}; {}", finding.detail), unit_hint()),
        };
    }
    let detail = format!(
        "the template's nearest vertex is {:.0} mm from the camera; {}",
        1e3 * nearest,
        finding.detail
    );
    let hint =
        "nothing is filmed from so near: give the template in metres, and take no floor or table into it";
    Finding { level: Level::Error, detail, hint: Some(hint.into()), ..finding }
}

/// Why the unit of the depth map that the template was made of may be another.
fn doubtful_unit(scene: &Scene) -> Option<String> {
    let depth = TemplateRecord::read(&scene.folder)?.depth?;
    let unit = Unit { metres: depth.unit?, told: depth.unit_told };
    unit.doubt(&scene.template.positions)
}

fn unit_hint() -> Hint {
    Hint::from("measure the fabric, and say what a unit of the depth map is").with(Remedy::DepthScale)
}

/// Loading refuses a template that lies beside the mask, and doubts one that lies badly on it.
fn template_overlap(scene: &Scene, iou: f64) -> Finding {
    ok(
        "overlap",
        format!("template and mask of frame {}: {iou:.3} (intersection over union)", scene.first_frame),
    )
}

fn orientation(scene: &Scene, mask: &Image, own: f64) -> Finding {
    let best = best_variant(axis_variants(&scene.template, &scene.camera, mask));
    if best.iou > own + VARIANT_GAIN {
        let detail = format!(
            "the template fits the mask better with {} ({:.2} instead of {own:.2})",
            best.name, best.iou
        );
        let repair = Repair { scale: rescaling(scene), ..best.repair(&scene.folder) };
        let hint = Hint::from("template.obj must have x right, y down, z forward");
        return doubt("orientation", detail, hint.with(Remedy::RepairTemplate(repair)));
    }
    ok("orientation", format!("no flip or swap of axes fits better by {VARIANT_GAIN} (best {:.2})", best.iou))
}

/// The factor that brings a template in another unit to metres. Its projection does not show it: a scale about the
/// camera changes no image.
fn rescaling(scene: &Scene) -> f64 {
    let length = diagonal(&scene.template.positions);
    if DIAGONAL.contains(&length) {
        return 1.0;
    }
    let factors = [0.001, 0.01, 10.0, 100.0, 1000.0].into_iter().filter(|f| DIAGONAL.contains(&(f * length)));
    let strangeness = |f: &f64| (f * length / 0.7).ln().abs();
    let best = factors.min_by(|a, b| strangeness(a).total_cmp(&strangeness(b)));
    best.unwrap_or(1.0)
}

fn uv(scene: &Scene) -> Finding {
    let mesh = &scene.template;
    let beyond = mesh.uvs.iter().filter(|uv| uv.min_element() < 0.0 || uv.max_element() > 1.0).count();
    // Shift the raster off the round numbers on which uv grids lie.
    let at = |i: u32| mesh.uvs[i as usize] * UV_RASTER as f64 - glam::DVec2::new(0.4143, 0.3819);
    let mut hits = vec![0u8; UV_RASTER * UV_RASTER];
    for triangle in mesh.triangle_uvs() {
        fill_triangle(triangle.map(at), [UV_RASTER; 2], false, |x, y| {
            let hit = &mut hits[y * UV_RASTER + x];
            *hit = hit.saturating_add(1);
        });
    }
    let count = |least: u8| hits.iter().filter(|h| **h >= least).count();
    let (used, twice) = (count(1), count(2));
    let detail = format!(
        "{:.0} % of the texture used, {:.1} % of that more than once, {beyond} coordinates outside 0…1",
        100.0 * used as f64 / hits.len() as f64,
        100.0 * twice as f64 / used.max(1) as f64
    );
    if used == 0 {
        return doubt("uv", detail, "texture coordinates cover nothing: unwrap the mesh");
    }
    if beyond > 0 {
        return doubt("uv", detail, "move all texture coordinates into 0…1");
    }
    // 1 % leaves room for rounding along seams.
    if twice * 100 > used {
        return doubt(
            "uv",
            detail,
            "places that share texture share colour: unwrap the mesh without overlap",
        );
    }
    ok("uv", detail)
}

fn truth(scene: &Scene) -> Finding {
    let (truth, count) = (&scene.truth, scene.frames.len());
    let of_frames =
        |with: usize| if with < count { format!(" in {with} of {count} frames") } else { String::new() };
    let with_points = (0..count).filter(|k| truth.points_in(*k).is_some()).count();
    let found = [
        (with_points > 0).then(|| format!("measured points{}", of_frames(with_points))),
        truth.vertices.as_ref().map(|_| "true vertices".to_owned()),
        truth
            .tracks
            .as_ref()
            .map(|t| format!("{} tracked points{}", t.vertices.len(), of_frames(t.points.len()))),
    ];
    let found: Vec<String> = found.into_iter().flatten().collect();
    let detail = match &found[..] {
        [] => "none; results cannot be evaluated, only compared with the video".to_owned(),
        [rest @ .., last] if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => found.concat(),
    };
    ok("truth", detail)
}
