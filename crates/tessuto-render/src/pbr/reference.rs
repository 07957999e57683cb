//! Outgoing radiance of a point, written plainly: directions spread evenly over the hemisphere, every triangle
//! tested, formulas in f64.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::{EnvironmentMap, Material, SurfacePoint};
use tessuto_core::math::rng::Rng;

/// BRDF f(o, i) [1/sr] of `texel` = (diffuse `[3]`, roughness, metallic) for unit vectors to viewer and light and the
/// unit normal. Formulas: [`super::brdf`].
pub fn brdf(texel: [f64; 5], n: DVec3, o: DVec3, i: DVec3) -> DVec3 {
    let [r, g, b, roughness, metallic] = texel;
    let base = DVec3::new(r, g, b);
    let (no, ni) = (n.dot(o), n.dot(i));
    if no <= 0.0 || ni <= 0.0 {
        return DVec3::ZERO;
    }
    let h = (o + i).normalize();
    let alpha2 = roughness.powi(4);
    let d = alpha2 / (PI * (n.dot(h).powi(2) * (alpha2 - 1.0) + 1.0).powi(2));
    let lambda = |c: f64| ((1.0 + alpha2 * (1.0 / (c * c) - 1.0)).sqrt() - 1.0) / 2.0;
    let g = 1.0 / (1.0 + lambda(no) + lambda(ni));
    let f0 = base * metallic + DVec3::splat(0.04 * (1.0 - metallic));
    let f = f0 + (DVec3::ONE - f0) * (1.0 - o.dot(h)).powi(5);
    base * (1.0 - metallic) / PI + f * (d * g / (4.0 * no * ni))
}

/// Mean and variance of the mean of `count` directions' contributions to the linear colour of `point`, on the cloth
/// `triangles` with vertices at `positions`, seen from the origin; `own` is the triangle that the point lies on.
pub fn colour(
    triangles: &[[u32; 3]],
    positions: &[DVec3],
    material: &Material,
    environment: &EnvironmentMap,
    (point, own): (&SurfacePoint, usize),
    count: usize,
    rng: &mut Rng,
) -> [DVec3; 2] {
    let position = point.position.as_dvec3();
    let o = -position.normalize();
    let n = point.normal.as_dvec3().normalize();
    let [a, b, c] = triangles[own].map(|v| positions[v as usize]);
    let facing = (b - a).cross(c - a);
    let facing = if facing.dot(o) < 0.0 { -facing } else { facing };
    let texel = match material.of_back(point.turned) {
        Some([r, g, b, roughness, metallic, ..]) => [r, g, b, roughness, metallic],
        None => material.sample(point.uv),
    };
    let texel = texel.map(f64::from);
    let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
    for _ in 0..count {
        let z = 1.0 - 2.0 * rng.uniform();
        let ring = (1.0 - z * z).sqrt();
        let (sin, cos) = (TAU * rng.uniform()).sin_cos();
        let i = DVec3::new(ring * cos, ring * sin, z);
        let i = if i.dot(n) < 0.0 { -i } else { i };
        if i.dot(facing) <= 0.0 || blocked(triangles, positions, own, position, i) {
            continue;
        }
        let radiance = DVec3::from_array(environment.texels[environment.texel_of(i)].map(f64::from));
        let value = brdf(texel, n, o, i) * radiance * i.dot(n) * TAU;
        sum += value;
        squares += value * value;
    }
    let mean = sum / count as f64;
    [mean, (squares / count as f64 - mean * mean) / count as f64]
}

/// Whether a ray from `origin` meets a triangle other than `own`.
pub fn blocked(
    triangles: &[[u32; 3]],
    positions: &[DVec3],
    own: usize,
    origin: DVec3,
    direction: DVec3,
) -> bool {
    triangles.iter().enumerate().any(|(t, corners)| {
        let [a, b, c] = corners.map(|v| positions[v as usize] - origin);
        let sides = [b.cross(c), c.cross(a), a.cross(b)].map(|m| m.dot(direction));
        let inside = sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0);
        let normal = (b - a).cross(c - a);
        t != own && inside && a.dot(normal) / direction.dot(normal) > f64::from(super::bvh::NEAREST)
    })
}
