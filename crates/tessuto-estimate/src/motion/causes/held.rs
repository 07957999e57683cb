//! Which vertices are held.
//!
//! Pins show in the image: what they hold keeps still while the rest moves. Which movement is still is a guess,
//! and where causes do not explain the motion with it, more is held ([`Guess::wider`]). Where nothing keeps still,
//! hands hold the cloth, and the two upper corners are the best guess. A sheet that hardly moves is taken the same
//! way, but then nothing is sure.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use tessuto_core::camera::Viewpoint;
use tessuto_core::mesh::{Mesh, Positions};

/// A vertex is still if it moves by less than this fraction of the median movement.
const STILL: f64 = 0.2;
/// The same of the movement about its mean, where what keeps so still does not hold the sheet: what is found of a
/// pin is unsure, too, and may be off in the same way in all frames but the template's.
const STILL_ENOUGH: [f64; 3] = [0.2, 0.3, 0.45];
/// Movement of the sheet, as a fraction of its distance, below which nothing is informed: a tenth of a pixel of
/// most cameras. Where pins are not found among so small movements, the causes' misfit says so.
const LEAST: f64 = 1e-4;

/// A guess at what is held.
pub(crate) struct Guess {
    /// Vertices in ascending order.
    pub held: Vec<usize>,
    /// More of them, ever less still, where these do not hold it.
    pub wider: Vec<Vec<usize>>,
    /// Whether they keep still in the image; otherwise they are the upper corners, for want of better.
    pub still: bool,
    /// Whether the sheet moves enough to distinguish them.
    pub told: bool,
}

/// The held vertices of `template`, given positions `found`, shape [N, V], how they are seen, `views`, shape
/// `[N]`, and where `down` is.
pub(crate) fn held_vertices(
    template: &Mesh,
    (found, views): (&[Positions], &[Viewpoint]),
    down: DVec3,
) -> Guess {
    let x = &template.positions;
    let border = border(template);
    let centre = x.iter().sum::<DVec3>() / x.len() as f64;
    let movement = movements(x, (found, views));
    let median = median(&movement);
    let is_above = |v: usize| (x[v] - centre).dot(down) < 0.0;
    let is_still = |v: usize| movement[v] < STILL * median;
    let still: Vec<usize> = border.iter().copied().filter(|v| is_still(*v) && is_above(*v)).collect();
    let told = median > LEAST;
    if still.is_empty() {
        let held = upper_corners(x, &border, centre, down);
        return Guess { held, wider: Vec::new(), still: false, told };
    }
    let about_mean = movements(&mean(&found[1..]), (&found[1..], &views[1..]));
    let limit = self::median(&about_mean);
    let mut wider: Vec<Vec<usize>> = Vec::new();
    for part in STILL_ENOUGH {
        let is_held = |v: usize| is_still(v) || about_mean[v] < part * limit;
        let held: Vec<usize> = border.iter().copied().filter(|v| is_held(*v) && is_above(*v)).collect();
        if held.len() > wider.last().unwrap_or(&still).len() {
            wider.push(held);
        }
    }
    Guess { held: still, wider, still: true, told }
}

/// Root mean square of the movement of every vertex in the image from where it would be in `x`, in units of its
/// distance.
fn movements(x: &[DVec3], (found, views): (&[Positions], &[Viewpoint])) -> Vec<f64> {
    let seen = |p: DVec3| DVec2::new(p.x, p.y) / p.z.max(1e-9);
    let of = |i: usize| {
        let moved = |(f, view): (&Positions, &Viewpoint)| {
            seen(view.in_camera(f[i])).distance_squared(seen(view.in_camera(x[i])))
        };
        let squares: f64 = found.iter().zip(views).map(moved).sum();
        (squares / found.len().max(1) as f64).sqrt()
    };
    (0..x.len()).map(of).collect()
}

