//! The simulation and its derivatives.

mod gradient;
