//! The readers and seeds of tessuto's own tests.

#[path = "../../crates/tessuto/tests/invariants/readers.rs"]
pub mod readers;
#[path = "../../crates/tessuto/tests/invariants/seeds.rs"]
pub mod seeds;

/// Reads `bytes` with the reader `name`; panics where that is a fault.
pub fn read(name: &str, bytes: &[u8]) {
    let (_, reader) = readers::READERS.into_iter().find(|(n, _)| *n == name).expect("a reader of this name");
    readers::read(reader, bytes);
}
