//! The bytes of an .rrd stream: a header, framed protobuf messages, an index of them.
//!
//! ```text
//! "RRF2"  version [4]  options [4]      compression 0: none, serializer 2: protobuf
//! then any number of: kind u64, length u64, message [length]
//! the last of which is the index, and
//! offset u64, length u64, checksum u32 of the index  "RRF2"  "FOOT"  1 u32
//! ```
//!
//! All numbers are little-endian. The messages have two dozen fields in all, so they are encoded here. Whatever comes
//! before the index can be read without it: a stream may stop after any message.
//!
//! Source: rerun, `re_log_encoding` and `re_protos` 0.36.3; wire format: Google, *Protocol Buffers: Encoding*.

use super::xxh32::xxh32;

/// What the viewer calls the program; recordings of one application share its layout.
pub(super) const APPLICATION: &str = "tessuto";

/// Version of rerun whose format this is; later ones read it too.
const VERSION: [u8; 4] = [0, 36, 0, 0];

/// Start of the checksum.
const SEED: u32 = 7_850_921;

/// Kinds of messages.
const END: u64 = 0;
const STORE_INFO: u64 = 1;
const ARROW: u64 = 2;

/// Kind of compression.
const UNCOMPRESSED: u64 = 1;
/// Bytes before a message's body.
pub(super) const FRAME: u64 = 16;

/// A protobuf message. Fields are numbered from 1.
#[derive(Default)]
struct Message(Vec<u8>);

impl Message {
    fn raw(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn number(mut self, field: u64, value: u64) -> Self {
        self.raw(field << 3);
        self.raw(value);
        self
    }

    fn fixed(mut self, field: u64, value: u64) -> Self {
        self.raw(field << 3 | 1);
        self.0.extend(value.to_le_bytes());
        self
    }

    fn bytes(mut self, field: u64, value: &[u8]) -> Self {
        self.raw(field << 3 | 2);
        self.raw(value.len() as u64);
        self.0.extend(value);
        self
    }

    fn message(self, field: u64, value: &Self) -> Self {
        self.bytes(field, &value.0)
    }
}

/// Unique number of a chunk or row: [of the recording, within it].
pub(super) type Id = [u64; 2];

fn id_message([high, low]: Id) -> Message {
    Message::default().fixed(1, high).fixed(2, low)
}

/// What every message says of the recording it belongs to.
pub(super) struct Store(Message);

impl Store {
    /// Recording `id`.
    pub fn new(id: &str) -> Self {
        const RECORDING: u64 = 1;
        let application = Message::default().bytes(1, APPLICATION.as_bytes());
        Self(Message::default().number(1, RECORDING).bytes(2, id.as_bytes()).message(3, &application))
    }

    /// The start of a stream: header, and which recording follows.
    pub fn opening(&self, row: Id) -> Vec<u8> {
        const OTHER: u64 = 6;
        let made_by = Message::default().bytes(1, APPLICATION.as_bytes());
        let source = Message::default().number(1, OTHER).message(2, &made_by);
        let version = Message::default().number(1, u32::from_le_bytes(VERSION).into());
        let info = Message::default().message(2, &self.0).message(5, &source).message(6, &version);
        let message = Message::default().message(1, &id_message(row)).message(2, &info);
        let header = [*b"RRF2", VERSION, [0, 2, 0, 0]].concat();
        [header, framed(STORE_INFO, &message.0)].concat()
    }

    /// A chunk, given as an Arrow IPC stream.
    pub fn chunk(&self, id: Id, is_static: bool, arrow: &[u8]) -> Vec<u8> {
        const ARROW_IPC: u64 = 1;
        let message = Message::default()
            .message(1, &self.0)
            .number(2, UNCOMPRESSED)
            .number(3, arrow.len() as u64)
            .number(4, ARROW_IPC)
            .bytes(5, arrow)
            .message(6, &id_message(id))
            .number(7, is_static.into());
        framed(ARROW, &message.0)
    }

    /// The end of a stream that is `offset` bytes long so far.
    pub fn ending(&self, manifest: &Manifest, offset: u64) -> Vec<u8> {
        const VERSION_0: u64 = 1;
        let schema = Message::default().bytes(1, &manifest.schema);
        let table = Message::default()
            .number(1, VERSION_0)
            .bytes(2, &manifest.table)
            .number(3, UNCOMPRESSED)
            .number(4, manifest.table.len() as u64);
        let recording = Message::default()
            .message(1, &self.0)
            .message(2, &schema)
            .bytes(3, &manifest.digest)
            .message(4, &table);
        let index = Message::default().message(1, &recording).0;
        let mut out = framed(END, &index);
        out.extend((offset + FRAME).to_le_bytes());
        out.extend((index.len() as u64).to_le_bytes());
        out.extend(xxh32(&index, SEED).to_le_bytes());
        out.extend(b"RRF2FOOT");
        out.extend(1u32.to_le_bytes());
        out
    }
}

/// The index of a recording.
pub(super) struct Manifest {
    /// Columns of the recording as one table, an Arrow IPC schema, and its SHA-256.
    pub schema: Vec<u8>,
    pub digest: Vec<u8>,
    /// A row per chunk, an Arrow IPC stream.
    pub table: Vec<u8>,
}

fn framed(kind: u64, message: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(16 + message.len());
    out.extend(kind.to_le_bytes());
    out.extend((message.len() as u64).to_le_bytes());
    out.extend(message);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_encoded_as_the_standard_shows() {
        // Field 1 is 150; field 2 is the text "testing".
        let message = Message::default().number(1, 150).bytes(2, b"testing");
        assert_eq!(message.0, [&[0x08, 0x96, 0x01, 0x12, 0x07][..], b"testing"].concat());
    }
}
