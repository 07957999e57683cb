//! From pixels to motion: two methods, and what they share.
//!
//! `spacetime` (preset `default`) searches the positions of all frames at once, as a sum of [`terms`] over the
//! [`observed`] video; [`causes`] then finds stiffnesses, gravity, air and what is held,
//! and `inverse` the accelerations that lead a simulation along them.
//! `rollout` (preset `saft`) optimises stiffnesses and accelerations through the simulation and a renderer.
//! Both end in the same [`parameters`]. `texture` is what the fabric looks like in the first frame.

pub mod causes;
pub(crate) mod inverse;
#[doc(hidden)]
pub mod observed;
pub mod parameters;
pub mod rollout;
pub mod spacetime;
#[doc(hidden)]
pub mod terms;
pub mod texture;
