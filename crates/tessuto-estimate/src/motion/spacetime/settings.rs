//! Settings of the search for all frames' positions.

use tessuto_core::settings::settings;

settings! {
    /// Strictness of every term. A residual of one spread σ costs ½: the larger σ, the weaker the term.
    pub struct SpacetimeSettings {
        /// Spread σ of the strain of an edge; larger is weaker.
        strain: f64 = 0.001, number(1e-6..=10.0, "");
        /// Strain and signed bending beyond this many spreads are treated as a fold and resisted less and less; larger
        /// is stricter.
        tail: f64 = 1.0, number(1e-3..=1e6, "");
        /// Spread σ of the bending angle at a vertex, whatever its direction, where edges measure a 24th of the
        /// sheet; it grows with their length. Larger is weaker.
        bend: f64 = 0.15, number(1e-6..=1e3, "rad");
        /// Spread σ of the bending angle at a vertex against that of the template, with its sign, where edges
        /// measure a 24th of the sheet; it grows with their length. While all frames are refined together, rest
        /// and spread are the clip's own. Larger is weaker.
        signed_bend: f64 = 0.06, number(1e-6..=1e3, "rad");
        /// Spread σ of the shearing angle at a vertex about the sheet's own smooth shear; larger is weaker.
        shear: f64 = 0.01, number(1e-6..=1e3, "rad");
        /// Shear beyond this many spreads is resisted less and less; larger is stricter.
        shear_tail: f64 = 1.0, number(1e-3..=1e9, "");
        /// Spread of the modes of the sheet's own smooth shear; larger is weaker. A sheet that is found to shear
        /// by much more is followed again with a larger one of more modes.
        shear_smooth: f64 = 0.0015, number(1e-6..=1e3, "rad");
        /// Standard deviation σ of vertices on edges detected as fixed; larger is weaker.
        still: f64 = 0.0001, number(1e-6..=1e6, "m");
        /// Spread σ of the height of vertices over a given plane on which they lie; larger is weaker. The tail of
        /// measured depth is its tail.
        plane: f64 = 0.001, number(1e-6..=1e3, "m");
        /// Spread σ of the acceleration of a vertex while the sheet is first followed; larger is weaker. After
        /// that it is the clip's own, a tenth of this at least.
        acceleration: f64 = 10.0, number(1e-4..=1e6, "m/s²");
        /// Noise σ of the colour of one pixel of the finest level, all channels together, of a sheet of 160 px.
        /// Larger is weaker.
        colour: f64 = 0.0273861, number(1e-6..=1e3, "sRGB");
        /// Colours that differ by more than this many spreads σ count less and less; larger is stricter.
        colour_tail: f64 = 3.65148, number(1e-3..=1e6, "");
        /// Weight of the comparison with the frames before and after, relative to that with the first frame.
        neighbour_weight: f64 = 0.5, number(0.0..=100.0, "");
        /// Noise σ of one pixel of outline: its distance to that of the mask, of a sheet of 160 px. Larger is weaker.
        outline: f64 = 0.464758, number(1e-5..=1e5, "px of the finest level");
        /// Outlines farther apart than this many spreads σ count less and less; larger is stricter.
        outline_tail: f64 = 25.8199, number(1e-3..=1e6, "");
        /// Weight of measured depth, whose errors are new in every frame, relative to that of images, whose errors
        /// are not.
        depth_weight: f64 = 3.0, number(0.0..=1e6, "");
        /// Measured depth farther off than this many spreads σ of its own noise counts less and less; larger is
        /// stricter.
        depth_tail: f64 = 3.0, number(1e-3..=1e6, "");
        /// Smoothness of the brightness field, relative to the data.
        gain_smoothness: f64 = 1.0, number(0.0..=1e6, "");
        /// Noise σ of the logarithm of the brightness of one pixel about what the light of the scene explains, of
        /// a sheet of 160 px; larger is weaker. Where the light explains little of the brightness, shading counts
        /// less at the end.
        shading: f64 = 0.122474, number(1e-4..=1e3, "");
        /// The same in proportion to the logarithm itself; larger is weaker.
        shading_share: f64 = 0.489898, number(0.0..=1e3, "");
        /// Brightness beyond this many spreads σ is treated as an outlier; larger is stricter, 0 leaves shading out.
        shading_tail: f64 = 0.816497, number(0.0..=1e6, "");
        /// Standard deviation of a per-frame log-exposure offset; larger is weaker.
        shading_offset: f64 = 0.05, number(1e-6..=1e3, "");
        /// Resolution of the finest level of the image pyramids, each of which halves the frames: the coarsest at
        /// which the sheet still measures this many pixels in the first frame (the root of its area). Smaller
        /// images are magnified, up to four times.
        resolution: f64 = 120.0, number(1.0..=1e5, "px");
        /// Number of levels in use; the search goes from coarse to fine.
        levels: usize = 2, number(1.0..=8.0, "");
        /// Number of coarser levels that are used besides to find each frame from the ones before.
        track_levels: usize = 2, number(0.0..=8.0, "");
        /// The search starts with spreads of strain and shear that are larger by this factor; frames are found
        /// both with and without it at the finest level.
        start_spread: f64 = 2.0, number(1.0..=1e6, "");
        /// Frames are found with a spread of signed bending larger by this factor, too.
        start_bend: f64 = 3.0, number(1.0..=1e6, "");
        /// The search starts with tails that are longer by this factor, close to least squares; they shorten to
        /// their own from coarse to fine.
        start_tail: f64 = 100.0, number(1.0..=1e9, "");
        /// Most frames that are searched together; longer clips are searched part by part. Memory grows with it.
        window: usize = 200, number(24.0..=1e6, "");
        /// Iterations over all frames at each level.
        iterations: usize = 22, number(0.0..=1e6, "");
        /// Iterations over all frames once the physics is known.
        iterations_along: usize = 10, number(0.0..=1e6, "");
    }
}
