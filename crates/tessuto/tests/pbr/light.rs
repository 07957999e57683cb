//! Direct light: draws against their densities, closed forms, the plain twin, derivatives, any number of threads.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};
use tessuto::math::gradient_check::check;
use tessuto::math::rng::Rng;
use tessuto::mesh::{Side, grid};
use tessuto::pbr::brdf::Brdf;
use tessuto::pbr::{
    EnvironmentMap, EnvironmentSampler, Geometry, Gradients, Material, RadianceEstimate, Shader,
    SurfacePoint, accumulate, radiance, radiance_by_diffuse, radiance_vjp, reference, visible_points,
};
use tessuto::raster::{Rasterizer, Rendering};
use tessuto::{Camera, Mesh};
use wide::{f32x8, u32x8};

const CAMERA: Camera = Camera { fx: 60.0, fy: 60.0, cx: 23.5, cy: 23.5, width: 48, height: 48 };

/// A cloth with deep folds, so that it shadows itself.
fn folded() -> Mesh {
    let mut mesh = grid(17, 17, DVec2::splat(0.6), 1.0);
    let mut rng = Rng::new(3, 0);
    for p in &mut mesh.positions {
        p.z += 0.08 * (22.0 * p.x + 5.0 * p.y).sin();
        *p += rng.vector() * 0.003;
    }
    mesh
}

fn points(mesh: &Mesh, geometry: &Geometry) -> Vec<SurfacePoint> {
    let rasterizer = Rasterizer::new(mesh);
    let seen =
        visible_points(&rasterizer, CAMERA, geometry, 0, &mesh.positions, &mut Rendering::new(), |_, _| true);
    seen.into_iter().map(|(_, point)| point).collect()
}

fn geometry(mesh: &Mesh) -> Geometry {
    Geometry::new(mesh, std::slice::from_ref(&mesh.positions))
}

fn random_environment(width: usize, seed: u64) -> EnvironmentMap {
    let mut rng = Rng::new(seed, 1);
    let mut environment = EnvironmentMap::uniform(width, width / 2, [0.0; 3]);
    environment.texels.iter_mut().for_each(|t| *t = [(); 3].map(|()| rng.uniform().powi(4) as f32 * 3.0));
    environment
}

fn random_material(size: usize, seed: u64) -> Material {
    let mut rng = Rng::new(seed, 2);
    let planes: Vec<f32> = (0..5 * size * size).map(|_| 0.25 + 0.6 * rng.uniform() as f32).collect();
    Material::from_planes(size, size, &planes)
}

fn uniforms(rng: &mut Rng) -> f32x8 {
    f32x8::from([(); 8].map(|()| ((rng.next_u32() >> 8) as f32) / (1 << 24) as f32))
}

/// A flat cloth and the point in its middle.
fn flat() -> (Geometry, SurfacePoint) {
    let mesh = grid(2, 2, DVec2::splat(0.5), 1.0);
    let geometry = geometry(&mesh);
    let all = points(&mesh, &geometry);
    let middle = all.iter().min_by(|a, b| {
        let key = |p: &SurfacePoint| p.position.truncate().length();
        key(a).total_cmp(&key(b))
    });
    (geometry, *middle.unwrap())
}

fn colour(
    geometry: &Geometry,
    point: &SurfacePoint,
    material: &Material,
    environment: &EnvironmentMap,
    samples: usize,
) -> [f32; 3] {
    let light = EnvironmentSampler::new(environment, 0.1);
    let shader = Shader { geometry, material, light: &light };
    let mut out = RadianceEstimate::default();
    shader.estimate(point, 11, samples, &mut out);
    out.colour
}

#[test]
fn a_diffuse_surface_under_a_uniform_sky_has_its_base_colour() {
    // Roughness 1, no metal: what the microfacets add is integrated numerically below.
    let (geometry, point) = flat();
    let environment = EnvironmentMap::uniform(64, 32, [2.0; 3]);
    let material = Material::uniform(1, 1, [0.8, 0.5, 0.0], 1.0, 0.0);
    let got = colour(&geometry, &point, &material, &environment, 32_000);
    let n = DVec3::NEG_Z;
    let o = -point.position.as_dvec3().normalize();
    let layer = integral(|i| reference::brdf([0.0, 0.0, 0.0, 1.0, 0.0], n, o, i).x * n.dot(i).max(0.0));
    for (c, base) in [0.8, 0.5, 0.0].into_iter().enumerate() {
        let expected = 2.0 * (base + layer);
        assert!((f64::from(got[c]) - expected).abs() < 3e-3, "channel {c}: {} for {expected}", got[c]);
    }
}

