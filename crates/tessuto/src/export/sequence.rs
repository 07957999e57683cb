//! What the formats of one file per frame share: names, and what is said of frames that were left out.

use super::Clip;

/// Name of the file of the `n`-th frame that is there.
pub(super) fn frame_name(clip: &Clip, n: usize, ending: &str) -> String {
    format!("{}_{:04}.{ending}", clip.name, clip.first_frame + clip.frames[n])
}

/// Which frames were left out and why, for whoever misses them.
pub(super) fn gaps(clip: &Clip) -> Option<(String, Vec<u8>)> {
    let left_out = clip.left_out();
    let value = serde_json::json!({
        "frames_per_second": clip.fps,
        "first_frame": clip.first_frame,
        "frame_count": clip.frame_count,
        "frames_left_out": left_out,
        "verdicts": clip.verdicts,
    });
    let text = serde_json::to_string_pretty(&value).expect("plain data") + "\n";
    (!left_out.is_empty()).then(|| (format!("{}_frames.json", clip.name), text.into_bytes()))
}
