//! The recorded and rendered scenes that come with the project's checkout, beside the workspace.

use tessuto::io::scene::{LoadOptions, load};

use crate::support::recordings::recorded;

#[test]
fn recorded_scene_loads_whole() {
    let Some(folder) = recorded("R1") else { return };
    let start = std::time::Instant::now();
    let loaded = load(&folder, &LoadOptions::default()).unwrap();
    println!("R1 loaded in {:.2} s; warnings: {:#?}", start.elapsed().as_secs_f64(), loaded.warnings);
    let scene = loaded.scene;
    assert_eq!((scene.frames.len(), scene.template.positions.len()), (50, 1024));
    assert_eq!((scene.crop.x0, scene.crop.y1, scene.full_size), (300, 980, [1920, 1080]));
    assert!((scene.camera.cx - (962.134 - 300.0)).abs() < 1e-9);
    assert_eq!(
        (scene.frames.frame(49).unwrap().rgb.width, scene.frames.frame(49).unwrap().mask.height),
        (800, 700)
    );
    assert_eq!(scene.truth.points.as_ref().map(Vec::len), Some(50));
    assert!(scene.truth.vertices.is_none());
}

#[test]
fn a_part_of_a_rendered_scene_is_the_same_part_of_the_whole() {
    for name in ["S1", "S2"] {
        let Some(folder) = recorded(name) else { return };
        let whole = load(&folder, &LoadOptions::default()).unwrap();
        println!("{name}: crop {:?}, warnings: {:#?}", whole.scene.crop, whole.warnings);
        let part =
            load(&folder, &LoadOptions { frames: Some(5..8), ..LoadOptions::default() }).unwrap().scene;
        let whole = whole.scene;
        assert_eq!((part.first_frame, part.frames.len()), (5, 3));
        // The crop follows the masks that are loaded, so compare what does not depend on it.
        for k in 0..3 {
            let (a, b) = (&part.frames.frame(k).unwrap().mask, &whole.frames.frame(5 + k).unwrap().mask);
            assert_eq!(a.data.iter().sum::<f32>(), b.data.iter().sum::<f32>());
        }
        let (a, b) = (part.truth.vertices.unwrap(), whole.truth.vertices.unwrap());
        assert_eq!(a[..], b[5..8]);
        assert_eq!(part.truth.points.unwrap()[2], whole.truth.points.unwrap()[7]);
        // The first true shape is the template.
        let apart = b[0].iter().zip(&whole.template.positions).map(|(a, b)| (*a - *b).length());
        assert!(apart.fold(0.0, f64::max) < 1e-5);
    }
}
