//! Differentiable images of a triangle mesh on the CPU: two renderers, each a function and its adjoint.
//!
//! - [`raster`]: textured triangles with coverage and depth; gradients by positions, also through silhouettes, and
//!   by the texture;
//! - [`pbr`]: direct light of an environment map on a moving cloth with shadows; gradients by material maps and light;
//! - `decoder`, with the cargo feature of this name: material maps as the output of an untrained network.
//!
//! Results are the same, bit for bit, for any number of threads. This crate is what
//! [tessuto](https://docs.rs/tessuto) looks at fabric with, where the modules have the same names.
//!
//! ```
//! use tessuto_core::glam::DVec2;
//! use tessuto_core::{Camera, mesh};
//! use tessuto_render::raster::{Gradients, Rasterizer, Rendering, Texture};
//!
//! let sheet = mesh::grid(4, 4, DVec2::splat(0.2), 1.0); // 20 cm, one metre away
//! let camera = Camera { fx: 100.0, fy: 100.0, cx: 15.5, cy: 15.5, width: 32, height: 32 };
//! let (grey, rasterizer) = (Texture::uniform(8, 8, [0.5; 3]), Rasterizer::new(&sheet));
//! let mut image = Rendering::new();
//! rasterizer.render(&camera, &sheet.positions, &grey, &mut image);
//! let covered: f32 = image.rgba.iter().map(|pixel| pixel[3]).sum();
//! assert!((covered - 400.0).abs() < 1.0, "20×20 pixels");
//!
//! // To cover more, the sheet has to come nearer.
//! let (by_coverage, mut gradients) = (vec![[0.0, 0.0, 0.0, 1.0]; 32 * 32], Gradients::new(&rasterizer));
//! rasterizer.render_vjp(&camera, &sheet.positions, &grey, &image, &by_coverage, None, &mut gradients);
//! assert!(gradients.positions.iter().map(|g| g.z).sum::<f64>() < 0.0);
//! ```

#[cfg(feature = "decoder")]
pub mod decoder;
pub mod pbr;
pub mod raster;
