//! What masks cannot be made of, each with its place and the way out.

use std::path::Path;

use super::frames::Frames;
use super::judge::clearness;
use super::record::Click;
use super::region::Region;
use super::steady::{movement, steadiness};
use super::track::Tracked;
use tessuto_core::error::{Error, Hint, Remedy, Result};

/// The fewest pixels of fabric.
pub(super) const FEWEST: usize = 400;
/// Overlap of what was drawn with what was found, and clear fraction of the outline: below either nothing was found.
const FOUND: (f64, f64) = (0.6, 0.15);
/// Fractions of changing pixels inside of the outline and, of the image, elsewhere: it is around the wrong thing.
const STILL: (f64, f64) = (0.01, 0.02);

/// Which frames of the input the scene's are.
#[derive(Debug, Clone, Copy)]
pub(super) struct Origin {
    first: usize,
    stride: usize,
}

impl Origin {
    /// As the import noted it in scene.json; the same numbers where it did not.
    pub fn of(folder: &Path) -> Self {
        let text = std::fs::read_to_string(folder.join("scene.json")).unwrap_or_default();
        let manifest: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
        let number = |value: &serde_json::Value| value.as_u64().and_then(|v| usize::try_from(v).ok());
        let notes = &manifest["notes"];
        Self {
            first: number(&notes["frames"][0]).unwrap_or(0),
            stride: number(&notes["stride"]).unwrap_or(1),
        }
    }

    /// The first `count` frames of the scene, as numbers of the input.
    fn before(self, count: usize) -> Remedy {
        let end = self.first.saturating_add(count.saturating_sub(1).saturating_mul(self.stride)) + 1;
        Remedy::Frames(Some(self.first..end))
    }
}

/// Refuses a polygon that is none.
pub(super) fn polygon(outline: &[[f64; 2]], [width, height]: [usize; 2]) -> Result<()> {
    let fail = |problem: String, hint: &str| {
        Err(Error::usage(format!("the outline {problem}"), Hint::from(hint).with(Remedy::Outline)))
    };
    if outline.len() < 3 {
        return fail(
            format!("has {} corners", outline.len()),
            "give three or more, in order around the fabric",
        );
    }
    let far = |p: &&[f64; 2]| {
        // A click beside the image means its border.
        let beyond = |v: f64, n: usize| !(v >= -0.1 * n as f64 && v <= 1.1 * n as f64);
        beyond(p[0], width) || beyond(p[1], height)
    };
    if let Some([x, y]) = outline.iter().find(far) {
        return fail(
            format!("has a corner at {x},{y}, outside of the {width}×{height} pixels of the frames"),
            "corners are column,row of the scene's first frame, which import may have made smaller",
        );
    }
    let area = Region::polygon(
        &outline.iter().map(|p| glam::DVec2::from_array(*p)).collect::<Vec<_>>(),
        [width, height],
    )
    .area();
    if area < FEWEST {
        return fail(
            format!("covers {area} pixels"),
            "give the corners in order around the fabric, so that no sides cross",
        );
    }
    Ok(())
}

/// Refuses clicks that no frame has.
pub(super) fn clicks(clicks: &[Click], [width, height]: [usize; 2], count: usize) -> Result<()> {
    for Click { frame, x, y, .. } in clicks {
        if *frame >= count {
            return Err(Error::usage(
                format!("a place in frame {frame} of {count} frames"),
                format!("frames are 0 to {}", count - 1),
            ));
        }
        if !(*x >= 0.0 && *y >= 0.0 && *x < width as f64 && *y < height as f64) {
            return Err(Error::usage(
                format!("the place {x},{y} of frame {frame} is outside of {width}×{height} pixels"),
                "give column,row in pixels of the scene's frames",
            ));
        }
    }
    Ok(())
}

/// Refuses an image of another size.
pub(super) fn size(path: &Path, found: [usize; 2], expected: [usize; 2]) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    Err(Error::input(
        path.display().to_string(),
        format!("is {}×{} pixels, but the frames {}×{}", found[0], found[1], expected[0], expected[1]),
        "give an image of the scene's frames",
    ))
}

