//! What the search for the motion keeps of a video: pyramids of its colours and distances to its outlines, at the
//! resolution that memory has room for.

mod magnify;
pub mod occlusion;
pub mod outline_distance;
pub mod pyramid;
pub mod samples;
pub mod silhouette;

use magnify::magnified;
use outline_distance::OutlineDistance;
use pyramid::{Level, pyramid};
use tessuto_core::camera::{Camera, Viewpoint};
use tessuto_core::error::Result;
use tessuto_core::scene::Scene;
use tessuto_core::video::Frame;

/// Most bytes that colours and what is computed from them may take, and that outlines may take.
const COLOUR_MEMORY: usize = 3 << 30;
const OUTLINE_MEMORY: usize = 512 << 20;
/// Bytes per pixel of the finest level: a pyramid of four floats, and twice the colours of the surface points.
const COLOUR_BYTES: usize = 54;
const OUTLINE_BYTES: usize = 4;
/// Fewest pixels along the shorter side of a level.
const LEAST_SIDE: usize = 2;

/// The video as the search sees it.
#[derive(Debug)]
pub struct Observed {
    /// Finest and coarsest level of the pyramids in use.
    pub range: [usize; 2],
    /// Pixels of level 0 along one of the video.
    pub magnification: usize,
    /// How every frame is seen, in pixels of level 0, shape `[N]`.
    pub views: Vec<Viewpoint>,
    /// Pyramids; levels finer than the finest in use have no colours. Shape `[N][levels]`.
    pub levels: Vec<Vec<Level>>,
    /// That of the clip's first frame, with which all are compared. Shape `[levels]`.
    pub first: Vec<Level>,
    /// Outlines, shape `[N]`.
    pub outlines: Vec<OutlineDistance>,
}

impl Observed {
    /// Looks at every frame of `scene`, a part of a `clip` or all of it, magnified by `magnification`, at the levels
    /// `range` (finest, coarsest), or at as many coarser ones where these would not fit into memory; at none that
    /// has fewer than two pixels a side.
    ///
    /// # Errors
    /// Those of reading the frames.
    pub fn new(clip: &Scene, scene: &Scene, range: [usize; 2], magnification: usize) -> Result<Self> {
        let camera = scene.camera.magnified(magnification);
        let count = scene.frames.len();
        let finest = fitting(&camera, count * COLOUR_BYTES, COLOUR_MEMORY).max(range[0]);
        // Small images have few levels.
        let last = (camera.width.min(camera.height) / LEAST_SIDE).max(1).ilog2() as usize;
        let range = [finest, range[1] + finest - range[0]].map(|level| level.min(last));
        let scale = 1 << fitting(&camera, count * OUTLINE_BYTES, OUTLINE_MEMORY);
        let views: Vec<_> = scene.viewpoints().iter().map(|view| view.with_camera(camera)).collect();
        let look = |frame: &Frame, view: &Viewpoint| {
            let larger = (magnification > 1).then(|| magnified(frame, magnification));
            let frame = larger.as_ref().unwrap_or(frame);
            (pyramid(frame, view, range), OutlineDistance::new(&frame.mask, scale))
        };
        let looked = scene.frames.map(0..count, || (), |(), n| Ok(look(&*scene.frames.frame(n)?, &views[n])));
        let (levels, outlines) = looked?.into_iter().unzip();
        let first = look(&*clip.frames.frame(0)?, &clip.viewpoint(0).with_camera(camera)).0;
        Ok(Self { range, magnification, views, levels, first, outlines })
    }

    /// The levels in use, coarse to fine.
    pub fn coarse_to_fine(&self) -> impl Iterator<Item = usize> + use<> {
        (self.range[0]..=self.range[1]).rev()
    }
}

/// The finest level at which all pixels, of `bytes` each, fit into `memory`.
fn fitting(camera: &Camera, bytes: usize, memory: usize) -> usize {
    let fits = |level: &usize| (camera.width >> level) * (camera.height >> level) * bytes <= memory;
    (0..usize::BITS as usize).find(fits).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::Settings;

    #[test]
    fn long_large_videos_are_looked_at_from_farther_away() {
        let level = |width: usize, frames: usize| {
            let camera = Camera { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, width, height: width };
            fitting(&camera, frames * COLOUR_BYTES, COLOUR_MEMORY)
        };
        assert_eq!([level(800, 50), level(3840, 4), level(3840, 300)], [0, 0, 4]);
        assert!((3840usize >> 4).pow(2) * 300 * COLOUR_BYTES <= COLOUR_MEMORY);
        assert!((3840usize >> 3).pow(2) * 300 * COLOUR_BYTES > COLOUR_MEMORY);
    }

    #[test]
    fn small_pictures_have_few_levels() {
        let settings = Settings::default().with(|s| {
            s.frames = 2;
            s.size = 48;
            s.grid = [4, 4];
        });
        let scene = crate::synth::make(&settings).unwrap();
        for (asked, found) in [([1, 2], [1, 2]), ([0, 8], [0, 4]), ([7, 8], [4, 4])] {
            let observed = Observed::new(&scene, &scene, asked, 1).unwrap();
            assert_eq!(observed.range, found);
            assert_eq!(observed.levels[1].len(), found[1] + 1);
        }
    }
}
