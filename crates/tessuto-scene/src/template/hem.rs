//! The sides of a sheet as the mask shows them: the border of the grid is moved, within the patch between the four
//! corners, onto the outline, and what is inside follows. Depth stays that of the patch: an outline does not show how
//! a sheet bends (tried: bending the grid until its threads keep their lengths made a sagging sheet six times worse).

use glam::{DVec2, DVec3};

use super::outline::Outline;
use tessuto_core::camera::Camera;
use tessuto_core::mesh::Mesh;

/// Moves the border of `mesh`, the grid of `columns`×`rows` vertices on the patch between `positions` `[m]` (upper
/// left, upper right, lower right, lower left), onto the outline between `corners` `[px]`, where these are seen.
pub fn hem(
    mesh: &mut Mesh,
    [columns, rows]: [usize; 2],
    positions: [DVec3; 4],
    camera: &Camera,
    outline: &Outline,
    corners: [DVec2; 4],
) {
    let counts = [columns, rows, columns, rows];
    let ends = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
    // Parameters (s, t) of the patch along each side, in the direction of the outline.
    let sides: [Vec<DVec2>; 4] = std::array::from_fn(|k| {
        let seen = side(outline, corners[k], corners[(k + 1) % 4], counts[k]);
        let straight = |j: usize| ends[k].lerp(ends[(k + 1) % 4], j as f64 / (counts[k] - 1) as f64);
        seen.iter().enumerate().map(|(j, q)| parameter(positions, camera, *q, straight(j))).collect()
    });
    let [top, right, bottom, left] = sides;
    for r in 0..rows {
        for c in 0..columns {
            let (s, t) = (c as f64 / (columns - 1) as f64, r as f64 / (rows - 1) as f64);
            // Transfinite interpolation (Coons): both families of lines, less what both count.
            let along = top[c].lerp(bottom[columns - 1 - c], t);
            let across = left[rows - 1 - r].lerp(right[r], s);
            let both = top[0].lerp(top[columns - 1], s).lerp(bottom[columns - 1].lerp(bottom[0], s), t);
            mesh.positions[r * columns + c] = on_patch(positions, along + across - both);
        }
    }
}

fn on_patch(p: [DVec3; 4], st: DVec2) -> DVec3 {
    p[0].lerp(p[1], st.x).lerp(p[3].lerp(p[2], st.x), st.y)
}

/// Where on the patch the camera sees `q`, by Newton's method from `start`.
fn parameter(positions: [DVec3; 4], camera: &Camera, q: DVec2, start: DVec2) -> DVec2 {
    let seen = |st: DVec2| camera.project(on_patch(positions, st));
    let mut st = start;
    for _ in 0..20 {
        let (miss, h) = (q - seen(st), 1e-5);
        let du = (seen(st + DVec2::new(h, 0.0)) - seen(st)) / h;
        let dv = (seen(st + DVec2::new(0.0, h)) - seen(st)) / h;
        let step = DVec2::new(miss.perp_dot(dv), du.perp_dot(miss)) / du.perp_dot(dv);
        // A sheet seen along its plane has no such place.
        if !step.is_finite() || (st + step - start).length() > 0.5 {
            return start;
        }
        st += step;
        if step.length() < 1e-10 {
            break;
        }
    }
    st
}

/// `count` points that divide the outline between two corners evenly, smoothed over half their distance: masks have
/// steps and ragged edges.
fn side(outline: &Outline, from: DVec2, to: DVec2, count: usize) -> Vec<DVec2> {
    let points = &outline.points;
    let n = points.len();
    let nearest = |c: DVec2| {
        let distance = |k: &usize| points[*k].distance_squared(c);
        (0..n).min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("an outline has points")
    };
    let (first, last) = (nearest(from), nearest(to));
    let mut raw = vec![from];
    raw.extend((0..=(last + n - first) % n).map(|k| points[(first + k) % n]));
    raw.push(to);
    let window = (raw.len() / (count - 1) / 2).max(3);
    let smooth: Vec<DVec2> = (0..raw.len())
        .map(|k| {
            // The same on both sides, so that the ends stay.
            let reach = window.min(k).min(raw.len() - 1 - k);
            raw[k - reach..=k + reach].iter().sum::<DVec2>() / (2 * reach + 1) as f64
        })
        .collect();
    let mut lengths = vec![0.0];
    for pair in smooth.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + pair[0].distance(pair[1]));
    }
    let total = lengths[lengths.len() - 1];
    (0..count)
        .map(|j| {
            let wanted = total * j as f64 / (count - 1) as f64;
            let k = lengths.partition_point(|l| *l < wanted).clamp(1, smooth.len() - 1);
            let step = lengths[k] - lengths[k - 1];
            let t = if step > 0.0 { (wanted - lengths[k - 1]) / step } else { 0.0 };
            smooth[k - 1].lerp(smooth[k], t.clamp(0.0, 1.0))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::template::overlap_with_mask;
    use crate::template::rectangle::{locate, patch};
    use tessuto_core::image::Image;

    #[test]
    fn a_sagging_side_is_followed() {
        let camera = Camera { fx: 700.0, fy: 700.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };
        let size = DVec2::new(0.6, 0.5);
        let mut truth = tessuto_core::mesh::grid(25, 21, size, 1.2);
        for p in &mut truth.positions {
            // The upper side sags by 5 cm in its middle, the lower one not at all.
            p.y += 0.05 * (1.0 - (p.x / 0.3).powi(2)) * (0.25 - p.y) / 0.5;
        }
        let whole = Image { width: 640, height: 480, channels: 1, data: vec![1.0; 640 * 480] };
        let covered = tessuto_render::raster::coverage::template_coverage(&truth, &truth.positions, camera);
        let mask = Image { data: covered.iter().map(|c| f32::from(u8::from(*c))).collect(), ..whole };
        let mut outline = Outline::new(&mask, "mask").unwrap();
        let corners = outline.corners();
        let found = locate(&camera, size, corners).unwrap();
        let mut mesh = patch(found.positions, [25, 21]);
        let overlap = overlap_with_mask(&mesh, &camera, &mask);
        hem(&mut mesh, [25, 21], found.positions, &camera, &outline, corners);
        let hemmed = overlap_with_mask(&mesh, &camera, &mask);
        assert!(overlap < 0.95 && hemmed > 0.985, "{overlap} before, {hemmed} after");
        let error =
            mesh.positions.iter().zip(&truth.positions).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(error < 0.01, "{error} m");
    }
}
