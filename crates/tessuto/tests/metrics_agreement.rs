//! The metrics against an independent program's (numpy, scipy): tools of the data set, not of this
//! crate. Expected values: its printed means over all frames, for the same motions.

mod metrics_support;

use metrics_support::{load, wave};
use tessuto::metrics::{Inputs, Metrics, QUANTITIES, evaluate};

/// Means of the motion `wave` (or the still template) on scene `name`.
fn means(name: &str, moving: bool) -> Option<Metrics> {
    let data = load(name)?;
    let inputs =
        Inputs { template: &data.template, camera: &data.camera, truth: &data.truth, first_frame: 0 };
    let frames = data.truth.points.as_ref().unwrap().len();
    let motion = if moving {
        wave(&data.template.positions, frames)
    } else {
        vec![data.template.positions.clone(); frames]
    };
    let start = std::time::Instant::now();
    let evaluation = evaluate(&inputs, &motion, 0..frames, 0).unwrap();
    println!("{name}: {frames} frames in {:.2} s", start.elapsed().as_secs_f64());
    Some(evaluation.mean)
}

/// `expected`: cd1, cd2, p2s1, p2s2, depth, vertex.
fn agrees(name: &str, moving: bool, expected: [Option<f64>; 6]) {
    let Some(m) = means(name, moving) else { return };
    for (quantity, value) in QUANTITIES.iter().zip(m.values()) {
        println!("{name} moving {moving} {} {value:?}", quantity.key);
    }
    for (found, expected) in [m.cd1, m.cd2, m.p2s1, m.p2s2, m.depth, m.vertex].into_iter().zip(expected) {
        assert_eq!(found.is_some(), expected.is_some(), "{name}: {m:?}");
        let (found, expected) = (found.unwrap_or(1.0), expected.unwrap_or(1.0));
        assert!((found / expected - 1.0).abs() < 2e-2, "{name}: {found} for {expected} in {m:?}");
    }
}

#[test]
fn still_template_of_the_real_recording() {
    agrees(
        "R1",
        false,
        [8.74e-2, 8.41e-3, 8.41e-2, 8.08e-3, 4.62e-2]
            .map(Some)
            .into_iter()
            .chain([None])
            .collect::<Vec<_>>()
            .try_into()
            .unwrap(),
    );
}
