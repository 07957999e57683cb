//! The pool of threads that all commands share.

/// Uses `count` threads, or as many as there are cores.
pub fn use_threads(count: Option<u16>) -> anyhow::Result<()> {
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(count) = count {
        pool = pool.num_threads(usize::from(count));
    }
    pool.build_global()?;
    Ok(())
}
