//! A result is called good or not for the right frames, in the files that it leaves; no truth is looked at.

use glam::DVec3;
use tessuto::Reconstruction;
use tessuto::config::{Config, Preset};
use tessuto::metrics::{State, Verdict};
use tessuto::motion::parameters::Parameters;
use tessuto::motion::texture::fit_texture;
use tessuto::raster::{Rasterizer, Texture};
use tessuto::result::{self, Context, Folder, Run, Summary};
use tessuto::session::Session;
use tessuto::sim::Accelerations;
use tessuto::{Back, Motion, Scene, synth};

const FRAMES: usize = 12;
/// From this frame on a motion is spoilt.
const HALF: usize = 6;
/// What the folder keeps of the other side.
const BACK: Back = Back::Plain(None);

/// A made-up scene without its truth, its true motion and its print as the first frame shows it.
fn scene(change: impl FnOnce(&mut synth::Settings)) -> (Scene, Vec<Vec<DVec3>>, Texture) {
    let settings = synth::Settings::default().with(|s| {
        (s.frames, s.size, s.grid) = (FRAMES, 160, [13, 13]);
        (s.seed, s.wind) = (2, 20.0);
        change(s);
    });
    let mut scene = synth::make(&settings).unwrap();
    let motion = std::mem::take(&mut scene.truth).vertices.unwrap().into_frames();
    let mut config = Config::preset(Preset::Default);
    config.set("texture.size=128").unwrap();
    let texture = fit_texture(
        &Rasterizer::new(&scene.template),
        &scene.viewpoint(0),
        &scene.template.positions,
        &scene.frames.frame(0).unwrap(),
        &config.texture,
        &mut Session::new(|_, _| Ok(())),
    );
    (scene, motion, texture.unwrap())
}

/// The verdict on `motion`, as summary.json of its folder tells it.
fn verdict(scene: &Scene, texture: &Texture, motion: Vec<Vec<DVec3>>) -> Verdict {
    let folder = tempfile::tempdir().unwrap();
    let vertices = scene.template.positions.len();
    let accelerations = Accelerations {
        constant: DVec3::ZERO,
        dynamic: vec![vec![DVec3::ZERO; vertices]; FRAMES - 1],
        entries_per_frame: 1,
        wind: None,
    };
    let reconstruction = Reconstruction {
        motion: Motion::new(motion).unwrap(),
        deviations: None,
        parameters: Parameters::of_springs([2.0, -3.0, -3.0], accelerations),
        causes: None,
        texture: texture.clone(),
        back: BACK,
        history: Vec::new(),
        timings: vec![("refine".into(), 1.5), ("track".into(), 2.0)],
        failure: None,
    };
    let run = Run {
        version: "0.0".into(),
        scene: "somewhere/cloth".into(),
        frames: [0, FRAMES],
        settings: Config::preset(Preset::Default),
    };
    let warnings = ["a remark".to_owned()];
    let context = Context { scene, run: &run, evaluation: None, warnings: &warnings, command: "" };
    result::write_motion(folder.path(), scene, &run, &reconstruction).unwrap();
    result::write_pictures(folder.path(), &context, &reconstruction).unwrap();
    let opened = Folder::open(folder.path()).unwrap();
    assert_eq!(opened.back, BACK);
    let made = Summary::of(&opened).unwrap();
    made.write(folder.path()).unwrap();
    let summary = Summary::read(folder.path()).unwrap().expect("summary.json");
    assert_eq!(summary, made);
    assert_eq!((summary.name.as_str(), summary.vertices, summary.seconds), ("cloth", vertices, 3.5));
    assert_eq!((summary.frames, summary.warnings.as_slice()), ([0, FRAMES], &warnings[..]));
    let metrics = result::read_metrics(folder.path()).unwrap().expect("metrics.json");
    assert_eq!(
        metrics.agreement.iter().map(|f| f.frame).collect::<Vec<_>>(),
        (0..FRAMES).collect::<Vec<_>>()
    );
    let warning = summary.warning();
    let verdict = summary.verdict.expect("a verdict");
    assert_eq!(warning.is_some(), verdict.state > State::Found);
    // metrics.json says the same frame by frame.
    let stretches = [(State::Doubtful, &verdict.doubtful), (State::Lost, &verdict.lost)];
    for (n, frame) in metrics.verdicts.iter().enumerate() {
        let within = |list: &[[usize; 2]]| list.iter().any(|[first, end]| (*first..*end).contains(&n));
        let told = stretches.iter().find(|(_, list)| within(list)).map_or(State::Found, |(state, _)| *state);
        assert_eq!((frame.frame, frame.state, frame.reason.is_empty()), (n, told, told == State::Found));
    }
    let counts = verdict.counts;
    assert_eq!((metrics.verdicts.len(), counts.found + counts.doubtful + counts.lost), (FRAMES, FRAMES));
    verdict
}

