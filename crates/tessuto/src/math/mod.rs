//! Numbers without a domain: random streams, sparse systems, gradient checks.

pub mod rng;
