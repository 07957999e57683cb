//! A made-up video goes in, the motion comes out; the program's answer is compared with the truth.
//!
//! `cargo run --release --example reconstruct_synthetic`

use tessuto::config::{Config, Preset};
use tessuto::metrics::{Inputs, evaluate};
use tessuto::session::Session;
use tessuto::{Motion, reconstruct, synth};

fn main() -> tessuto::Result<()> {
    let settings = synth::Settings::default().with(|s| {
        s.frames = 8;
        s.size = 160;
        s.grid = [11, 11];
        s.seed = 5;
    });
    let scene = synth::make(&settings)?;
    let mut config = Config::preset(Preset::Default);
    config.set("texture.size=128")?;

    let mut last_stage = tessuto::session::Name::default();
    let mut session = Session::new(|epoch, _| {
        if epoch.stage != last_stage {
            last_stage.clone_from(&epoch.stage);
            println!("{last_stage}");
        }
        Ok(())
    });
    let result = reconstruct(&scene, &config, &mut session)?;

    let error = |motion: &Motion| -> tessuto::Result<f64> {
        let evaluation = evaluate(&Inputs::from(&scene), motion, 0..scene.frames.len(), 0)?;
        Ok(evaluation.mean.vertex.expect("a made-up scene has true vertices"))
    };
    let still = Motion::new(vec![scene.template.positions.clone(); scene.frames.len()])?;
    let (found, template) = (error(&result.motion)?, error(&still)?);
    println!("mean vertex error {:.2} mm, of the template held still {:.2} mm", 1e3 * found, 1e3 * template);
    assert!(found < 2e-3 && found < 0.5 * template, "{found} m");
    Ok(())
}
