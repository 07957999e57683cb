//! The readers and seeds of tessuto's own tests.

use std::io::Cursor;
use std::sync::Once;

use tessuto_video::native::{self, Limits};

#[path = "../../crates/tessuto-video/tests/clips/mod.rs"]
pub mod clips;
#[path = "../../crates/tessuto-video/tests/clips/damage.rs"]
pub mod damage;
#[path = "../../crates/tessuto/tests/invariants/readers.rs"]
pub mod readers;
#[path = "../../crates/tessuto/tests/invariants/seeds.rs"]
pub mod seeds;

/// Reads `bytes` with the reader `name`; panics where that is a fault.
pub fn read(name: &str, bytes: &[u8]) {
    let (_, reader) = readers::READERS.into_iter().find(|(n, _)| *n == name).expect("a reader of this name");
    readers::read(reader, bytes);
}

/// Reads `bytes` as a film and decodes a few frames. Panics of the decoders, which are caught, are no fault; all
/// others end the program.
pub fn film(bytes: &[u8]) {
    static HOOK: Once = Once::new();
    const LIMITS: Limits = Limits { side: 1024, frame_bytes: 4 << 20, frames: 100_000 };
    HOOK.call_once(|| {
        // The library's own hook comes first: it would hide what this one is for.
        drop(native::read(Cursor::new(Vec::new()), 0, LIMITS));
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !panic.location().is_some_and(|place| place.file().contains("rust_h26")) {
                before(panic);
                std::process::abort();
            }
        }));
    });
    if let Ok(film) = native::read(Cursor::new(bytes.to_vec()), bytes.len() as u64, LIMITS) {
        film.take(4).for_each(drop);
    }
}
