//! The pictures, the contact sheet and the page of a small made-up reconstruction.

use std::path::Path;

use glam::DVec3;
use tessuto::metrics::{Evaluation, FrameMetrics, Metrics};
use tessuto::report::{
    FramePictures, HistoryRow, KeyNumber, Kind, Parameter, ReportData, Scales, chosen_frames, contact_sheet,
    html, measured_depth_image,
};
use tessuto::{Camera, Frame, Image, io};

const WIDTH: usize = 64;
const HEIGHT: usize = 48;

/// A disc of fabric around column `x`: colour, mask and depth.
fn disc(x: f32, z: f32) -> (Image, Image, Image) {
    let mut images =
        (Image::new(WIDTH, HEIGHT, 3), Image::new(WIDTH, HEIGHT, 1), Image::new(WIDTH, HEIGHT, 1));
    for row in 0..HEIGHT {
        for column in 0..WIDTH {
            if (column as f32 - x).hypot(row as f32 - 24.0) < 12.0 {
                images.0.pixel_mut(column, row).copy_from_slice(&[0.8, 0.4, 0.2]);
                images.1.pixel_mut(column, row)[0] = 1.0;
                images.2.pixel_mut(column, row)[0] = z;
            }
        }
    }
    images
}

/// Calls `look` with the pictures of a disc that is 4 px too far left and 10 mm too far away.
fn with_pictures(look: impl FnOnce(&FramePictures)) {
    let (rgb, mask, depth) = disc(28.0, 1.21);
    let (observed_rgb, observed_mask, measured) = disc(32.0, 1.20);
    let observed = Frame { rgb: observed_rgb, mask: observed_mask };
    look(&FramePictures {
        rgb: &rgb,
        mask: &mask,
        depth: &depth,
        observed: &observed,
        measured_depth: Some(&measured),
    });
}

#[test]
fn pictures_show_the_sign_of_what_differs() {
    with_pictures(|pictures| {
        let scales = Scales::fitting([(pictures.depth, pictures.measured_depth)]);
        assert_eq!(scales.depth, [1.21, 1.22]);
        assert!((scales.depth_difference - 0.01).abs() < 1e-9, "{scales:?}");
        let at = |kind, x| pictures.picture(kind, &scales).unwrap().pixel(x, 24).to_vec();
        let (red, blue) = (|c: &[f32]| c[0] > 1.5 * c[2], |c: &[f32]| c[2] > 1.5 * c[0]);
        // Rendered only at the left, observed only at the right, both in the middle.
        assert!(red(&at(Kind::MaskDifference, 18)) && blue(&at(Kind::MaskDifference, 42)));
        assert!(at(Kind::MaskDifference, 30).iter().all(|v| *v > 0.95));
        assert!(red(&at(Kind::DepthDifference, 30)));
        assert!(at(Kind::Difference, 30).iter().all(|v| *v < 0.02) && at(Kind::Difference, 42)[0] > 0.9);
        assert_ne!(at(Kind::Depth, 30), at(Kind::Depth, 60));
        let unmeasured = FramePictures { measured_depth: None, ..*pictures };
        assert!(unmeasured.picture(Kind::DepthDifference, &scales).is_none());
    });
}

#[test]
fn measured_points_become_a_surface_without_gaps() {
    let camera = Camera { fx: 100.0, fy: 100.0, cx: 31.5, cy: 23.5, width: WIDTH, height: HEIGHT };
    let mut points = Vec::new();
    for row in 0..10 {
        for column in 0..10 {
            // Every third pixel.
            points.push(
                camera.ray(glam::DVec2::new(10.0 + 3.0 * f64::from(column), 8.0 + 3.0 * f64::from(row)))
                    * 2.0,
            );
        }
    }
    points.push(points[0] * 1.5);
    points.push(DVec3::new(50.0, 0.0, 1.0));
    let image = measured_depth_image(&points, &camera);
    assert!((8..36).all(|y| (10..38).all(|x| (image.pixel(x, y)[0] - 2.0).abs() < 1e-6)));
    assert_eq!(image.pixel(60, 40)[0], 0.0);
}

