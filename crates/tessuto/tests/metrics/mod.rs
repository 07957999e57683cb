//! Errors against the truth, and the verdict without it.

mod agreement;
mod analytic;
mod partial;
mod verdict;
