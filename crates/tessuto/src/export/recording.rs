//! The format `rrd`: a recording for the viewer of rerun, in builds with the feature `rerun`.

use super::Clip;
use super::row::{Output, Row};
use tessuto_core::error::Result;

pub(super) const FORMAT: Row = Row {
    key: "rrd",
    programs: "rerun",
    content: "recording for rerun: video, camera, mesh, texture (camera axes)",
    files: &[(".rrd", "recording for the viewer of rerun")],
    feature: Some(("rerun", cfg!(feature = "rerun"))),
    for_blender: false,
    outputs,
};

#[cfg(feature = "rerun")]
fn outputs(clip: &Clip) -> Result<Vec<Output>> {
    Ok(vec![Output::File(format!("{}.rrd", clip.name), super::rrd::encode(clip)?)])
}

#[cfg(not(feature = "rerun"))]
fn outputs(_: &Clip) -> Result<Vec<Output>> {
    Err(tessuto_core::Error::left_out("format rrd", "rerun"))
}
