//! Metrics that are symmetric by definition give the same number both ways round, and zero for equals.

use glam::DVec3;
use proptest::prelude::*;
use tessuto::Image;
use tessuto::math::rng::Rng;
use tessuto::mesh::surface::{distances_squared, point_triangle_squared};
use tessuto::metrics::chamfer::nearest_squared;
use tessuto::metrics::{correlation, psnr, ssim};

use super::{holds, rigid_motion};

fn cloud(rng: &mut Rng, count: usize) -> Vec<DVec3> {
    (0..count).map(|_| rng.vector()).collect()
}

fn chamfer(a: &[DVec3], b: &[DVec3]) -> f64 {
    let mean = |values: Vec<f64>| values.iter().map(|d| d.sqrt()).sum::<f64>() / values.len() as f64;
    mean(nearest_squared(a, b)) + mean(nearest_squared(b, a))
}

#[test]
fn chamfer_distance_is_symmetric_and_rigid() {
    holds(60, (any::<u64>(), 1usize..60, 1usize..60, rigid_motion()), |(seed, m, n, (turn, shift))| {
        let mut rng = Rng::new(seed, 0);
        let (a, b) = (cloud(&mut rng, m), cloud(&mut rng, n));
        prop_assert!((chamfer(&a, &b) - chamfer(&b, &a)).abs() <= 1e-14);
        prop_assert_eq!(chamfer(&a, &a), 0.0);
        let moved = |points: &[DVec3]| points.iter().map(|p| turn * *p + shift).collect::<Vec<DVec3>>();
        let (there, here) = (chamfer(&moved(&a), &moved(&b)), chamfer(&a, &b));
        prop_assert!((there - here).abs() <= 1e-12, "{here} {there}");
        // The tree finds what trying all pairs finds.
        let plain = a.iter().map(|p| b.iter().map(|q| p.distance_squared(*q)).fold(f64::INFINITY, f64::min));
        prop_assert_eq!(nearest_squared(&a, &b), plain.collect::<Vec<f64>>());
        Ok(())
    });
}

#[test]
fn distance_to_a_triangle_ignores_the_order_of_its_corners() {
    holds(200, (any::<u64>(), 0.0..1.0f64), |(seed, flatness)| {
        let mut rng = Rng::new(seed, 0);
        let [p, a, b] = [rng.vector(), rng.vector(), rng.vector()];
        // Down to a triangle without area.
        let c = a.lerp(b, rng.uniform()) + rng.vector() * flatness;
        let orders = [[a, b, c], [b, c, a], [c, a, b], [a, c, b], [c, b, a], [b, a, c]];
        let found = orders.map(|t| point_triangle_squared(p, t));
        prop_assert!(found.iter().all(|d| (d - found[0]).abs() <= 1e-9), "{found:?}");
        // No corner is nearer, and the tree agrees.
        let nearest = [a, b, c].iter().map(|q| p.distance_squared(*q)).fold(f64::INFINITY, f64::min);
        prop_assert!(found[0] <= nearest * (1.0 + 1e-12));
        let [of_point, of_triangle] = distances_squared(&[p], &[a, b, c], &[[0, 1, 2]]);
        prop_assert_eq!([of_point[0], of_triangle[0]], [found[0]; 2]);
        Ok(())
    });
}

#[test]
fn likeness_of_pictures_is_symmetric() {
    holds(20, any::<u64>(), |seed| {
        let mut rng = Rng::new(seed, 0);
        let mut image = || {
            let data = (0..20 * 17 * 3).map(|_| rng.uniform() as f32).collect();
            Image { width: 20, height: 17, channels: 3, data }
        };
        let (a, b) = (image(), image());
        let covered = vec![true; 20 * 17];
        let (ab, ba) = (ssim(&a, &b, &covered).unwrap(), ssim(&b, &a, &covered).unwrap());
        prop_assert!((ab - ba).abs() < 1e-12 && ab < 0.9, "{ab} {ba}");
        prop_assert!((ssim(&a, &a, &covered).unwrap() - 1.0).abs() < 1e-12);
        prop_assert_eq!(psnr(&a.data, &b.data), psnr(&b.data, &a.data));
        let (ab, ba) = (correlation(&a.data, &b.data).unwrap(), correlation(&b.data, &a.data).unwrap());
        prop_assert!((ab - ba).abs() < 1e-12);
        Ok(())
    });
}
