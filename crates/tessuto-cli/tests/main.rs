//! The program as a user runs it, in one test program.
//!
//! Alone: `cargo test --release -p tessuto-cli --test main commands::render`.

mod commands;
#[path = "../../tessuto/tests/support/missing.rs"]
mod missing;
#[path = "../../tessuto/tests/support/scene_maker.rs"]
mod scene_maker;
#[path = "../../tessuto/tests/template/shapes.rs"]
mod shapes;
