//! Fits the untrained decoder to an image and prints PSNR and seconds per step.
//!
//! ```sh
//! cargo run --release -p tessuto --example decoder_fit -- image=diffuse.png config=published steps=100
//! cargo run --release -p tessuto --example decoder_fit -- tiles=1 latent=16 channels=64,64,32 rate=5e-3 steps=200
//! ```

use std::time::Instant;

use tessuto::decoder::{CHANNELS, Decoder, DecoderConfig};

fn main() {
    let mut config = DecoderConfig::light(256);
    let (mut last, mut image) = (40, None);
    for argument in std::env::args().skip(1) {
        let (key, value) = argument.split_once('=').expect("arguments are key=value");
        let number = || value.parse::<f64>().expect("a number");
        match key {
            "config" => {
                config =
                    if value == "published" { DecoderConfig::published() } else { DecoderConfig::light(256) }
            }
            "tiles" => config.tiles = number() as usize,
            "overlap" => config.overlap = number() as usize,
            "latent" => config.latent_edge = number() as usize,
            "channels" => config.channels = value.split(',').map(|n| n.parse().expect("a number")).collect(),
            "rate" => config.learning_rate = number(),
            "beta2" => config.betas[1] = number(),
            "steps" => last = number() as usize,
            "image" => image = Some(tessuto::io::image::read(value.as_ref()).expect("an image")),
            _ => panic!("{key}: no such argument"),
        }
    }
    let mut decoder = Decoder::new(&config, 0);
    let edge = decoder.edge();
    println!("{config:?}: maps of {edge}² px, {} weights", decoder.weight_count());
    // Nearest texel; roughness and metallic are flat. Without an image: rings.
    let target: Vec<f32> = (0..CHANNELS * edge * edge)
        .map(|k| {
            let (c, y, x) = (k / edge / edge, k / edge % edge, k % edge);
            match &image {
                _ if c >= 3 => 0.5,
                Some(p) => p.pixel(x * p.width / edge, y * p.height / edge)[c],
                None => 0.5 + 0.3 * ((x * x + y * y) as f32 / (edge * (20 + 10 * c)) as f32).sin(),
            }
        })
        .collect();
    let diffuse = 3 * edge * edge;
    let (start, mut next, mut ratio) = (Instant::now(), 1.0, 0.0);
    for step in 0..=last {
        let maps = decoder.maps();
        ratio = tessuto::metrics::psnr(&maps[..diffuse], &target[..diffuse]);
        if step as f64 >= next || step == last {
            let spent = start.elapsed().as_secs_f64();
            println!("{step:5} steps  {ratio:5.2} dB  {:.3} s a step", spent / step as f64);
            next *= 1.5;
        }
        let gradient: Vec<f32> = maps.iter().zip(&target).map(|(m, t)| m - t).collect();
        assert!(decoder.step(&gradient), "the gradient is finite");
    }
    assert!(ratio > 12.0, "the decoder fits: {ratio} dB");
}
