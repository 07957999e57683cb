//! Samples against the dense inverse; misfits and calibration against what is known of them.

use glam::{DVec2, DVec3};

use super::*;
use crate::motion::spacetime::SpacetimeSettings;
use crate::motion::terms::Term;
use crate::motion::terms::shear::Shear;
use crate::motion::terms::strain::Strain;
use crate::session::Checkpoints;
use tessuto_core::camera::{Camera, Rect};
use tessuto_core::error::Error;
use tessuto_core::image::Image;
use tessuto_core::math::rng::Rng;
use tessuto_core::mesh::{Mesh, grid};
use tessuto_core::scene::{Scene, Truth};
use tessuto_core::video::{Frame, Video};
use tessuto_sim::Cloth;

const KAPPA: f64 = 1e3;

/// Systems of three frames of a small sheet: strain, shear with its smooth modes, and something that holds the
/// vertices, some of them firmly.
fn systems(cloth: &Cloth, mesh: &Mesh, low_rank: bool) -> Vec<FrameSystem> {
    let mut rng = Rng::new(4, 0);
    let of_frame = |_| {
        let x: Positions = mesh.positions.iter().map(|p| *p + rng.vector() * 2e-3).collect();
        let mut system = FrameSystem::zeros(cloth);
        Strain { cloth, sigma: 0.1, tail: 10.0 }.add_system(&x, &mut system);
        Shear::new(cloth, mesh, [0.002, 100.0, 1.0]).add_system(&x, &mut system);
        let held: Vec<f64> = x.iter().map(|_| 200.0 + 3e4 * (5.0 * rng.signed() - 4.0).max(0.0)).collect();
        system.matrix.add_masses(&cloth.pattern, &held, 1.0);
        system.low_rank = system.low_rank.filter(|_| low_rank);
        system
    };
    (0..3).map(of_frame).collect()
}

fn sheet() -> (Mesh, Cloth) {
    let mesh = grid(4, 3, DVec2::new(0.1, 0.08), 1.0);
    let cloth = Cloth::new(&mesh);
    (mesh, cloth)
}

/// H⁻¹ by Gauss and Jordan, from the products of H with unit vectors.
fn inverse(joint: &JointSystem) -> Vec<Vec<f64>> {
    let (frames, vertices) = (joint.systems.len(), joint.cloth.vertex_count());
    let size = 3 * frames * vertices;
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for k in 0..size {
        let mut unit = vec![vec![DVec3::ZERO; vertices]; frames];
        unit[k / (3 * vertices)][k / 3 % vertices][k % 3] = 1.0;
        let mut row: Vec<f64> = joint.multiply(&unit).iter().flatten().flat_map(|x| x.to_array()).collect();
        row.extend((0..size).map(|j| f64::from(u8::from(j == k))));
        rows.push(row);
    }
    for k in 0..size {
        let pivot = rows[k][k];
        rows[k].iter_mut().for_each(|x| *x /= pivot);
        let own = rows[k].clone();
        for (j, row) in rows.iter_mut().enumerate().filter(|(j, _)| *j != k) {
            let factor = row[k];
            assert!(j < size);
            row.iter_mut().zip(&own).for_each(|(x, o)| *x -= factor * o);
        }
    }
    rows.into_iter().map(|row| row[size..].to_vec()).collect()
}

/// Trace of every vertex's block and the standard error of its estimate from `count` samples: Var ‖x‖² = 2 ‖C‖²
/// for normal x of covariance C.
fn marginals(inverse: &[Vec<f64>], count: f64) -> Vec<[f64; 2]> {
    let block = |v: usize| {
        let at = |i: usize, j: usize| inverse[3 * v + i][3 * v + j];
        let squares: f64 = (0..9).map(|k| at(k / 3, k % 3).powi(2)).sum();
        [at(0, 0) + at(1, 1) + at(2, 2), (2.0 * squares / count).sqrt()]
    };
    (0..inverse.len() / 3).map(block).collect()
}

/// Mean and largest size of the estimates' errors, in standard errors.
fn errors(joint: &JointSystem, variances: &[Vec<f64>], count: usize) -> [f64; 2] {
    let expected = marginals(&inverse(joint), count as f64);
    let of_vertex = |(found, [trace, error]): (&f64, &[f64; 2])| (found - trace) / error;
    let errors: Vec<f64> = variances.iter().flatten().zip(&expected).map(of_vertex).collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    [mean, errors.iter().fold(0.0, |m: f64, e| m.max(e.abs()))]
}

