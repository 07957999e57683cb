//! The library's remedies in the words of the Python package.

use tessuto::{Hint, Remedy, Repair, Warning};

/// A hint, with the arguments that carry it out.
pub fn hint(hint: &Hint) -> String {
    let ways: Vec<String> = hint.remedies.iter().map(way).collect();
    match ways.is_empty() {
        true => hint.text.clone(),
        false => format!("{}: {}", hint.text, ways.join(", or ")),
    }
}

/// A warning, with its hint.
pub fn warning(warning: &Warning) -> String {
    let found = format!("{}: {}", warning.topic, warning.found);
    warning.hint.as_ref().map_or_else(|| found.clone(), |own| format!("{found}\n  hint: {}", hint(own)))
}

fn way(remedy: &Remedy) -> String {
    match remedy {
        Remedy::Replace => "replace=True".into(),
        Remedy::NoResume => "resume=False".into(),
        Remedy::Frames(None) => "frames=(first, end)".into(),
        Remedy::Frames(Some(range)) => format!("frames=({}, {})", range.start, range.end),
        Remedy::Check => "the program's `tessuto check SCENE --picture FILE.png`".into(),
        Remedy::Appearance => "tessuto.appearance(scene, result)".into(),
        Remedy::TrueMotion => "motion=\"truth\"".into(),
        Remedy::Set(assignment) => {
            let (key, value) = assignment.split_once('=').unwrap_or((assignment, ""));
            format!("settings={{\"{key}\": {value}}}")
        }
        Remedy::Feature(name) => {
            format!("pip install . --config-settings=build-args=\"--features {name}\"")
        }
        Remedy::DepthScale => "tessuto template SCENE --depth FILE --depth-scale METRES".into(),
        Remedy::WithoutLost => "without_lost=True".into(),
        Remedy::Object => "masks == N, or the program's `tessuto import SCENE --object N`".into(),
        Remedy::Outline | Remedy::Plate | Remedy::MakeMasks(_) => "the program's `tessuto masks`".into(),
        Remedy::MakeTemplate(_)
        | Remedy::Remesh
        | Remedy::Regrid
        | Remedy::EstimateCamera
        | Remedy::TriangleSide => "the program's `tessuto template`".into(),
        Remedy::RepairTemplate(repair) => self::repair(repair),
        Remedy::Weld => "merge vertices that touch".into(),
        // Scenes of other programs are imported by the program.
        Remedy::Fps
        | Remedy::Poses
        | Remedy::RefinePoses
        | Remedy::PoseScale
        | Remedy::Rate
        | Remedy::Masks
        | Remedy::Stride(..)
        | Remedy::AllowGaps
        | Remedy::Downscale
        | Remedy::Intrinsics
        | Remedy::Import(_)
        | Remedy::CameraId => format!("the program's `tessuto import`, {remedy}"),
    }
}

/// In terms of the array of vertices.
fn repair(repair: &Repair) -> String {
    let flipped: Vec<String> = "012"
        .chars()
        .zip(repair.flip)
        .filter(|(_, flip)| *flip)
        .map(|(axis, _)| format!("vertices[:, {axis}] *= -1"))
        .collect();
    let parts = [
        repair.swap_xy.then(|| "vertices[:, :2] = vertices[:, 1::-1]".to_owned()),
        (!flipped.is_empty()).then(|| flipped.join("; ")),
        (repair.scale != 1.0).then(|| format!("vertices *= {}", repair.scale)),
        repair.weld.then(|| "merge vertices that touch".to_owned()),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join("; ")
}
