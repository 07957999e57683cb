//! A round cloth that lies on a table and is lifted at one side: its template from the first frame, its motion from the
//! search.

use glam::DVec3;
use tessuto::config::{Config, Preset};
use tessuto::io::image::Samples;
use tessuto::io::scene::{Recording, assemble};
use tessuto::mesh::Positions;
use tessuto::session::Session;
use tessuto::template::table::{PlaneFrom, Side, from_outline};
use tessuto::{Image, Mesh, Motion, Scene, Truth, reconstruct};

use super::shapes::{Table, camera, drawn, lifted, rings, round};

const FRAMES: usize = 8;

fn time(frame: usize) -> f64 {
    frame as f64 / (FRAMES - 1) as f64
}

/// The clip of a drawn shape, its template made of the first mask with triangles of `side` `[m]`.
fn filmed(mesh: &Mesh, width: usize, side: f64) -> Scene {
    let (table, camera) = (Table::tilted(), camera(width));
    let shape = |frame: usize| -> Positions {
        mesh.positions.iter().map(|p| table.at(lifted(*p, time(frame)))).collect()
    };
    let images: Vec<(Image, Image)> = (0..FRAMES).map(|n| drawn(mesh, &shape(n), camera)).collect();
    let bytes =
        |image: &Image| Samples::Bytes(image.data.iter().map(|v| (v * 255.0).round() as u8).collect());
    let plane = PlaneFrom::Given(table.plane());
    let mask = &images[0].1;
    let made = from_outline(&camera, (mask, "mask"), plane, Side::Length(side), &mut |_| ()).unwrap();
    let flat: Vec<DVec3> = made.mesh.positions.iter().map(|p| table.within(*p)).collect();
    let vertices =
        (0..FRAMES).map(|n| flat.iter().map(|p| table.at(lifted(*p, time(n)))).collect()).collect();
    let recording = Recording {
        name: "round".to_owned(),
        fps: 25.0,
        camera,
        poses: None,
        crop: None,
        frames: images.iter().map(|(rgb, _)| bytes(rgb)).collect(),
        masks: images.iter().map(|(_, mask)| bytes(mask)).collect(),
        template: made.mesh,
        truth: Truth { vertices: Some(Motion::new(vertices).unwrap()), ..Truth::default() },
        planes: Vec::new(),
        back: None,
        more: Vec::new(),
    };
    let loaded = assemble(recording).unwrap();
    println!("{:?}", loaded.warnings);
    loaded.scene
}

/// Mean distances of the vertices from the truth `[m]`: of the motion found, and of the template held still.
fn errors(scene: &Scene) -> [f64; 2] {
    let mut config = Config::preset(Preset::Motion);
    for assignment in ["texture.epochs=5", "texture.size=32"] {
        config.set(assignment).unwrap();
    }
    let result = reconstruct(scene, &config, &mut Session::silent()).unwrap();
    assert!(result.failure.is_none(), "{:?}", result.failure);
    let truth = scene.truth.vertices.as_ref().unwrap();
    let off = |motion: &mut dyn Iterator<Item = &DVec3>| {
        let pairs = motion.zip(truth.iter().flatten());
        pairs.map(|(a, b)| a.distance(*b)).sum::<f64>() / (truth.len() * truth.vertex_count()) as f64
    };
    let still = std::iter::repeat_n(&scene.template.positions, FRAMES);
    [off(&mut result.motion.iter().flatten()), off(&mut still.flatten())]
}

#[test]
fn the_motion_of_a_round_cloth_is_found() {
    let scene = filmed(&round().mesh, 240, 0.04);
    let [found, still] = errors(&scene);
    println!(
        "{} vertices: {:.2} mm off, {:.2} mm if held still",
        scene.template.positions.len(),
        1e3 * found,
        1e3 * still
    );
    assert!(found < 3e-3 && found < 0.15 * still, "{found} {still}");
}

#[test]
fn the_motion_of_a_cloth_with_a_hole_is_found() {
    let fine: Vec<f64> = (0..=17).map(|k| 0.08 + 0.01 * f64::from(k)).collect();
    let scene = filmed(&rings(&fine), 240, 0.04);
    let [found, still] = errors(&scene);
    println!("{:.2} mm off, {:.2} mm if held still", 1e3 * found, 1e3 * still);
    assert!(found < 3e-3 && found < 0.15 * still, "{found} {still}");
}
