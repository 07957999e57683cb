//! Whether further cameras are where the scene says: what the first one shows of the sheet in frame 0 is looked for in
//! each of them around the place where the template has it.
//!
//! Of a point found at another place, the part across its epipolar line is an error of the cameras, whatever the
//! template's shape; the part along it may be the template's as well.

use glam::{DVec2, DVec3};

use super::findings::{doubt, ok};
use super::{Finding, Level};
use tessuto_core::camera::Viewpoint;
use tessuto_core::error::Result;
use tessuto_core::image::Image;
use tessuto_core::math::median::median;
use tessuto_core::scene::{PoseUnit, Scene};
use tessuto_render::raster::coverage::{overlap, template_coverage};

/// Half a side of a patch, and how far it is looked for `[px]`.
const HALF: i32 = 5;
const REACH: i32 = 8;
/// Points that are looked for at most.
const MOST: usize = 200;
/// A patch is found where it correlates by as much; it has a pattern where its grey levels spread by as much.
const ALIKE: f64 = 0.9;
const PATTERN: f64 = 0.04;
/// Fewest points that say anything, and the median distance `[px]` from which on cameras are doubted.
const FEWEST: usize = 12;
const DOUBTED: f64 = 2.0;

/// A finding about every further camera.
///
/// # Errors
/// Those of reading the first frames.
pub(super) fn findings(scene: &Scene) -> Result<Vec<Finding>> {
    let first = scene.frames.frame(0)?;
    let mut out = Vec::new();
    for (v, view) in scene.more.iter().enumerate() {
        let other = scene.seen_by(v + 1);
        let frame = other.frames.frame(0)?;
        let there = other.viewpoint(0);
        let mesh = &scene.template;
        let what = format!("view {}", view.name);
        let detail =
            format!("{} frames of {}×{} px", view.frames.len(), view.full_size[0], view.full_size[1]);
        if scene.pose_unit == PoseUnit::Unknown {
            // The template is in metres.
            let why =
                "where it sees the template is known once a run has found the length of a unit of its poses";
            out.push(ok(&what, format!("{detail}; {why}")));
            continue;
        }
        let iou = overlap(&template_coverage(mesh, &mesh.positions, there), &frame.mask);
        let found = off(scene, (&scene.viewpoint(0), &first.rgb), (&there, &frame.rgb));
        let detail = format!("{detail}, overlap of the template with its first mask {iou:.2}");
        out.push(match found {
            None => ok(&what, format!("{detail}; too little pattern to compare it with the first view")),
            Some(([across, along], count)) => {
                let detail = format!(
                    "{detail}; {count} places of the sheet are {across:.1} px off their epipolar lines, {along:.1} px \
                     along them (medians)"
                );
                let hint = "calibrate the cameras together again, and check that their frames are of the same times";
                if across > DOUBTED { doubt(&what, detail, hint) } else { ok(&what, detail) }
            }
        });
    }
    debug_assert!(out.iter().all(|finding| finding.level != Level::Error));
    Ok(out)
}

/// Median distances `[px]` across and along epipolar lines of what both cameras show, and of how many places.
fn off(scene: &Scene, first: (&Viewpoint, &Image), other: (&Viewpoint, &Image)) -> Option<([f64; 2], usize)> {
    let x = &scene.template.positions;
    let triangles = scene.template.triangles();
    let (mut across, mut along) = (Vec::new(), Vec::new());
    for t in triangles.iter().step_by(triangles.len().div_ceil(MOST)) {
        let corners = t.map(|v| x[v as usize]);
        let centre = corners.iter().sum::<DVec3>() / 3.0;
        let Some(way) = displacement(corners, centre, first, other) else { continue };
        // What lies on the ray of the first camera, nearer and farther, in the other's image.
        let ray = first.0.direction(centre);
        let [near, far] = [-1e-3, 1e-3].map(|by| other.0.project(centre + ray * by));
        let line = (far - near).normalize_or_zero();
        across.push(way.perp_dot(line).abs());
        along.push(way.dot(line).abs());
    }
    let count = across.len();
    (count >= FEWEST).then_some(()).and_then(|()| Some(([median(across)?, median(along)?], count)))
}

