//! The default method: the positions of all frames at once, those that explain the video with the least strain,
//! bending and acceleration.
//!
//! Several cameras may have filmed it: "the image" is then that of each, and what is compared with images adds up over
//! them (`eye.rs`, `look.rs`). One camera is the common case.
//!
//! Unknown are the positions x_n `[m]` of every vertex in every frame n = 1 … N−1; x_0 is the template. Sought is the
//! minimum of
//!
//!   E(x) = Σ_n [ colour_n(x_n) + outline_n(x_n) + shading_n(x_n) + strain(x_n) + signed_bend(x_n)
//!                + bend(x_n) + shear(x_n) + still(x_n) + depth_n(x_n) + planes(x_n) ]
//!          + ½ Σ_n ‖x_{n+1} − 2 x_n + x_{n−1}‖²/σ_a²,  σ_a = `acceleration` · Δt².
//!
//! | term | residual r | what it adds | spread σ, tail τ (settings) |
//! |---|---|---|---|
//! | [colour](super::terms::colour), first frame | I_n(π(x_p)) − g_n(p) T(p) of every surface point p, sRGB | k a_p ρ(‖r‖/σ; τ) | `colour`, `colour_tail` |
//! | colour, adjacent frames | I_n(π(x_p)) − A_n(p), A_n the mean of what frames n±1 show; while the sheet is followed, what the last one shows | ω k a_p ρ(‖r‖/σ; τ), ω = `neighbour_weight` | the same |
//! | [outline](super::terms::outline) | distance `[px]` of every point q of the boundary, and of folds with nothing behind, to the mask's outline | k L_q ρ(r/σ; τ) | `outline` `[px]`, `outline_tail` |
//! | [shading](super::terms::shading) | logarithm of every vertex's brightness relative to the first frame, less what light and frame explain | k a_v c(r/σ; τ) | `shading` and `shading_share` of that logarithm, `shading_tail` |
//! | [strain](super::terms::strain) | ‖e‖/l_e − 1 of every edge | c(r/σ; τ) | `strain`, `tail` |
//! | [signed bend](super::terms::signed_bend) | change of a vertex's height over two opposite neighbours since rest, by arm length `[rad]`; σ in proportion to that length | c(r/σ; τ) | `signed_bend` `[rad]`, `tail` |
//! | [bend](super::terms::bend) | change of every bending angle `[rad]`; σ likewise | ½ (r/σ)² | `bend` `[rad]` |
//! | [shear](super::terms::shear) | change of every shearing angle less the sheet's own smooth shear m `[rad]` | c(r/σ; τ), ½ ‖m‖²/σ_m² | `shear` `[rad]`, `shear_tail`; σ_m `shear_smooth` `[rad]` |
//! | [still](super::terms::still) | displacement `[m]` of every vertex of an edge that does not move in the image (`still.rs`); not while the sheet is followed, nor where motions are compared | ½ (r/σ)² | `still` `[m]` |
//! | [depth](super::terms::depth), where it was measured | z_p/m_n(π(x_p)) − 1 of every surface point p, with its depth z_p and the measured m_n | k a_p ρ(r/σ; τ), k of depth | the first map's own noise, `depth_tail` |
//! | [planes](super::terms::plane), where they are given or the sheet lies on one (`lies.rs`) | height of every vertex above each `[m]` | ½ (r/σ)² below, ρ(r/σ; τ) above | `plane` `[m]`, `depth_tail` |
//! | [acceleration] | acceleration of every vertex, x_{n+1} − 2 x_n + x_{n−1} by the square of the time between frames `[m/s²]` | ½ (r/σ)² | `acceleration` `[m/s²]` |
//!
//! All are without unit, as negative logarithms of probabilities are: a residual of one σ costs ½ where τ is
//! large. ρ is Geman and McClure's kernel, c Cauchy's, both in [`super::terms::robust`]: what is more than τ
//! spreads off counts as an outlier. π is the projection and I_n the image pyramid of frame n at the level in use,
//! [`super::observed`].
//!
//! **Pixels.** σ of colours, outlines and shading is the noise of one independent pixel, and a pixel counts as k
//! of these. The areas a_p and a_v, the lengths L_q and the distances of outlines are in pixels of the finest
//! level of the pyramids, whose resolution follows the sheet's size in the image (`resolution`): what a camera of
//! more pixels would add is not independent. Images in which the sheet is smaller than that are magnified, so that
//! interpolation and blur lose less of them; a pixel remains one of the video then. k is the product of
//! - 160 px over the size of the sheet in the first frame. Of larger sheets pixels are fewer independent ones:
//!   errors of the camera are alike over a pixel, those of the model (shading, the mesh) over a part of the sheet,
//!   and half-way between lies what serves small images and large ones. So colours and shading count more in
//!   proportion to the sheet's size, not to its area, and outlines the same whatever it is;
//! - for colours, the part of the contrast that is print at the level in use (`print`): on a plain sheet light and
//!   folds alone differ, and do not move with the cloth;
//! - from the second level of `refine` on, for colours and outlines what the clip's own noise makes of a pixel, by
//!   their residuals, and for shading how much of the brightness the light explains (`noise`).
//!
//! Of measured depth a_p is in pixels of its maps, and k is `depth_weight` over the number of pixels that err together,
//! as the first map shows it. Depth is the one term whose noise is new in every pixel and frame. Errors of the others
//! are those of a model: print, light and mesh are wrong alike from frame to frame and over parts of the sheet, so that
//! taken one by one they count too often, by a factor that does not matter among themselves.
//!
//! To count k times is to have a noise of σ/√k and a tail of √k τ: the cut-off σ τ stays.
//!
//! **What does not count.** a_p is the area in the first frame; what turns away fills less of the image, and a_p
//! shrinks with it. Points that the sheet hides itself cost nothing, nor do those of which a frame shows no
//! fabric, nor boundary that lies over more of the sheet, or beside a fold that explains the outline better
//! ([`super::observed::occlusion`]), or near the border of the image, which may cut the mask's outline
//! ([`super::observed::outline_distance`]). A vertex has shading by as much of its surroundings as the frame shows
//! from the same side as the first (`light.rs`). Where motions are compared, every pixel of the mask that shows
//! none of the sheet, and every one of the sheet beside the mask, costs as much as the worst of differences, ½ k
//! τ² of colours, and a_p is the area in the frame at hand, larger or smaller: every pixel of the mask counts
//! once, so that what a motion hides is neither good nor bad, nor is half of the sheet held nearer that covers as
//! much.
//!
//! **Two sides.** Where the fabric's other side does not look like its front (`back`), T_p of a triangle that shows
//! it is the back's colour, or not known, and a border that lies over the other side is compared with the line
//! between both in the image, as others are with the mask's outline: a plain back has nothing else that moves with
//! it.
//!
//! **What is held fixed** while a step in x is taken, and found anew from the positions before the next: the
//! gains, A_n less what is in front of the fabric, what is hidden and what turns away, which folds are outlines,
//! the light with the brightness that it explains, and the normals of signed bending. The smooth shear m is not:
//! it always is the best one. Where motions are compared, spreads and tails are the settings' own except for σ_a and
//! σ_m, and k is that of size and print; the best path leaves adjacent frames out.
//!
//! Shading changes as the cloth moves. The gains g_n [V, 3], brightness of every vertex and channel relative to
//! the first frame, absorb it: they follow from the positions by least squares, smooth over the mesh ([`gain`]).
//! What is brighter has turned towards the light: light, which is one for the whole clip, and what a whole frame
//! is brighter by for other causes follow from the positions too (`light.rs`). While the sheet is first followed,
//! neither the light is known nor how fast the sheet changes its velocity, a flag fifty times as fast as paper;
//! the light and σ_a are taken from the best path forward, and all that comes after uses them.
//!
//! `track` finds a pool of starts frame by frame, with different strictness; `refine` then lowers E over all
//! frames together by Gauss-Newton steps with Levenberg's damping, from each of them. What they become shows how
//! the cloth of this clip bends and how much is to be made of its images: with that the sheet is followed again,
//! forward and backward (`again`), E lowered from what is found then, too, and at last from the best path through
//! all. Both go from coarse to fine images, `track` from coarser ones (`track_levels`). Heavy tails have many
//! minima: a sheet that is allowed to crumple does so wherever the start is off. So both keep lengths, shear and
//! bending close to least squares at first (spreads of strain and shear times `start_spread`, that of signed
//! bending times `start_bend` or as it is; tails times `start_tail`), and let these shrink to their own values in
//! equal ratios, after which only true folds are left in the tails: `refine` over its iterations, `track` from
//! level to level in each frame, where one of its two followers keeps the wider spreads. Where both find the same,
//! the best path through them (`best_path`) is the only start, and nothing is followed again; else both are the
//! pool (`followed`). Frames that are lost on the way and found again later are filled from the later ones, by
//! those who go backward.
//!
//! Of a part that is reflected along the view rays the image hardly changes: a dent is found for a bulge, and no
//! small step leads from one to the other. So `fuse` proposes such motions, and those that contended, and takes from
//! each what it explains better, vertex by vertex. Where the pictures of a stretch of frames cost twice what they do
//! before and after it, a part of the sheet was lost on the way and found again: then it proposes that stretch as
//! followed from its end, and with a part of the sheet folded over (`stretch`, `fold`).
//!
//! Sheets that keep their lengths better than most are held to them more firmly after the first level of `refine`
//! (`noise`). `track` takes the template for the shape at rest; in `refine` the shape at rest and the spread of
//! bending about it are the clip's own from the start (`bent`).
//!
//! How far the sheet shears as a whole is not known before: straight cloth and paper hardly do, and what a hand
//! pulls askew does by several hundredths, which looks much like a turn in depth. `track` begins with a narrow
//! spread σ_m, and follows the sheet once more with a wider one if the shear that it found is many times as large
//! ([`super::terms::shear`]).
//!
//! Once the causes of the motion are known, `along` goes on at the finest level: accelerations are then expected
//! to be those that the causes make, and spread about these as the motion found before does.
//!
//! Long clips are searched part by part (`parts`).
//!
//! How far the result may be off is estimated from the same system and from how badly each frame matches
//! ([`deviation`]).

