//! Bits of a parameter set, from the first of each byte on.

use std::borrow::Cow;

use crate::refused::Refused;

/// Reads bits; what lies beyond the end is an error, never a guess.
pub(crate) struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Bits<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Bits { bytes, at: 0 }
    }

    pub(crate) fn bit(&mut self) -> Result<bool, Refused> {
        let byte = self.bytes.get(self.at / 8).ok_or_else(short)?;
        let bit = byte >> (7 - self.at % 8) & 1 == 1;
        self.at += 1;
        Ok(bit)
    }

    /// `count` ≤ 32 bits as a number, the first the highest.
    pub(crate) fn bits(&mut self, count: u32) -> Result<u32, Refused> {
        let mut value = 0;
        for _ in 0..count {
            value = value << 1 | u32::from(self.bit()?);
        }
        Ok(value)
    }

    pub(crate) fn skip(&mut self, count: usize) -> Result<(), Refused> {
        self.at += count;
        if self.at > self.bytes.len() * 8 { Err(short()) } else { Ok(()) }
    }

    /// Exp-Golomb code ue(v), up to 2³² − 2.
    pub(crate) fn unsigned(&mut self) -> Result<u32, Refused> {
        let mut zeros = 0;
        while !self.bit()? {
            zeros += 1;
            if zeros > 31 {
                return Err(Refused::Damaged("a number of a parameter set is too long".into()));
            }
        }
        Ok((1 << zeros) - 1 + self.bits(zeros)?)
    }

    /// Exp-Golomb code ue(v) that may not exceed `largest`.
    pub(crate) fn up_to(&mut self, largest: u32, what: &str) -> Result<u32, Refused> {
        let value = self.unsigned()?;
        if value > largest {
            return Err(Refused::Damaged(format!("{what} is {value}; at most {largest} is allowed")));
        }
        Ok(value)
    }

    /// Exp-Golomb code se(v).
    pub(crate) fn signed(&mut self) -> Result<i64, Refused> {
        let code = i64::from(self.unsigned()?);
        Ok(if code % 2 == 1 { (code + 1) / 2 } else { -(code / 2) })
    }
}

fn short() -> Refused {
    Refused::Damaged("a parameter set ends early".into())
}

/// Whether a unit is free of what no encoder writes into one: two zeros before 0, 1 or 2, such as holes of zeros
/// that a failing card leaves. A few zeros behind it are common.
pub(crate) fn is_sound(unit: &[u8]) -> bool {
    let end = unit.iter().rposition(|&b| b != 0).map_or(0, |k| k + 1);
    unit.len() - end <= 8 && !unit[..end].windows(3).any(|w| w[0] == 0 && w[1] == 0 && w[2] < 3)
}

/// The payload of a unit: without the bytes 3 that keep start codes out of it (ITU-T H.264, 7.4.1.1; H.265, 7.4.2.1).
pub(crate) fn unescaped(bytes: &[u8]) -> Cow<'_, [u8]> {
    let Some(first) = bytes.windows(3).position(|w| w == [0, 0, 3]) else { return Cow::Borrowed(bytes) };
    let mut out = Vec::with_capacity(bytes.len());
    out.extend_from_slice(&bytes[..first]);
    let mut zeros = 0;
    for &byte in &bytes[first..] {
        if zeros >= 2 && byte == 3 {
            zeros = 0;
            continue;
        }
        zeros = if byte == 0 { zeros + 1 } else { 0 };
        out.push(byte);
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_the_standard_codes_them() {
        // 1, 010, 011, 00100, 00101 | se: 1, 010, 011, 00100, 00101
        let bytes = [0b1010_0110, 0b0100_0010, 0b1101_0011, 0b0010_0001, 0b0100_0000];
        let mut bits = Bits::new(&bytes);
        let unsigned: Vec<u32> = (0..5).map(|_| bits.unsigned().unwrap()).collect();
        assert_eq!(unsigned, [0, 1, 2, 3, 4]);
        let signed: Vec<i64> = (0..5).map(|_| bits.signed().unwrap()).collect();
        assert_eq!(signed, [0, 1, -1, 2, -2]);
        assert!(bits.bits(16).is_err());
        assert!(Bits::new(&[0; 9]).unsigned().is_err());
    }

    #[test]
    fn holes_are_not_sound() {
        assert!(is_sound(&[0x65, 0, 0, 3, 0, 0, 3, 1, 0, 0]));
        for hole in [[0, 0, 0], [0, 0, 1], [0, 0, 2]] {
            assert!(!is_sound(&[&[0x65, 4][..], &hole, &[9]].concat()));
        }
        assert!(!is_sound(&[&[0x65, 4][..], &[0; 9]].concat()));
    }

    #[test]
    fn bytes_that_keep_start_codes_out_are_dropped() {
        assert_eq!(*unescaped(&[0, 0, 3, 1, 0, 0, 3, 0, 0, 3]), [0, 0, 1, 0, 0, 0, 0]);
        assert_eq!(*unescaped(&[1, 0, 0, 0, 3, 3]), [1, 0, 0, 0, 3]);
        assert_eq!(*unescaped(&[5, 0, 3]), [5, 0, 3]);
    }
}
