//! Masks among hands, people and like colours: made clips of what went wrong on filmed ones.

use tessuto::masks::{Made, Request, make};

use super::{filmed, overlap};

/// Width and height of the sheet [px].
const SHEET: [f64; 2] = [70.0, 60.0];

/// Where a sheet that sways as a whole has its upper left corner.
fn corner(n: usize) -> [f64; 2] {
    let t = n as f64;
    [48.0 + 7.0 * (t / 4.0).sin(), 34.0 + 4.0 * (t / 3.0).sin()]
}

/// Place on the sheet.
fn on_sheet(n: usize, x: f64, y: f64) -> Option<[f64; 2]> {
    let [x0, y0] = corner(n);
    let [u, v] = [x - x0, y - y0];
    ((0.0..=SHEET[0]).contains(&u) && (0.0..=SHEET[1]).contains(&v)).then_some([u, v])
}

fn print([u, v]: [f64; 2]) -> [f64; 3] {
    let wave = ((u / 5.0).sin() * (v / 4.0).cos() + (u / 11.0 + v / 7.0).sin()) * 0.15;
    [0.3 + wave, 0.5 - wave, 0.35 + 0.5 * wave]
}

/// A wall without a repeat.
fn wall(x: f64, y: f64) -> [f64; 3] {
    let plaster = 0.07 * ((x / 3.1 + y / 7.0).sin() * (y / 2.9 - x / 11.0).cos() + (x / 6.3 - y / 4.7).sin());
    [0.55, 0.55, 0.6].map(|c| c + plaster)
}

/// The rectangle of the sheet in frame 0.
fn drawn() -> Request {
    let [x, y] = corner(0);
    let [w, h] = SHEET;
    outlined(vec![[x, y], [x + w, y], [x + w, y + h], [x, y + h]])
}

fn outlined(outline: Vec<[f64; 2]>) -> Request {
    Request { outline: Some(outline), ..Request::default() }
}

fn said(made: &Made) -> String {
    let findings = made.record.findings.iter().map(|f| format!("{}: {}", f.frames(), f.text));
    made.record.notes.iter().cloned().chain(findings).collect::<Vec<_>>().join("\n")
}

/// A person in a printed shirt, who sways, covers most of a papered wall; the camera moves by so many pixels a frame.
fn swaying(pan: f64) -> impl Fn(usize, f64, f64) -> [f64; 3] {
    move |n, x, y| {
        if let Some(place) = on_sheet(n, x, y) {
            return print(place);
        }
        let x = x + pan * n as f64;
        let sway = 9.0 * (n as f64 / 3.0).sin();
        let u = x - sway;
        if (36.0..133.0).contains(&u) && y > 8.0 {
            let shirt = 0.1 * ((u / 3.7).sin() * (y / 4.3).cos() + (u / 9.0 - y / 5.0).cos());
            return [0.45 + shirt, 0.3 - shirt, 0.3 + 0.3 * shirt];
        }
        let paper = 0.15 * (x / 2.7 + y / 9.0).sin() * (y / 2.3 - x / 13.0).cos();
        wall(x, y).map(|c| c + paper)
    }
}

#[test]
fn a_person_who_sways_is_no_camera_that_moves() {
    let folder = filmed(14, &swaying(0.0));
    let made = make(folder.path(), &drawn(), &|_| {}).unwrap();
    assert!(said(&made).contains("while the rest stands still"), "{}", said(&made));
    let truth = |n: usize, x: f64, y: f64| on_sheet(n, x, y).is_some();
    let worst = (0..14).map(|n| overlap(folder.path(), n, &truth)).fold(1.0, f64::min);
    assert!(worst > 0.95, "{worst}");
    // The same by a camera that moves by 1.5 px a frame.
    let folder = filmed(14, &swaying(1.5));
    let refused = make(folder.path(), &drawn(), &|_| {}).unwrap_err().to_string();
    assert!(refused.contains("camera did not stand still"), "{refused}");
    let frame: f64 = refused.split(|c: char| !c.is_ascii_digit()).find_map(|w| w.parse().ok()).unwrap();
    let by = refused.split(" px").next().unwrap().rsplit(' ').next().unwrap().parse::<f64>().unwrap();
    assert!((by - 1.5 * frame).abs() < 1.5 + 0.3 * by, "{refused}");
}

/// The upper half of a plain towel goes up and down, the lower one rests on a table; place on the towel.
fn on_towel(n: usize, x: f64, y: f64) -> Option<[f64; 2]> {
    let lifted = ((75.0 - y) / 50.0).clamp(0.0, 1.0).powf(1.5);
    let phase = std::f64::consts::TAU * n as f64 / 18.0;
    let [u, v] = [x - 9.0 * phase.sin() * lifted - 45.0, y + 6.0 * (1.0 - phase.cos()) * lifted - 24.0];
    ((0.0..=80.0).contains(&u) && (0.0..=85.0).contains(&v)).then_some([u, v])
}

#[test]
fn a_half_that_rests_on_a_table_is_right() {
    let count = 24;
    let folder = filmed(count, &|n, x, y| match on_towel(n, x, y) {
        Some([u, v]) => [0.3, 0.5, 0.7].map(|c| c + 0.01 * (u / 4.0).sin() * (v / 3.0).cos()),
        None => wall(x, y),
    });
    let corners = vec![[45.0, 24.0], [125.0, 24.0], [125.0, 109.0], [45.0, 109.0]];
    let made = make(folder.path(), &outlined(corners), &|_| {}).unwrap();
    let truth = |n: usize, x: f64, y: f64| on_towel(n, x, y).is_some();
    let worst = (0..count).map(|n| overlap(folder.path(), n, &truth)).fold(1.0, f64::min);
    assert!(worst > 0.96, "{worst}");
    // At the end of the clip one direction alone shows what comes and goes, and frame 23 is named.
    assert!(made.record.doubtful().count() <= 1, "{}", said(&made));
}

#[test]
fn an_arm_that_crosses_is_left_out_and_named() {
    let count = 16;
    // From the right to beyond the middle of the sheet and back, in frames 5 to 11, by up to 40 px a frame.
    let arm = |n: usize, x: f64, y: f64| {
        let t = (n as f64 - 4.0) / 8.0;
        let tip = 172.0 - 95.0 * (std::f64::consts::PI * t).sin();
        (0.0..1.0).contains(&t) && x > tip && (y - 62.0 - 0.1 * x).abs() < 7.0
    };
    let folder = filmed(count, &|n, x, y| match (arm(n, x, y), on_sheet(n, x, y)) {
        (true, _) => [0.85, 0.62, 0.5].map(|c| c + 0.02 * (x / 4.0).sin()),
        (_, Some(place)) => print(place),
        _ => wall(x, y),
    });
    let made = make(folder.path(), &drawn(), &|_| {}).unwrap();
    let truth = |n: usize, x: f64, y: f64| on_sheet(n, x, y).is_some() && !arm(n, x, y);
    let overlaps: Vec<f64> = (0..count).map(|n| overlap(folder.path(), n, &truth)).collect();
    assert!(overlaps.iter().all(|o| *o > 0.94), "{overlaps:?}");
    let crossing = made.record.findings.iter().find(|f| f.text.contains("in front of"));
    let crossing = crossing.unwrap_or_else(|| panic!("{}", said(&made)));
    assert!((5..=7).contains(&crossing.first) && (9..=11).contains(&crossing.last), "{}", said(&made));
    assert!(!crossing.doubtful);
}
