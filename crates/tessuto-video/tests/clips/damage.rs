//! Films damaged at random, always the same ones.

use std::path::Path;

use super::clips;

/// Xorshift, by its state.
pub struct Random(u64);

impl Random {
    pub fn new(number: u64) -> Random {
        let mut random = Random(number.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        (0..4).for_each(|_| _ = random.next());
        random
    }

    pub fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub fn below(&mut self, count: usize) -> usize {
        ((self.next() >> 11) % count.max(1) as u64) as usize
    }
}

/// Places of a film that are not frames: what is read before one is decoded.
fn places(film: &[u8], name: &str) -> Vec<usize> {
    let all = || (0..film.len()).collect();
    if !name.ends_with(".mp4") && !name.ends_with(".mov") {
        return all();
    }
    // Everything but the content of mdat.
    let mut at = 0;
    let mut found = Vec::new();
    while at + 8 <= film.len() {
        let size = u32::from_be_bytes(film[at..at + 4].try_into().unwrap()) as usize;
        let data = &film[at + 4..at + 8] == b"mdat";
        found.extend(at..at + if data { 8 } else { size });
        at += size.max(8);
    }
    found
}

/// A film of which one to four bits are turned, which most often are of frames.
pub fn turned(film: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = film.to_vec();
    for _ in 0..1 + random.below(4) {
        let at = random.below(bytes.len());
        bytes[at] ^= 1 << random.below(8);
    }
    bytes
}

/// A film changed at one to eight places.
pub fn changed(film: &[u8], structure: &[usize], random: &mut Random) -> Vec<u8> {
    let mut bytes = film.to_vec();
    for _ in 0..1 + random.below(8) {
        if bytes.is_empty() {
            break;
        }
        let anywhere = random.below(4) == 0;
        let at = if anywhere { random.below(bytes.len()) } else { structure[random.below(structure.len())] };
        let at = at.min(bytes.len() - 1);
        match random.below(10) {
            0..3 => bytes[at] ^= 1 << random.below(8),
            3 | 4 => bytes[at] = random.next() as u8,
            5 => {
                let value =
                    [0u32, 1, 0xFFFF_FFFF, 0x7FFF_FFFF, 0x8000_0000, 0xFFFF, 0x100_0000, 16][random.below(8)];
                let value = value.to_be_bytes();
                let count = value.len().min(bytes.len() - at);
                bytes[at..at + count].copy_from_slice(&value[..count]);
            }
            6 => {
                let end = (at + 1 + random.below(32)).min(bytes.len());
                drop(bytes.drain(at..end));
            }
            7 => {
                let from = random.below(bytes.len());
                let piece = bytes[from..(from + 1 + random.below(64)).min(bytes.len())].to_vec();
                drop(bytes.splice(at..at, piece));
            }
            8 => {
                let from = random.below(bytes.len());
                let count = random.below(32).min(bytes.len() - at).min(bytes.len() - from);
                bytes.copy_within(from..from + count, at);
            }
            _ if random.below(4) == 0 => bytes.truncate(at),
            _ => bytes[at] = bytes[at].wrapping_add(1),
        }
    }
    bytes
}

/// Small films of every kind, with the places that [`changed`] prefers.
pub fn seeds(folder: &Path) -> Vec<(String, Vec<u8>, Vec<usize>)> {
    let mut seeds = Vec::new();
    for kind in
        clips::KINDS.iter().filter(|k| !k.arguments.contains("sine") && !k.name.starts_with("cropped"))
    {
        let path = clips::make(folder, kind, "64x64", "0.2");
        let bytes = std::fs::read(path).unwrap();
        let structure = places(&bytes, kind.name);
        seeds.push((kind.name.to_owned(), bytes, structure));
    }
    seeds
}