pub mod acceleration;
mod again;
mod along;
mod back;
mod bent;
pub mod best_path;
pub mod deviation;
mod eye;
mod fold;
mod followed;
mod fuse;
pub mod gain;
mod joint;
mod level;
mod lies;
mod light;
mod look;
#[cfg(test)]
mod moved;
mod noise;
mod parts;
mod path_scale;
mod print;
#[cfg(test)]
mod proof;
mod refine;
mod relief;
mod settings;
mod still;
mod stretch;
mod track;
#[cfg(test)]
mod views;

use glam::DVec3;

use super::observed::silhouette::{InnerEdge, inner_edges};
use super::terms::PriorTerms;
use super::terms::bend::Bend;
use super::terms::shading::{HARMONICS, Light};
use super::terms::shear::Shear;
use super::terms::signed_bend::SignedBend;
use super::terms::strain::Strain;
use eye::Eye;
use level::LevelSearch;
use look::Gains;
pub use parts::{Found, Search};
pub use path_scale::scaled;
pub use settings::SpacetimeSettings;
use tessuto_core::error::{Error, Hint, Remedy, Result};
use tessuto_core::mesh::{Positions, Side};
use tessuto_core::scene::{Back, Scene};
use tessuto_render::raster::Rasterizer;
use tessuto_sim::Cloth;

