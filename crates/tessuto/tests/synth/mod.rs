//! Made-up scenes: the same for the same settings, in view, and what each kind of them promises.

use tessuto::Frame;
use tessuto::synth::{Mover, Settings, film, make, write};
use tessuto::{Positions, Scene};

/// Longest step of the simulation `[s]`.
const STEP: f64 = 5e-3;

fn settings() -> Settings {
    Settings::default().with(|s| (s.frames, s.size, s.grid) = (4, 64, [7, 7]))
}

fn frame(scene: &Scene, n: usize) -> Frame {
    scene.frames.frame(n).unwrap().into_owned()
}

fn vertices(settings: &Settings) -> Vec<Positions> {
    make(settings).unwrap().truth.vertices.unwrap().into_frames()
}

fn farthest(a: &[Positions], b: &[Positions]) -> f64 {
    assert_eq!(a.len(), b.len());
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(p, q)| p.distance(*q)).fold(0.0, f64::max)
}

#[test]
fn the_same_settings_write_the_same_bytes_with_any_number_of_threads() {
    let files = |settings: &Settings, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let folder = tempfile::tempdir().unwrap();
        pool.install(|| write::write(folder.path(), &film(settings).unwrap(), settings)).unwrap();
        let names = ["scene.json", "template.obj", "gt/vertices.npy", "gt/points/points_003.npy"];
        let images = ["rgbs/rgb_003.png", "masks/mask_003.png"];
        names.into_iter().chain(images).map(|name| std::fs::read(folder.path().join(name)).unwrap()).collect()
    };
    for mover in [Mover::Wind, Mover::Hands, Mover::Paper] {
        let settings = settings().with(|s| (s.mover, s.occluders, s.blur, s.fps) = (mover, 2, 0.7, 12.0));
        let one: Vec<Vec<u8>> = files(&settings, 1);
        assert!(one == files(&settings, 3), "{mover:?}");
        let other = files(&settings.clone().with(|s| s.seed = 1), 1);
        assert!(one[4] != other[4] && one[2] != other[2], "{mover:?}: the seed does not matter");
    }
}

#[test]
fn the_sheet_moves_and_stays_in_view() {
    for mover in [Mover::Wind, Mover::Hands, Mover::Paper] {
        for seed in 0..6 {
            let fps = if mover == Mover::Wind { 50.0 } else { 10.0 };
            let settings = settings().with(|s| {
                (s.mover, s.seed, s.fps) = (mover, seed, fps);
                (s.wind, s.frames, s.size) = (4.0, 10, 32);
            });
            let scene = make(&settings).unwrap();
            let vertices = scene.truth.vertices.unwrap();
            assert_eq!(scene.template.positions, vertices[0]);
            let moved = vertices[9].iter().zip(&vertices[0]).map(|(p, q)| p.distance(*q)).sum::<f64>() / 49.0;
            assert!(moved > 5e-3, "{mover:?}, seed {seed}: {moved} m");
            for p in vertices.iter().flatten() {
                let pixel = scene.camera.project(*p);
                let inside = pixel.min_element() > -0.5 && pixel.max_element() < 31.5;
                assert!(inside, "{mover:?}, seed {seed}: {pixel}");
            }
        }
    }
}

#[test]
fn the_rate_changes_the_times_of_the_frames_and_not_the_path() {
    for mover in [Mover::Wind, Mover::Hands, Mover::Paper] {
        let at = |fps: f64, frames: usize| {
            let settings = settings().with(|s| {
                (s.mover, s.fps, s.frames) = (mover, fps, frames);
                (s.size, s.wind) = (32, 5.0);
            });
            vertices(&settings)
        };
        // All these rates have frames at whole steps of the simulation.
        let fine = at(1.0 / STEP, 61);
        for (fps, frames) in [(10.0, 4), (20.0, 7), (50.0, 16)] {
            let every = (1.0 / (STEP * fps)).round() as usize;
            let expected: Vec<Positions> = fine.iter().step_by(every).cloned().collect();
            let off = farthest(&at(fps, frames), &expected);
            assert!(off < 1e-9, "{mover:?}, {fps} frames/s: {off} m");
        }
        // Others have steps of another length, and differ by the error of the integrator.
        let expected: Vec<Positions> = fine.iter().step_by(20).cloned().collect();
        let other: Vec<Positions> = at(30.0, 10).into_iter().step_by(3).collect();
        let off = farthest(&other, &expected);
        assert!(off < 5e-3, "{mover:?}: {off} m");
        assert!(farthest(&expected[..3], &expected[1..]) > 4.0 * off, "{mover:?}: it hardly moves");
    }
}