/// ∫ f over the sphere.
fn integral(f: impl Fn(DVec3) -> f64) -> f64 {
    let n = 1000;
    let mut sum = 0.0;
    for a in 0..n {
        let z = (a as f64 + 0.5) / n as f64 * 2.0 - 1.0;
        for b in 0..n {
            let (sin, cos) = ((b as f64 + 0.5) / n as f64 * TAU).sin_cos();
            let ring = (1.0 - z * z).sqrt();
            sum += f(DVec3::new(ring * cos, ring * sin, z));
        }
    }
    sum * 4.0 * PI / (n * n) as f64
}

#[test]
fn in_a_white_furnace_mirrors_keep_energy_and_lose_little() {
    for roughness in [0.2, 0.4, 0.7, 1.0] {
        let (geometry, point) = flat();
        let material = Material::uniform(1, 1, [1.0; 3], roughness, 1.0);
        let environment = EnvironmentMap::uniform(64, 32, [1.0; 3]);
        let got = colour(&geometry, &point, &material, &environment, 16_000)[0];
        // A single bounce off a rough layer loses what would bounce twice.
        let (n, o) = (DVec3::NEG_Z, -point.position.as_dvec3().normalize());
        let texel = [1.0, 1.0, 1.0, f64::from(roughness), 1.0];
        let expected = integral(|i| reference::brdf(texel, n, o, i).x * n.dot(i).max(0.0));
        eprintln!("roughness {roughness}: {got:.4}, integral {expected:.4}");
        assert!(got < 1.003 && got > 0.25, "roughness {roughness}: {got}");
        // The narrowest lobe slips through the integral's grid.
        let tolerance = if roughness < 0.3 { 0.1 } else { 0.01 };
        assert!((f64::from(got) - expected).abs() < tolerance, "{got} {expected}");
    }
}

#[test]
fn one_texel_of_light_gives_its_cosine_and_both_sides_are_alike() {
    let (geometry, point) = flat();
    let material = Material::uniform(1, 1, [0.6; 3], 1.0, 0.0);
    let n = DVec3::NEG_Z;
    let o = -point.position.as_dvec3().normalize();
    for (column, row, lit) in [(3, 20, true), (60, 12, true), (32, 16, false)] {
        let mut environment = EnvironmentMap::uniform(64, 32, [0.0; 3]);
        environment.texels[row * 64 + column] = [50.0; 3];
        let i = environment.direction(column, row);
        let f = reference::brdf([0.6, 0.6, 0.6, 1.0, 0.0], n, o, i).x;
        let expected = f * n.dot(i).max(0.0) * environment.solid_angle(row) * 50.0;
        let got = f64::from(colour(&geometry, &point, &material, &environment, 4000)[0]);
        assert_eq!(lit, expected > 0.0);
        assert!(
            (got - expected).abs() < 0.01 * expected + 1e-6,
            "texel {column} {row}: {got} for {expected}"
        );
    }
    // The same triangles, wound the other way.
    let mut mesh = grid(2, 2, DVec2::splat(0.5), 1.0);
    mesh.faces[0].vertices.reverse();
    mesh.faces[0].uvs.reverse();
    let turned = super::light::geometry(&mesh);
    let environment = random_environment(64, 8);
    let same = points(&mesh, &turned).into_iter().find(|p| p.position == point.position).unwrap();
    let (a, b) = (
        colour(&geometry, &point, &material, &environment, 16_000),
        colour(&turned, &same, &material, &environment, 16_000),
    );
    assert!((a[0] - b[0]).abs() < 0.01 * a[0], "{a:?} {b:?}");
}

