//! Differentiable cloth simulation: two elastic models, springs and a continuum ([`fabric`]), two implicit
//! integrators, a network that stands for one ([`surrogate`]), their adjoints.
//!
//! A [`Cloth`] is made from a polygon mesh: its edges are the threads, its parameters a handful of numbers that a
//! loss can be differentiated by. Sheets hang, fall, slide and flutter in moving [`air`]. Results are the same,
//! bit for bit, for any number of threads. This crate is what [tessuto](https://docs.rs/tessuto) recovers fabric
//! with, where it is called `tessuto::sim`.
//!
//! [`rollout()`] simulates a clip, [`rollout_vjp`] takes the derivatives of a loss by its positions back to
//! accelerations, stiffnesses and the initial state:
//!
//! ```
//! use tessuto_core::glam::{DVec2, DVec3};
//! use tessuto_sim::{
//!     Accelerations, Cloth, Integrator, RolloutInputs, State, StepSettings, Stiffness, rollout, rollout_vjp,
//! };
//!
//! let mesh = tessuto_core::mesh::grid(6, 6, DVec2::splat(0.2), 1.0);
//! let cloth = Cloth::new(&mesh);
//! let settings = StepSettings {
//!     integrator: Integrator::ImplicitEuler,
//!     step: 0.005,
//!     damping: 0.9,
//!     tolerance: 1e-9,
//!     newton_limit: 50,
//! };
//! // Two frames of four sub-steps in free fall.
//! let initial = State { x: mesh.positions.clone(), v: vec![DVec3::ZERO; 36] };
//! let stiffness = Stiffness::uniform(&cloth, [200.0, 1e-3, 1e-3]);
//! let mut accelerations = Accelerations::zeros(3, 1, 36);
//! accelerations.constant = DVec3::Y * 9.81;
//! let inputs = RolloutInputs { initial: &initial, accelerations: &accelerations, stiffness: &stiffness };
//! let motion = rollout(&cloth, &settings, 4, 3, &inputs)?;
//! assert!(motion.frames[2][0].y > mesh.positions[0].y);
//!
//! // How the mean height of the last frame follows from the acceleration.
//! let mut grad_frames = vec![vec![DVec3::ZERO; 36]; 3];
//! grad_frames[2] = vec![DVec3::Y / 36.0; 36];
//! let gradients = rollout_vjp(&cloth, &settings, &inputs, &motion, &grad_frames);
//! let fallen = motion.frames[2][0].y - mesh.positions[0].y;
//! assert!((gradients.constant.y * 9.81 - fallen).abs() < 1e-9, "it is linear");
//! # Ok::<(), tessuto_core::Error>(())
//! ```

pub mod air;
#[doc(hidden)]
pub mod angle;
pub mod cloth;
pub mod contact;
pub mod continuum;
pub mod fabric;
mod flat;
mod friction;
pub mod hinge;
pub mod implicit_euler;
pub mod lattice;
pub mod linearized_euler;
pub mod membrane;
mod model;
pub mod per_width;
#[doc(hidden)]
pub mod rollout;
mod springs;
pub mod state;
pub mod step;
pub mod stiffness;
#[doc(hidden)]
pub mod stretch;
pub mod surrogate;
#[doc(hidden)]
pub mod textile;
#[doc(hidden)]
pub mod ties;
#[cfg(feature = "decoder")]
pub mod training;
mod wind;

pub use cloth::Cloth;
pub use fabric::Fabric;
pub use flat::panel;
pub use model::{Model, Property};
pub use rollout::{Accelerations, Rollout, RolloutGradients, RolloutInputs, play, rollout, rollout_vjp};
pub use state::{Integrator, State, StepSettings};
pub use stiffness::{Energy, HessianKind, Stiffness};
pub use ties::TiedCloth;
