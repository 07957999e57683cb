//! Parameter sets as they come: the first says what the frames are, the others may not change it.

use crate::format::Format;
use crate::limits::Limits;
use crate::refused::{Refused, not_handled};
use crate::track::Codec;
use crate::{h264, hevc};

/// What the parameter sets of a film said so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sequence {
    /// The last set as bytes, which is often sent again.
    bytes: Vec<u8>,
    pub(crate) format: Option<Format>,
}

impl Sequence {
    /// The set that was read last.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Takes any unit; reads it if it is a sequence parameter set. To be called before the decoder sees it: what a
    /// set asks for is taken by the decoder at once.
    pub(crate) fn unit(&mut self, codec: Codec, unit: &[u8], limits: &Limits) -> Result<(), Refused> {
        let is_sequence = match codec {
            Codec::H264 => h264::kind(unit) == h264::SEQUENCE,
            Codec::Hevc => hevc::kind(unit) == hevc::SEQUENCE && hevc::is_base(unit),
        };
        if !is_sequence || unit == self.bytes {
            return Ok(());
        }
        let found = match codec {
            Codec::H264 => h264::sequence(unit)?,
            Codec::Hevc => hevc::sequence(unit)?,
        };
        found.check(limits)?;
        if let Some(before) = &self.format
            && !before.same_frames(&found)
        {
            let [[a, b], [c, d]] = [before.size, found.size];
            return not_handled(format!(
                "frames that change within the film ({a}×{b} px, then {c}×{d} px, or their colours)"
            ));
        }
        self.bytes = unit.to_vec();
        self.format.get_or_insert(found);
        Ok(())
    }
}