#[test]
fn the_brdf_is_reciprocal_and_its_fast_form_agrees_with_the_plain_one() {
    let mut rng = Rng::new(5, 0);
    let mut worst: f64 = 0.0;
    for _ in 0..200 {
        let mut direction = || {
            let d = DVec3::new(rng.signed(), rng.signed(), 0.05 + rng.uniform());
            d.normalize()
        };
        let (o, i) = (direction(), direction());
        let texel = [0.7, 0.2, 0.4, 0.2 + 0.8 * rng.uniform(), rng.uniform()];
        let f = reference::brdf(texel, DVec3::Z, o, i);
        assert!((f - reference::brdf(texel, DVec3::Z, i, o)).length() < 1e-12 * f.length());
        let mut lanes = [0.0f32; 8];
        (0..5).for_each(|c| lanes[c] = texel[c] as f32);
        let brdf = Brdf::new(&lanes, o.as_vec3().to_array());
        let e = brdf.eval(&i.as_vec3().to_array().map(f32x8::splat));
        let (dg, s) = (f64::from(e.dg.to_array()[0]), f64::from(e.schlick.to_array()[0]));
        let fast = f64::from(brdf.diffuse[0]) / PI + dg * (f64::from(brdf.f0[0]) * (1.0 - s) + s);
        worst = worst.max((fast - f.x).abs() / f.x);
    }
    eprintln!("worst relative difference {worst:.1e}");
    assert!(worst < 2e-4);
}

/// χ² of `counts` with `expected`, as a number of standard deviations.
fn chi_square(counts: &[f64], expected: &[f64]) -> f64 {
    let (mut sum, mut cells, mut rest) = (0.0, 0, [0.0; 2]);
    for (count, expected) in counts.iter().zip(expected) {
        if *expected < 10.0 {
            rest[0] += count;
            rest[1] += expected;
        } else {
            sum += (count - expected).powi(2) / expected;
            cells += 1;
        }
    }
    if rest[1] > 10.0 {
        sum += (rest[0] - rest[1]).powi(2) / rest[1];
    }
    (sum - f64::from(cells)) / f64::from(2 * cells).sqrt()
}

#[test]
fn directions_from_the_light_follow_their_density() {
    let environment = random_environment(32, 6);
    let light = EnvironmentSampler::new(&environment, 0.1);
    let mut rng = Rng::new(9, 0);
    let draws = 400_000;
    let mut counts = vec![0.0; 32 * 16];
    for _ in 0..draws / 8 {
        let pick = u32x8::from([(); 8].map(|()| rng.next_u32()));
        let (texels, directions) = light.sample(pick, uniforms(&mut rng), uniforms(&mut rng));
        let again = light.texels_of(&directions);
        let directions = directions.map(f32x8::to_array);
        for k in 0..8 {
            let [x, y, z] = [0, 1, 2].map(|axis| f64::from(directions[axis][k]));
            let d = DVec3::new(x, y, z);
            assert!((d.length() - 1.0).abs() < 1e-5);
            counts[environment.texel_of(d.normalize())] += 1.0;
            // Only on the very border of a texel may rounding tell them apart.
            if texels[k] != again[k] {
                counts[texels[k] as usize] += 0.0;
            }
        }
    }
    let all: Vec<u32> = (0..512).collect();
    let expected: Vec<f64> = all
        .chunks(8)
        .flat_map(|t| light.lookup(t.try_into().unwrap())[3].to_array())
        .enumerate()
        .map(|(i, pdf)| f64::from(pdf) * environment.solid_angle(i / 32) * f64::from(draws))
        .collect();
    assert!((expected.iter().sum::<f64>() / f64::from(draws) - 1.0).abs() < 1e-5);
    let deviations = chi_square(&counts, &expected);
    eprintln!("χ² is {deviations:.1} standard deviations off");
    assert!(deviations.abs() < 4.0);
}

