//! Exports without lost frames: the others are what and when they were, and the files say what is missing.

use std::path::Path;

use serde_json::Value;
use tessuto::export::{Clip, Format, export};
use tessuto::io;
use tessuto::metrics::{FrameVerdict, State};

use super::files::{accessor, clip, floats, parse_glb, word, y_up};

/// The clip of 4 frames, numbers 7 to 10 of a video of 25 frames/s, in these states.
fn judged(states: [State; 4]) -> Clip {
    let verdict = |(k, state): (usize, State)| FrameVerdict {
        frame: 7 + k,
        state,
        reason: if state == State::Found { String::new() } else { "creased".into() },
    };
    Clip { verdicts: states.into_iter().enumerate().map(verdict).collect(), ..clip(false) }
}

fn exported(clip: &Clip, folder: &Path) {
    export(
        clip,
        &[Format::Glb, Format::Usd, Format::Obj, Format::Ply, Format::Pc2, Format::Npz],
        folder,
        false,
    )
    .unwrap();
}

/// The bytes of array `name` of an uncompressed .npz file.
pub(super) fn array<'a>(npz: &'a [u8], name: &str) -> &'a [u8] {
    let mut at = 0;
    while &npz[at..at + 4] == b"PK\x03\x04" {
        let (size, length) = (word(npz, at + 18), usize::from(npz[at + 26]));
        let start = at + 30 + length;
        if &npz[at + 30..start] == format!("{name}.npy").as_bytes() {
            return &npz[start..start + size];
        }
        at = start + size;
    }
    panic!("no array {name}");
}

#[test]
fn lost_frames_are_left_out_and_the_others_keep_their_times() {
    use State::{Doubtful, Found, Lost};
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let whole = judged([Found, Lost, Lost, Doubtful]);
    let clip = whole.clone().without_lost().unwrap();
    assert_eq!((clip.motion.len(), clip.left_out()), (2, vec![8, 9]));
    exported(&clip, folder.path());
    let (first, last) = (y_up(&whole, 0), y_up(&whole, 3));

    let bytes = std::fs::read(at("cloth.glb")).unwrap();
    let (gltf, binary) = parse_glb(&bytes);
    let read = |index: &Value| floats(accessor(&gltf, binary, index));
    let sampler = &gltf["animations"][0]["samplers"][0];
    assert_eq!((read(&sampler["input"]), read(&sampler["output"])), (vec![0.0, 0.12], vec![0.0, 1.0]));
    assert_eq!(gltf["meshes"][0]["extras"]["targetNames"], serde_json::json!(["frame 3"]));
    assert_eq!(gltf["scenes"][0]["extras"]["frames_left_out"], serde_json::json!([8, 9]));

    let usd = std::fs::read_to_string(at("cloth.usda")).unwrap();
    let samples = |n: usize| usd.matches(&format!("\n            {n}: [")).count();
    assert_eq!([0, 1, 2, 3].map(samples), [3, 0, 0, 3], "extent, points and normals");
    assert!(usd.contains("endTimeCode = 3") && usd.contains("because they were lost: [8, 9]"), "{usd}");

    for format in ["obj", "ply"] {
        let file = |n: usize| at(&format!("cloth_{format}/cloth_{n:04}.{format}"));
        assert_eq!([7, 8, 9, 10].map(|n| file(n).is_file()), [true, false, false, true]);
        let text = std::fs::read_to_string(at(&format!("cloth_{format}/cloth_frames.json"))).unwrap();
        let told: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(told["frames_left_out"], serde_json::json!([8, 9]));
        assert_eq!(
            told["verdicts"][1],
            serde_json::json!({"frame": 8, "state": "lost", "reason": "creased"})
        );
    }
    let mesh = io::obj::read(&at("cloth_obj/cloth_0010.obj")).unwrap();
    let found: Vec<f32> = mesh.positions.iter().flat_map(|p| p.as_vec3().to_array()).collect();
    assert_eq!(found, last);

    // A third and two thirds of the way.
    let pc2 = std::fs::read(at("cloth.pc2")).unwrap();
    assert_eq!(word(&pc2, 28), 4);
    for (k, v) in floats(&pc2[32..]).into_iter().enumerate() {
        let (n, k) = (k / first.len(), k % first.len());
        let expected = first[k] + (last[k] - first[k]) * n as f32 / 3.0;
        assert!((v - expected).abs() < 1e-6, "sample {n}, number {k}: {v} for {expected}");
    }
    let still = std::fs::read_to_string(at("cloth_pc2.obj")).unwrap();
    assert!(still.starts_with("# lost frames, interpolated in the cache: [8, 9]\n"), "{still}");

    let npz = std::fs::read(at("cloth.npz")).unwrap();
    let shape = |name: &str| {
        std::fs::write(at("array.npy"), array(&npz, name)).unwrap();
        io::npy::read(&at("array.npy")).unwrap().shape
    };
    assert_eq!(
        (shape("motion"), shape("dynamic_force")),
        (vec![2, 15, 3], vec![3, 15, 3]),
        "forces of the whole clip"
    );
    let integers = |name: &str| {
        let bytes = array(&npz, name);
        assert!(bytes.windows(3).any(|w| w == b"(2,"), "{}", String::from_utf8_lossy(bytes));
        [8, 4].map(|from_end| word(bytes, bytes.len() - from_end))
    };
    assert_eq!((integers("frames"), integers("states")), ([7, 10], [0, 1]));
}

#[test]
fn a_clip_may_begin_and_end_lost() {
    let folder = tempfile::tempdir().unwrap();
    let clip = judged([State::Lost, State::Found, State::Found, State::Lost]).without_lost().unwrap();
    exported(&clip, folder.path());
    let bytes = std::fs::read(folder.path().join("cloth.glb")).unwrap();
    let (gltf, binary) = parse_glb(&bytes);
    let sampler = &gltf["animations"][0]["samplers"][0];
    assert_eq!(floats(accessor(&gltf, binary, &sampler["input"])), [0.04, 0.08]);
    let pc2 = std::fs::read(folder.path().join("cloth.pc2")).unwrap();
    let held: Vec<f32> = [1, 1, 2, 2].into_iter().flat_map(|n| y_up(&judged([State::Found; 4]), n)).collect();
    assert_eq!(floats(&pc2[32..]), held);
}

#[test]
fn whole_clips_say_nothing_of_gaps() {
    let (plain, same) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let clip = judged([State::Doubtful; 4]);
    exported(&clip, plain.path());
    exported(&clip.without_lost().unwrap(), same.path());
    for name in ["cloth.glb", "cloth.usda", "cloth.pc2", "cloth.npz", "cloth_pc2.obj"] {
        let read = |folder: &Path| std::fs::read(folder.join(name)).unwrap();
        assert!(read(plain.path()) == read(same.path()), "{name}");
    }
    assert!(!plain.path().join("cloth_obj/cloth_frames.json").exists());
}

#[test]
fn nothing_to_export_and_nothing_known_are_refused() {
    for (clip, fragment) in
        [(judged([State::Lost; 4]), "no frame that is not lost"), (clip(false), "holds no verdicts")]
    {
        let error = clip.without_lost().unwrap_err();
        assert_eq!(error.exit_code(), 3);
        assert!(error.to_string().contains(fragment), "{error}");
    }
}