/// Refuses a cut and a camera that moves; notes about smaller faults. `steadied`: the known motion of the camera is
/// taken out of `frames`.
pub(super) fn clip(
    frames: &Frames,
    first: &Region,
    noise: f32,
    (origin, steadied): (Origin, bool),
) -> Result<Vec<String>> {
    let found = steadiness(frames, first, noise);
    if let Some(n) = found.cut {
        // The fabric is known in frame 0, which the take behind the cut has not, however long it is.
        return Err(Error::input(
            format!("frame {n}"),
            "the whole image changes here: a cut, or a flash",
            Hint::from(
                "import the take that begins with frame 0, to which the outline belongs; another one \
                 needs its own",
            )
            .with(origin.before(n)),
        ));
    }
    // First: a fabric that is treated as the surroundings looks like a camera that moves.
    if let Some((inside, Some((at, elsewhere)))) = Some(movement(frames, first, noise))
        && inside < STILL.0
        && elsewhere > STILL.1
    {
        return Err(Error::input(
            "frame 0",
            format!(
                "nothing moves inside of the outline, but things move around {:.0},{:.0}: the fabric is elsewhere",
                at[0], at[1]
            ),
            Hint::from("give the outline of what moves").with(Remedy::Outline),
        ));
    }
    if let Some(moved) = found.moved.filter(|_| steadied) {
        return Err(no_plane(moved, origin));
    }
    if let Some((n, shift)) = found.moved {
        return Err(Error::input(
            format!("frame {n}"),
            format!(
                "the surroundings have moved by {shift:.0} px since frame 0: the camera did not stand still"
            ),
            Hint::from(
                "give where the camera was, as an app on the phone records it, or masks that another program made; \
                 or import the part before",
            )
            .with(Remedy::Poses)
            .with(Remedy::Masks)
            .with(origin.before(n)),
        ));
    }
    let shaken = found.shaken.map(|(n, shift)| {
        let cause =
            if steadied { "what is behind the fabric is not quite a plane" } else { "the camera shakes" };
        format!("the surroundings are {shift:.1} px off in frame {n}: {cause}; masks and motion suffer")
    });
    // Of a camera that moved the fabric itself hides other parts of the wall in every frame.
    let swaying = found.swaying.filter(|_| !steadied).map(|(n, part)| {
        format!(
            "{:.0} % of the surroundings move in frame {n} while the rest stands still: somebody who moves, not the \
             camera",
            100.0 * part
        )
    });
    Ok(shaken.into_iter().chain(swaying).collect())
}

/// The error of surroundings that are `shift` px off in frame `n` with the camera's motion taken out.
fn no_plane((n, shift): (usize, f32), origin: Origin) -> Error {
    let problem = format!(
        "the surroundings are {shift:.0} px off from those of frame 0, with the camera's motion taken out: what is \
         behind the fabric is no plane, or the poses are not this clip's"
    );
    Error::input(format!("frame {n}"), problem, other_masks(n, origin))
}

/// The error of a frame `n` that shows little of what frame 0 does.
pub(super) fn unseen(n: usize, origin: Origin) -> Error {
    let problem = "little of what frame 0 shows is in sight, with the camera's motion taken out: it turned away, or \
                   the poses are not this clip's";
    Error::input(format!("frame {n}"), problem, other_masks(n, origin))
}

/// The error of poses that do not explain frame `n`: what was `found`, and `why` that may be.
pub(super) fn other_poses(n: usize, found: &str, why: &str) -> Error {
    let hint = Hint::from(format!("{why}; or give masks that another program made"));
    let hint = hint.with(Remedy::Poses).with(Remedy::Masks);
    Error::input(format!("frame {n}"), format!("the poses are not this clip's: {found}"), hint)
}

/// What helps from frame `n` on where the place behind the fabric is not known.
fn other_masks(n: usize, origin: Origin) -> Hint {
    let text = "give masks that another program made, or import the part before";
    Hint::from(text).with(Remedy::Masks).with(origin.before(n.max(1)))
}

/// Refuses an outline in which no fabric was found.
pub(super) fn outline(drawn: &Region, tracked: &Tracked) -> Result<()> {
    let overlap = drawn.overlap(&tracked.regions[0]);
    let clear = clearness(&tracked.regions[0], &tracked.evidence[0]);
    if overlap >= FOUND.0 && clear >= FOUND.1 {
        return Ok(());
    }
    Err(Error::input(
        "frame 0",
        format!(
            "no fabric was found in the outline: what was found overlaps it by {:.0} %, and inside and \
             outside differ along {:.0} % of its border",
            100.0 * overlap,
            100.0 * clear
        ),
        Hint::from(
            "give corners on the fabric's own border, more of them where it bends, or the empty place",
        )
        .with(Remedy::Outline)
        .with(Remedy::Plate),
    ))
}

/// The error of fabric that is gone.
pub(super) fn lost(path: &Path, n: usize, origin: Origin) -> Error {
    Error::input(
        path.display().to_string(),
        format!("no fabric is left in frame {n}: it has left the image, or was lost"),
        Hint::from("import the part before, or click where it is").with(origin.before(n.max(1))),
    )
}
