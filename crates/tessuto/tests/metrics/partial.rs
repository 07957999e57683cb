//! Truth of some frames only: what is there is measured, the rest is counted.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use tessuto::mesh::grid;
use tessuto::metrics::{Evaluation, Inputs, Metrics, QUANTITIES, evaluate, table};
use tessuto::{Camera, Mesh, Motion, Result, Tracks, Truth};

const CAMERA: Camera = Camera { fx: 400.0, fy: 400.0, cx: 199.5, cy: 149.5, width: 400, height: 300 };
const FRAMES: usize = 5;

fn template() -> Mesh {
    grid(5, 5, DVec2::splat(0.4), 1.0)
}

/// Frame k is k mm too far away.
fn motion() -> Motion {
    let shape = |k: usize| template().positions.iter().map(|p| *p + DVec3::Z * 1e-3 * k as f64).collect();
    Motion::new((0..FRAMES).map(shape).collect()).unwrap()
}

fn run(truth: &Truth) -> Result<Evaluation> {
    let template = template();
    evaluate(
        &Inputs { template: &template, views: vec![CAMERA.into()], truth, first_frame: 10 },
        &motion(),
        0..FRAMES,
        0,
    )
}

/// 8 points on the mesh; point p is p mm to the right of its place, in the frames `frames`.
fn tracks(frames: &[usize]) -> Tracks {
    let vertices = (0..8u32).map(|p| [p, p + 1, p + 6, p + 5]).collect();
    let weights = (0..8).map(|p| if p % 2 == 0 { [0.25; 4] } else { [0.2, 0.3, 0.5, 0.0] }).collect();
    let mut tracks = Tracks { vertices, weights, points: BTreeMap::new() };
    let places: Vec<DVec3> = tracks.on(&template().positions).collect();
    let moved = |(p, place): (usize, &DVec3)| *place + DVec3::X * 1e-3 * p as f64;
    let points: Vec<DVec3> = places.iter().enumerate().map(moved).collect();
    tracks.points = frames.iter().map(|k| (*k, points.clone())).collect();
    tracks
}

fn near(found: Option<f64>, expected: f64) {
    assert!(found.is_some_and(|f| (f - expected).abs() < 1e-12), "{found:?} for {expected}");
}

#[test]
fn points_of_some_frames_are_averaged_over_those() {
    let points = |k: usize| if k == 1 || k == 4 { template().positions } else { Vec::new() };
    let truth = Truth { points: Some((0..FRAMES).map(points).collect()), ..Truth::default() };
    let found = run(&truth).unwrap();
    assert_eq!(found.frames.iter().map(|f| f.frame).collect::<Vec<_>>(), [11, 14]);
    assert_eq!((found.frames_without_truth, found.frame_count()), (3, 5));
    near(found.mean.depth, 2.5e-3);
    near(found.mean.cd1, 0.5 * (found.frames[0].metrics.cd1.unwrap() + found.frames[1].metrics.cd1.unwrap()));
    assert!(found.mean.vertex.is_none() && found.mean.track.is_none());
    assert!(table(&found).ends_with("truth in 2 of 5 frames\n"), "{}", table(&found));
    let json = serde_json::to_value(&found).unwrap();
    assert_eq!(json["frames_without_truth"], 3);

    // With another truth of all frames, these are all there, and each mean is over its own.
    let still = Motion::new(vec![template().positions; FRAMES]).unwrap();
    let found = run(&Truth { vertices: Some(still), ..truth }).unwrap();
    near(found.mean.depth, 2.5e-3);
    near(found.mean.vertex, 2e-3);
    assert_eq!((found.frames.len(), found.frames_without_truth), (5, 0));
    assert_eq!([6, 7].map(|k| (QUANTITIES[k].key, found.frames_with(k))), [("depth", 2), ("vertex", 5)]);
    let text = table(&found);
    assert!(text.contains("depth difference [m], in 2 of 5 frames") && !text.contains("truth in"), "{text}");
    assert!(serde_json::to_value(&found).unwrap().get("frames_without_truth").is_none());
}

