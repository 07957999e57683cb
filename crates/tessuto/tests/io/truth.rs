//! Truth of some frames only, and tracked points.

use glam::DVec3;
use tessuto::Tracks;
use tessuto::io::npy;
use tessuto::io::scene::{LoadOptions, load};

use crate::support::scene_maker::{FRAMES, TinyScene, template};

/// Arrays of gt/tracks.npz as a test changes them.
struct Arrays {
    frames: (Vec<usize>, Vec<f64>),
    vertices: (Vec<usize>, Vec<f64>),
    weights: (Vec<usize>, Vec<f64>),
    points: (Vec<usize>, Vec<f64>),
}

/// Two points in frames 3 and 1: the middle of a quad, and one in a triangle.
fn arrays() -> Arrays {
    let points = (0..12).map(|k| 0.9 + 0.01 * f64::from(k)).collect();
    Arrays {
        frames: (vec![2], vec![3.0, 1.0]),
        vertices: (vec![2, 4], vec![0.0, 1.0, 5.0, 6.0, 7.0, 8.0, 13.0, -1.0]),
        weights: (vec![2, 4], vec![0.25, 0.25, 0.25, 0.25, 0.5, 0.25, 0.25, 0.0]),
        points: (vec![2, 2, 3], points),
    }
}

fn write(scene: &TinyScene, arrays: &Arrays) {
    let array = |(shape, data): &(Vec<usize>, Vec<f64>)| npy::encode(shape, data);
    let Arrays { frames, vertices, weights, points } = arrays;
    let files = [("frames", frames), ("vertices", vertices), ("weights", weights), ("points", points)];
    let archive = npy::archive(&files.map(|(name, a)| (name, array(a))));
    std::fs::create_dir_all(scene.path("gt")).unwrap();
    std::fs::write(scene.path("gt/tracks.npz"), archive).unwrap();
}

fn tracks(scene: &TinyScene, options: &LoadOptions) -> Tracks {
    load(scene.folder(), options).unwrap().scene.truth.tracks.unwrap()
}

fn refused(scene: &TinyScene, fragments: &[&str]) {
    let error = load(scene.folder(), &LoadOptions::default()).unwrap_err();
    let text = error.to_string();
    assert_eq!(error.exit_code(), 3, "{text}");
    for fragment in fragments.iter().chain(&["gt/", "hint: "]) {
        assert!(text.contains(fragment), "{fragment:?} is not in: {text}");
    }
}

#[test]
fn points_of_some_frames_are_enough() {
    let scene = TinyScene::with_truth();
    for n in [0, 2] {
        std::fs::remove_file(scene.path(&format!("gt/points/points_{n:03}.npy"))).unwrap();
    }
    npy::write_points(&scene.path("gt/points/points_003.npy"), &[]).unwrap();
    let truth = load(scene.folder(), &LoadOptions::default()).unwrap().scene.truth;
    let counts: Vec<usize> = (0..FRAMES).map(|k| truth.points_in(k).map_or(0, <[_]>::len)).collect();
    assert_eq!(counts, [0, 25, 0, 0]);
    std::fs::remove_file(scene.path("gt/vertices.npy")).unwrap();
    let part = LoadOptions { frames: Some(1..3), ..LoadOptions::default() };
    let truth = load(scene.folder(), &part).unwrap().scene.truth;
    assert_eq!([0, 1, 2].map(|k| truth.knows(k)), [true, false, false]);

    // Numbers that cannot be meant.
    std::fs::rename(scene.path("gt/points/points_001.npy"), scene.path("gt/points/points_004.npy")).unwrap();
    refused(&scene, &["points_004.npy is beyond n_frames = 4, while points_000.npy is missing", "from 0"]);
    for n in [3, 4] {
        std::fs::remove_file(scene.path(&format!("gt/points/points_{n:03}.npy"))).unwrap();
    }
    refused(&scene, &["gt/points", "no file like points_000.npy"]);
}

