//! Benchmarks of tessuto; run `cargo bench -p tessuto-bench`.