#[test]
fn what_cannot_be_measured_is_not_left_out_of_the_mean() {
    // In frame 3 the points are beside the mesh: they have no depth difference.
    let beside: Vec<DVec3> = template().positions.iter().map(|p| *p + DVec3::X).collect();
    let points = |k: usize| if k == 3 { beside.clone() } else { template().positions };
    let found = run(&Truth { points: Some((0..FRAMES).map(points).collect()), ..Truth::default() }).unwrap();
    assert!(found.frames[3].metrics.depth.is_none() && found.mean.depth.is_none());
    assert!(found.mean.cd1.is_some());
}

#[test]
fn tracked_points_alone_are_measured() {
    let truth = Truth { tracks: Some(tracks(&[0, 3])), ..Truth::default() };
    let found = run(&truth).unwrap();
    assert_eq!(found.frames.iter().map(|f| f.frame).collect::<Vec<_>>(), [10, 13]);
    // Point p is p mm aside; in frame 3 all are 3 mm too near, too.
    let distance = |p: usize, k: usize| (p as f64).hypot(k as f64) * 1e-3;
    let mean = |k: usize| (0..8).map(|p| distance(p, k)).sum::<f64>() / 8.0;
    let of = |metrics: &Metrics| [metrics.track, metrics.track_p90, metrics.track_worst];
    let [first, last] = [0, 1].map(|row| of(&found.frames[row].metrics));
    near(first[0], 3.5e-3);
    near(first[1], 6.3e-3);
    near(first[2], 7e-3);
    near(last[0], mean(3));
    near(last[2], distance(7, 3));
    // Over all 16 points: 0.9 · 15 = 13.5, half way from the 14th to the 15th.
    let mut all: Vec<f64> = [0, 3].into_iter().flat_map(|k| (0..8).map(move |p| distance(p, k))).collect();
    all.sort_by(f64::total_cmp);
    let [track, p90, worst] = of(&found.mean);
    near(track, 0.5 * (3.5e-3 + mean(3)));
    near(p90, 0.5 * (all[13] + all[14]));
    near(worst, distance(7, 3));
    let text = table(&found);
    assert!(text.contains("tracked points: mean 4.20 mm") && text.contains("largest 7.62 mm"), "{text}");
    assert!(text.ends_with("truth in 2 of 5 frames\n"), "{text}");
    let back: Evaluation = serde_json::from_str(&serde_json::to_string(&found).unwrap()).unwrap();
    assert_eq!(back, found);
}

#[test]
fn truth_that_does_not_belong_to_the_motion_is_refused() {
    let refused = |truth: Truth, fragment: &str| {
        let text = run(&truth).unwrap_err().to_string();
        assert!(text.contains(fragment) && text.contains("hint: "), "{fragment}: {text}");
    };
    let with = |change: fn(&mut Tracks)| {
        let mut tracks = tracks(&[0, 3]);
        change(&mut tracks);
        Truth { tracks: Some(tracks), ..Truth::default() }
    };
    refused(
        Truth { points: Some(vec![Vec::new(); FRAMES]), ..Truth::default() },
        "none of the frames 10..15 has any",
    );
    refused(with(|t| t.vertices[3][0] = 25), "they name vertex 25, the mesh has 25");
    refused(with(|t| t.weights.truncate(7)), "8 points have vertices, 7 have weights");
    refused(with(|t| t.points.entry(0).or_default().truncate(5)), "frame 0 of the motion has 5 points of 8");
    refused(with(|t| drop(t.points.insert(5, vec![DVec3::Z; 8]))), "frame 5 of the motion, which has 5");
    refused(with(|t| t.points.entry(0).or_default()[2].x = f64::NAN), "not finite");
}
