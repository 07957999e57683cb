//! Coverage: triangles that share an edge share no pixel and leave none out, in any order of the faces.

use glam::{DVec2, DVec3};
use proptest::prelude::*;
use tessuto::Camera;
use tessuto::math::rng::Rng;
use tessuto::mesh::{Face, Mesh, grid};
use tessuto::raster::{Rasterizer, Rendering, Texture, reference};

use super::holds;

const CAMERA: Camera = Camera { fx: 60.0, fy: 55.0, cx: 23.5, cy: 19.5, width: 48, height: 40 };

fn face(corners: &[u32]) -> Face {
    Face { vertices: corners.to_vec(), uvs: corners.to_vec() }
}

fn mesh(positions: Vec<DVec3>, faces: Vec<Face>) -> Mesh {
    Mesh { uvs: vec![DVec2::splat(0.5); positions.len()], positions, faces }
}

/// Pixels that the fast rasteriser covers, and the number of triangles over each by the plain one.
fn coverage(mesh: &Mesh) -> (Vec<bool>, Vec<usize>) {
    let rasterizer = Rasterizer::new(mesh);
    let mut rendering = Rendering::new();
    let texture = Texture::uniform(2, 2, [0.5; 3]);
    rasterizer.render(CAMERA, &mesh.positions, &texture, &mut rendering);
    let plain = reference::PlainTexture { width: 1, height: 1, texels: vec![[0.5, 0.5, 0.5, 1.0]] };
    let hits = reference::render(&rasterizer, CAMERA, &mesh.positions, &plain).hits;
    let covered: Vec<bool> = rendering.triangle.iter().map(|t| *t != Rendering::NO_TRIANGLE).collect();
    assert!(covered.iter().zip(&hits).all(|(c, h)| *c == (*h > 0)), "fast and plain coverage differ");
    (covered, hits)
}

/// Pixel positions; on whole and half pixels half of the time, where edges meet pixel centres.
fn pixel() -> impl Strategy<Value = DVec2> {
    let whole = (-8i32..110, -8i32..90).prop_map(|(x, y)| DVec2::new(f64::from(x), f64::from(y)) * 0.5);
    let any = (-4.0..52.0f64, -4.0..44.0f64).prop_map(|(x, y)| DVec2::new(x, y));
    prop_oneof![whole, any]
}

/// The point at 1 m that projects to `pixel`.
fn at(pixel: DVec2) -> DVec3 {
    CAMERA.ray(pixel)
}

#[test]
fn the_two_sides_of_an_edge_part_its_pixels() {
    holds(400, (pixel(), pixel(), pixel(), pixel()), |(a, b, c, d)| {
        let side = |p: DVec2| (b - a).perp_dot(p - a);
        // The third corners on either side of the shared edge a b, and each triangle of some area.
        prop_assume!(side(c) * side(d) < 0.0 && side(c).abs() > 1e-6 && side(d).abs() > 1e-6);
        let positions: Vec<DVec3> = [a, b, c, d].map(at).to_vec();
        let alone = |corners: [u32; 3]| coverage(&mesh(positions.clone(), vec![face(&corners)])).0;
        let (one, other) = (alone([0, 1, 2]), alone([1, 0, 3]));
        let (both, hits) = coverage(&mesh(positions.clone(), vec![face(&[0, 1, 2]), face(&[1, 0, 3])]));
        prop_assert!(hits.iter().all(|h| *h <= 1), "a pixel belongs to both triangles");
        for k in 0..both.len() {
            prop_assert_eq!(both[k], one[k] || other[k]);
            // Inside the edge itself, away from its ends, no pixel centre is lost.
            let q = DVec2::new((k % CAMERA.width) as f64, (k / CAMERA.width) as f64);
            let t = (q - a).dot(b - a) / (b - a).length_squared();
            if side(q).abs() < 1e-9 && (0.01..0.99).contains(&t) && (b - a).length() > 1.0 {
                prop_assert!(both[k], "pixel {q} on the shared edge is in neither triangle");
            }
        }
        Ok(())
    });
}

#[test]
fn a_flat_mesh_leaves_no_gap_and_hits_nothing_twice() {
    holds(60, (any::<u64>(), 0.0..0.45f64, -0.5..0.5f64), |(seed, jitter, tilt)| {
        let mut rng = Rng::new(seed, 0);
        // Wider than the image: every pixel must be covered exactly once.
        let mut sheet = grid(7, 6, DVec2::new(1.8, 1.6), 1.0);
        let spacing = DVec2::new(1.8 / 6.0, 1.6 / 5.0);
        for (v, p) in sheet.positions.iter_mut().enumerate() {
            let inner = (1..6).contains(&(v % 7)) && (1..5).contains(&(v / 7));
            if inner {
                *p += (DVec2::new(rng.signed(), rng.signed()) * jitter * 0.5 * spacing).extend(0.0);
            }
            p.z = 1.0 + tilt * p.x * 0.5;
        }
        let (covered, hits) = coverage(&sheet);
        let margin = |k: usize| {
            let (x, y) = (k % CAMERA.width, k / CAMERA.width);
            (4..CAMERA.width - 4).contains(&x) && (4..CAMERA.height - 4).contains(&y)
        };
        prop_assert!(hits.iter().all(|h| *h <= 1));
        prop_assert!((0..covered.len()).filter(|k| margin(*k)).all(|k| covered[k]), "a gap");
        Ok(())
    });
}

#[test]
fn coverage_and_depth_do_not_depend_on_the_order_of_the_faces() {
    holds(60, (any::<u64>(), 0.0..0.3f64), |(seed, crumple)| {
        let mut rng = Rng::new(seed, 0);
        let mut cloth = grid(6, 6, DVec2::new(0.6, 0.5), 1.0);
        cloth.positions.iter_mut().for_each(|p| *p += rng.vector() * crumple);
        let mut shuffled = cloth.clone();
        for k in (1..shuffled.faces.len()).rev() {
            shuffled.faces.swap(k, rng.next_u32() as usize % (k + 1));
        }
        prop_assert!(shuffled.faces != cloth.faces);
        let draw = |mesh: &Mesh| {
            let mut out = Rendering::new();
            let texture = Texture::uniform(2, 2, [0.5; 3]);
            Rasterizer::new(mesh).render(CAMERA, &mesh.positions, &texture, &mut out);
            out
        };
        let (a, b) = (draw(&cloth), draw(&shuffled));
        prop_assert!(a.inverse_depth.iter().any(|d| *d > 0.0));
        prop_assert_eq!(&a.inverse_depth, &b.inverse_depth);
        Ok(())
    });
}