#[test]
fn directions_from_the_brdf_follow_their_density() {
    for (roughness, metallic, tilt) in [(0.3, 0.8, 0.5), (0.6, 0.1, 1.2), (1.0, 0.5, 0.1)] {
        let wo = [f64::sin(tilt) as f32, 0.0, f64::cos(tilt) as f32];
        let brdf = Brdf::new(&[0.6, 0.5, 0.4, roughness, metallic, 0.0, 0.0, 0.0], wo);
        let (rows, columns, fine) = (24, 24, 24);
        let cell = |z: f64, azimuth: f64| {
            let row = (z * f64::from(rows)) as i32;
            row.clamp(0, rows - 1) * columns
                + ((azimuth / TAU * f64::from(columns)) as i32).clamp(0, columns - 1)
        };
        let draws = 400_000;
        let mut expected = vec![0.0; (rows * columns) as usize];
        let steps = rows * fine;
        for a in 0..steps {
            for b in 0..steps {
                let z = (f64::from(a) + 0.5) / f64::from(steps);
                let azimuth = (f64::from(b) + 0.5) / f64::from(steps) * TAU;
                let ring = (1.0 - z * z).sqrt();
                let d = [ring * azimuth.cos(), ring * azimuth.sin(), z].map(|v| f32x8::splat(v as f32));
                let share = f64::from(brdf.eval(&d).pdf.to_array()[0]) * TAU / f64::from(steps * steps);
                expected[cell(z, azimuth) as usize] += share * f64::from(draws);
            }
        }
        let mut rng = Rng::new(12, 0);
        let mut counts = vec![0.0; (rows * columns) as usize];
        let mut above = 0.0;
        for _ in 0..draws / 8 {
            let d =
                brdf.sample(uniforms(&mut rng), uniforms(&mut rng), uniforms(&mut rng)).map(f32x8::to_array);
            for k in 0..8 {
                if d[2][k] > 0.0 {
                    above += 1.0;
                    let azimuth = f64::from(d[1][k]).atan2(f64::from(d[0][k])).rem_euclid(TAU);
                    counts[cell(f64::from(d[2][k]), azimuth) as usize] += 1.0;
                }
            }
        }
        let total: f64 = expected.iter().sum();
        assert!((above / total - 1.0).abs() < 0.01, "{above} of {total}");
        let deviations = chi_square(&counts, &expected);
        eprintln!("roughness {roughness}: χ² is {deviations:.1} standard deviations off");
        assert!(deviations.abs() < 5.0);
    }
}

#[test]
fn horizons_change_no_bit() {
    let mesh = folded();
    let geometry = geometry(&mesh);
    let traced = geometry.clone().without_horizons();
    let (environment, material) = (random_environment(64, 4), random_material(8, 4));
    let light = EnvironmentSampler::new(&environment, 0.1);
    let mut shadowed = 0;
    for (k, point) in points(&mesh, &geometry).iter().enumerate() {
        let colour_with = |geometry: &Geometry| {
            let shader = Shader { geometry, material: &material, light: &light };
            let mut out = RadianceEstimate::default();
            shader.estimate(point, k as u32, 32, &mut out);
            out.colour
        };
        let (fast, slow) = (colour_with(&geometry), colour_with(&traced));
        assert_eq!(fast, slow, "point {k}");
        let blocked = |d: DVec3| {
            let triangles = mesh.triangles();
            let own = point.patch as usize;
            reference::blocked(&triangles, &mesh.positions, own, point.position.as_dvec3(), d.normalize())
        };
        shadowed += usize::from(blocked(DVec3::new(1.0, 0.1, -0.15)));
    }
    assert!(shadowed > 50, "only {shadowed} points lie in a shadow: the scene proves nothing");
}

#[test]
fn fast_and_plain_agree() {
    let mesh = folded();
    let geometry = geometry(&mesh);
    let (environment, material) = (random_environment(16, 4), random_material(8, 4));
    let light = EnvironmentSampler::new(&environment, 0.1);
    let shader = Shader { geometry: &geometry, material: &material, light: &light };
    let mut rng = Rng::new(21, 0);
    let triangles = mesh.triangles();
    let (mut worst, mut squares, mut count) = (0.0f64, 0.0, 0);
    for (k, point) in points(&mesh, &geometry).iter().enumerate().filter(|(k, _)| k % 37 == 0) {
        // Where the normal leans away from the viewer, the fast one turns it back.
        if point.normal.dot(-point.position.normalize()) < 0.02 {
            continue;
        }
        let own = (point, point.patch as usize);
        let [mean, variance] =
            reference::colour(&triangles, &mesh.positions, &material, &environment, own, 4000, &mut rng);
        // Independent estimates, whose spread tells their error.
        let runs: Vec<f64> = (0..16)
            .map(|run| {
                let mut out = RadianceEstimate::default();
                shader.estimate(point, (k * 16 + run) as u32, 128, &mut out);
                f64::from(out.colour[1])
            })
            .collect();
        let fast = runs.iter().sum::<f64>() / 16.0;
        let spread = runs.iter().map(|r| (r - fast).powi(2)).sum::<f64>() / (15.0 * 16.0);
        let z = (fast - mean.y) / (variance.y + spread).sqrt();
        worst = worst.max(z.abs());
        squares += z * z;
        count += 1;
    }
    let mean_square = squares / f64::from(count);
    eprintln!("{count} points: worst z {worst:.1}, mean of z² {mean_square:.2}");
    assert!(count > 20 && worst < 5.0 && (0.4..1.8).contains(&mean_square));
}

