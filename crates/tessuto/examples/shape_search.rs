//! What keeps the search for a motion from the truth: the search, or its objective?
//!
//! `cargo run --release --example shape_search -- SCENE [key=value ...]`
//!
//! Searches a scene with known vertices twice, once as always and once starting from the truth, and prints the errors
//! and the objectives reached. If the start from the truth stays there with the lower objective, the search is at
//! fault; if it walks away, the objective is.
//!
//! `step=K` takes every K-th frame only, `cut=A..B` leaves the frames A to B − 1 out, as if the sheet had jumped.
//!
//! After the search as always, it prints how far the positions are said to be off, and how often the true vertices
//! are within that.

use std::ops::Range;
use std::path::Path;

use tessuto::config::Preset;
use tessuto::io::scene::{LoadOptions, load};
use tessuto::mesh::Positions;
use tessuto::metrics::{Inputs, QUANTITIES, evaluate};
use tessuto::motion::spacetime::Problem;
use tessuto::motion::spacetime::best_path::Pool;
use tessuto::session::Session;
use tessuto::sim::Cloth;
use tessuto::{Config, Motion, Scene};

fn main() -> tessuto::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().expect("usage: shape_search SCENE [key=value ...]");
    let mut config = Config::preset(Preset::Default);
    let (mut from_truth, mut from_start, mut save, mut step, mut cut) = (true, true, None, 1, 0..0);
    for argument in arguments {
        match argument.as_str() {
            "no-truth" => from_truth = false,
            "only-truth" => from_start = false,
            a if a.starts_with("step=") => step = a[5..].parse().expect("a number"),
            a if a.starts_with("cut=") => {
                let (from, to) = a[4..].split_once("..").expect("FROM..TO");
                cut = from.parse().expect("a number")..to.parse().expect("a number");
            }
            a if a.starts_with("save=") => save = Some(a[5..].to_string()),
            assignment => config.set(assignment)?,
        }
    }
    let scene = thinned(load(Path::new(&folder), &LoadOptions::default())?.scene, step, &cut)?;
    let cloth = Cloth::new(&scene.template);
    let mut problem = Problem::new(&scene, &cloth, config.spacetime.clone())?;
    let clock = std::time::Instant::now();
    if from_start {
        let session = &mut Session::silent();
        let (mut pool, _) = problem.track(session)?;
        report(&scene, &problem, "tracked", &pool.best, clock.elapsed().as_secs_f64());
        let (refined, _) = problem.refine(&mut pool, session)?;
        report(&scene, &problem, "refined", &refined, clock.elapsed().as_secs_f64());
        let clock = std::time::Instant::now();
        let deviations = problem.deviations(&refined, &pool, config.seed, session)?;
        report_deviations(&scene, &deviations, &refined, clock.elapsed().as_secs_f64());
        if let Some(path) = &save {
            tessuto::io::npy::write_field(Path::new(&path), &refined)?;
        }
    }
    if let (true, Some(truth)) = (from_truth, &scene.truth.vertices) {
        let truth: Vec<Positions> = truth.iter().cloned().collect();
        report(&scene, &problem, "truth", &truth, 0.0);
        let (refined, _) = problem.refine(&mut Pool::of(truth), &mut Session::silent())?;
        report(&scene, &problem, "from truth", &refined, clock.elapsed().as_secs_f64());
        if let Some(path) = &save {
            tessuto::io::npy::write_field(Path::new(&path), &refined)?;
        }
    }
    Ok(())
}

/// Every `step`-th frame of the scene, without those of `cut`.
fn thinned(mut scene: Scene, step: usize, cut: &Range<usize>) -> tessuto::Result<Scene> {
    let kept = |n: &usize| n.is_multiple_of(step) && !cut.contains(n);
    let numbers = || (0..scene.frames.len()).filter(kept);
    let frames: tessuto::Result<Vec<_>> =
        numbers().map(|n| Ok(scene.frames.frame(n)?.into_owned())).collect();
    let vertices = scene.truth.vertices.as_ref().map(|v| numbers().map(|n| v[n].clone()).collect());
    let points = scene.truth.points.as_ref().map(|p| numbers().map(|n| p[n].clone()).collect());
    scene.frames = frames?.into();
    scene.truth.vertices = vertices.map(Motion::new).transpose()?;
    scene.truth.points = points;
    scene.fps /= step as f64;
    Ok(scene)
}

