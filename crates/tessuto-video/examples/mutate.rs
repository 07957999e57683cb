//! Damaged films by the million: `mutate [COUNT] [FIRST] [EVERY]`.
//!
//! Small clips of many kinds, made by ffmpeg, are changed at random and read. Nothing may panic but the decoders,
//! which are not ours and are caught; nothing may take longer than ten seconds. One input in EVERY (64) is
//! decoded, of the others the container is read. What is decoded several frames at once must be what it is one by one,
//! frames and errors. What fails is printed with its number; `mutate 1 NUMBER` repeats it.

#[path = "../tests/clips/mod.rs"]
mod clips;
#[path = "../tests/clips/damage.rs"]
mod damage;

use std::io::Cursor;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use tessuto_video::native::{self, Limits, Refused};

/// Longest time for one input.
const PATIENCE: Duration = Duration::from_secs(10);
/// Sides that keep the decoders' time short.
const LIMITS: Limits = Limits { side: 4096, frame_bytes: 32 << 20, frames: 100_000 };

static NOW: AtomicU64 = AtomicU64::new(0);
static OURS: AtomicU64 = AtomicU64::new(0);
static DECODERS: AtomicU64 = AtomicU64::new(0);
static DIFFERENT: AtomicU64 = AtomicU64::new(0);

fn main() {
    let mut arguments = std::env::args().skip(1).map(|a| a.parse::<u64>().expect("a number"));
    let (count, first) = (arguments.next().unwrap_or(100_000), arguments.next().unwrap_or(0));
    let every = arguments.next().unwrap_or(64) as usize;
    let folder = tempfile::tempdir().unwrap();
    let seeds = damage::seeds(folder.path());
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
        let mut random = damage::Random::new(number);
        let (_, film, structure) = &seeds[random.below(seeds.len())];
        let whole = random.below(every) == 0;
        let bytes = if whole && random.below(2) == 0 {
            damage::turned(film, &mut random)
        } else {
            damage::changed(film, structure, &mut random)
        };
        let began = Instant::now();
        let length = bytes.len() as u64;
        let read = || native::read(Cursor::new(bytes.clone()), length, LIMITS);
        let mut result = read().map(drop);
        if whole && result.is_ok() {
            let several: Vec<_> = read().into_iter().flat_map(|film| film.take(20)).collect();
            let single: Vec<_> = read().into_iter().flat_map(|film| film.one_by_one().take(20)).collect();
            if several != single {
                DIFFERENT.fetch_add(1, Relaxed);
                println!("FAULT: several frames at once are not the same as one by one, input {number}");
            }
            result = several.into_iter().find_map(Result::err).map_or(Ok(()), Err);
        }
        results[match result {
            Ok(()) => 0,
            Err(Refused::NotHandled(_)) => 1,
            Err(Refused::Damaged(_) | Refused::TooLarge(_) | Refused::Changed(_) | Refused::Turned(_)) => 2,
            Err(Refused::Unreadable(_)) => 3,
        }] += 1;
        slowest = slowest.max((began.elapsed(), number));
        if (number + 1 - first) % 500_000 == 0 {
            println!("{} inputs, {:.0?}", number + 1 - first, start.elapsed());
        }
    }
    let [read, not_handled, damaged, unreadable] = results;
    println!(
        "{count} inputs in {:.0?}: {read} read, {not_handled} not handled, {damaged} damaged, {unreadable} unreadable",
        start.elapsed()
    );
    println!("panics: {} of the decoders, caught; {} others", DECODERS.load(Relaxed), OURS.load(Relaxed));
    println!("slowest: {:.2?}, input {}", slowest.0, slowest.1);
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    status.lines().filter(|l| l.starts_with("VmHWM")).for_each(|l| println!("{l}"));
    println!("otherwise several at once than one by one: {}", DIFFERENT.load(Relaxed));
    if OURS.load(Relaxed) + DIFFERENT.load(Relaxed) > 0 {
        std::process::exit(1);
    }
}
