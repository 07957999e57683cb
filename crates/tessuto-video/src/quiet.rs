//! Panics of the decoders, which are not ours, as errors.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

thread_local! {
    /// Whether this thread is inside of [`caught`].
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Number of [`Workers`].
static WORKERS: AtomicUsize = AtomicUsize::new(0);

/// While one of these lives, panics of the decoder of H.264 are silent in every thread: it starts threads of its own
/// and catches what happens in them.
pub(crate) struct Workers(());

impl Workers {
    pub(crate) fn new() -> Self {
        WORKERS.fetch_add(1, SeqCst);
        Workers(())
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        WORKERS.fetch_sub(1, SeqCst);
    }
}

/// What `work` returns, or `None` if it panics, of which nothing is printed.
///
/// What it left half done must not be used again. The first call puts a hook before the program's own that lets
/// the panics of all other work through.
pub(crate) fn caught<T>(work: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    if !std::thread::panicking() {
        HOOK.call_once(|| {
            let before = take_hook();
            set_hook(Box::new(move |info| {
                let is_workers = || info.location().is_some_and(|at| at.file().contains("rust_h264"));
                if !(QUIET.get() || WORKERS.load(SeqCst) > 0 && is_workers()) {
                    before(info);
                }
            }));
        });
    }
    let outer = QUIET.replace(true);
    let result = catch_unwind(AssertUnwindSafe(work));
    QUIET.set(outer);
    result.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_none() {
        assert_eq!(caught(|| 3), Some(3));
        assert_eq!(caught(|| -> u8 { panic!("must not be printed") }), None);
        assert!(!QUIET.get());
    }
}
