//! Terms of the objective of one frame.

pub mod colour;
pub mod signed_bend;
pub mod strain;
