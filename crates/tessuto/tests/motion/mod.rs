//! The search for the motion.

mod divergence;
mod gradient;
mod held;
mod streamed;
mod views;