#[test]
fn samples_have_the_variances_of_the_dense_inverse() {
    let (mesh, cloth) = sheet();
    let count = 3000;
    let systems = systems(&cloth, &mesh, true);
    let joint = JointSystem { cloth: &cloth, systems: &systems, kappa: KAPPA, lambda: 0.0 };
    let variances = joint.variances(count, 5, &mut Session::silent()).unwrap();
    let [mean, largest] = errors(&joint, &variances, count);
    println!("mean error {mean:.2}, largest {largest:.2} standard errors");
    // 36 estimates: all within four standard errors except in one case in four hundred. They vary together, so their
    // mean error does too.
    assert!(largest < 4.0 && mean.abs() < 2.0, "{mean} {largest}");

    // What the modes of shear take off the matrix matters: without it, or with another acceleration term, the
    // variances are others.
    let without = self::systems(&cloth, &mesh, false);
    let stiffer = JointSystem { systems: &without, ..joint };
    assert!(errors(&stiffer, &variances, count)[1] > 6.0, "{:?}", errors(&stiffer, &variances, count));
    let freer = JointSystem { cloth: &cloth, systems: &systems, kappa: 0.5 * KAPPA, lambda: 0.0 };
    assert!(errors(&freer, &variances, count)[1] > 4.0, "{:?}", errors(&freer, &variances, count));
}

#[test]
fn bytes_do_not_depend_on_threads_nor_on_interruptions() {
    let (mesh, cloth) = sheet();
    let systems = systems(&cloth, &mesh, true);
    let joint = JointSystem { cloth: &cloth, systems: &systems, kappa: KAPPA, lambda: 0.0 };
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| joint.variances(6, 5, &mut Session::silent()).unwrap())
    };
    let whole = with(1);
    assert_eq!(whole, with(2));
    assert_ne!(whole, joint.variances(6, 6, &mut Session::silent()).unwrap(), "the seed does nothing");

    let folder = tempfile::tempdir().unwrap();
    let open = || Checkpoints::open(folder.path(), "scene".into(), std::time::Duration::ZERO);
    let mut session = Session::new(|epoch, _| match epoch.step {
        3 => Err(Error::Interrupted("enough".into())),
        _ => Ok(()),
    });
    session.keep_in(open(), None).unwrap();
    joint.variances(6, 5, &mut session).unwrap_err();
    let mut steps = 0;
    let mut session = Session::new(|_, _| {
        steps += 1;
        Ok(())
    });
    session.keep_in(open(), open().newest(&mut |_| panic!()).unwrap()).unwrap();
    let gone_on = joint.variances(6, 5, &mut session).unwrap();
    drop(session);
    assert_eq!((gone_on, steps), (whole, 3));
    // The state of another cloth is refused.
    let (mesh, cloth) = (grid(3, 3, DVec2::ONE, 1.0), Cloth::new(&grid(3, 3, DVec2::ONE, 1.0)));
    let systems = self::systems(&cloth, &mesh, true);
    let other = JointSystem { cloth: &cloth, systems: &systems, kappa: KAPPA, lambda: 0.0 };
    let mut session = Session::silent();
    session.keep_in(open(), open().newest(&mut |_| panic!()).unwrap()).unwrap();
    assert!(other.variances(6, 5, &mut session).unwrap_err().to_string().contains("checkpoint, deviation"));
}

const SIZE: usize = 96;

/// A patterned flat sheet in front of the camera, in frames that all show the same; a millimetre is 0.3 pixels.
pub(in super::super) fn still() -> Scene {
    let camera = Camera { fx: 300.0, fy: 300.0, cx: 47.5, cy: 47.5, width: SIZE, height: SIZE };
    let template = grid(7, 6, DVec2::new(0.2, 0.16), 1.0);
    let (mut rgb, mut mask) = (Image::new(SIZE, SIZE, 3), Image::new(SIZE, SIZE, 1));
    for y in 0..SIZE {
        for x in 0..SIZE {
            for c in 0..3 {
                let (u, v, k) = (x as f32, y as f32, c as f32 + 1.0);
                rgb.data[3 * (y * SIZE + x) + c] = 0.5 + 0.3 * (0.6 * u + k).sin() * (0.5 * v).cos();
            }
            let inside = (x as f32 - 47.5).abs() < 30.0 && (y as f32 - 47.5).abs() < 24.0;
            mask.data[y * SIZE + x] = f32::from(inside);
        }
    }
    Scene {
        name: "still".into(),
        folder: "still".into(),
        fps: 50.0,
        camera,
        crop: Rect { x0: 0, y0: 0, x1: SIZE, y1: SIZE },
        poses: None,
        pose_unit: Default::default(),
        depths: None,
        more: Vec::new(),
        full_size: [SIZE, SIZE],
        first_frame: 0,
        template,
        frames: Video::from(vec![Frame { rgb, mask }; 4]),
        known: Default::default(),
        truth: Truth::default(),
    }
}

