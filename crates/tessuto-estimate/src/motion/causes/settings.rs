//! Settings of the search for causes.

use tessuto_core::settings::settings;

/// Resistance of an edge to shortening, as a fraction of that to lengthening: coarse edges shorten as the cloth wrinkles below them.
pub const COMPRESSION: f64 = 0.05;

settings! {
    /// Settings of the causes of a motion.
    pub struct CauseSettings {
        /// Search for stiffnesses, gravity, air and what is held; otherwise stiffnesses are effective values that replay the motion.
        fit: bool = false, flag();
        /// Gauss-Newton iterations, at most.
        iterations: usize = 6, number(0.0..=100.0, "");
        /// Strength of the springs between the simulated and the found positions while causes are searched.
        tie: f64 = 100.0, number(0.0..=1e6, "1/s²");
        /// Strength of the pull that leads the replay along the found positions, less where the fabric is stiff: it is what no cause
        /// explains. Of positions that are sure to 5 mm; surer ones pull with the square. A softer one leaves more of their noise out.
        tracking: f64 = 6.4e5, number(1e-6..=1e12, "1/s²");
        /// Spread of ln of a stiffness about its start, half of it for stretch; larger is weaker.
        spread: f64 = 2.0, number(1e-3..=100.0, "");
        /// Spread of the wind's velocity, a tenth of it in the first frame, in which cloth hangs still as a rule; larger is weaker.
        wind: f64 = 1.0, number(1e-6..=1e3, "m/s");
        /// Time between two values of the wind.
        wind_interval: f64 = 0.1, number(1e-3..=1e3, "s");
        /// Most vertices times frames that the search looks at, from the first frame on.
        window: usize = 32_000, number(1.0..=1e9, "");
    }
}
