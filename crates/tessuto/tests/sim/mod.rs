//! The simulation and its derivatives.

mod continuum;
mod gradient;
mod standards;
