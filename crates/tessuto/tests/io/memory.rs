//! A scene from arrays is the scene of the same folder, and is refused for the same reasons.

use glam::DVec3;
use tessuto::io::image::{Samples, read_bytes, read_grey};
use tessuto::io::scene::{LoadOptions, Recording, assemble, load};
use tessuto::{Camera, Error, Mesh, Motion, Truth, io};

use crate::support::scene_maker::{FRAMES, TinyScene};

fn recording(tiny: &TinyScene) -> Recording {
    let frame = |n: usize| {
        let image = read_bytes(&tiny.path(&format!("rgbs/rgb_{n:03}.png"))).unwrap();
        Samples::Bytes(image.data)
    };
    // Words of 16 bits say the same.
    let mask = |n: usize| {
        let image = read_grey(&tiny.path(&format!("masks/mask_{n:03}.png"))).unwrap();
        Samples::Words(image.data.iter().map(|v| (v * 65_535.0).round() as u16).collect())
    };
    Recording {
        name: "tiny".to_owned(),
        fps: 25.0,
        camera: Camera { fx: 40.0, fy: 40.0, cx: 11.5, cy: 13.5, width: 24, height: 24 },
        poses: None,
        crop: None,
        frames: (0..FRAMES).map(frame).collect(),
        masks: (0..FRAMES).map(mask).collect(),
        template: io::obj::read(&tiny.path("template.obj")).unwrap(),
        planes: Vec::new(),
        back: None,
        more: Vec::new(),
        truth: Truth::default(),
    }
}

#[test]
fn arrays_make_the_scene_of_their_folder() {
    let tiny = TinyScene::new();
    let loaded = load(&tiny.path(""), &LoadOptions::default()).unwrap();
    let made = assemble(recording(&tiny)).unwrap();
    assert_eq!(made.warnings, loaded.warnings);
    let (a, b) = (&made.scene, &loaded.scene);
    assert_eq!((a.camera, a.crop, a.full_size), (b.camera, b.crop, b.full_size));
    assert_eq!((&a.name, a.fps, &a.template), (&b.name, b.fps, &b.template));
    for n in 0..FRAMES {
        let (a, b) = (a.frames.frame(n).unwrap(), b.frames.frame(n).unwrap());
        assert_eq!(a.rgb, b.rgb, "frame {n}");
        assert_eq!(a.mask, b.mask, "frame {n}");
    }
}

#[test]
fn arrays_are_refused_with_their_place() {
    let tiny = TinyScene::new();
    let bad = |change: &dyn Fn(&mut Recording), place: &str, problem: &str| {
        let mut recording = recording(&tiny);
        change(&mut recording);
        let error = assemble(recording).unwrap_err();
        let Error::Input { place: found, problem: what, .. } = &error else { panic!("{error}") };
        assert!(found == place && what.contains(problem), "{place}: {problem}, not {error}");
    };
    let black = |r: &mut Recording, k: usize| r.masks[k] = Samples::Bytes(vec![0; 24 * 24]);
    bad(&|r| black(r, 2), "masks[2]", "the mask is empty");
    bad(&|r| r.frames[1] = Samples::Bytes(vec![0; 7]), "frames[1]", "is not an image of 24×24 px");
    bad(&|r| r.masks.truncate(3), "masks", "3 masks of 4 frames");
    bad(&|r| (r.frames, r.masks) = (vec![], vec![]), "scene", "\"n_frames\" is 0");
    bad(&|r| r.fps = f64::NAN, "scene", "\"fps\" is NaN");
    bad(&|r| r.camera.fx = 0.0, "scene", "\"fx\" is 0");
    bad(&|r| r.template.positions[3].y = f64::NAN, "template", "vertex 3 is");
    bad(&|r| r.template.faces[1].vertices[0] = 99, "template", "face 1 is [99");
    bad(&|r| r.template.positions.iter_mut().for_each(|p| p.z -= 2.0), "template", "behind the camera");
    let still = |r: &Recording, n| Motion::new(vec![r.template.positions.clone(); n]).unwrap();
    bad(&|r| r.truth.vertices = Some(still(r, 3)), "truth", "[3, ");
    let away = |mesh: &mut Mesh| mesh.positions.iter_mut().for_each(|p| *p += DVec3::X * 0.35);
    bad(&|r| away(&mut r.template), "tiny/template.obj", "far from the mask");
}