#[test]
fn the_other_side_has_its_own_colour_and_no_part_in_the_maps() {
    let mesh = folded();
    let geometry = geometry(&mesh);
    let front = Side::front(&mesh, &CAMERA.into());
    let seen_as = |front: Side, turned: bool| -> Vec<SurfacePoint> {
        let (rasterizer, x) = (Rasterizer::new(&mesh).two_sided(front, [0.0; 3]), &mesh.positions);
        let seen = visible_points(&rasterizer, CAMERA, &geometry, 0, x, &mut Rendering::new(), |_, _| true);
        seen.into_iter().map(|(_, point)| point).filter(|point| point.turned == turned).collect()
    };
    let (environment, maps) = (random_environment(16, 4), random_material(8, 4));
    let light = EnvironmentSampler::new(&environment, 0.1);
    let lined = Material { back: Some([0.3, 0.5, 0.1]), ..maps.clone() };
    // Of one texel, so that nothing is interpolated.
    let plain = Material::uniform(1, 1, [0.3, 0.5, 0.1], 1.0, 0.0);
    let shader = |material| Shader { geometry: &geometry, material, light: &light };
    let (seen, turned) = (seen_as(front, false), seen_as(front.other(), true));
    assert!(seen.len() > 500 && seen.len() == turned.len());
    assert_eq!(radiance(&shader(&lined), &seen, 3, 8), radiance(&shader(&maps), &seen, 3, 8));
    assert_eq!(radiance(&shader(&lined), &turned, 3, 8), radiance(&shader(&plain), &turned, 3, 8));
    assert_eq!(radiance(&shader(&maps), &turned, 3, 8), radiance(&shader(&maps), &seen, 3, 8));
    let ones = vec![[1.0; 3]; turned.len()];
    let [of_lined, of_plain] =
        [&lined, &plain].map(|material| radiance_vjp(&shader(material), &turned, 3, 8, &ones));
    assert!(of_lined.material.iter().all(|g| *g == 0.0) && of_plain.material.iter().any(|g| *g > 0.0));
    assert!(of_lined.light == of_plain.light && of_lined.light.iter().flatten().any(|g| *g > 0.0));
    let triangles = mesh.triangles();
    let twin = |material| {
        let own = (&turned[100], turned[100].patch as usize);
        reference::colour(&triangles, &mesh.positions, material, &environment, own, 100, &mut Rng::new(5, 0))
    };
    assert_eq!(twin(&lined), twin(&plain));
}

