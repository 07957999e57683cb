//! Settings of the search for causes.

use tessuto_core::settings::settings;

/// Resistance of an edge to shortening, as a fraction of that to lengthening: coarse edges shorten as the cloth
/// wrinkles below them.
pub const COMPRESSION: f64 = 0.05;

settings! {
    /// Settings of the causes of a motion.
    pub struct CauseSettings {
        /// Estimate stiffnesses, gravity, air and held vertices; otherwise stiffnesses are effective values that
        /// replay the motion.
        fit: bool = false, flag();
        /// Gauss-Newton iterations, at most.
        iterations: usize = 6, number(0.0..=100.0, "");
        /// Strength of the springs between simulated and found positions while physics is estimated.
        tie: f64 = 100.0, number(0.0..=1e6, "1/s²");
        /// Strength of the pull that leads the replay along the found positions, less where the fabric is stiff:
        /// the residual force. It is for positions with a standard deviation of 5 mm, and goes with the inverse
        /// square. A softer pull follows less of their noise.
        tracking: f64 = 6.4e5, number(1e-6..=1e12, "1/s²");
        /// Spread of ln of a stiffness about its start, half of it for stretch; larger is weaker.
        spread: f64 = 2.0, number(1e-3..=100.0, "");
        /// Spread of the wind's velocity, a tenth of it in the first frame, in which cloth usually hangs still;
        /// larger is weaker.
        wind: f64 = 1.0, number(1e-6..=1e3, "m/s");
        /// Time between two values of the wind.
        wind_interval: f64 = 0.1, number(1e-3..=1e3, "s");
        /// Most vertices times frames that the search looks at, from the first frame on.
        window: usize = 32_000, number(1.0..=1e9, "");
    }
}