/// One level, that of the video magnified as far as it goes.
pub(in super::super) fn at_the_finest_level() -> SpacetimeSettings {
    SpacetimeSettings { resolution: 1e5, levels: 1, track_levels: 0, ..SpacetimeSettings::default() }
}

#[test]
fn misfits_are_nothing_at_the_truth_and_measure_what_is_wrong() {
    let scene = still();
    let cloth = Cloth::new(&scene.template);
    let problem = Problem::new(&scene, &cloth, at_the_finest_level()).unwrap();
    let truth = scene.template.positions.clone();
    let misfit = |x: &Positions| {
        let mut search = problem.at_level(0);
        (0..GAIN_FITS).for_each(|_| search.update_references(&vec![x.clone(); 4]));
        search.misfit(2, x)
    };
    let right = misfit(&truth);
    assert!(right.texture <= 1e-3 && right.outline < 0.5 / 300.0 && right.prior < 1e-9, "{right:?}");
    // Aside by 12 mm, most of a stripe: two of the four edges are off by 3.6 pixels.
    let aside: Positions = truth.iter().map(|p| *p + DVec3::X * 0.012).collect();
    let wrong = misfit(&aside);
    assert!(wrong.texture > 0.2 && wrong.prior < 1e-9, "{wrong:?}");
    let expected = 0.012 * (0.32f64 / 0.72).sqrt();
    assert!((wrong.outline / expected - 1.0).abs() < 0.15, "{wrong:?} {expected}");
    // Stretched by three spreads along x: three of its edges' four parts.
    let stretched: Positions = truth.iter().map(|p| DVec3::new(p.x * 1.003, p.y, p.z)).collect();
    let expected = 0.5 * 10f64.ln() * 36.0 / 42.0;
    let found = misfit(&stretched).prior;
    assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
    // Plain cloth has no pattern to follow.
    let mut plain = still();
    let frame = Frame {
        rgb: Image { data: vec![0.5; 3 * SIZE * SIZE], ..Image::new(SIZE, SIZE, 3) },
        ..plain.frames.frame(0).unwrap().into_owned()
    };
    plain.frames = Video::from(vec![frame; 4]);
    let problem = Problem::new(&plain, &cloth, SpacetimeSettings::default()).unwrap();
    let search = problem.at_level(0);
    assert!(search.misfit(2, &truth).texture > 0.9);
}

#[test]
fn the_calibration_is_the_formula() {
    let misfit = Misfit { outline: 2e-3, texture: 0.125, prior: 0.25 };
    let variances = [1e-8, 4e-8, 9e-8];
    let posterior = 0.5 * (14e-8f64 / 3.0).sqrt();
    let a = FACTOR * (4e-6 * 64e-6 * posterior * 0.125).powf(0.2);
    let found = size(mean(&variances), &misfit, 8e-3 - AGREEMENT_FLOOR);
    assert!((found / a - 1.0).abs() < 1e-12, "{found} {a}");
    for (sigma, factor) in spread(&variances, a).iter().zip([0.5, 1.0, 1.5]) {
        let expected = (factor * a * a + FLOOR * FLOOR).sqrt();
        assert!((sigma / expected - 1.0).abs() < 1e-12, "{sigma} {expected}");
    }
    assert!((fineness(25) - 0.125f64.powf(0.3)).abs() < 1e-12 && [200, 1024].map(fineness) == [1.0; 2]);
    let none = size(mean(&[0.0; 2]), &misfit, 0.0);
    assert!(spread(&[0.0; 2], none).iter().all(|s| s.is_finite() && *s >= FLOOR));
    // Over time sizes that are equal stay so, and what stands out lasts, at the ends of a clip as well.
    assert_eq!(lasting(&[2.0; 4]), [2.0; 4]);
    let lasts = lasting(&[0.0, 0.0, 9.0, 0.0, 0.0, 0.0]);
    assert_eq!(lasts, [9.0 / 6.0, 18.0 / 8.0, 3.0, 2.0, 9.0 / 8.0, 0.0]);
    assert!(lasting(&[]).is_empty());
    // Pooling keeps constants, and spreads what stands out over its neighbours and frames.
    let adjacency = [vec![1], vec![0, 2], vec![1]];
    assert_eq!(averaged(&vec![vec![2.0; 3]; 3], &adjacency), vec![vec![2.0; 3]; 3]);
    let pooled = averaged(&[vec![0.0, 0.0, 6.0], vec![0.0; 3], vec![0.0; 3]], &adjacency);
    assert_eq!(pooled, [[0.0, 1.0, 1.5], [0.0, 2.0 / 3.0, 1.0], [0.0; 3]]);
}

