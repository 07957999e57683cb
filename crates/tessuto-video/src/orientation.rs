//! How frames of H.264 and HEVC say that they are turned: the message "display orientation" beside them.
//!
//! Source: ITU-T H.264 (08/2021), D.1.27 and D.2.27; H.265 (08/2021), D.2.17 and D.3.17; of messages: 7.3.2.3.1.

use crate::bits::{Bits, unescaped};
use crate::refused::{Refused, not_handled};
use crate::track::Codec;
use crate::{h264, hevc};

/// `payloadType` of the message.
const ORIENTATION: usize = 47;
/// `nal_unit_type` of messages: of H.264, and of HEVC in front of a frame.
const MESSAGES: [u8; 2] = [6, 39];

/// What the units of one frame say of its orientation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Said {
    /// As the frame shown before.
    Nothing,
    /// Nothing, but the frame begins a sequence, in which nothing is said yet.
    Anew,
    /// Clockwise `[degrees]`, a multiple of 90, and whether for later frames too.
    Turn(u32, bool),
}

/// How the frames shown so far were turned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Orientation {
    /// Of the last frame `[degrees]`.
    pub(crate) turn: u32,
    lasts: bool,
}

impl Orientation {
    /// Takes what the next frame that is shown says.
    pub(crate) fn take(&mut self, said: Said) {
        *self = match said {
            Said::Turn(turn, lasts) => Orientation { turn, lasts },
            Said::Nothing if self.lasts => *self,
            _ => Orientation::default(),
        };
    }
}

/// What `units` of one frame say.
///
/// # Errors
/// [`Refused::NotHandled`] of frames that are mirrored, or turned by no multiple of 90°.
pub(crate) fn said(codec: Codec, units: &[&[u8]]) -> Result<Said, Refused> {
    let mut said = Said::Nothing;
    for unit in units {
        let (is_message, header, is_anew) = match codec {
            Codec::H264 => (h264::kind(unit) == MESSAGES[0], 1, h264::kind(unit) == 5),
            Codec::Hevc => (
                hevc::kind(unit) == MESSAGES[1],
                2,
                (16..=20).contains(&hevc::kind(unit)) && hevc::is_base(unit),
            ),
        };
        if is_message && let Some(payload) = message(&unescaped(unit.get(header..).unwrap_or_default())) {
            said = orientation(codec, payload)?;
        } else if is_anew && said == Said::Nothing {
            said = Said::Anew;
        }
    }
    Ok(said)
}

/// The message among those of a unit. What is cut off says nothing, as to ffmpeg.
fn message(mut unit: &[u8]) -> Option<&[u8]> {
    let number = |unit: &mut &[u8]| {
        let more = unit.iter().position(|&b| b != 255)?;
        let number = 255 * more + usize::from(unit[more]);
        *unit = &unit[more + 1..];
        Some(number)
    };
    // The last byte ends the unit.
    while unit.len() > 2 {
        let kind = number(&mut unit)?;
        let size = number(&mut unit)?;
        let payload = unit.get(..size)?;
        if kind == ORIENTATION {
            return Some(payload);
        }
        unit = &unit[size..];
    }
    None
}

fn orientation(codec: Codec, payload: &[u8]) -> Result<Said, Refused> {
    let mut bits = Bits::new(payload);
    let mut read = || -> Result<(bool, [bool; 2], u32, bool), Refused> {
        if bits.bit()? {
            return Ok((true, [false; 2], 0, false));
        }
        let flips = [bits.bit()?, bits.bit()?];
        let anticlockwise = bits.bits(16)?;
        let lasts = match codec {
            Codec::H264 => bits.unsigned()? > 0,
            Codec::Hevc => bits.bit()?,
        };
        Ok((false, flips, anticlockwise, lasts))
    };
    let Ok((is_cancelled, flips, anticlockwise, lasts)) = read() else { return Ok(Said::Nothing) };
    if is_cancelled {
        return Ok(Said::Anew);
    }
    // Both together are half a turn; the angle is in parts of 2^16 of a whole one.
    if flips[0] != flips[1] || anticlockwise % (1 << 14) != 0 {
        return not_handled("frames that are mirrored, or turned by no multiple of 90°");
    }
    let turn = 360 - 90 * (anticlockwise >> 14) + if flips[0] { 180 } else { 0 };
    Ok(Said::Turn(turn % 360, lasts))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_say_how_frames_are_turned() {
        let of = |codec, bits: u32| {
            let head: &[u8] = if codec == Codec::H264 { &[6] } else { &[39 << 1, 1] };
            // A message of type 5, then the one that is looked for.
            let unit = [head, &[5, 2, 7, 7, 47, 3], &bits.to_be_bytes()[1..], &[0x80]].concat();
            said(codec, &[&unit]).map_err(drop)
        };
        // The period 0 or 1 of H.264, the flag of HEVC.
        for (codec, once, lasting) in [(Codec::H264, 0b10000, 0b01000), (Codec::Hevc, 0, 0b10000)] {
            let turned =
                |flips: u32, quarters: u32, rest: u32| of(codec, flips << 21 | quarters << 19 | rest);
            assert_eq!(turned(0, 2, once), Ok(Said::Turn(180, false)));
            assert_eq!(turned(0, 1, lasting), Ok(Said::Turn(270, true)), "anticlockwise");
            assert_eq!(turned(3, 0, lasting), Ok(Said::Turn(180, true)), "both flips");
            assert_eq!(turned(1, 0, once), Err(()), "mirrored");
            assert_eq!(of(codec, 1000 << 5 | once), Err(()), "an angle between");
            assert_eq!(of(codec, 1 << 23), Ok(Said::Anew), "cancelled");
            assert_eq!(said(codec, &[&[6 << 3, 1], &[6], &[39 << 1]]), Ok(Said::Nothing), "cut off");
        }
        assert_eq!(of(Codec::H264, 0), Ok(Said::Nothing), "the period is cut off");
    }

    #[test]
    fn a_turn_lasts_until_another_or_a_new_sequence() {
        let mut orientation = Orientation::default();
        let mut after = |said| {
            orientation.take(said);
            orientation.turn
        };
        assert_eq!([after(Said::Nothing), after(Said::Turn(90, false)), after(Said::Nothing)], [0, 90, 0]);
        assert_eq!([after(Said::Turn(90, true)), after(Said::Nothing), after(Said::Anew)], [90, 90, 0]);
        assert_eq!(
            [after(Said::Turn(90, true)), after(Said::Turn(180, true)), after(Said::Nothing)],
            [90, 180, 180]
        );
    }
}
