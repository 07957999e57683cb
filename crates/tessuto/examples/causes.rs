//! How well the causes of a motion are found, without the search for the motion.
//!
//! `cargo run --release --example causes -- SCENE MOTION.npy [DEVIATION.npy] [key=value ...]`
//!
//! MOTION is a result's motion.npy, or gt/vertices.npy of the scene. Prints factors and angles against
//! gt/physics.json, where there is one, and how far the motion goes on as gt/calm.npy, and as gt/stiffer.npy with
//! ten times the bend stiffness. `known` takes stiffnesses, gravity, drag and friction from gt/physics.json
//! instead of searching, `held=0,24` takes these vertices as held, `start=1,10,0.1` multiplies the starts of
//! stretch, bend and shear. `residual=0` leaves out what no cause explains, `friction=1e-8` sets the internal
//! friction, `profile=0.1,1,10` holds the bend stiffness at the found one times each of these while all else is
//! searched again, `length=0.9997` takes the panel's lengths times that, `compression=1` lets edges resist
//! shortening.

use std::path::Path;
use std::time::Instant;

use glam::DVec3;
use tessuto::Config;
use tessuto::config::Preset;
use tessuto::io::npy;
use tessuto::io::scene::{LoadOptions, load};
use tessuto::mesh::Positions;
use tessuto::motion::causes::{self, Changes, Hold, Otherwise};

fn field(path: &Path) -> Option<Vec<Positions>> {
    let array = npy::read(path).ok()?;
    let shape = |n: usize, i: usize| DVec3::from_slice(&array.data[3 * (n * array.shape[1] + i)..][..3]);
    Some((0..array.shape[0]).map(|n| (0..array.shape[1]).map(|i| shape(n, i)).collect()).collect())
}