#[test]
fn tracks_arrive_in_metres_in_the_frames_they_belong_to() {
    let scene = TinyScene::new();
    write(&scene, &arrays());
    let found = tracks(&scene, &LoadOptions::default());
    assert_eq!(found.vertices, [[0, 1, 5, 6], [7, 8, 13, 0]]);
    assert_eq!(found.weights[1], [0.5, 0.25, 0.25, 0.0]);
    assert_eq!(found.points.keys().copied().collect::<Vec<_>>(), [1, 3]);
    assert!(found.points[&3][1].distance(DVec3::new(0.93, 0.94, 0.95)) < 1e-12);
    let positions = template().positions;
    let middle = 0.25 * (positions[0] + positions[1] + positions[5] + positions[6]);
    assert!(found.on(&positions).next().unwrap().distance(middle) < 1e-15);

    let part = LoadOptions { frames: Some(2..4), ..LoadOptions::default() };
    assert_eq!(tracks(&scene, &part).points.keys().copied().collect::<Vec<_>>(), [1]);
    scene.edit("scene.json", "\"name\"", "\"units\": \"cm\", \"name\"");
    scene.move_template(|p| p.map(|v| 100.0 * v));
    let found = tracks(&scene, &LoadOptions::default());
    assert!(found.points[&3][1].distance(DVec3::new(0.0093, 0.0094, 0.0095)) < 1e-12);
}

#[test]
fn bad_tracks_are_refused_with_file_array_and_way_out() {
    let scene = TinyScene::new();
    let changed = |change: fn(&mut Arrays), fragments: &[&str]| {
        let mut arrays = arrays();
        change(&mut arrays);
        write(&scene, &arrays);
        refused(&scene, &[&["tracks.npz"], fragments].concat());
    };
    changed(|a| a.frames.1[0] = 4.0, &["\"frames\"", "names frame 4", "0 to 3"]);
    changed(|a| a.frames.1[0] = 1.5, &["\"frames\"", "names frame 1.5"]);
    changed(|a| a.frames.1[0] = f64::NAN, &["\"frames\"", "names frame NaN"]);
    changed(|a| a.frames.1[0] = 1.0, &["\"frames\"", "names frame 1 twice"]);
    changed(|a| a.frames.0 = vec![1, 2], &["\"frames\"", "has shape [1, 2], expected [F]"]);
    changed(|a| a.vertices.1[4] = 25.0, &["\"vertices\"", "point 1 names vertex 25", "0 to 24"]);
    changed(|a| a.vertices.1[0] = -1.0, &["\"vertices\"", "point 0 names vertex -1"]);
    changed(|a| a.vertices.1[0] = 0.5, &["\"vertices\"", "point 0 names vertex 0.5"]);
    changed(|a| a.vertices.0 = vec![4, 2], &["\"vertices\"", "has shape [4, 2], expected [P, 4]"]);
    changed(
        |a| {
            a.weights.0 = vec![1, 4];
            a.weights.1.truncate(4);
        },
        &["\"weights\"", "has shape [1, 4], expected [2, 4]"],
    );
    changed(|a| a.weights.1[0] = f64::NAN, &["\"weights\"", "point 0", "NaN", "sum is 1"]);
    changed(|a| a.weights.1[4] = 0.6, &["\"weights\"", "point 1", "of sum 1.1"]);
    changed(|a| a.points.0 = vec![4, 3], &["\"points\"", "has shape [4, 3], expected [2, 2, 3]"]);
    changed(|a| a.points.1[10] = f64::NAN, &["\"points\"", "point 1 in row 1 is NaN", "leave out"]);
    changed(
        |a| {
            a.frames = (vec![0], vec![]);
            a.points = (vec![0, 2, 3], vec![]);
        },
        &["\"frames\"", "has shape [0]", "one at least"],
    );

    let one = npy::archive(&[("frames", npy::encode(&[1], &[0u32]))]);
    std::fs::write(scene.path("gt/tracks.npz"), one).unwrap();
    refused(&scene, &["tracks.npz", "\"vertices\"", "is missing; the file has frames"]);
    let text = npy::archive(&[("vertices", b"no array".to_vec())]);
    std::fs::write(scene.path("gt/tracks.npz"), text).unwrap();
    refused(&scene, &["tracks.npz", "\"vertices\"", "not a readable .npy"]);
    scene.truncate("gt/tracks.npz");
    refused(&scene, &["tracks.npz", "no zip archive", "numpy.savez"]);
}
