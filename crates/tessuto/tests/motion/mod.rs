//! The search for the motion.

mod divergence;
mod gradient;
mod streamed;
