//! Damaged films are read or refused. The long search is `examples/mutate.rs`, and the fuzz targets in `fuzz/`.

mod clips;
#[path = "clips/damage.rs"]
mod damage;

use std::io::Cursor;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use tessuto_video::native::{self, Limits};

/// Damaged films tried.
const TRIES: u64 = 3000;

#[test]
fn damaged_films_are_read_or_refused() {
    if !clips::ffmpeg_is_there() {
        println!("NOT TESTED: damaged films, ffmpeg is not installed");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let seeds = damage::seeds(folder.path());
    // Panics of the decoders are caught; those of our own code would be as well, and must not be there. The
    // crate's hook comes first.
    static PANICS: Mutex<Vec<String>> = Mutex::new(Vec::new());
    drop(native::read(Cursor::new(Vec::new()), 0, Limits::default()));
    std::panic::set_hook(Box::new(|panic| {
        let place = panic.location().map_or(String::new(), ToString::to_string);
        if !place.contains("rust_h26") {
            PANICS.lock().unwrap().push(panic.to_string());
        }
    }));
    let mut read = 0;
    for number in 0..TRIES {
        let mut random = damage::Random::new(number);
        let (name, film, structure) = &seeds[random.below(seeds.len())];
        let bytes = if number % 8 == 0 {
            damage::turned(film, &mut random)
        } else {
            damage::changed(film, structure, &mut random)
        };
        let start = Instant::now();
        let length = bytes.len() as u64;
        if let Ok(film) = native::read(Cursor::new(bytes.clone()), length, Limits::default()) {
            read += 1;
            if number % 8 == 0 {
                let again = native::read(Cursor::new(bytes), length, Limits::default()).unwrap();
                let single: Vec<_> = again.one_by_one().take(10).collect();
                assert!(
                    film.take(10).collect::<Vec<_>>() == single,
                    "{name}, try {number}: not as one by one"
                );
            }
        }
        assert!(start.elapsed() < Duration::from_secs(20), "{name}, try {number}");
    }
    drop(std::panic::take_hook());
    let panics = PANICS.lock().unwrap();
    assert!(panics.is_empty(), "{panics:#?}");
    // Neither nothing nor everything got through to the frames.
    assert!((TRIES / 20..TRIES * 19 / 20).contains(&read), "{read} of {TRIES} were opened");
}
