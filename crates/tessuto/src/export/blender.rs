//! A script that sets up a scene of Blender: what neither GLB nor USD can hold, such as pixels that are not
//! square and the light. What it does does not depend on the formats beside it; what it knows of the clip is a
//! table at its top.

use std::path::{Component, Path, PathBuf};

use serde_json::{Value, json};

use super::Clip;
use crate::result::OtherCamera;
use tessuto_core::camera::{Camera, Pose};

const BODY: &str = include_str!("../../assets/export/blender.py");
/// How it ends.
const CALL: &str = "main()\n";
/// What comes before that where the other side has a colour of its own.
const BACK: &str = include_str!("../../assets/export/blender_back.py");

/// Name of the script.
pub(super) fn name(clip: &Clip) -> String {
    format!("{}_blender.py", clip.name)
}

/// The script, for a `folder` that it will be in.
pub(super) fn encode(clip: &Clip, folder: &Path) -> Vec<u8> {
    let poses = |poses: &[Pose]| poses.iter().map(Pose::rows).collect::<Vec<_>>();
    // Width, height, fx, fy, cx, cy.
    let intrinsics = |c: &Camera| json!(c);
    let other = |other: &OtherCamera| {
        let mut table = intrinsics(&other.camera);
        (table["name"], table["poses"]) = (json!(other.name), json!(poses(&other.poses)));
        table
    };
    let video = clip.video.as_ref().and_then(|file| relative(file, folder)).unwrap_or_default();
    // JSON of texts and finite numbers is Python, too.
    let mut table = json!({
        "name": clip.name,
        "fps": clip.fps,
        "frames": clip.frame_count,
        "first": clip.first_frame,
        "video": video,
        "light": clip.environment.as_ref().map_or_else(String::new, |_| clip.environment_file()),
        "poses": clip.poses.as_deref().map_or_else(Vec::new, poses),
        "views": clip.others.iter().map(other).collect::<Vec<_>>(),
    });
    if let (Value::Object(table), Value::Object(own)) = (&mut table, intrinsics(&clip.camera)) {
        table.extend(own);
    }
    let mut body = BODY.to_owned();
    if let Some(back) = clip.back {
        table["back"] = json!(back.colour);
        let (before, call) = BODY.split_at(BODY.len() - CALL.len());
        body = format!("{before}{BACK}{call}");
    }
    format!("# Written by tessuto {} for Blender.\nCLIP = {table:#}\n{body}", clip.version).into_bytes()
}

/// The way to `file` from `folder`, with slashes: folders that are moved together keep it. `None` where either is
/// not there.
fn relative(file: &Path, folder: &Path) -> Option<String> {
    let file = file.canonicalize().ok()?;
    // What is about to be made is not there yet: the nearest folder that is counts.
    let (mut there, mut missing) = (std::path::absolute(folder).ok()?, Vec::new());
    while !there.exists() {
        missing.push(there.file_name()?.to_owned());
        there.pop();
    }
    let mut from = there.canonicalize().ok()?;
    from.extend(missing.iter().rev());
    let (to, from): (Vec<Component>, Vec<Component>) =
        (file.components().collect(), from.components().collect());
    let same = to.iter().zip(&from).take_while(|(a, b)| a == b).count();
    // Windows' drives have no way from one to another.
    if same == 0 {
        return Some(file.to_string_lossy().into_owned());
    }
    let mut way: PathBuf = from[same..].iter().map(|_| Component::ParentDir).collect();
    way.extend(&to[same..]);
    Some(way.to_string_lossy().replace('\\', "/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_script_ends_with_its_call() {
        assert!(BODY.ends_with(&format!("\n\n\n{CALL}")));
        assert!(BACK.starts_with("import_print = ") && BACK.ends_with("\n\n\n"));
    }

    #[test]
    fn the_way_is_relative_and_goes_up() {
        let home = tempfile::tempdir().unwrap();
        let at = |name: &str| home.path().join(name);
        std::fs::create_dir_all(at("scenes/flag/rgbs")).unwrap();
        std::fs::write(at("scenes/flag/rgbs/rgb_000.png"), "").unwrap();
        let way = relative(&at("scenes/flag/rgbs/rgb_000.png"), &at("results/flag/export"));
        assert_eq!(way.as_deref(), Some("../../../scenes/flag/rgbs/rgb_000.png"));
        let way = relative(&at("scenes/flag/rgbs/rgb_000.png"), &at("scenes/flag"));
        assert_eq!(way.as_deref(), Some("rgbs/rgb_000.png"));
        assert_eq!(relative(&at("nothing.png"), home.path()), None);
    }
}
