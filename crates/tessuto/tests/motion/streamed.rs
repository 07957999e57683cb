//! A video too long to hold is read again and again: to the same result.

use tessuto::appearance::{self, AppearanceSettings};
use tessuto::config::{Config, Preset};
use tessuto::io::scene::{LoadOptions, load};
use tessuto::pbr::Geometry;
use tessuto::session::{Session, identity};
use tessuto::synth::{self, Settings};
use tessuto::{Scene, reconstruct};

fn silent<'a>() -> Session<'a> {
    Session::new(|_, _| Ok(()))
}

fn folder() -> tempfile::TempDir {
    let settings = Settings::default().with(|s| (s.frames, s.grid, s.size) = (5, [6, 6], 64));
    let folder = tempfile::tempdir().unwrap();
    synth::write::write(folder.path(), &synth::make(&settings).unwrap(), &settings).unwrap();
    folder
}

fn held_and_streamed(folder: &tempfile::TempDir) -> [Scene; 2] {
    [1 << 30, 0].map(|held_bytes| {
        load(folder.path(), &LoadOptions { held_bytes, ..LoadOptions::default() }).unwrap().scene
    })
}

#[test]
fn a_streamed_video_gives_the_same_bytes_as_a_held_one() {
    let folder = folder();
    let [held, streamed] = held_and_streamed(&folder);
    assert!(held.frames.held().is_some() && streamed.frames.held().is_none());
    assert_eq!(identity(&held, "").unwrap(), identity(&streamed, "").unwrap());
    for preset in [Preset::Default, Preset::Saft] {
        let mut config = Config::preset(preset);
        for assignment in ["texture.epochs=5", "texture.size=16", "rollout.last_epochs=2"] {
            config.set(assignment).unwrap();
        }
        let [a, b] = [&held, &streamed].map(|s| reconstruct(s, &config, &mut silent()).unwrap());
        assert_eq!(a.motion, b.motion);
        assert_eq!(a.texture.texels, b.texture.texels);
    }
    let motion = held.truth.vertices.clone().unwrap();
    let geometry = Geometry::new(&held.template, &motion);
    for most_pixels in [1000, 1 << 20] {
        let mut settings = AppearanceSettings::default();
        (settings.steps, settings.batch, settings.most_pixels) = (3, 64, most_pixels);
        let fit = |scene| appearance::fit(scene, &motion, &geometry, &settings, 0, &mut silent()).unwrap();
        assert_eq!(fit(&held).maps().texels, fit(&streamed).maps().texels);
    }
}

#[test]
fn files_that_change_under_a_run_are_named() {
    let folder = folder();
    let [_, streamed] = held_and_streamed(&folder);
    streamed.frames.frame(2).unwrap();
    let path = folder.path().join("rgbs/rgb_002.png");
    std::fs::copy(folder.path().join("rgbs/rgb_003.png"), &path).unwrap();
    let error = streamed.frames.frame(2).unwrap_err().to_string();
    assert!(error.contains("rgb_002.png") && error.contains("changed"), "{error}");
    std::fs::remove_file(&path).unwrap();
    assert!(streamed.frames.frame(2).unwrap_err().to_string().contains("rgb_002.png"));
    // The first of several frames is the one that is told, whatever ends first.
    std::fs::remove_file(folder.path().join("rgbs/rgb_004.png")).unwrap();
    let error = identity(&streamed, "").unwrap_err().to_string();
    assert!(error.contains("rgb_002.png"), "{error}");
}
