//! The rasteriser and its adjoint.

mod adjoint;
mod forward;