#[test]
fn the_true_motion_is_good_and_spoilt_halves_are_named() {
    let (scene, motion, texture) = scene(|_| {});
    let found = verdict(&scene, &texture, motion.clone());
    assert_eq!(found.state, State::Found, "{}", found.sentence);
    assert!(found.sentence.starts_with("found: silhouette "), "{}", found.sentence);
    assert!(found.silhouette.unwrap().worst > 0.97, "{found:?}");

    let size = {
        let p = &scene.template.positions;
        (p[12] - p[0]).length()
    };
    let spoilt = |change: &dyn Fn(usize, DVec3, DVec3) -> DVec3| -> Vec<Vec<DVec3>> {
        let frame = |(n, shape): (usize, &Vec<DVec3>)| -> Vec<DVec3> {
            let centre = shape.iter().sum::<DVec3>() / shape.len() as f64;
            let moved = |(v, p): (usize, &DVec3)| if n < HALF { *p } else { change(v, *p, centre) };
            shape.iter().enumerate().map(moved).collect()
        };
        motion.iter().enumerate().map(frame).collect()
    };
    type Change<'a> = &'a dyn Fn(usize, DVec3, DVec3) -> DVec3;
    let shifted: Change = &|_, p, _| p + 0.2 * size * DVec3::X;
    // The print slides over a silhouette that stays: only colours tell.
    let slid: Change = &|_, p, centre| centre + (p - centre) * DVec3::new(-1.0, 1.0, 1.0);
    let stretched: Change = &|_, p, centre| centre + (p - centre) * DVec3::new(1.0, 1.0, 8.0);
    let crumpled: Change = &|v, p, _| {
        let towards = [DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y, DVec3::Z][v * 7 % 5];
        p + 0.1 * size * towards
    };
    let cases = [
        ("shifted", shifted, "of the mask not covered"),
        ("slid", slid, "texture displaced"),
        ("stretched", stretched, "strained by"),
        ("crumpled", crumpled, "creased"),
        ("crumpled", crumpled, "flipped"),
    ];
    for (name, change, reason) in cases {
        let found = verdict(&scene, &texture, spoilt(change));
        assert_eq!(found.state, State::Lost, "{name}: {}", found.sentence);
        assert!(found.lost.last().is_some_and(|l| l[1] == FRAMES), "{name}: {}", found.sentence);
        assert_eq!(
            (found.counts.found, found.counts.lost + found.counts.doubtful),
            (HALF, FRAMES - HALF),
            "{name}"
        );
        assert!(found.sentence.contains("from frame 6 on"), "{name}: {}", found.sentence);
        assert!(found.sentence.contains(reason), "{name}: {}", found.sentence);
    }
}

/// Blur takes what is fine out of the print; the true motion, blurred alike, has it still.
#[test]
fn the_true_motion_of_a_blurred_clip_is_found() {
    let (scene, motion, texture) = scene(|s| {
        (s.mover, s.wind) = (synth::Mover::Hands, 2.0);
        (s.fps, s.blur) = (10.0, 0.9);
    });
    let found = verdict(&scene, &texture, motion.clone());
    assert_eq!(found.state, State::Found, "{}", found.sentence);
    // One that is ahead of the video is not.
    let ahead = |k: usize| {
        motion[k].iter().zip(&motion[(k + 1).min(FRAMES - 1)]).map(|(p, q)| p.lerp(*q, 0.7)).collect()
    };
    let found = verdict(&scene, &texture, (0..FRAMES).map(ahead).collect());
    assert!(found.counts.lost + found.counts.doubtful > FRAMES / 2, "{}", found.sentence);
}
