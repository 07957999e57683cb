//! What the crates of [tessuto](https://docs.rs/tessuto) share. Whoever reconstructs fabric depends on `tessuto`;
//! whoever simulates or renders alone, on `tessuto-sim` or `tessuto-render`, meets these types in their arguments.
//!
//! - [`Mesh`], [`Motion`] and [`Positions`]: polygons with texture coordinates, and where their vertices are in
//!   every frame;
//! - [`Camera`] and [`Viewpoint`]: from points to pixels and back, with derivatives;
//! - [`Scene`] and [`Video`]: what was filmed, by which camera, of which cloth;
//! - [`math`]: sparse symmetric systems of 3×3 blocks, damped Gauss-Newton steps, numbers that carry derivatives,
//!   random streams;
//! - [`Error`]: what is wrong, where, and the way out.
//!
//! ```
//! use tessuto_core::glam::{DMat3, DVec2};
//! use tessuto_core::math::block_matrix::{BlockMatrix, BlockPattern};
//! use tessuto_core::math::factor::{Analysis, Scratch};
//! use tessuto_core::{Camera, Viewpoint, mesh};
//!
//! // A sheet one metre in front of a camera, and where it sees the upper left corner.
//! let sheet = mesh::grid(5, 4, DVec2::new(0.4, 0.3), 1.0);
//! let camera = Camera { fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };
//! let corner = Viewpoint::from(camera).project(sheet.positions[0]);
//! assert!(corner.distance(DVec2::new(219.5, 164.5)) < 1e-9);
//!
//! // A x = b, where the block of each pair of neighbours is −1, each diagonal block 5: the matrix is factorised
//! // along the sheet.
//! let edges = sheet.edges();
//! let pattern = BlockPattern::new(&sheet.positions, &edges);
//! let mut matrix = BlockMatrix::zeros(&pattern);
//! (0..sheet.positions.len()).for_each(|v| matrix.add_diagonal(&pattern, v, &(5.0 * DMat3::IDENTITY)));
//! (0..edges.len()).for_each(|k| matrix.add_pair(&pattern, k, &-DMat3::IDENTITY));
//! let (analysis, mut scratch) = (Analysis::new(&pattern), Scratch::default());
//! let factor = analysis.factorize(&pattern, &matrix, &mut scratch);
//! let x = analysis.solve(&pattern, &factor, &sheet.positions, &mut scratch);
//!
//! let back = matrix.multiply(&pattern, &x);
//! assert!(back.iter().zip(&sheet.positions).all(|(p, q)| p.distance(*q) < 1e-12));
//! ```
//!
//! Metres, seconds, kilograms; x right, y down, z forward; the centre of pixel (column i, row j) is at (i, j).

pub mod camera;
pub mod error;
pub mod image;
pub mod math;
pub mod mesh;
pub mod optim;
#[doc(hidden)]
pub mod parallel;
#[doc(hidden)]
pub mod processor;
pub mod scene;
pub mod settings;
#[doc(hidden)]
pub mod text;
pub mod video;

pub use glam;

pub use camera::{Camera, Pose, Rect, Viewpoint};
pub use error::{Error, Hint, Remedy, Repair, Result, Warning};
pub use image::Image;
pub use mesh::{Mesh, Motion, Positions};
pub use scene::{Back, Depths, Known, Plane, PoseUnit, Scene, Tracks, Truth, View};
pub use video::{Frame, Video};
