//! Whether the template lies on the planes of the scene, or above them.

use super::Finding;
use super::findings::{doubt, ok};
use tessuto_core::mesh::diagonal;
use tessuto_core::scene::Scene;

/// A template that reaches farther behind a plane than this part of its size is not where the plane is, or the plane
/// is not there.
const BEHIND: f64 = 0.02;

/// A finding about every plane.
pub(super) fn findings(scene: &Scene) -> Vec<Finding> {
    let positions = &scene.template.positions;
    let size = diagonal(positions);
    let of = |(k, plane): (usize, &tessuto_core::scene::Plane)| {
        let heights = || positions.iter().map(|x| plane.above(*x));
        let (least, most) =
            (heights().fold(f64::INFINITY, f64::min), heights().fold(f64::NEG_INFINITY, f64::max));
        let what = format!("plane {k}");
        let detail = format!("the template is {:.1} to {:.1} mm above it", 1e3 * least, 1e3 * most);
        if least < -BEHIND * size {
            let hint = "its point and normal are in the camera's frame: x right, y down, z ahead; nothing is found \
                        behind it";
            return doubt(&what, detail, hint);
        }
        ok(&what, detail)
    };
    scene.known.planes.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::super::Level;
    use super::*;
    use tessuto_core::scene::Plane;
    use tessuto_estimate::synth::{Mover, Settings, make};

    #[test]
    fn a_template_behind_a_plane_is_doubted() {
        let settings = Settings::default().with(|s| {
            (s.mover, s.frames, s.fps, s.size, s.grid) = (Mover::Table, 2, 10.0, 48, [5, 5]);
        });
        let mut scene = make(&settings).unwrap();
        assert!(matches!(findings(&scene)[..], [Finding { level: Level::Ok, .. }]));
        let Plane { normal, height } = scene.known.planes[0];
        scene.known.planes[0].height = height + 0.05;
        let found = &findings(&scene)[0];
        assert!(found.level == Level::Warning && found.detail.contains("-50.0"), "{normal} {}", found.detail);
    }
}
