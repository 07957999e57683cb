//! Physically based direct light on a deforming cloth, with derivatives: material maps and an environment map
//! → linear colours of surface points, and back.
//!
//! The motion is fixed, so everything that depends on geometry alone is made once: [`Geometry`] (per frame a tree
//! of triangles, per triangle a horizon that the cloth does not rise above) and [`SurfacePoint`]s (what a pixel
//! sees). [`Shader`] then estimates the radiance of a point towards the camera: in bundles of eight directions
//! from the [`EnvironmentSampler`] and eight from the [`brdf`], combined by the balance heuristic. Each direction
//! is shadowed by the cloth itself. Directions and their densities are constants to the derivative.
//! [`mod@reference`] is the same quantity, written plainly.
//!
//! [`render_frame`] draws with them. [`accumulate()`] is both ways at once, value and adjoint of a loss over many
//! points:
//!
//! ```
//! use tessuto_core::glam::DVec2;
//! use tessuto_core::Camera;
//! use tessuto_render::pbr::{
//!     EnvironmentMap, EnvironmentSampler, Geometry, Gradients, Material, Shader, accumulate, visible_points,
//! };
//! use tessuto_render::raster::{Rasterizer, Rendering};
//!
//! let mesh = tessuto_core::mesh::grid(4, 4, DVec2::splat(0.2), 1.0);
//! let camera = Camera { fx: 100.0, fy: 100.0, cx: 15.5, cy: 15.5, width: 32, height: 32 };
//! let geometry = Geometry::new(&mesh, std::slice::from_ref(&mesh.positions));
//! let rasterizer = Rasterizer::new(&mesh);
//! let rendering = &mut Rendering::new();
//! let seen = visible_points(&rasterizer, &camera, &geometry, 0, &mesh.positions, rendering, |_, _| true);
//! let points: Vec<_> = seen.into_iter().map(|(_pixel, point)| point).collect();
//!
//! let material = Material::uniform(16, 16, [0.5, 0.4, 0.3], 0.8, 0.0);
//! let environment = EnvironmentMap::uniform(32, 16, [2.0; 3]);
//! let light = EnvironmentSampler::new(&environment, 0.1);
//! let shader = Shader { geometry: &geometry, material: &material, light: &light };
//! // The loss is the sum of the red radiance of all points; of the two estimates of each point the first is used.
//! let loss = |_point: usize, colours: &[[f32; 3]; 2]| (colours[0][0], [[1.0, 0.0, 0.0], [0.0; 3]]);
//! let mut gradients = Gradients::default();
//! accumulate(&shader, &points, 7, 64, loss, &mut gradients);
//! // It is linear in the light: Σ L ∂loss/∂L = loss.
//! let along_light: f32 = gradients.light.iter().map(|g| 2.0 * g[0]).sum();
//! assert!((f64::from(along_light) / gradients.loss - 1.0).abs() < 1e-3);
//! ```
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

pub use accumulate::{Gradients, accumulate, radiance, radiance_by_diffuse, radiance_vjp};
pub use environment::EnvironmentMap;
pub use environment_sampler::EnvironmentSampler;
pub use geometry::Geometry;
#[doc(hidden)]
pub use material::Footprint;
pub use material::{CHANNELS, Material};
pub use render::{RenderScene, render_frame};
pub use shader::{LANES, RadianceEstimate, Shader};
pub use surface::SurfacePoint;
#[doc(hidden)]
pub use surface::barycentrics;
pub use visible_points::visible_points;
