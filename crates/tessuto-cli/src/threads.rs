//! The threads that all work shares.

use clap::Args;

/// `--threads`, of every command that computes.
#[derive(Args)]
pub struct Threads {
    /// Threads [default: all cores]. What is written does not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl Threads {
    /// Makes the pool of threads.
    pub fn start(&self) -> anyhow::Result<()> {
        let mut pool = rayon::ThreadPoolBuilder::new();
        if let Some(count) = self.threads {
            pool = pool.num_threads(usize::from(count));
        }
        pool.build_global()?;
        Ok(())
    }
}