#[test]
fn contact_sheet_shows_the_first_and_the_last_frame() {
    assert_eq!(chosen_frames(1), [0]);
    assert_eq!(chosen_frames(4), [0, 1, 2, 3]);
    let chosen = chosen_frames(40);
    assert!(chosen.len() == 9 && chosen[0] == 0 && chosen[8] == 39 && chosen.is_sorted());
    with_pictures(|pictures| {
        let scales = Scales::fitting([(pictures.depth, None)]);
        let sheet = contact_sheet(&[(0, *pictures), (7, *pictures)], &scales);
        assert!(sheet.data.iter().all(|v| (0.0..=1.0).contains(v)));
        let cloth =
            sheet.data.chunks_exact(3).filter(|p| (p[0] - 0.8).abs() < 1e-3 && (p[2] - 0.2).abs() < 1e-3);
        assert!(cloth.count() > 4 * 5_000);
    });
}

fn data(frames: Vec<usize>) -> ReportData {
    let history = (0..30).map(|epoch| HistoryRow {
        epoch,
        active_frames: 2 + epoch / 5,
        losses: vec![("total".into(), 0.5f64.powi(epoch as i32)), ("<energy>".into(), 0.0)],
        parameters: vec![("Y".into(), 200.0 + epoch as f64)],
    });
    let row = |frame| FrameMetrics { frame, metrics: Metrics { depth: Some(5.4e-3), ..Metrics::default() } };
    ReportData {
        title: "<script>alert(1)</script>".into(),
        subtitle: "2 frames".into(),
        command: "tessuto reconstruct \"a b\" --out c".into(),
        key_numbers: vec![KeyNumber::new("mask overlap", "0.98", "")],
        kinds: Kind::ALL.to_vec(),
        pictures: "pictures".into(),
        contact_sheet: "contact_sheet.png".into(),
        history: history.collect(),
        parameters: vec![Parameter {
            name: "Y".into(),
            label: "Stretch stiffness".into(),
            value: 229.0,
            unit: "N/m".into(),
            note: String::new(),
        }],
        evaluation: Some(Evaluation {
            mean: row(0).metrics,
            frames: frames.iter().copied().map(row).collect(),
            maps: None,
        }),
        timings: vec![("motion".into(), 4000.0), ("report".into(), 1.5)],
        warnings: vec!["a & b".into()],
        config: "seed = 0".into(),
        frames,
    }
}

#[test]
fn page_links_only_files_that_were_written_and_escapes_names() {
    let folder = tempfile::tempdir().unwrap();
    let frames = vec![3, 4];
    with_pictures(|pictures| {
        let scales = Scales::fitting([(pictures.depth, pictures.measured_depth)]);
        for frame in &frames {
            pictures.write(&folder.path().join("pictures"), *frame, &scales).unwrap();
        }
        io::image::write_png(
            &folder.path().join("contact_sheet.png"),
            &contact_sheet(&[(3, *pictures)], &scales),
        )
        .unwrap();
    });
    let path = folder.path().join("report.html");
    html::write(&path, &data(frames)).unwrap();
    let page = std::fs::read_to_string(&path).unwrap();

    let links: Vec<&str> = page.split("src=\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
    assert_eq!(links.len(), 1 + Kind::ALL.len());
    for link in &links {
        assert!(folder.path().join(Path::new(link)).exists(), "{link}");
    }
    for kind in Kind::ALL {
        assert!(folder.path().join("pictures").join(kind.path(4)).exists());
    }
    assert!(!page.contains("<script>alert") && !page.contains("<energy>") && !page.contains("://"));
    for text in
        ["a &#38; b", "229.0000", "N/m", "5.4", "1 h 06 min", "data-frames=\"3 4 \"", "tessuto reconstruct"]
    {
        assert!(page.contains(text), "{text} is missing");
    }
    assert!(page.contains("Errors") && page.contains("log scale"));
}

#[test]
fn page_without_anything_is_still_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    html::write(&path, &ReportData::default()).unwrap();
    let page = std::fs::read_to_string(&path).unwrap();
    assert!(page.ends_with("</html>") || page.ends_with("</html>\n"));
    assert!(!page.contains("<img") && !page.contains("<h2>"));
    assert_eq!(
        html::write(&folder.path().join("no/such"), &ReportData::default()).unwrap_err().exit_code(),
        5
    );
}
