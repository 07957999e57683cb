//! The simulation and its derivatives.

mod contact;
mod continuum;
mod gradient;
mod standards;