/// Positions, shape [N, V], and why they are not better if the search failed.
pub type Fitted = (Vec<Positions>, Option<Error>);

/// What is known before the search.
struct Start {
    /// Positions of the first frames, one at least, of which the first stays as it is. Shape [K, V].
    known: Vec<Positions>,
    /// Where the part of the clip does not begin with its first frame: the way of every vertex from that to the
    /// clip's second `[m]`.
    way: Option<Positions>,
}

/// Everything about the clip that stays fixed.
pub struct Problem<'a> {
    scene: &'a Scene,
    cloth: &'a Cloth,
    settings: SpacetimeSettings,
    priors: PriorTerms<'a>,
    /// Neighbours of every vertex along edges.
    adjacency: Vec<Vec<u32>>,
    /// All edges but the border's.
    inner_edges: Vec<InnerEdge>,
    rasterizer: Rasterizer,
    /// What each camera saw; the first is the scene's own.
    eyes: Vec<Eye<'a>>,
    /// What is known of the positions.
    start: Start,
    /// The side that the clip's first frame shows more of, and what the other one looks like.
    front: Side,
    back: Back,
    /// The light, once it is known; zero before.
    light: Light,
    /// Spread of accelerations `[m/s²]`: that of the settings until the clip's own is known.
    acceleration: f64,
}

