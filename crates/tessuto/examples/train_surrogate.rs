//! Trains the surrogate of a simulation step and writes its weights. The same numbers make the same bytes on the
//! same machine.
//!
//! ```sh
//! cargo run --release -p tessuto --features decoder --example train_surrogate -- \
//!     out=crates/tessuto-sim/assets/surrogate/weights.f32
//! cargo run --release -p tessuto --features decoder --example train_surrogate -- steps=3 batch=2 pool=2
//! ```

use std::time::Instant;

use tessuto::math::rng::Rng;
use tessuto::training::{Settings, initial_weights, train};

fn main() {
    let mut settings = Settings::default();
    let mut out = None;
    for argument in std::env::args().skip(1) {
        let (key, value) = argument.split_once('=').expect("arguments are key=value");
        let number = || value.parse::<f64>().expect("a number");
        match key {
            "steps" => settings.steps = number() as usize,
            "batch" => settings.batch = number() as usize,
            "pool" => settings.pool = number() as usize,
            "rate" => settings.rate = number(),
            "seed" => settings.seed = number() as u64,
            "out" => out = Some(value.to_owned()),
            _ => panic!("{key}: no such argument"),
        }
    }
    println!("{settings:?}");
    let (start, mut sum) = (Instant::now(), [0.0; 2]);
    let weights = train(&settings, &initial_weights(&mut Rng::new(settings.seed, 0)), |step, losses| {
        sum.iter_mut().zip(losses).for_each(|(sum, loss)| *sum += loss);
        if (step + 1) % 100 == 0 || step + 1 == settings.steps {
            let mean = sum.map(|s| s / (step % 100 + 1) as f64);
            println!(
                "{:5} steps  loss of both iterations {mean:.3?}  {:.1} s",
                step + 1,
                start.elapsed().as_secs_f64()
            );
            sum = [0.0; 2];
        }
    });
    assert!(weights.iter().all(|w| w.is_finite()));
    if let Some(out) = out {
        let bytes: Vec<u8> = weights.iter().flat_map(|w| w.to_le_bytes()).collect();
        std::fs::write(&out, bytes).expect("a place to write to");
    }
}
