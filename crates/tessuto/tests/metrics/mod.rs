//! Errors against the truth.

mod agreement;
mod analytic;
