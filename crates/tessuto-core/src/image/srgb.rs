//! The sRGB transfer curve (IEC 61966-2-1).

macro_rules! curve {
    ($decode:ident, $encode:ident, $float:ty) => {
        /// Linear value of an sRGB-encoded one.
        #[inline]
        pub fn $decode(s: $float) -> $float {
            if s <= 0.040_45 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) }
        }

        /// sRGB encoding of a linear value; goes on above 1.
        #[inline]
        pub fn $encode(l: $float) -> $float {
            if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 }
        }
    };
}

curve!(decode, encode, f32);
curve!(decode_f64, encode_f64, f64);

/// Derivative of [`encode`].
#[inline]
pub fn encode_slope(l: f32) -> f32 {
    if l <= 0.003_130_8 { 12.92 } else { 1.055 / 2.4 * l.powf(1.0 / 2.4 - 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decode_inverts_encode_and_the_slope_is_its_derivative() {
        for k in 1..100 {
            let l = k as f32 * 0.013;
            assert!((decode(encode(l)) - l).abs() < 1e-5);
            let h = 1e-3 * l;
            let difference = (encode(l + h) - encode(l - h)) / (2.0 * h);
            assert!((difference / encode_slope(l) - 1.0).abs() < 2e-3, "at {l}");
        }
    }
}
