//! Numbers out of bytes that may end early.

use crate::refused::{Refused, damaged};

/// Reads numbers, the highest byte first.
#[derive(Clone, Copy)]
pub(crate) struct Bytes<'a> {
    /// What is left.
    pub(crate) rest: &'a [u8],
    /// What it is, for errors.
    what: &'a str,
}

impl<'a> Bytes<'a> {
    pub(crate) fn new(rest: &'a [u8], what: &'a str) -> Self {
        Bytes { rest, what }
    }

    /// The next `count` bytes.
    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8], Refused> {
        let Some((taken, rest)) = self.rest.split_at_checked(count) else {
            return damaged(format!("{} ends early", self.what));
        };
        self.rest = rest;
        Ok(taken)
    }

    /// The next `count` ≤ 8 bytes as a number.
    pub(crate) fn number(&mut self, count: usize) -> Result<u64, Refused> {
        Ok(self.take(count)?.iter().fold(0, |n, &b| n << 8 | u64::from(b)))
    }

    pub(crate) fn u8(&mut self) -> Result<u8, Refused> {
        Ok(self.number(1)? as u8)
    }

    pub(crate) fn u16(&mut self) -> Result<u16, Refused> {
        Ok(self.number(2)? as u16)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, Refused> {
        Ok(self.number(4)? as u32)
    }

    pub(crate) fn i32(&mut self) -> Result<i32, Refused> {
        Ok(self.u32()? as i32)
    }

    pub(crate) fn u64(&mut self) -> Result<u64, Refused> {
        self.number(8)
    }
}
