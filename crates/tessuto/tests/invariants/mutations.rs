//! Readers against damaged files: thousands of changed seeds, always the same ones, and every file that once broke a
//! reader. The long search is that of the fuzz targets in `fuzz/`, which use the same readers.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use tessuto::math::rng::Rng;

use super::readers::{READERS, read};
use super::seeds;

/// Damaged files tried with each reader.
const TRIES: u64 = 1600;
/// What parsers stumble over.
const TOKENS: [&[u8]; 30] = [
    b"nan",
    b"inf",
    b"-1",
    b"0",
    b"1e999",
    b"-0.0",
    b"4294967295",
    b"18446744073709551615",
    b"1e300",
    b"9223372036854775808",
    b"null",
    b"true",
    b"[",
    b"]",
    b"{",
    b"}",
    b"\"",
    b",",
    b":",
    b"\n",
    b" ",
    b"\0",
    b"\xff\xff\xff\xff",
    b"\x7f\xff\xff\xff",
    b"\\",
    b"/",
    b"*a",
    b"&a ",
    b"#",
    b"- ",
];

#[test]
fn damaged_files_are_read_or_refused() {
    let mut failures = Vec::new();
    for (number, (name, reader)) in READERS.into_iter().enumerate() {
        let seeds = seeds::seeds(name);
        assert!(!seeds.is_empty(), "{name} has no seed");
        for seed in &seeds {
            reader(seed).unwrap_or_else(|e| panic!("{name} refuses its own seed: {e}"));
        }
        for k in 0..TRIES {
            let mut rng = Rng::new(k, number as u64);
            let bytes = damaged(&seeds[k as usize % seeds.len()], &mut rng);
            if catch_unwind(AssertUnwindSafe(|| read(reader, &bytes))).is_err() {
                failures.push(format!("{name}, try {k}: {:?}", String::from_utf8_lossy(&bytes)));
            }
        }
    }
    assert!(failures.is_empty(), "{} of them: {:#?}", failures.len(), &failures[..failures.len().min(5)]);
}

#[test]
fn files_that_once_broke_a_reader_are_refused() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/invariants/regressions");
    let mut count = 0;
    for (name, reader) in READERS {
        for entry in std::fs::read_dir(folder.join(name)).into_iter().flatten() {
            let path = entry.unwrap().path();
            let bytes = std::fs::read(&path).unwrap();
            println!("{}", path.display());
            read(reader, &bytes);
            count += 1;
        }
    }
    assert!(count > 0, "no files below {}", folder.display());
}

/// `seed` after one to five changes.
fn damaged(seed: &[u8], rng: &mut Rng) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..1 + rng.next_u32() % 5 {
        let at = rng.next_u32() as usize % (bytes.len() + 1);
        let end = (at + 1 + rng.next_u32() as usize % 16).min(bytes.len());
        match rng.next_u32() % 7 {
            0 if at < bytes.len() => bytes[at] ^= 1 << (rng.next_u32() % 8),
            1 if at < bytes.len() => bytes[at] = rng.next_u32() as u8,
            2 => drop(bytes.drain(at..end)),
            3 => drop(bytes.splice(at..at, TOKENS[rng.next_u32() as usize % TOKENS.len()].iter().copied())),
            4 => {
                // Another token in place of a number or word.
                let wordy = |b: &u8| b.is_ascii_alphanumeric() || b".-+_".contains(b);
                let length = bytes[at..].iter().take_while(|b| wordy(b)).count();
                let token = TOKENS[rng.next_u32() as usize % TOKENS.len()];
                drop(bytes.splice(at..at + length, token.iter().copied()));
            }
            5 => {
                let part = bytes[at.min(end)..end].to_vec();
                drop(bytes.splice(at..at, part));
            }
            _ if rng.next_u32().is_multiple_of(4) => bytes.truncate(at),
            _ => {}
        }
    }
    bytes
}