impl<'a> Problem<'a> {
    /// Looks at every frame of every camera.
    ///
    /// # Errors
    /// Those of reading the frames.
    pub fn new(scene: &'a Scene, cloth: &'a Cloth, settings: SpacetimeSettings) -> Result<Self> {
        let start = Start { known: vec![scene.template.positions.clone()], way: None };
        Self::of_part(scene, scene, cloth, settings, start)
    }

    /// Looks at every frame of every camera of `scene`, a part of the `clip` whose first frame the template is of.
    ///
    /// # Errors
    /// Those of reading the frames.
    fn of_part(
        clip: &Scene,
        scene: &'a Scene,
        cloth: &'a Cloth,
        settings: SpacetimeSettings,
        start: Start,
    ) -> Result<Self> {
        let template = &scene.template;
        let s = &settings;
        let priors = PriorTerms {
            strain: Strain { cloth, sigma: s.strain, tail: s.tail },
            signed_bend: SignedBend::new(cloth, template, s.signed_bend, s.tail),
            bend: Bend::new(cloth, template, s.bend),
            shear: Shear::new(cloth, template, [s.shear, s.shear_tail, s.shear_smooth]),
        };
        let views = 0..scene.view_count();
        let eyes: Vec<Eye> = views.map(|v| Eye::new(clip, scene, v, s)).collect::<Result<_>>()?;
        let back = back::back(scene.known.back, &eyes[0].observed);
        let mut problem = Self {
            front: Side::front(template, &eyes[0].observed.first[0].view),
            back,
            scene,
            cloth,
            priors,
            adjacency: template.neighbours(),
            inner_edges: inner_edges(template, cloth),
            rasterizer: Rasterizer::new(template),
            eyes,
            start,
            light: [0.0; HARMONICS],
            acceleration: settings.acceleration,
            settings,
        };
        for v in 0..problem.eyes.len() {
            problem.eyes[v].seams = back::seams(problem.back, &problem.eyes[v].observed);
            problem.eyes[v].print = (0..problem.level_count()).map(|k| problem.part_printed(v, k)).collect();
        }
        Ok(problem)
    }

    /// 1/σ_a² of the acceleration term [1/m²].
    fn acceleration_weight(&self) -> f64 {
        self.weight_of(self.acceleration)
    }

    /// 1/σ² of an acceleration term of spread `sigma` [m/s²], [1/m²].
    fn weight_of(&self, sigma: f64) -> f64 {
        (self.scene.fps.powi(2) / sigma).powi(2)
    }

    /// Number of resolutions at which the sheet is followed: level 0 is the finest, of all cameras.
    fn level_count(&self) -> usize {
        self.eyes.iter().map(Eye::level_count).max().unwrap_or(1)
    }

    /// The levels, coarse to fine.
    fn coarse_to_fine(&self) -> impl Iterator<Item = usize> + use<> {
        (0..self.level_count()).rev()
    }

    /// The levels at which all frames are refined together, coarse to fine.
    fn refined_levels(&self) -> Vec<usize> {
        (0..self.settings.levels.min(self.level_count())).rev().collect()
    }

    /// Whether the vertices of two motions are within this `part` of the sheet's size of each other, root mean
    /// square, in every frame.
    fn alike(&self, a: &[Positions], b: &[Positions], part: f64) -> bool {
        let reach = part * self.scene.template.area().sqrt();
        a.iter().zip(b).all(|(a, b)| apart(a, b) <= reach)
    }

    /// Whether positions, and gains of every camera, have this cloth's vertices; the latter of `gains`, shape [., C].
    fn matches(&self, frames: &[Positions], gains: &[Vec<Gains>]) -> bool {
        let count = self.cloth.vertex_count();
        let of_cameras = |of: &Vec<Gains>| of.len() == self.eyes.len() && of.iter().all(|g| g.len() == count);
        frames.iter().all(|x| x.len() == count && x.iter().all(|p: &DVec3| p.is_finite()))
            && gains.iter().all(of_cameras)
    }
}

/// Root mean square distance of corresponding vertices `[m]`.
fn apart(a: &[DVec3], b: &[DVec3]) -> f64 {
    let squares: f64 = a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum();
    (squares / a.len() as f64).sqrt()
}

fn diverged(place: &str, value: f64) -> Error {
    Error::numerical(
        format!("space-time search, {place}"),
        format!("objective {value}"),
        Hint::from("look at camera and template").with(Remedy::Check),
    )
}
