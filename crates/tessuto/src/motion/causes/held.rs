//! Which vertices are held.
//!
//! Pins show in the image: what they hold keeps still while the rest moves. Where nothing does, hands hold the cloth, and the two
//! upper corners are the best guess. A sheet that hardly moves is taken the same way, but then nothing is sure.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use crate::mesh::{Mesh, Positions};

/// A vertex is still if it moves by less than this fraction of the median movement.
const STILL: f64 = 0.2;
/// Movement of the sheet, as a fraction of its distance, below which what keeps still cannot be told: a fifth of it is what images of
/// found vertices are off by.
const LEAST: f64 = 5e-4;

/// A guess at what is held.
pub(crate) struct Guess {
    /// Vertices in ascending order.
    pub held: Vec<usize>,
    /// Whether they keep still in the image; otherwise they are the upper corners, for want of better.
    pub still: bool,
    /// Whether the sheet moves enough to tell them apart.
    pub told: bool,
}

/// The held vertices of `template`, given positions `found`, shape [N, V], and where `down` is.
pub(crate) fn held_vertices(template: &Mesh, found: &[Positions], down: DVec3) -> Guess {
    let x = &template.positions;
    let border = border(template);
    let centre = x.iter().sum::<DVec3>() / x.len() as f64;
    let movement = movements(x, found);
    let mut sorted = movement.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[sorted.len() / 2];
    let is_above = |v: usize| (x[v] - centre).dot(down) < 0.0;
    let still: Vec<usize> =
        border.iter().copied().filter(|v| movement[*v] < STILL * median && is_above(*v)).collect();
    let told = median > LEAST;
    match still.is_empty() {
        false => Guess { held: still, still: true, told },
        true => Guess { held: upper_corners(x, &border, centre, down), still: false, told },
    }
}

/// Root mean square of the movement of every vertex in the image since the template, in units of its distance.
fn movements(x: &[DVec3], found: &[Positions]) -> Vec<f64> {
    let seen = |p: DVec3| DVec2::new(p.x, p.y) / p.z.max(1e-9);
    let of = |i: usize| {
        let squares: f64 = found.iter().map(|f| seen(f[i]).distance_squared(seen(x[i]))).sum();
        (squares / found.len().max(1) as f64).sqrt()
    };
    (0..x.len()).map(of).collect()
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
    use crate::mesh::grid;

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
        let carried: Vec<Positions> = (0..12)
            .map(|n| mesh.positions.iter().map(|p| *p + DVec3::X * 0.01 * f64::from(n)).collect())
            .collect();
        assert_eq!(held_vertices(&mesh, &carried, DVec3::Y).held, [0, 6]);
        assert_eq!(held_vertices(&mesh, &carried, DVec3::X).held, [0, 35]);
        // A tenth of a pixel or two of movement, pins of which no image tells.
        let hardly: Vec<Positions> = frames
            .iter()
            .map(|x| x.iter().zip(&mesh.positions).map(|(x, p)| p.lerp(*x, 3e-3)).collect())
            .collect();
        assert!(!held_vertices(&mesh, &hardly, DVec3::Y).told);
    }
}
