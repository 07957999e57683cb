//! Fits the untrained decoder to a picture and prints seconds per step and PSNR against time.
//!
//! ```sh
//! cargo run --release -p tessuto --example decoder_fit -- picture=diffuse.png config=published seconds=60
//! cargo run --release -p tessuto --example decoder_fit -- tiles=1 latent=16 channels=64,64,32 rate=5e-3
//! ```

use std::time::Instant;

use tessuto::decoder::{CHANNELS, Decoder, DecoderConfig, LastDoubling};

fn main() {
    let mut config = DecoderConfig::light();
    let (mut seconds, mut picture) = (4.0, None);
    for argument in std::env::args().skip(1) {
        let (key, value) = argument.split_once('=').expect("arguments are key=value");
        let number = || value.parse::<f64>().expect("a number");
        match key {
            "config" => {
                config =
                    if value == "published" { DecoderConfig::published() } else { DecoderConfig::light() }
            }
            "tiles" => config.tiles = number() as usize,
            "overlap" => config.overlap = number() as usize,
            "latent" => config.latent_edge = number() as usize,
            "channels" => config.channels = value.split(',').map(|n| n.parse().expect("a number")).collect(),
            "shuffle" => {
                config.last = if value == "yes" { LastDoubling::Shuffle } else { LastDoubling::Convolution }
            }
            "rate" => config.learning_rate = number(),
            "beta2" => config.betas[1] = number(),
            "seconds" => seconds = number(),
            "picture" => picture = Some(tessuto::io::image::read(value.as_ref()).expect("a picture")),
            _ => panic!("{key}: no such argument"),
        }
    }
    let mut decoder = Decoder::new(&config, 0);
    let edge = decoder.edge();
    println!("{config:?}: maps of {edge}² px, {} weights", decoder.weight_count());
    // Nearest texel; roughness and metallic are flat. Without a picture: rings.
    let target: Vec<f32> = (0..CHANNELS * edge * edge)
        .map(|k| {
            let (c, y, x) = (k / edge / edge, k / edge % edge, k % edge);
            match &picture {
                _ if c >= 3 => 0.5,
                Some(p) => p.pixel(x * p.width / edge, y * p.height / edge)[c],
                None => 0.5 + 0.3 * ((x * x + y * y) as f32 / (edge * (20 + 10 * c)) as f32).sin(),
            }
        })
        .collect();
    let diffuse = 3 * edge * edge;
    let (start, mut steps, mut next, mut ratio) = (Instant::now(), 0, 0.0, 0.0);
    loop {
        let maps = decoder.maps();
        ratio = f64::max(ratio, tessuto::metrics::psnr(&maps[..diffuse], &target[..diffuse]));
        let spent = start.elapsed().as_secs_f64();
        if spent >= next || spent >= seconds {
            println!(
                "{spent:6.1} s  {steps:5} steps  {:.3} s a step  {ratio:.2} dB",
                spent / f64::from(steps.max(1))
            );
            next = f64::max(1.0, spent * 1.6);
        }
        if spent >= seconds {
            break;
        }
        let gradient: Vec<f32> = maps.iter().zip(&target).map(|(m, t)| m - t).collect();
        assert!(decoder.step(&gradient), "the gradient is finite");
        steps += 1;
    }
    assert!(ratio > 12.0, "the decoder fits: {ratio} dB");
}
