//! Physically based direct light on a deforming cloth, with derivatives: material maps and an environment map
//! → linear colours of surface points, and back.
//!
//! The motion is fixed, so everything that depends on geometry alone is made once: [`Geometry`] (per frame a
//! tree of triangles, per triangle a horizon that the cloth does not rise above) and [`SurfacePoint`]s (what a pixel
//! sees). [`Shader`] then estimates the radiance of a point towards the camera: in bundles of eight directions from
//! the [`EnvironmentSampler`] and eight from the [`brdf`], combined by the balance heuristic. Each direction is shadowed by
//! the cloth itself. Directions and their densities are constants to the derivative. [`mod@reference`] is
//! the same quantity, written plainly.
//!
//! Colours are linear; arithmetic is f32, eight directions at a time. Results are the same, bit for bit, for
//! any number of threads.
//!
//! Light that comes from behind the triangle that a pixel sees is blocked, even where the interpolated
//! normal would accept it: cloth is opaque.

mod accumulate;
pub mod brdf;
mod bvh;
mod denoise;
mod environment;
mod environment_sampler;
mod geometry;
mod gradient_sums;
mod horizon;
mod material;
pub mod reference;
mod render;
mod shader;
mod surface;
mod visible_points;

pub use accumulate::{Gradients, accumulate};
pub use environment::EnvironmentMap;
pub use environment_sampler::EnvironmentSampler;
pub use geometry::Geometry;
pub use material::{CHANNELS, Material};
pub use render::{RenderScene, render_frame};
pub use shader::{LANES, RadianceEstimate, Shader};
pub use surface::SurfacePoint;
pub(crate) use surface::barycentrics;
pub use visible_points::visible_points;