#[test]
fn gradients_match_central_differences() {
    let mesh = folded();
    let geometry = geometry(&mesh);
    let points = points(&mesh, &geometry);
    let (environment, material) = (random_environment(16, 4), random_material(8, 4));
    // The densities are constants to the derivative, so they stay those of the unchanged light.
    let light = EnvironmentSampler::new(&environment, 0.1);
    let mut rng = Rng::new(31, 0);
    let adjoints: Vec<[[f32; 3]; 2]> =
        points.iter().map(|_| [(); 2].map(|()| [(); 3].map(|()| rng.signed() as f32))).collect();
    let run = |material: &Material, light: &EnvironmentSampler| {
        let shader = Shader { geometry: &geometry, material, light };
        let mut gradients = Gradients::default();
        let loss = |i: usize, c: &[[f32; 3]; 2]| {
            let value: f32 = (0..6).map(|k| c[k / 3][k % 3] * adjoints[i][k / 3][k % 3]).sum();
            (value, adjoints[i])
        };
        accumulate(&shader, &points, 3, 8, loss, &mut gradients);
        gradients
    };
    let gradients = run(&material, &light);
    let wide = |v: &[f32]| v.iter().copied().map(f64::from).collect::<Vec<f64>>();
    let narrow = |v: &[f64]| v.iter().map(|v| *v as f32).collect::<Vec<f32>>();

    // The light enters linearly.
    let texels = wide(&environment.texels.concat());
    let by_light = check(&texels, &wide(&gradients.light.concat()), 0.3, 8, 1, |x| {
        let mut moved = environment.clone();
        moved.texels.iter_mut().zip(narrow(x).chunks_exact(3)).for_each(|(t, v)| t.copy_from_slice(v));
        let mut light = light.clone();
        light.set_radiance(&moved);
        run(&material, &light).loss
    });
    eprintln!("light: worst relative error {:.1e}", by_light.relative_error);
    assert!(by_light.relative_error < 2e-3);

    // Directions depend on the material, but the derivative takes them as drawn: those of the light alone do not.
    // So the derivative is that of the mean, which many points and the light's directions estimate.
    let planes = material.to_planes();
    let mut worst = 0.0f64;
    for channel in 0..5 {
        // All but roughness enter linearly; a long step drowns the noise of directions drawn anew.
        let step = if channel == 3 { 0.01 } else { 0.1 };
        let moved = |s: f32| {
            let mut planes = planes.clone();
            planes[channel * 64..(channel + 1) * 64].iter_mut().for_each(|v| *v += s * step);
            let material = Material::from_planes(8, 8, &planes);
            let shader = Shader { geometry: &geometry, material: &material, light: &light };
            let mut gradients = Gradients::default();
            let loss = |_: usize, c: &[[f32; 3]; 2]| (c[0][0] + c[0][1] + c[0][2], [[1.0; 3], [0.0; 3]]);
            accumulate(&shader, &points, 3, 512, loss, &mut gradients);
            gradients
        };
        let numeric = (moved(1.0).loss - moved(-1.0).loss) / (2.0 * f64::from(step));
        let analytic: f64 =
            moved(0.0).material[channel * 64..(channel + 1) * 64].iter().copied().map(f64::from).sum();
        assert!(analytic != 0.0);
        let error = (numeric - analytic).abs() / numeric.abs();
        eprintln!("channel {channel}: {analytic:.4e} and {numeric:.4e}, relative error {error:.1e}");
        worst = worst.max(error);
    }
    assert!(worst < 2e-2, "{worst}");
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let mesh = folded();
    let geometry = geometry(&mesh);
    let points = points(&mesh, &geometry);
    let light = EnvironmentSampler::new(&random_environment(32, 4), 0.1);
    let material = random_material(16, 4);
    let shader = Shader { geometry: &geometry, material: &material, light: &light };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut gradients = Gradients::default();
        let loss = |i: usize, c: &[[f32; 3]; 2]| (c[0][0] * i as f32, [c[1], c[0]]);
        pool.install(|| accumulate(&shader, &points, 5, 16, loss, &mut gradients));
        (gradients.loss, gradients.material, gradients.light)
    };
    assert!(run(1) == run(2));
}

#[test]
fn colours_alone_and_their_adjoint_are_those_of_the_first_estimate() {
    let mesh = folded();
    let geometry = geometry(&mesh);
    let points = points(&mesh, &geometry);
    let (environment, material) = (random_environment(16, 6), random_material(8, 6));
    let light = EnvironmentSampler::new(&environment, 0.1);
    let shader = Shader { geometry: &geometry, material: &material, light: &light };
    let mut rng = Rng::new(8, 0);
    let grad: Vec<[f32; 3]> = points.iter().map(|_| [(); 3].map(|()| rng.signed() as f32)).collect();
    let colours = radiance(&shader, &points, 5, 16);
    let mut both = Gradients::default();
    let loss = |i: usize, c: &[[f32; 3]; 2]| {
        assert_eq!(c[0], colours[i]);
        (0.0, [grad[i], [0.0; 3]])
    };
    accumulate(&shader, &points, 5, 16, loss, &mut both);
    let alone = radiance_vjp(&shader, &points, 5, 16, &grad);
    assert_eq!((&alone.material, &alone.light), (&both.material, &both.light));

    // It is linear in the light: Σ L ∂loss/∂L = loss.
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
    let value = dot(&colours.concat(), &grad.concat());
    let along = dot(&environment.texels.concat(), &alone.light.concat());
    assert!(
        (along - value).abs() < 1e-3 * dot(&colours.concat(), &vec![1.0; 3 * colours.len()]),
        "{along} {value}"
    );

    // The shares of a point's texels sum up to 1, so its derivative by the map there is the sum of theirs.
    let by_diffuse = radiance_by_diffuse(&shader, &points, 5, 16);
    assert!(by_diffuse.iter().zip(&colours).all(|([colour, _], alone)| colour == alone));
    let slopes: Vec<[f32; 3]> = by_diffuse.iter().map(|[_, slope]| *slope).collect();
    let by_point = dot(&slopes.concat(), &grad.concat());
    let by_texel = alone.material[..3 * 64].iter().copied().map(f64::from).sum::<f64>();
    eprintln!("by the diffuse map {by_point:.5e} and {by_texel:.5e}");
    assert!((by_point - by_texel).abs() < 1e-4 * dot(&slopes.concat(), &vec![1.0; 3 * slopes.len()]));
    assert!(by_texel != 0.0);
}
