//! Pre-flight check: what to know about a scene before spending hours on it.
//!
//! A check fails where [loading](tessuto_estimate::io::scene::load) fails, and where masks or template cannot be
//! those of one piece of fabric; it names every error it can reach, measures what may be wrong without being an
//! error, and draws the template over frame 0.

mod drawing;
mod findings;
mod masks;
mod outline;
mod planes;
mod poses;
mod repeats;
mod views;

use std::path::Path;

use tessuto_core::error::{Error, Hint, Result, Warning};
use tessuto_core::image::Image;
use tessuto_core::scene::Scene;
use tessuto_estimate::io::scene::{LoadOptions, Loaded, attempt};
use tessuto_render::raster::coverage::{overlap, template_coverage};

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// As it should be.
    Ok,
    /// Doubtful; computing goes on.
    Warning,
    /// The scene cannot be used, or what would come of it had no meaning.
    Error,
}

/// One thing found.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// How bad it is.
    pub level: Level,
    /// Topic, one word; the place for errors.
    pub what: String,
    /// What was found, with the figures.
    pub detail: String,
    /// The way out, where something need be done.
    pub hint: Option<Hint>,
}

/// Everything found, and the image that shows it.
#[derive(Debug, Clone)]
pub struct CheckReport {
    /// Errors first, then figures and warnings in a fixed order.
    pub findings: Vec<Finding>,
    /// Overlap of the template with the first mask (intersection over union), where both are readable.
    pub iou: Option<f64>,
    /// The crops of the first, middle and last frame with the masks' outlines (yellow), the first with the template's
    /// edges (cyan), where readable; a row for each camera.
    pub image: Option<Image>,
}

impl CheckReport {
    /// How many findings are of this level.
    pub fn count(&self, level: Level) -> usize {
        self.findings.iter().filter(|f| f.level == level).count()
    }
}

/// Checks a scene that has been loaded.
///
/// # Errors
/// Those of reading its frames once more.
pub fn check(loaded: &Loaded) -> Result<CheckReport> {
    let (findings, iou) = all_findings(&loaded.scene)?;
    let findings = findings::with_warnings(findings, &loaded.warnings);
    Ok(CheckReport { findings, iou: Some(iou), image: Some(drawing::draw(&loaded.scene)?) })
}

/// What a computation on a scene should know beside what loading said: the warnings of its check.
///
/// # Errors
/// [`Error::Input`] for the first finding that is an error; those of reading its frames once more.
pub fn gate(loaded: &Loaded) -> Result<Vec<Warning>> {
    let scene = &loaded.scene;
    let mut warnings = Vec::new();
    for Finding { level, what, detail, hint } in all_findings(scene)?.0 {
        match level {
            Level::Ok => {}
            Level::Warning => warnings.push(Warning { topic: what, found: detail, hint }),
            Level::Error => {
                let place = format!("{}, {what}", scene.folder.display());
                return Err(Error::input(place, detail, hint.unwrap_or_else(|| "check the scene".into())));
            }
        }
    }
    Ok(warnings)
}

/// What a computation should know of the views of a `scene` whose lengths had no unit when it was checked.
///
/// # Errors
/// Those of reading the first frames.
pub(crate) fn views_in_metres(scene: &Scene) -> Result<Vec<Warning>> {
    let doubted = views::findings(scene)?.into_iter().filter(|finding| finding.level == Level::Warning);
    Ok(doubted
        .map(|Finding { what, detail, hint, .. }| Warning { topic: what, found: detail, hint })
        .collect())
}

/// What is found in frames, masks, camera and template, and the overlap of the template with the first mask.
fn all_findings(scene: &Scene) -> Result<(Vec<Finding>, f64)> {
    let covered = template_coverage(&scene.template, &scene.template.positions, scene.viewpoint(0));
    let first = scene.frames.frame(0)?;
    let iou = overlap(&covered, &first.mask);
    let of_template = findings::of_template(scene, &first.mask, &covered, iou);
    let of_planes = planes::findings(scene);
    let of_cameras = views::findings(scene)?.into_iter().chain(poses::findings(scene)?);
    let all = findings::of_video(scene)?.into_iter().chain(of_template).chain(of_planes).chain(of_cameras);
    Ok((all.collect(), iou))
}

/// Checks what is there of a scene whose template cannot be read.
fn check_video(loaded: &Loaded) -> Result<CheckReport> {
    let mut findings = findings::of_video(&loaded.scene)?;
    findings.extend(poses::findings(&loaded.scene)?);
    let findings = findings::with_warnings(findings, &loaded.warnings);
    Ok(CheckReport { findings, iou: None, image: Some(drawing::draw(&loaded.scene)?) })
}

/// Checks the scene in `folder`, whether or not it can be loaded.
pub fn check_folder(folder: &Path, options: &LoadOptions) -> CheckReport {
    let attempt = attempt(folder, options);
    let nothing = CheckReport { findings: Vec::new(), iou: None, image: None };
    let checked = match &attempt.loaded {
        Some(loaded) if attempt.template_missing => check_video(loaded),
        Some(loaded) => check(loaded),
        None => Ok(nothing.clone()),
    };
    let mut report =
        checked.unwrap_or_else(|error| CheckReport { findings: vec![error_finding(&error)], ..nothing });
    report.findings.splice(0..0, attempt.errors.iter().map(error_finding));
    report
}

fn error_finding(error: &Error) -> Finding {
    let (what, detail, hint) = match error {
        Error::Input { place, problem, hint } | Error::Numerical { place, problem, hint } => {
            (place.clone(), problem.clone(), Some(hint.clone()))
        }
        Error::Usage { problem, hint } => ("options".into(), problem.clone(), Some(hint.clone())),
        other => ("scene".into(), other.to_string(), None),
    };
    Finding { level: Level::Error, what, detail, hint }
}