#[test]
fn deviations_grow_where_the_positions_are_wrong() {
    let scene = still();
    let cloth = Cloth::new(&scene.template);
    let problem = Problem::new(&scene, &cloth, at_the_finest_level()).unwrap();
    let frames = vec![scene.template.positions.clone(); 4];
    let deviations = |frames: &[Positions], tracked: &[Positions]| {
        problem.deviations(frames, &Pool::of(tracked.to_vec()), 1, &mut Session::silent()).unwrap()
    };
    let right = deviations(&frames, &frames);
    assert_eq!([right.len(), right[0].len()], [4, 42]);
    assert!(right[0].iter().all(|s| *s == 0.0));
    assert!(right[1..].iter().flatten().all(|s| (FLOOR..2e-3).contains(s)), "{right:?}");
    let (mut wrong, off) = (frames.clone(), 0.012);
    wrong[3].iter_mut().for_each(|p| p.x += off);
    let found = deviations(&wrong, &frames);
    let mean = |of_frame: &[f64]| of_frame.iter().sum::<f64>() / 42.0;
    // The error is within two deviations. What one frame shows counts for the two before it as well, by less.
    let means = [1, 2, 3].map(|n| mean(&found[n]));
    println!("{off} m off, deviations {means:?}");
    assert!(2.0 * means[2] > off && means[2] > 0.01 * fineness(42), "{means:?}");
    assert!(means[0] < 0.4 * means[2] && means[1] < 0.8 * means[2], "{means:?}");
}

#[test]
fn what_searches_differ_by_is_uncertain() {
    let scene = still();
    let cloth = Cloth::new(&scene.template);
    let problem = Problem::new(&scene, &cloth, at_the_finest_level()).unwrap();
    let frames = vec![scene.template.positions.clone(); 4];
    let aside = |by: f64| -> Vec<Positions> {
        frames.iter().map(|x| x.iter().map(|p| *p + DVec3::Z * by).collect()).collect()
    };
    let of = |motions: Vec<Vec<Positions>>| {
        let pool = Pool { motions, best: frames.clone(), agreed: false, asked: None };
        problem.deviations(&frames, &pool, 1, &mut Session::silent()).unwrap()[2][7]
    };
    let alone = of(vec![frames.clone()]);
    // A second one may have found what the first did not; of four two agree and the worst does not count.
    let [near, far] = [0.02, 0.2].map(aside);
    let cases = [of(vec![frames.clone(), far.clone()]), of(vec![frames.clone(), near.clone(), near, far])];
    println!("{alone} alone, {cases:?} with others");
    assert_eq!(cases[0], alone);
    assert!((cases[1] - alone.hypot(0.02)).abs() < 1e-12);
}

#[test]
fn hidden_vertices_are_as_far_as_the_way_to_seen_ones() {
    let (mesh, _) = sheet();
    let (adjacency, x) = (mesh.neighbours(), &mesh.positions);
    // The first column alone is seen.
    let left = x.iter().map(|p| p.x).fold(f64::INFINITY, f64::min);
    let seen: Vec<bool> = x.iter().map(|p| p.x < left + 1e-9).collect();
    assert!(seen.contains(&true) && seen.contains(&false));
    for (d, p) in distances(&seen, &adjacency, x).iter().zip(x) {
        assert!((d - (p.x - left)).abs() < 1e-12, "{d} at {p}");
    }
    assert!(distances(&vec![false; x.len()], &adjacency, x).iter().all(|d| *d == 0.0));
    assert!(distances(&vec![true; x.len()], &adjacency, x).iter().all(|d| *d == 0.0));
}