/// How far from the image of `centre` the other camera shows `[px]` what the first one shows there of the plane of
/// `corners`; `None` where there is no pattern, or nothing alike.
fn displacement(
    [a, b, c]: [DVec3; 3],
    centre: DVec3,
    (first, image): (&Viewpoint, &Image),
    (other, in_image): (&Viewpoint, &Image),
) -> Option<DVec2> {
    let normal = (b - a).cross(c - a);
    let at = first.project_in_front(centre)?;
    let (eye, mut patch, mut places) = (first.eye(), Vec::new(), Vec::new());
    for dy in -HALF..=HALF {
        for dx in -HALF..=HALF {
            let p = at + DVec2::new(f64::from(dx), f64::from(dy));
            let ray = first.ray(p);
            let on_plane = eye + ray * (normal.dot(centre - eye) / normal.dot(ray));
            patch.push(grey(image, p)?);
            places.push(other.project_in_front(on_plane)?);
        }
    }
    let patch = normalised(patch)?;
    let correlation = |by: DVec2| {
        let seen: Option<Vec<f64>> = places.iter().map(|p| grey(in_image, *p + by)).collect();
        let seen = normalised(seen?)?;
        Some(patch.iter().zip(&seen).map(|(a, b)| a * b).sum::<f64>())
    };
    let mut best = (ALIKE, None);
    for dy in -REACH..=REACH {
        for dx in -REACH..=REACH {
            let by = DVec2::new(f64::from(dx), f64::from(dy));
            if let Some(value) = correlation(by).filter(|value| *value > best.0) {
                best = (value, Some(by));
            }
        }
    }
    best.1
}

/// Grey level at a pixel position; `None` outside of the image.
fn grey(image: &Image, p: DVec2) -> Option<f64> {
    let corner = p.floor();
    let inside = corner.min_element() >= 0.0
        && corner.x + 1.0 < image.width as f64
        && corner.y + 1.0 < image.height as f64;
    if !inside {
        return None;
    }
    let f = p - corner;
    let at = |dx: usize, dy: usize| {
        let c = image.pixel(corner.x as usize + dx, corner.y as usize + dy);
        f64::from(c[0] + c[1] + c[2]) / 3.0
    };
    let row = |y: usize| (1.0 - f.x) * at(0, y) + f.x * at(1, y);
    Some((1.0 - f.y) * row(0) + f.y * row(1))
}

/// Of mean 0 and length 1; `None` without a pattern.
fn normalised(mut values: Vec<f64>) -> Option<Vec<f64>> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    values.iter_mut().for_each(|v| *v -= mean);
    let size = values.iter().map(|v| v * v).sum::<f64>().sqrt();
    values.iter_mut().for_each(|v| *v /= size);
    (size / count.sqrt() > PATTERN).then_some(values)
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;
    use tessuto_core::camera::Pose;
    use tessuto_estimate::synth::{Settings, make};

    #[test]
    fn cameras_that_are_where_the_scene_says_fit_and_others_are_doubted() {
        let small =
            |s: &mut Settings| (s.frames, s.size, s.grid, s.views, s.apart) = (2, 320, [13, 13], 2, 30.0);
        let mut scene = make(&Settings::default().with(small)).unwrap();
        let [right] = &findings(&scene).unwrap()[..] else { panic!("one finding") };
        println!("{}", right.detail);
        assert_eq!((right.level, right.what.as_str()), (Level::Ok, "view view1"));
        assert!(right.detail.contains("0.0 px off"), "{}", right.detail);
        // Half a degree is 3.5 px.
        let nod = Pose { rotation: DMat3::from_rotation_x(0.5f64.to_radians()), translation: DVec3::ZERO };
        scene.more[0].poses.iter_mut().for_each(|pose| *pose = nod.after(pose));
        let [wrong] = &findings(&scene).unwrap()[..] else { panic!("one finding") };
        println!("{}", wrong.detail);
        assert_eq!(wrong.level, Level::Warning);
        // In no unit it is nowhere yet.
        scene.pose_unit = PoseUnit::Unknown;
        let [unknown] = &findings(&scene).unwrap()[..] else { panic!("one finding") };
        assert!(unknown.level == Level::Ok && unknown.detail.contains("length of a unit"), "{unknown:?}");
    }
}