/// One line of objective and errors.
fn report(scene: &Scene, problem: &Problem, name: &str, frames: &[Positions], seconds: f64) {
    print!("{:12} {name:10} {seconds:5.1} s", scene.name);
    if let Some(truth) = &scene.truth.vertices {
        let (mut along, mut across, mut count) = (0.0, 0.0, 0.0);
        let mut of_frame = Vec::new();
        for (x, t) in frames.iter().zip(truth.iter()) {
            let mut sum = 0.0;
            for (x, t) in x.iter().zip(t) {
                let (e, ray) = (*x - *t, t.normalize());
                let d = e.dot(ray);
                along += d.abs();
                across += (e - ray * d).length();
                count += 1.0;
                sum += e.length();
            }
            of_frame.push(1e3 * sum / x.len() as f64);
        }
        let n = of_frame.len();
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        print!(
            " error {:6.2} mm (along {:5.2} across {:5.2}; thirds {:5.1} {:5.1} {:5.1}; worst {:5.1})",
            mean(&of_frame),
            1e3 * along / count,
            1e3 * across / count,
            mean(&of_frame[..n / 3]),
            mean(&of_frame[n / 3..2 * n / 3]),
            mean(&of_frame[2 * n / 3..]),
            of_frame.iter().fold(0.0f64, |a, b| a.max(*b)),
        );
    }
    if scene.truth.vertices.is_none() && scene.truth.points.is_some() {
        let motion = Motion::new(frames.to_vec()).expect("finite");
        let evaluation = evaluate(&Inputs::from(scene), &motion, 0..frames.len(), 0).expect("points");
        let values = QUANTITIES.iter().map(|q| q.key).zip(evaluation.mean.values()).take(2);
        values.for_each(|(name, v)| v.iter().for_each(|v| print!(" {name} {v:.4e}")));
    }
    let terms = problem.objective(frames);
    let total: f64 = terms.iter().map(|t| t.1).sum();
    print!(" | E {total:.4e}");
    terms.iter().for_each(|(name, value)| print!(" {name} {value:.2e}"));
    println!();
}

/// Bounds of error / deviation between which vertices are counted.
const BOUNDS: [f64; 6] = [0.5, 1.0, 1.5, 2.0, 3.0, f64::INFINITY];
/// A frame with a larger mean error than this [m] is lost.
const LOST: f64 = 0.015;

/// Mean deviation, and where there is truth how often it is within twice of that, and errors / deviations by their
/// size; then of every frame mean error and root mean square deviation [mm], those of lost frames in brackets.
fn report_deviations(scene: &Scene, deviations: &[Vec<f64>], frames: &[Positions], seconds: f64) {
    let count = (deviations.len() - 1) * scene.template.positions.len();
    let mean = 1e3 * deviations[1..].iter().flatten().sum::<f64>() / count as f64;
    print!("{:12} deviation {seconds:6.1} s mean {mean:6.2} mm", scene.name);
    let Some(truth) = &scene.truth.vertices else {
        println!();
        return;
    };
    let mut shares = [0.0; BOUNDS.len()];
    let mut of_frames = String::new();
    for ((deviations, x), truth) in deviations.iter().zip(frames).zip(truth.iter()).skip(1) {
        let errors: Vec<f64> = x.iter().zip(truth).map(|(a, b)| a.distance(*b)).collect();
        for (error, deviation) in errors.iter().zip(deviations) {
            let bin = BOUNDS.iter().position(|b| *error <= b * deviation).unwrap_or(BOUNDS.len() - 1);
            shares[bin] += 100.0 / count as f64;
        }
        let error = errors.iter().sum::<f64>() / errors.len() as f64;
        let square = deviations.iter().map(|s| s * s).sum::<f64>() / deviations.len() as f64;
        let [open, close] = if error > LOST { ["(", ")"] } else { ["", ""] };
        of_frames += &format!(" {open}{:.1}/{:.1}{close}", 1e3 * error, 1e3 * square.sqrt());
    }
    print!(", {:.1} % within 2 deviations; error/deviation", shares[..4].iter().sum::<f64>());
    BOUNDS.iter().zip(shares).for_each(|(bound, share)| print!(" ≤{bound} {share:.1} %"));
    println!("\n{:12} frames{of_frames}", scene.name);
}
