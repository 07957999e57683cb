//! Messages of the library as this program's user needs them: with the options and commands that are the way out.

use std::path::Path;

use tessuto::masks::Record;
use tessuto::text::quoted;
use tessuto::{Hint, Remedy, Repair, Warning};

/// An error, with its options.
pub fn error(error: &tessuto::Error) -> String {
    use tessuto::Error::{Input, Numerical, Usage};
    match error {
        Usage { hint: own, .. } | Input { hint: own, .. } | Numerical { hint: own, .. } => {
            // The hint stands at the end of every such message.
            let text = error.to_string();
            let found = text.strip_suffix(&own.to_string()).unwrap_or(&text);
            format!("{found}{}", hint(own))
        }
        _ => error.to_string(),
    }
}

/// A warning, with its options.
pub fn warning(warning: &Warning) -> String {
    let found = format!("{}: {}", warning.topic, warning.found);
    warning.hint.as_ref().map_or_else(|| found.clone(), |own| format!("{found}\n  hint: {}", hint(own)))
}

/// A hint, with its options.
pub fn hint(hint: &Hint) -> String {
    let options: Vec<String> = hint.remedies.iter().map(options).collect();
    match options.is_empty() {
        true => hint.text.clone(),
        false => format!("{}: {}", hint.text, options.join(", or ")),
    }
}

fn options(remedy: &Remedy) -> String {
    match remedy {
        Remedy::Replace => "--force".into(),
        Remedy::NoResume => "leave out --resume".into(),
        Remedy::Frames(None) => "--frames A..B".into(),
        Remedy::Frames(Some(range)) => format!("--frames {}..{}", range.start, range.end),
        Remedy::Check => "tessuto check SCENE --picture FILE.png".into(),
        Remedy::Appearance => "tessuto appearance SCENE".into(),
        Remedy::TrueMotion => "--motion gt".into(),
        Remedy::Set(assignment) => format!("--set {assignment}"),
        // Whoever lacks one feature may lack another; `full` has them all.
        Remedy::Feature(_) => "cargo install --path crates/tessuto-cli --features full".into(),
        Remedy::Fps => "--fps".into(),
        Remedy::Poses => "--poses PATH".into(),
        Remedy::RefinePoses => "tessuto import --refine-poses".into(),
        Remedy::PoseScale => "--pose-scale METRES".into(),
        Remedy::Rate => "--rate".into(),
        Remedy::Masks => "--masks".into(),
        Remedy::Object => "--object N".into(),
        Remedy::Stride(range, stride) => {
            format!("--frames {}..{} --stride {stride}", range.start, range.end)
        }
        Remedy::Outline => "--outline \"X,Y X,Y X,Y X,Y\"".into(),
        Remedy::Plate => "--plate FILE".into(),
        Remedy::MakeMasks(folder) => make_masks(&quoted(folder)),
        Remedy::Import(file) => import(&quoted(file), "SCENE").join(", or "),
        Remedy::AllowGaps => "--allow-gaps".into(),
        Remedy::Downscale => "tessuto import --downscale".into(),
        Remedy::Intrinsics => "--fx --fy --cx --cy".into(),
        Remedy::EstimateCamera => {
            "tessuto template SCENE --flat WIDTHxHEIGHTm --corners X,Y X,Y X,Y X,Y --camera estimate --force"
                .into()
        }
        Remedy::CameraId => "--camera-id".into(),
        Remedy::MakeTemplate(folder) => make_template(folder).join(", or "),
        Remedy::Remesh => "tessuto template SCENE --remesh 32 --from MESH".into(),
        Remedy::Regrid => "tessuto template SCENE --remesh 32 --force".into(),
        Remedy::TriangleSide => "--side LENGTH, such as 20mm".into(),
        Remedy::Weld => "--weld".into(),
        Remedy::DepthScale => "--depth-scale METRES, such as 0.00025".into(),
        Remedy::WithoutLost => "tessuto export RESULT --to glb --without-lost --force".into(),
        Remedy::RepairTemplate(repair) => repair_template(repair),
    }
}

/// The commands that make a scene of a clip.
pub fn import(clip: &str, scene: &str) -> [String; 2] {
    let outline = "\"X,Y X,Y X,Y X,Y\"";
    [format!("tessuto studio {clip}"), format!("tessuto import {clip} {scene} --fov 65 --outline {outline}")]
}

/// The command that makes masks.
pub fn make_masks(scene: &str) -> String {
    format!("tessuto masks {scene} --outline \"X,Y X,Y X,Y X,Y\"")
}

