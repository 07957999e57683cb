//! From pixels to motion: two methods, and what they share.
//!
//! `spacetime` (preset `default`) searches the positions of all frames at once, as a sum of [`terms`] over the
//! [`observed`] video; [`causes`] then finds stiffnesses, gravity, air and what is held,
//! and `inverse` the accelerations that lead a simulation along them.
//! [`baselines`] (presets `saft`, `phi-sft`, `pg-sft`) are the published rivals, which optimise stiffnesses and
//! accelerations through the simulation and a renderer.
//! Both end in the same [`parameters`]. `texture` is what the fabric looks like in the first frame.

pub mod baselines;
pub mod causes;
mod image_loss;
pub(crate) mod inverse;
#[doc(hidden)]
pub mod observed;
pub mod parameters;
pub mod spacetime;
#[doc(hidden)]
pub mod terms;
pub mod texture;
