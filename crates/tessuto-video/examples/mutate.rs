//! Damaged films by the million: `mutate [COUNT] [SEED]`.
//!
//! Small clips of many kinds, made by ffmpeg, are changed at random and read. Nothing may panic but the decoders, which are not ours
//! and are caught; nothing may take longer than ten seconds. One input in sixteen is decoded to its end, of the others the container.
//! What fails is printed with its number; `mutate 1 SEED` repeats it.

#[path = "../tests/clips/mod.rs"]
mod clips;

use std::io::Cursor;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use tessuto_video::{Limits, Refused, native};

/// Longest time for one input.
const PATIENCE: Duration = Duration::from_secs(10);
/// Sides that keep the decoders' time short.
const LIMITS: Limits = Limits { side: 4096, frame_bytes: 32 << 20, frames: 100_000 };

static NOW: AtomicU64 = AtomicU64::new(0);
static OURS: AtomicU64 = AtomicU64::new(0);
static DECODERS: AtomicU64 = AtomicU64::new(0);

/// Xorshift, by its state.
struct Random(u64);

impl Random {
    fn new(number: u64) -> Random {
        let mut random = Random(number.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        (0..4).for_each(|_| _ = random.next());
        random
    }

    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, count: usize) -> usize {
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

/// A film changed at one to eight places.
fn changed(film: &[u8], structure: &[usize], random: &mut Random) -> Vec<u8> {
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
                let value = [0u32, 1, 0xFFFF_FFFF, 0x7FFF_FFFF, 0x8000_0000, 0xFFFF, 0x100_0000, 16][random.below(8)];
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

/// Small films of every kind.
fn seeds() -> Vec<(String, Vec<u8>, Vec<usize>)> {
    let folder = tempfile::tempdir().unwrap();
    let mut seeds = Vec::new();
    for kind in clips::KINDS.iter().filter(|k| !k.arguments.contains("sine") && !k.name.starts_with("cropped")) {
        let path = clips::make(folder.path(), kind, "64x64", "0.2");
        let bytes = std::fs::read(path).unwrap();
        let structure = places(&bytes, kind.name);
        seeds.push((kind.name.to_owned(), bytes, structure));
    }
    seeds
}

fn main() {
    let mut arguments = std::env::args().skip(1).map(|a| a.parse::<u64>().expect("a number"));
    let (count, first) = (arguments.next().unwrap_or(100_000), arguments.next().unwrap_or(0));
    let seeds = seeds();
    // The crate's own hook comes first, so that this one sees what it would hide.
    drop(native::read(Cursor::new(Vec::new()), 0, LIMITS));
    std::panic::set_hook(Box::new(|panic| {
        let place = panic.location().map_or(String::new(), ToString::to_string);
        let number = NOW.load(Relaxed);
        if place.contains("rust_h26") {
            if DECODERS.fetch_add(1, Relaxed) < 40 {
                println!("caught: {place}, input {number}");
            }
        } else if OURS.fetch_add(1, Relaxed) < 40 {
            println!("FAULT: {place}, input {number}: {panic}");
        }
    }));
    std::thread::spawn(|| {
        let mut before = (u64::MAX, Instant::now());
        loop {
            std::thread::sleep(Duration::from_millis(500));
            let now = NOW.load(Relaxed);
            if now != before.0 {
                before = (now, Instant::now());
            } else if before.1.elapsed() > PATIENCE {
                println!("FAULT: input {now} takes longer than {PATIENCE:?}");
                std::process::exit(1);
            }
        }
    });
    let mut results = [0u64; 4];
    let mut slowest = (Duration::ZERO, 0);
    let start = Instant::now();
    for number in first..first + count {
        NOW.store(number, Relaxed);
        let mut random = Random::new(number);
        let (_, film, structure) = &seeds[random.below(seeds.len())];
        let whole = random.below(16) == 0;
        let bytes = changed(film, structure, &mut random);
        let began = Instant::now();
        let length = bytes.len() as u64;
        let result = native::read(Cursor::new(bytes), length, LIMITS).and_then(|film| {
            if whole { film.take(20).try_for_each(|frame| frame.map(drop)) } else { Ok(()) }
        });
        results[match result {
            Ok(()) => 0,
            Err(Refused::NotHandled(_)) => 1,
            Err(Refused::Damaged(_)) => 2,
            Err(Refused::Unreadable(_)) => 3,
        }] += 1;
        slowest = slowest.max((began.elapsed(), number));
        if (number + 1 - first) % 500_000 == 0 {
            println!("{} inputs, {:.0?}", number + 1 - first, start.elapsed());
        }
    }
    let [read, not_handled, damaged, unreadable] = results;
    println!("{count} inputs in {:.0?}: {read} read, {not_handled} not handled, {damaged} damaged, {unreadable} unreadable", start.elapsed());
    println!("panics: {} of the decoders, caught; {} others", DECODERS.load(Relaxed), OURS.load(Relaxed));
    println!("slowest: {:.2?}, input {}", slowest.0, slowest.1);
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    status.lines().filter(|l| l.starts_with("VmHWM")).for_each(|l| println!("{l}"));
    if OURS.load(Relaxed) > 0 {
        std::process::exit(1);
    }
}