#[test]
fn what_is_in_front_is_not_in_the_mask() {
    let plain = settings().with(|s| (s.mover, s.fps, s.frames, s.size) = (Mover::Paper, 10.0, 12, 96));
    let free = make(&plain).unwrap();
    let covered = plain.with(|s| s.occluders = 1);
    let [made, filmed] = [make(&covered).unwrap(), film(&covered).unwrap()];
    let amodal = make(&covered.with(|s| s.amodal = true)).unwrap();
    assert_eq!(frame(&made, 0).mask, frame(&free, 0).mask, "nothing is in front of the first frame");
    let mut shares = Vec::new();
    for n in 0..12 {
        let [free, made, filmed, amodal] = [&free, &made, &filmed, &amodal].map(|scene| frame(scene, n));
        let mut hidden = 0.0;
        for k in 0..free.mask.data.len() {
            let [a, b, c] = [&free, &made, &filmed].map(|f| f.mask.data[k]);
            let colour = |f: &Frame| [0, 1, 2].map(|c| f.rgb.data[3 * k + c]);
            assert!(b <= a && b == c);
            hidden += a - b;
            if b == 0.0 {
                assert_eq!(colour(&made), [0.0; 3], "frame {n}: colour outside of the mask");
            }
            if b == a {
                assert_eq!(colour(&made), colour(&free), "frame {n}: it is not in front here");
            } else if a == 1.0 && b == 0.0 {
                assert_eq!(colour(&filmed), colour(&amodal), "frame {n}");
                assert!(colour(&filmed).iter().sum::<f32>() > 0.1, "frame {n}: nothing is there");
            }
        }
        assert_eq!(amodal.mask, free.mask);
        shares.push(hidden / free.mask.data.iter().sum::<f32>());
    }
    assert!(shares[6..].iter().all(|s| (0.03..0.16).contains(s)), "{shares:?}");
    // The depth sensor does not see the sheet through it.
    let points = made.truth.points.as_ref().unwrap();
    for p in &points[9] {
        let pixel = made.camera.project(*p).round();
        assert!(frame(&made, 9).mask.pixel(pixel.x as usize, pixel.y as usize)[0] > 0.0, "{p}");
    }
}

#[test]
fn the_other_side_is_of_one_colour_where_it_is_seen() {
    let folded = settings().with(|s| {
        (s.mover, s.fold, s.frames, s.fps) = (Mover::Table, true, 10, 10.0);
        (s.size, s.grid, s.bend, s.shading) = (96, [13, 13], 1e-4, 0.0);
    });
    let colour = [0.0, 1.0, 0.0];
    let [printed, lined] =
        [None, Some(colour)].map(|back| make(&folded.clone().with(|s| s.back = back)).unwrap());
    assert_eq!(printed.truth.vertices, lined.truth.vertices);
    assert!(lined.known.back.is_none(), "the clip has to tell");
    let [a, b] = [frame(&printed, 0), frame(&lined, 0)];
    assert!(a.rgb == b.rgb && a.mask == b.mask, "the first frame shows the front");
    let (mut plain, mut same, mut seen) = (0, 0, 0);
    for n in 0..10 {
        let [a, b] = [frame(&printed, n), frame(&lined, n)];
        assert_eq!(a.mask, b.mask);
        let pixels = a.rgb.data.chunks_exact(3).zip(b.rgb.data.chunks_exact(3)).zip(&a.mask.data);
        for ((a, b), _) in pixels.filter(|(_, mask)| **mask == 1.0) {
            seen += 1;
            plain += usize::from(b.iter().zip(colour).all(|(b, c)| (b - c).abs() < 1e-6));
            same += usize::from(a == b);
        }
    }
    println!("of {seen} pixels {plain} show the other side, {same} the print");
    assert!(plain * 5 > seen && same * 5 > seen && (plain + same) * 10 > 9 * seen, "{plain} {same} {seen}");
}

#[test]
fn an_open_shutter_blurs_what_moves_and_nothing_else() {
    let sharp = settings().with(|s| s.wind = 0.0);
    let still = [make(&sharp).unwrap(), make(&sharp.with(|s| s.blur = 1.0)).unwrap()];
    for n in 0..4 {
        let [a, b] = [0, 1].map(|k| frame(&still[k], n));
        assert_eq!((a.rgb, a.mask), (b.rgb, b.mask), "a still sheet, frame {n}");
    }
    let moving = settings().with(|s| (s.mover, s.fps, s.size) = (Mover::Hands, 10.0, 128));
    let [a, b] = [0.0, 0.6].map(|blur| make(&moving.clone().with(|s| s.blur = blur)).unwrap());
    assert_eq!(a.truth.vertices, b.truth.vertices);
    assert_eq!(a.truth.points, b.truth.points);
    // Soft: more of the mask is grey, and neighbouring pixels differ less.
    let grey = |f: &Frame| f.mask.data.iter().filter(|v| (0.02..0.98).contains(*v)).count();
    let contrast = |f: &Frame| f.rgb.data.windows(4).map(|w| (w[3] - w[0]).abs()).sum::<f32>();
    let [a, b] = [frame(&a, 3), frame(&b, 3)];
    assert!(grey(&b) > grey(&a) * 5 / 4, "{} {}", grey(&a), grey(&b));
    assert!(contrast(&b) < 0.95 * contrast(&a), "{} {}", contrast(&a), contrast(&b));
}