/// Mean distance [mm] in each frame.
fn errors(a: &[Positions], b: &[Positions]) -> Vec<f64> {
    let mean = |(a, b): (&Positions, &Positions)| {
        1e3 * a.iter().zip(b).map(|(a, b)| a.distance(*b)).sum::<f64>() / a.len() as f64
    };
    a.iter().zip(b).map(mean).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn main() -> tessuto::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let (folder, motion) = (arguments.next().expect("SCENE"), arguments.next().expect("MOTION.npy"));
    let mut config = Config::preset(Preset::Default);
    let (mut known, mut held, mut start, mut deviations) = (false, None, [1.0; 3], None);
    let (mut residual, mut friction, mut length, mut compression) = (1.0, None, None, None);
    let mut profile = Vec::new();
    for argument in arguments {
        let numbers =
            |text: &str| -> Vec<f64> { text.split(',').map(|v| v.parse().expect("numbers")).collect() };
        match argument.split_once('=') {
            None if argument == "known" => known = true,
            None => deviations = npy::read(Path::new(&argument)).ok(),
            Some(("held", v)) => held = Some(numbers(v).iter().map(|v| *v as usize).collect::<Vec<_>>()),
            Some(("residual", v)) => residual = numbers(v)[0],
            Some(("friction", v)) => friction = Some(numbers(v)[0]),
            Some(("profile", v)) => profile = numbers(v),
            Some(("length", v)) => length = Some(numbers(v)[0]),
            Some(("compression", v)) => compression = Some(numbers(v)[0]),
            Some(("start", v)) => start.copy_from_slice(&numbers(v)),
            Some(_) => config.set(&argument)?,
        }
    }
    let mut scene = load(Path::new(&folder), &LoadOptions::default())?.scene;
    if held.is_some() {
        scene.known.held = held.take();
    }
    let frames = field(Path::new(&motion)).expect("a motion");
    let sigma: Vec<Vec<f64>> = match deviations {
        Some(d) => d.data.chunks(d.shape[1]).map(<[f64]>::to_vec).collect(),
        None => vec![vec![3e-3; frames[0].len()]; frames.len()],
    };
    let mut dynamics = config.dynamics.at(scene.fps);
    dynamics.stiffness.iter_mut().zip(start).for_each(|(range, s)| range.start += f64::log10(s));
    let truth: Option<serde_json::Value> =
        std::fs::read_to_string(Path::new(&folder).join("gt/physics.json"))
            .ok()
            .map(|text| serde_json::from_str(&text).expect("json"));
    if known {
        config.causes.iterations = 0;
    }
    let watch = Instant::now();
    let views = scene.viewpoints();
    let sheet = (&scene.template, &scene.known, &views[..]);
    let clock = (scene.fps, &dynamics);
    let mut found = causes::find(sheet, &frames, Some(&sigma), clock, &config.causes);
    let seconds = watch.elapsed().as_secs_f64();
    let number = |name: &str| truth.as_ref().and_then(|t| t[name].as_f64());
    let names = ["stretch", "bend", "shear"];
    if let (true, Some(t)) = (known, &truth) {
        found.causes.ln_stiffness = names.map(|n| number(n).expect("a number").ln());
        found.causes.ln_drag = number("drag").expect("a number").ln();
        found.causes.ln_friction = number("friction").unwrap_or(1e-8).ln();
        let g: Vec<f64> =
            t["gravity"].as_array().expect("3").iter().map(|v| v.as_f64().expect("g")).collect();
        found.causes.down = DVec3::from_slice(&g).normalize();
        let winds = t["wind_mean_per_frame"].as_array().expect("winds");
        let knots = found.knots;
        for (k, w) in found.causes.wind.iter_mut().enumerate() {
            let n = (knots.end * k as f64 / (knots.count - 1) as f64 * scene.fps).round() as usize;
            let v: Vec<f64> =
                winds[n].as_array().expect("3").iter().map(|v| v.as_f64().expect("v")).collect();
            *w = DVec3::from_slice(&v);
        }
    }
    if let Some(c) = friction {
        found.causes.ln_friction = f64::ln(c);
    }
    let c = &found.causes;
    let k = c.stiffness();
    for (i, name) in names.iter().enumerate() {
        let factor = number(name).map(|t| k[i] / t).unwrap_or(f64::NAN);
        let said = found.constraints.stiffness[i].text(k[i], |bound| format!("{bound:.3e}"));
        let sd = found.spread.ln_stiffness[i];
        println!("{name:8} {:.3e}  factor {factor:.2}  sd of ln {sd:.2}  {said}", k[i]);
    }
    let said = &found.constraints;
    let [drag, friction] = [(said.drag, c.drag()), (said.friction, c.friction())]
        .map(|(said, value)| said.text(value, |bound| format!("{bound:.2e}")));
    println!("drag     {:.2} (sd of ln {:.2}) {drag}", c.drag(), found.spread.ln_drag);
    println!("friction {:.2e} (sd of ln {:.2}) {friction}", c.friction(), found.spread.ln_friction);
    let down = truth
        .as_ref()
        .map(|t| DVec3::from_array([0, 1, 2].map(|k| t["gravity"][k].as_f64().expect("gravity"))));
    let off = down.map_or(f64::NAN, |g| c.down.angle_between(g).to_degrees());
    let (sd, said) = (found.spread.down.to_degrees(), said.down.text(0.0, |bound| bound.to_string()));
    println!("down {:.3} off {off:.1}° (sd {sd:.1}°) {said}", c.down);
    println!("held {:?}; misfit {:.2}; {seconds:.1} s", found.held, found.misfit);
    for factor in &profile {
        let bend = k[1] * factor;
        let mut dynamics = dynamics.clone();
        let range = &mut dynamics.stiffness[1];
        [range.start, range.low, range.high] = [bend.log10(); 3];
        let clock = (scene.fps, &dynamics);
        let again = causes::find(sheet, &frames, Some(&sigma), clock, &config.causes);
        let [_, _, shear] = again.causes.stiffness();
        let tilt = again.causes.down.angle_between(down.unwrap_or(found.causes.down)).to_degrees();
        println!(
            "profile: bend {bend:.3e} ({factor}): misfit {:.3}, shear {shear:.2e}, gravity {tilt:.1}° off",
            again.misfit
        );
    }
    if !profile.is_empty() {
        return Ok(());
    }
    let mut cut = causes::cut_cloth(&scene.template, &found.rest_lengths);
    let flat = tessuto::sim::panel(&scene.template).expect("a flat panel");
    let own: f64 = cut.edges.iter().map(|e| e.along(&flat).length() / e.rest_length).sum::<f64>();
    println!("panel's lengths over rest lengths {:.4}", own / cut.edges.len() as f64);
    for e in &mut cut.edges {
        if let Some(l) = length {
            e.rest_length = e.along(&flat).length() * l;
        }
        if let Some(c) = compression {
            e.compression = c;
        }
    }
    println!(
        "edges {}, first {:.6} {:.6}",
        cut.edges.len(),
        cut.edges[0].rest_length,
        cut.edges[1].rest_length
    );
    let clock = Instant::now();
    let (guided, parts, led) = causes::follow(&cut, &dynamics, &found, (&frames, &sigma), &config.causes);
    let [follows, beside] = [&guided.frames, &led].map(|of| mean(&errors(of, &frames)));
    let motions = (&guided.frames[..], led.clone());
    let sizes =
        causes::Explained::new((&cut, &scene.template), found.clone(), parts, motions, scene.fps).sizes;
    let seconds = clock.elapsed().as_secs_f64();
    println!("follows within {follows:.3} mm, without correction {beside:.2} in {seconds:.1} s; {sizes:.1?}");
    let gt = Path::new(&folder).join("gt");
    let last = frames.len() - 1;
    let plain = Otherwise { residual, ..Otherwise::default() };
    let clock = Instant::now();
    let changes = Changes::new(&cut, &dynamics, &found, &guided.frames);
    println!("what they leave {:.1} s", clock.elapsed().as_secs_f64());
    let clock = Instant::now();
    let run = changes.simulate(&plain);
    println!("the clip again {:.1} s", clock.elapsed().as_secs_f64());
    let by_frame = errors(&run.frames, &frames);
    println!("again {:.1} mm {by_frame:.0?}", mean(&by_frame));
    if let Some(truth) = field(&gt.join("vertices.npy")) {
        let off = |frames: &[Positions]| mean(&errors(frames, &truth));
        let (given, led, again) = (off(&frames), off(&led), off(&run.frames));
        println!("off the truth: {given:.2} mm as given, {led:.2} as led, {again:.2} again");
    }
    if let Some(calm) = field(&gt.join("calm.npy")) {
        let otherwise = Otherwise { further: calm.len(), air: 0.0, hold: Hold::Still, ..plain };
        let run = changes.simulate(&otherwise);
        let by_frame = errors(&run.frames[last + 1..], &calm);
        let still = errors(&vec![guided.frames[last].clone(); calm.len()], &calm);
        println!("calm {:.1} mm (held still {:.1}) {by_frame:.0?}", mean(&by_frame), mean(&still));
    }
    if let Some(stiffer) = field(&gt.join("stiffer.npy")) {
        let otherwise = Otherwise { scale: [1.0, 10.0, 1.0, 1.0], ..plain };
        let run = changes.simulate(&otherwise);
        let by_frame = errors(&run.frames, &stiffer);
        let same = mean(&errors(&guided.frames, &stiffer));
        println!("stiffer {:.1} mm (no change {same:.1}) {by_frame:.0?}", mean(&by_frame));
    }
    Ok(())
}
