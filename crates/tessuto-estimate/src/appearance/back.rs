//! Albedo of the fabric's other side, where that has one colour.
//!
//! Under the light that was found, the linear colour of a point there is b + a x in the albedo x. Least absolute
//! differences, min Σ w |c − b − a x| for the video's colours c, are not led astray by pixels that show something else:
//! x is the median of the (c − b)/a with weights w a. Points count by the squared cosine at which they are seen.

use super::observations::Observations;
use tessuto_core::image::srgb;
use tessuto_core::scene::Back;
use tessuto_render::pbr::{EnvironmentSampler, Geometry, Material, Shader, radiance_by_diffuse};

/// Most pixels that are looked at.
pub(super) const MOST_PIXELS: usize = 20_000;
/// Fewest pixels that tell the albedo.
const LEAST_PIXELS: usize = 30;
/// Albedo that the slope is taken at; the colour is linear in it.
const START: f32 = 0.5;
/// Limits of an albedo.
const LIMITS: [f32; 2] = [0.01, 0.95];

/// From the pixels `seen` that show the other side, under the light on the `geometry` of `material`; `None` where there
/// are too few.
pub(super) fn albedo(
    (geometry, material, light): (&Geometry, &Material, &EnvironmentSampler),
    seen: &Observations,
    (samples_per_pixel, seed): (usize, u32),
) -> Option<[f32; 3]> {
    if seen.points.len() < LEAST_PIXELS {
        return None;
    }
    let material = &Material { back: Some([START; 3]), ..material.clone() };
    let shader = Shader { geometry, material, light };
    let lit = radiance_by_diffuse(&shader, &seen.points, seed, samples_per_pixel);
    let of_channel = |c: usize| {
        let equations = lit.iter().zip(&seen.points).zip(&seen.colours);
        let ratios = equations.filter_map(|(([colour, slope], point), observed)| {
            let (a, b) = (slope[c], colour[c] - START * slope[c]);
            let cosine = point.normal.dot(geometry.to_viewer(point));
            let x = (srgb::decode(observed[c]) - b) / a;
            (a > 0.0 && x.is_finite()).then_some((x, cosine * cosine * a))
        });
        weighted_median(ratios.collect()).map(|x| x.clamp(LIMITS[0], LIMITS[1]))
    };
    Some([of_channel(0)?, of_channel(1)?, of_channel(2)?])
}

/// That of a side that was not seen, from its known linear colour c: c Σ x / Σ c′ over the front's albedos x and linear
/// colours c′ at the points `seen` in the first frame.
pub(super) fn of_front(
    back: Back,
    material: &Material,
    seen: &Observations,
    triangle_count: usize,
) -> Option<[f32; 3]> {
    let Back::Plain(Some(colour)) = back else { return None };
    let mut sums = [[0.0f32; 2]; 3];
    for (point, observed) in seen.points.iter().zip(&seen.colours) {
        if (point.patch as usize) < triangle_count {
            let texel = material.sample(point.uv);
            for (c, [albedo, linear]) in sums.iter_mut().enumerate() {
                *albedo += texel[c];
                *linear += srgb::decode(observed[c]);
            }
        }
    }
    let of_channel = |c: usize| {
        let [albedo, linear] = sums[c];
        (linear > 0.0).then(|| (srgb::decode(colour[c]) * albedo / linear).clamp(LIMITS[0], LIMITS[1]))
    };
    Some([of_channel(0)?, of_channel(1)?, of_channel(2)?])
}

/// The least value below which, with itself, lies at least half of the weight.
fn weighted_median(mut values: Vec<(f32, f32)>) -> Option<f32> {
    values.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|(_, weight)| f64::from(*weight)).sum::<f64>();
    let mut below = 0.0;
    values.into_iter().find_map(|(value, weight)| {
        below += f64::from(weight);
        (below >= half && half > 0.0).then_some(value)
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use tessuto_core::camera::Camera;
    use tessuto_core::mesh::{Mesh, Side, grid};
    use tessuto_render::pbr::{EnvironmentMap, SurfacePoint, radiance, visible_points};
    use tessuto_render::raster::{Rasterizer, Rendering};

    #[test]
    fn half_of_the_weight_lies_below_the_median() {
        assert_eq!(weighted_median(vec![(3.0, 1.0), (1.0, 1.0), (2.0, 1.0)]), Some(2.0));
        assert_eq!(weighted_median(vec![(3.0, 5.0), (1.0, 1.0), (2.0, 1.0)]), Some(3.0));
        assert_eq!(weighted_median(Vec::new()), None);
    }

    #[test]
    fn the_albedo_of_the_other_side_is_found_among_pixels_of_the_print() {
        let mut mesh: Mesh = grid(7, 7, DVec2::splat(0.4), 0.6);
        let camera = Camera { fx: 60.0, fy: 60.0, cx: 31.5, cy: 31.5, width: 64, height: 64 };
        let front = Side::front(&mesh, &camera.into());
        mesh.positions.iter_mut().for_each(|p| (p.x, p.z) = (-p.x, p.z + 0.05 * (9.0 * p.x).sin()));
        let motion = [mesh.positions.clone()];
        let geometry = Geometry::new(&mesh, &motion);
        let mut environment = EnvironmentMap::uniform(32, 16, [0.5; 3]);
        environment.texels.iter_mut().step_by(3).for_each(|t| *t = [2.0, 1.8, 1.5]);
        let light = &EnvironmentSampler::new(&environment, 0.25);
        let albedo_of_back = [0.6, 0.2, 0.05];
        let truth =
            Material { back: Some(albedo_of_back), ..Material::uniform(4, 4, [0.1, 0.6, 0.7], 0.5, 0.0) };
        let rasterizer = Rasterizer::new(&mesh).two_sided(front, [0.0; 3]);
        let rendering = &mut Rendering::new();
        let points = visible_points(&rasterizer, camera, &geometry, 0, &motion[0], rendering, |_, _| true);
        let points: Vec<SurfacePoint> = points.into_iter().map(|(_, point)| point).collect();
        assert!(points.len() > 1000 && points.iter().all(|p| p.turned));
        // One in five shows the front in truth.
        let shown: Vec<SurfacePoint> =
            points.iter().enumerate().map(|(i, p)| SurfacePoint { turned: i % 5 > 0, ..*p }).collect();
        let shader = Shader { geometry: &geometry, material: &truth, light };
        let colours = radiance(&shader, &shown, 77, 512).into_iter().map(|c| c.map(srgb::encode)).collect();
        let mut seen = Observations { points, colours };
        let maps = Material { back: None, ..truth.clone() };
        let found = albedo((&geometry, &maps, light), &seen, (64, 3)).unwrap();
        println!("{found:?}");
        assert!(found.iter().zip(albedo_of_back).all(|(a, b)| (a - b).abs() < 0.03), "{found:?}");
        // One that was not seen has the ratio of the front.
        let known = Back::Plain(Some([0.5, 0.25, 1.0]));
        seen.colours.fill([0.5; 3]);
        let guessed = of_front(known, &maps, &seen, mesh.triangles().len()).unwrap();
        let ratio = |c: f32, x: f32| (srgb::decode(c) * x / srgb::decode(0.5)).min(0.95);
        let expected = [ratio(0.5, 0.1), ratio(0.25, 0.6), ratio(1.0, 0.7)];
        assert!(guessed.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3), "{guessed:?}");
        assert_eq!(of_front(Back::Plain(None), &maps, &seen, mesh.triangles().len()), None);
        seen.points.truncate(5);
        assert_eq!(albedo((&geometry, &maps, light), &seen, (64, 3)), None);
    }
}
