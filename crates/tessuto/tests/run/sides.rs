//! A fabric whose other side has one colour: what is left of that in the folder of a result, and in its material.

use std::path::Path;

use glam::DVec3;
use tessuto::appearance::{self, AppearanceSettings, MapPrior};
use tessuto::config::{Config, Preset};
use tessuto::export::Clip;
use tessuto::motion::parameters::Parameters;
use tessuto::pbr::Geometry;
use tessuto::raster::Texture;
use tessuto::result::{self, Context, Folder, Run};
use tessuto::session::Session;
use tessuto::sim::Accelerations;
use tessuto::synth::{self, Mover, Settings};
use tessuto::{Back, Reconstruction, Scene, io};

const COLOUR: [f32; 3] = [0.6, 0.8, 0.4];
const FRAMES: usize = 8;

fn decode(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// A sheet that is folded over.
fn scene(back: Option<[f32; 3]>) -> Scene {
    let settings = Settings::default().with(|s| {
        (s.mover, s.fold, s.frames, s.fps) = (Mover::Table, true, FRAMES, 10.0);
        (s.size, s.grid, s.bend, s.back) = (96, [13, 13], 1e-4, back);
    });
    synth::make(&settings).unwrap()
}

/// The result of `scene` whose motion is the true one, in `folder`.
fn write(folder: &Path, scene: &Scene, back: Back) -> Folder {
    let vertices = scene.template.positions.len();
    let accelerations = Accelerations {
        constant: DVec3::ZERO,
        dynamic: vec![vec![DVec3::ZERO; vertices]; FRAMES - 1],
        entries_per_frame: 1,
        wind: None,
    };
    let found = Reconstruction {
        motion: scene.truth.vertices.clone().unwrap(),
        deviations: None,
        parameters: Parameters::of_springs([2.0, -3.0, -3.0], accelerations),
        causes: None,
        texture: Texture::uniform(8, 8, [1.0, 0.0, 0.0]),
        back,
        history: Vec::new(),
        timings: Vec::new(),
        failure: None,
    };
    let mut settings = Config::preset(Preset::Default);
    settings.set("texture.size=64").unwrap();
    let run = Run { version: "0.0".into(), scene: "cloth".into(), frames: [0, FRAMES], settings };
    let context = Context { scene, run: &run, evaluation: None, warnings: &[], command: "" };
    result::write_motion(folder, scene, &run, &found).unwrap();
    result::write_pictures(folder, &context, &found).unwrap();
    Folder::open(folder).unwrap()
}

#[test]
fn the_print_is_kept_clean_and_pictures_exports_and_page_show_the_colour() {
    let [printed, lined] = [scene(None), scene(Some(COLOUR))];
    let folders = [(); 3].map(|()| tempfile::tempdir().unwrap());
    let back = Back::Plain(Some(COLOUR));
    let cases = [(&printed, Back::Same), (&lined, Back::Same), (&lined, back)];
    let opened: Vec<Folder> =
        cases.iter().zip(&folders).map(|((scene, back), f)| write(f.path(), scene, *back)).collect();
    let print = |k: usize| io::image::read(&folders[k].path().join("texture.png")).unwrap().data;
    let off = |k: usize| {
        let of = print(k).iter().zip(print(0)).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
        (of / print(k).len() as f32).sqrt()
    };
    println!("the print is off by {:.4} if the sides are told apart, else by {:.4}", off(2), off(1));
    assert!(off(2) < 0.8 * off(1));

    // The last frame shows the other side, which has nothing of the texture, red.
    let shown = |k: usize| {
        let path = folders[k].path().join(format!("pictures/render/frame_{:03}.png", FRAMES - 1));
        let image = io::image::read(&path).unwrap();
        let near =
            |pixel: &[f32], colour: [f32; 3]| pixel.iter().zip(colour).all(|(a, b)| (a - b).abs() < 0.01);
        let count = |colour| image.data.chunks_exact(3).filter(|pixel| near(pixel, colour)).count();
        [count(COLOUR), count([1.0, 0.0, 0.0])]
    };
    let [[none, all], [plain, red]] = [shown(1), shown(2)];
    assert!(none == 0 && all > 500 && plain > 500 && red < all - plain + 100, "{none} {all} {plain} {red}");

    assert_eq!(opened[1].back, Back::Same);
    assert_eq!(opened[2].back, back);
    let parameters = |k: usize| std::fs::read_to_string(folders[k].path().join("parameters.json")).unwrap();
    assert!(!parameters(1).contains("back") && parameters(2).contains("\"back\": \"#99cc66\""));
    assert!(Clip::of(&opened[1]).unwrap().back.is_none());
    let exported = Clip::of(&opened[2]).unwrap().back.expect("a colour");
    assert!(exported.colour.iter().zip(COLOUR).all(|(a, b)| (a - decode(b)).abs() < 1e-5));
    for (k, expected) in [(1, 0), (2, 1)] {
        result::write_page(&opened[k]).unwrap();
        let page = std::fs::read_to_string(folders[k].path().join("report.html")).unwrap();
        let told = format!("\"back\":{{\"outward\":{},\"texture\":\"#99cc66\"", exported.outward);
        assert_eq!(page.matches(&told).count(), expected, "{told}");
    }
}

#[test]
fn the_other_side_has_an_albedo_of_its_own() {
    let lined = scene(Some(COLOUR));
    let motion = lined.truth.vertices.clone().unwrap();
    let geometry = Geometry::new(&lined.template, &motion);
    let mut settings = AppearanceSettings::default();
    (settings.map_size, settings.steps, settings.batch) = (32, 60, 200);
    (settings.prior, settings.sharpening_passes) = (MapPrior::Smooth, 0);
    let fit = |back: Back| {
        let session = &mut Session::new(|_, _| Ok(()));
        appearance::fit(&lined.with_back(back), &motion, &geometry, &settings, 0, session).unwrap().maps()
    };
    let [same, other] = [Back::Same, Back::Other].map(fit);
    assert!(same.back.is_none() && other.back.is_none() && same.texels != other.texels);
    let known = fit(Back::Plain(Some([0.0, 0.0, 1.0])));
    let plain = fit(Back::Plain(None));
    // The maps are those of the front, whatever is behind; the colour is that of the pixels, not what was told.
    assert_eq!(plain.texels, other.texels);
    assert_eq!(plain, known);
    let [r, g, b] = plain.back.expect("it is seen");
    let [x, y, z] = COLOUR.map(decode);
    println!("albedo {r:.3} {g:.3} {b:.3}");
    assert!((g / r / (y / x) - 1.0).abs() < 0.3 && (g / b / (y / z) - 1.0).abs() < 0.4, "{r} {g} {b}");
}
