//! The Python module `tessuto._native`: what the package in `python/tessuto` is made of.
//!
//! Everything here takes and returns plain arrays and words; names, defaults and documentation are the package's.
//! Whatever takes long runs without Python's lock.

mod appearance;
mod arrays;
mod cloth;
mod error;
mod light;
mod observer;
mod program;
mod raster;
mod remedy;
mod result;
mod run;
mod scene;

use pyo3::prelude::*;

/// Version of the package.
#[pyfunction]
fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::{
        appearance::appearance,
        cloth::{Cloth, ClothStep, Rollout, cloth_step, rollout},
        light::{LitPoints, direct_light, direct_light_vjp},
        program::main,
        raster::{Rasterizer, Rendered, rasterize},
        result::{
            check_result, evaluate, evaluate_scene, export, formats, read_image, read_mesh, render, simulate,
        },
        run::reconstruct,
        scene::Scene,
        version,
    };
}