fn mean(frames: &[Positions]) -> Positions {
    let of = |i: usize| frames.iter().map(|f| f[i]).sum::<DVec3>() / frames.len() as f64;
    (0..frames.first().map_or(0, Vec::len)).map(of).collect()
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// Edges of one face only.
fn border_edges(template: &Mesh) -> Vec<[usize; 2]> {
    let mut faces: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for face in &template.faces {
        let v = &face.vertices;
        for (k, a) in v.iter().enumerate() {
            let b = v[(k + 1) % v.len()];
            *faces.entry([*a.min(&b), *a.max(&b)]).or_default() += 1;
        }
    }
    faces.iter().filter(|(_, count)| **count == 1).map(|(edge, _)| edge.map(|v| v as usize)).collect()
}

/// Vertices at edges of one face only, in ascending order.
fn border(template: &Mesh) -> Vec<usize> {
    let mut out: Vec<usize> = border_edges(template).concat();
    out.sort_unstable();
    out.dedup();
    out
}

/// The border as one walk around the sheet, from its first vertex on; the longest one where there are holes.
pub(crate) fn border_loop(template: &Mesh) -> Vec<usize> {
    let mut around: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for [a, b] in border_edges(template) {
        around.entry(a).or_default().push(b);
        around.entry(b).or_default().push(a);
    }
    let mut longest = Vec::new();
    while let Some(start) = around.keys().next().copied() {
        let (mut walk, mut at) = (Vec::new(), start);
        loop {
            walk.push(at);
            let next = around.remove(&at).unwrap_or_default();
            match next.into_iter().find(|v| around.contains_key(v)) {
                Some(v) => at = v,
                None => break,
            }
        }
        if walk.len() > longest.len() {
            longest = walk;
        }
    }
    longest
}

/// The vertices of `border` that lie farthest up to either side.
fn upper_corners(x: &[DVec3], border: &[usize], centre: DVec3, down: DVec3) -> Vec<usize> {
    // Sideways is where the sheet is widest across gravity.
    let across = |v: &usize| {
        let d = x[*v] - centre;
        d - down * d.dot(down)
    };
    let wide = border.iter().map(across).max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let side = wide.unwrap_or(DVec3::X).normalize_or(DVec3::X);
    let corner = |sign: f64| {
        let direction = side * sign - down;
        let best = |a: &&usize, b: &&usize| {
            (x[**a] - centre).dot(direction).total_cmp(&(x[**b] - centre).dot(direction))
        };
        border.iter().max_by(best).copied()
    };
    let mut out: Vec<usize> = [corner(-1.0), corner(1.0)].into_iter().flatten().collect();
    out.sort_unstable();
    out.dedup();
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::camera::{Camera, Pose};
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::grid;

    const CAMERA: Camera = Camera { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, width: 1, height: 1 };

    /// What is held as a camera at the origin sees it; the same, moved as a whole with the camera, is held as well.
    fn held_vertices(mesh: &Mesh, found: &[Positions], down: DVec3) -> Guess {
        let views = vec![Viewpoint::from(CAMERA); found.len()];
        let guess = super::held_vertices(mesh, (found, &views), down);
        let pose = Pose::random(&mut Rng::new(2, 0));
        let view = Viewpoint { camera: CAMERA, camera_from_world: Some(pose) };
        let moved = |x: &Positions| -> Positions { x.iter().map(|p| pose.in_world(*p)).collect() };
        let there = Mesh { positions: moved(&mesh.positions), ..mesh.clone() };
        let moved: Vec<Positions> = found.iter().map(moved).collect();
        let views = vec![view; found.len()];
        let same = super::held_vertices(&there, (&moved, &views), view.turned_to_world(down));
        assert_eq!((&same.held, &same.wider), (&guess.held, &guess.wider));
        assert_eq!((same.still, same.told), (guess.still, guess.told));
        guess
    }

    #[test]
    fn pins_keep_still_and_hands_are_looked_for_at_the_corners() {
        let mesh = grid(7, 6, DVec2::splat(0.4), 1.0);
        let pins = [0, 3, 6];
        let swing = |n: usize| -> Positions {
            let at = |(i, p): (usize, &DVec3)| match pins.contains(&i) {
                true => *p,
                false => *p + DVec3::new(0.03 * (n as f64).sin(), 0.0, 0.1),
            };
            mesh.positions.iter().enumerate().map(at).collect()
        };
        let frames: Vec<Positions> = (0..12).map(swing).collect();
        let guess = held_vertices(&mesh, &frames, DVec3::Y);
        assert!(guess.still && guess.told);
        assert_eq!(guess.held, pins);
        assert!(guess.wider.is_empty());
        // One pin was found beside where the template has it, another one a quarter as restless as the sheet.
        let mut unsure = frames.clone();
        for x in &mut unsure[1..] {
            x[3].x += 0.02;
            let shaken = 0.25 * (x[10] - mesh.positions[10]);
            x[6] += shaken;
        }
        let unsure = held_vertices(&mesh, &unsure, DVec3::Y);
        assert_eq!((&unsure.held[..], &unsure.wider[..]), (&[0][..], &[vec![0, 3], pins.to_vec()][..]));
        let carried: Vec<Positions> = (0..12)
            .map(|n| mesh.positions.iter().map(|p| *p + DVec3::X * 0.01 * f64::from(n)).collect())
            .collect();
        assert_eq!(held_vertices(&mesh, &carried, DVec3::Y).held, [0, 6]);
        assert_eq!(held_vertices(&mesh, &carried, DVec3::X).held, [0, 35]);
        // A tenth of a pixel or two of movement, pins that no image shows.
        let hardly: Vec<Positions> = frames
            .iter()
            .map(|x| x.iter().zip(&mesh.positions).map(|(x, p)| p.lerp(*x, 3e-3)).collect())
            .collect();
        assert!(!held_vertices(&mesh, &hardly, DVec3::Y).told);
    }
}