/// The commands that make a template in the scene `folder`: a flat rectangle from its size, a garment on a table,
/// or any mesh.
pub fn make_template(folder: &Path) -> [String; 3] {
    let corners = corners_of(folder).map_or_else(|| "--from-mask".to_owned(), |c| format!("--corners {c}"));
    let scene = quoted(folder);
    let garment = "--on-table --paper A4 --paper-corners X,Y X,Y X,Y X,Y".to_owned();
    [format!("--flat WIDTHxHEIGHTm {corners}"), garment, "--remesh 32 --from MESH.obj".to_owned()]
        .map(|options| format!("tessuto template {scene} {options}"))
}

/// The corners of the outline that the masks in `folder` were made from, clockwise from the upper left, as they
/// are typed; `None` where it has not four. They are the fabric's own, where those found in a mask are a guess.
fn corners_of(folder: &Path) -> Option<String> {
    let outline = Record::read(folder).ok().flatten()?.outline?;
    let mut corners: [[f64; 2]; 4] = outline.try_into().ok()?;
    let cross = |k: usize| corners[k][0] * corners[(k + 1) % 4][1] - corners[k][1] * corners[(k + 1) % 4][0];
    // Rows go down: clockwise is positive.
    if (0..4).map(cross).sum::<f64>() < 0.0 {
        corners.reverse();
    }
    let first = (0..4).min_by(|a, b| corners[*a].iter().sum::<f64>().total_cmp(&corners[*b].iter().sum()))?;
    corners.rotate_left(first);
    Some(corners.map(|[x, y]| format!("{x},{y}")).join(" "))
}

fn repair_template(repair: &Repair) -> String {
    let Repair { folder, swap_xy, scale, weld, .. } = repair;
    let folder: &Path = folder;
    let flipped = repair.flipped();
    let parts = [
        Some(format!("tessuto template {}", quoted(folder))),
        swap_xy.then(|| "--swap xy".to_owned()),
        (!flipped.is_empty()).then(|| format!("--flip {flipped}")),
        (*scale != 1.0).then(|| format!("--scale {scale}")),
        weld.then(|| "--weld".to_owned()),
        Some("--force".to_owned()),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_corners_of_an_outline_are_those_of_the_template() {
        let folder = tempfile::tempdir().unwrap();
        let put = |outline: &str| {
            let text = format!(
                r#"{{"format": "masks of tessuto 1", "outline": {outline}, "plate": null, "clicks": [],
                "largest_piece": false, "noise": 1.0, "frames": [], "notes": []}}"#
            );
            std::fs::write(folder.path().join("masks.json"), text).unwrap();
            let [flat, _, mesh] = make_template(folder.path());
            assert!(mesh.ends_with("--remesh 32 --from MESH.obj"));
            flat.split_once("WIDTHxHEIGHTm ").unwrap().1.to_owned()
        };
        let clockwise = "--corners 3,2.5 9,2 9,6 3,6";
        assert_eq!(put("[[3, 2.5], [9, 2], [9, 6], [3, 6]]"), clockwise);
        assert_eq!(put("[[9, 6], [9, 2], [3, 2.5], [3, 6]]"), clockwise);
        for other in ["null", "[[3, 2], [9, 2], [9, 6]]", "[[3, 2], [6, 1], [9, 2], [9, 6], [3, 6]]"] {
            assert_eq!(put(other), "--from-mask", "{other}");
        }
    }

    #[test]
    fn errors_and_warnings_end_with_options() {
        let repair =
            Repair { swap_xy: true, flip: [true, false, true], scale: 0.01, ..Repair::of("my scene") };
        let told = tessuto::Error::input(
            "a.obj",
            "is strange",
            Hint::from("turn it").with(Remedy::RepairTemplate(repair)),
        );
        assert_eq!(
            error(&told),
            "a.obj: is strange\n  hint: turn it: tessuto template 'my scene' --swap xy --flip xz --scale 0.01 --force"
        );
        let own = Hint::from("a part").with(Remedy::Frames(Some(1..3))).with(Remedy::AllowGaps);
        let told = Warning { topic: "frames".into(), found: "a gap".into(), hint: Some(own) };
        assert_eq!(warning(&told), "frames: a gap\n  hint: a part: --frames 1..3, or --allow-gaps");
        assert_eq!(error(&tessuto::Error::Interrupted("here".into())), "interrupted: here");
    }
}
