//! Direct light and its adjoint.

mod light;
