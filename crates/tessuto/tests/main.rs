//! The library from outside, in one program: each test binary would link the whole library again. The folders are those
//! of `src`; `architecture` reads the sources and documents, `invariants` tries random states and damaged files.
//!
//! Alone: `cargo test --release -p tessuto --test main sim::gradient`.

mod architecture;
mod export;
mod invariants;
mod io;
mod masks;
mod metrics;
mod motion;
mod pbr;
mod raster;
mod report;
mod run;
mod sim;
mod support;
mod synth;
mod template;
