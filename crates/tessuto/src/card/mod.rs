//! The card of a fabric: what its clips say of it together, and the tests of a textile laboratory on a simulated
//! piece of it, as one page that needs no other file.

pub mod combine;
mod drawing;
pub mod laboratory;
pub mod page;

pub use combine::{Answer, Clip, Contradiction, Parameter, combine};
pub use laboratory::{Tested, simulate};
pub use page::{Card, render, write};

/// Three digits, or a whole number above 1000; a power of ten where the number is very small.
pub(crate) fn digits(value: f64) -> String {
    let size = value.abs();
    if size > 0.0 && size < 1e-2 {
        return format!("{value:.2e}");
    }
    let decimals = if size > 0.0 { 2 - size.log10().floor().clamp(-2.0, 2.0) as i32 } else { 0 };
    format!("{value:.*}", decimals.max(0) as usize)
}
