//! The light of the scene, from how bright the sheet is where it has turned.
//!
//! Brightness and light follow from the positions, like the gains, and are held fixed while a step is taken. The
//! light c has the least
//!
//!   Σ_nv w_nv ρ((c·(Y(n_nv) − Y(n_0v)) + o_n − h_nv)/σ_nv; τ) + ½ Σ_n o_n²/σ_o² + ½ Σ_k p_k c_k²
//!
//! over all frames n and vertices v, with Cauchy's ρ and the harmonics Y of
//! [`shading`](crate::motion::terms::shading); h_nv is the logarithm of what the points around a vertex show,
//! relative to the first frame, p_k the mean square of Y_k over the sphere by that of the first of its order, so that
//! no direction of the light is favoured, and o_n what the whole frame is brighter by for other causes: light that the
//! sheet takes from itself, clouds, a camera that adapts. What else the light does not explain, shadows above all,
//! grows with h: σ_nv² = σ² + (s h_nv)².

use glam::DVec3;
use tessuto_core::parallel;

use super::gain::{Around, GAIN_FITS};
use super::{LevelSearch, Positions, Problem};
use crate::motion::terms::Term;
use crate::motion::terms::robust::Noise;
use crate::motion::terms::shading::{HARMONICS, Light, Seen, harmonics};
use tessuto_core::math::root::Root;
use tessuto_core::mesh::vertex_normals;

/// Reweighted least squares, for the light and for what whole frames are brighter by.
const FITS: usize = 8;
/// Rounds of both, after a light without the latter.
const ROUNDS: usize = 3;
/// p, see the module.
const HELD: Light = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 4.0, 12.0];
/// Where nothing is known of the light, tails are longer by this factor at first.
const START_TAIL: f64 = 100.0;

/// A vertex that is seen in some frame.
struct Turned {
    vertex: usize,
    /// Change of the harmonics since the first frame.
    change: Light,
    /// h.
    brighter: f64,
    /// w.
    weight: f64,
    /// σ and τ.
    noise: Noise,
}

impl Turned {
    /// What `light` leaves of the brightness.
    fn rest(&self, light: &Light) -> f64 {
        self.brighter - self.change.iter().zip(light).map(|(y, c)| y * c).sum::<f64>()
    }

    /// Weight of the squared `residual`, with a tail that is longer by `start`.
    fn weight(&self, residual: f64, start: f64) -> f64 {
        self.weight * Noise { tail: start * self.noise.tail, ..self.noise }.cauchy(residual).1
    }
}

impl LevelSearch<'_, '_> {
    /// Fits the light to the sheet at `frames`, which show `around` their vertices, from the second on, of every
    /// camera; from now on every vertex's brightness is compared with it.
    pub(super) fn update_light(&mut self, frames: &[Positions], around: &[Vec<Vec<Around>>]) {
        let first = self.harmonics_of_first();
        let later = frames.len() - 1;
        // Image by image, camera after camera.
        let of_image = |k: usize| {
            let (v, n) = (k / later, k % later + 1);
            self.turned(v, (n, &frames[n]), &around[v][n - 1], &first)
        };
        let turned: Vec<Vec<Turned>> = parallel::map(later * self.looks.len(), of_image);
        let mut offsets = vec![0.0; turned.len()];
        // Not from the last light: the same positions have the same one, whatever came before.
        self.light = self.fit_light([0.0; HARMONICS], &turned, &offsets, START_TAIL);
        for _ in 0..ROUNDS {
            offsets = parallel::over(&turned, |turned| self.offset(turned));
            self.light = self.fit_light(self.light, &turned, &offsets, 1.0);
        }
        for v in 0..self.looks.len() {
            let of_image = |turned: &Vec<Turned>| self.targets(turned, self.offset(turned), &first);
            let of_images = turned[v * later..(v + 1) * later].iter().map(of_image);
            self.looks[v].brightness = std::iter::once(Vec::new()).chain(of_images).collect();
        }
    }

    /// Compares the brightness in camera `v` of `frame`, found at `x`, which shows `around` its vertices, with the
    /// light as it is.
    pub(super) fn update_brightness(&mut self, v: usize, (frame, x): (usize, &Positions), around: &[Around]) {
        let first = self.harmonics_of_first();
        let turned = self.turned(v, (frame, x), around, &first);
        self.looks[v].brightness[frame] = self.targets(&turned, self.offset(&turned), &first);
    }

    /// Harmonics of every vertex's normal in the template.
    fn harmonics_of_first(&self) -> Vec<Light> {
        self.normals(&self.problem.scene.template.positions).into_iter().map(harmonics).collect()
    }

    /// Normal of every vertex, of length 1.
    fn normals(&self, x: &Positions) -> Vec<DVec3> {
        vertex_normals(self.problem.rasterizer.triangles(), x)
    }

    /// The vertices that camera `v` sees in a `frame` with the sheet at `x`, from the same side as in the first.
    fn turned(
        &self,
        v: usize,
        (frame, x): (usize, &Positions),
        around: &[Around],
        first: &[Light],
    ) -> Vec<Turned> {
        let (look, s) = (&self.looks[v], &self.problem.settings);
        let template = &self.problem.scene.template.positions;
        let pixel = look.pixel_area() * look.eye.independent;
        let (before, now) = (self.normals(template), self.normals(x));
        let (now_view, first_view) = (&look.eye.observed.views[frame], &look.eye.observed.first[0].view);
        let of = |v: usize| -> Option<Turned> {
            let Around { products, area } = around[v];
            let a = now[v].dot(now_view.direction(x[v]));
            let b = before[v].dot(first_view.direction(template[v]));
            if area <= 0.0 || a * b <= 0.0 {
                return None;
            }
            let [product, square] = [0, 1].map(|i| products.iter().map(|p| p[i]).sum::<f64>());
            let brighter = (product / square).ln();
            let y = harmonics(now[v]);
            brighter.is_finite().then(|| Turned {
                vertex: v,
                change: std::array::from_fn(|k| y[k] - first[v][k]),
                brighter,
                weight: self.asked.shading * area * pixel,
                noise: Noise { sigma: s.shading.hypot(s.shading_share * brighter), tail: s.shading_tail },
            })
        };
        (0..x.len()).filter_map(of).collect()
    }

    /// What part of the change of brightness the light explains with the sheet at `frames`, by its robust kernel;
    /// 1 where nothing changes.
    fn light_explains(&self, frames: &[Positions]) -> f64 {
        let of_frame = |n: usize| [self.terms(n).shading.value(&frames[n]), self.unlit(n)];
        let sums: Vec<[f64; 2]> = parallel::later(frames, |(n, _)| of_frame(n));
        let [lit, unlit] = [0, 1].map(|k| sums.iter().map(|of_frame| of_frame[k]).sum::<f64>());
        if unlit > 0.0 { (1.0 - lit / unlit).clamp(0.0, 1.0) } else { 1.0 }
    }

    /// Σ w ρ(h/σ) over a frame: what there would be of shading if no light explained anything.
    fn unlit(&self, frame: usize) -> f64 {
        let first = self.harmonics_of_first();
        let of = |(seen, first): (&Option<Seen>, &Light)| {
            seen.map_or(0.0, |seen| {
                let at_first: f64 = first.iter().zip(&self.light).map(|(y, c)| y * c).sum();
                seen.weight * seen.noise.cauchy(seen.target - at_first).0
            })
        };
        self.looks.iter().map(|look| look.brightness[frame].iter().zip(&first).map(of).sum::<f64>()).sum()
    }

    /// The light by reweighted least squares that go on from `light`, with tails that start longer by `start`.
    fn fit_light(&self, mut light: Light, turned: &[Vec<Turned>], offsets: &[f64], start: f64) -> Light {
        for k in 0..FITS {
            let longer = start.powf(1.0 - k as f64 / (FITS - 1) as f64);
            let of_frame = |(n, turned): (usize, &Vec<Turned>)| {
                let offset = &offsets[n];
                let (mut matrix, mut rhs) = ([0.0; HARMONICS * HARMONICS], [0.0; HARMONICS]);
                for t in turned {
                    let weight = t.weight(t.rest(&light) - offset, longer);
                    for i in 0..HARMONICS {
                        rhs[i] += weight * t.change[i] * (t.brighter - offset);
                        (0..=i).for_each(|j| matrix[i * HARMONICS + j] += weight * t.change[i] * t.change[j]);
                    }
                }
                (matrix, rhs)
            };
            // Summed in order: the same bits for any number of threads.
            let sums = parallel::numbered(turned, of_frame);
            let (mut matrix, mut rhs) = ([0.0; HARMONICS * HARMONICS], [0.0; HARMONICS]);
            (0..HARMONICS).for_each(|k| matrix[k * (HARMONICS + 1)] = HELD[k]);
            for (of_matrix, of_rhs) in &sums {
                matrix.iter_mut().zip(of_matrix).for_each(|(a, b)| *a += b);
                rhs.iter_mut().zip(of_rhs).for_each(|(a, b)| *a += b);
            }
            light.copy_from_slice(&Root::of(&matrix, HARMONICS).solve(&rhs));
        }
        light
    }

    /// What a whole frame is brighter by than the light explains.
    fn offset(&self, turned: &[Turned]) -> f64 {
        let mut offset = 0.0;
        for _ in 0..FITS {
            let (mut sum, mut weights) = (0.0, self.problem.settings.shading_offset.powi(-2));
            for t in turned {
                let rest = t.rest(&self.light);
                let weight = t.weight(rest - offset, 1.0);
                sum += weight * rest;
                weights += weight;
            }
            offset = sum / weights;
        }
        offset
    }

    /// What every vertex's brightness is compared with.
    fn targets(&self, turned: &[Turned], offset: f64, first: &[Light]) -> Vec<Option<Seen>> {
        let mut out = vec![None; first.len()];
        for t in turned {
            let at_first: f64 = first[t.vertex].iter().zip(&self.light).map(|(y, c)| y * c).sum();
            let target = at_first + t.brighter - offset;
            out[t.vertex] = Some(Seen { target, weight: t.weight, noise: t.noise });
        }
        out
    }
}

impl Problem<'_> {
    /// What part of the change of brightness over `frames` the light explains, by its robust kernel; 1 where
    /// shading is left out.
    pub(super) fn light_explains(&self, frames: &[Positions]) -> f64 {
        if self.settings.shading_tail <= 0.0 {
            return 1.0;
        }
        let mut search = self.at_level(0);
        (0..GAIN_FITS).for_each(|_| search.update_references(frames));
        search.light_explains(frames)
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec2};

    use super::super::proof::scene;
    use super::super::{Problem, SpacetimeSettings};
    use super::*;
    use crate::motion::terms::shading::brightness;
    use crate::motion::terms::{FrameSystem, Term};
    use tessuto_core::math::rng::Rng;
    use tessuto_sim::Cloth;

    /// The light of a sheet that bends, one frame of which is darker as a whole, and a part of which lies in shadow.
    #[test]
    fn the_light_is_found_from_a_sheet_that_bends() {
        let scene = scene();
        let cloth = Cloth::new(&scene.template);
        let settings = SpacetimeSettings { resolution: 1e5, levels: 1, ..Default::default() };
        let problem = Problem::new(&scene, &cloth, settings).unwrap();
        let mut search = problem.at_level(0);
        let mut rng = Rng::new(3, 0);
        let light: Light = std::array::from_fn(|_| 1.5 * rng.signed());
        let template = &scene.template.positions;
        let mut frames = vec![template.clone()];
        for wave in [DVec2::new(10.0, 0.0), DVec2::new(0.0, 12.0), DVec2::new(8.0, -8.0)] {
            let bent = |x: &DVec3| *x + DVec3::Z * (0.05 * x.truncate().dot(wave).sin());
            frames.push(template.iter().map(bent).collect());
        }
        let before = search.normals(template);
        let mut around = Vec::new();
        for (n, x) in frames.iter().enumerate().skip(1) {
            let now = search.normals(x);
            let brighter = |v: usize| {
                let shadow = if v == 17 { 0.8 } else { 0.0 };
                let of_frame = if n == 2 { 0.05 } else { 0.0 };
                brightness(&light, now[v]) - brightness(&light, before[v]) - shadow - of_frame
            };
            let shown = |v: usize| Around { products: [[brighter(v).exp(), 1.0]; 3], area: 100.0 };
            around.push((0..x.len()).map(shown).collect::<Vec<_>>());
        }
        search.update_light(&frames, &[around.clone()]);
        let shown = around[1].clone();
        let (mut error, mut signal) = (0.0, 0.0);
        for x in &frames[1..] {
            for (now, before) in search.normals(x).into_iter().zip(&before) {
                let change = |light: &Light| brightness(light, now) - brightness(light, *before);
                error += (change(&search.light) - change(&light)).powi(2);
                signal += change(&light).powi(2);
            }
        }
        let ratio = (error / signal).sqrt();
        println!("error of the logarithms, of what they are: {ratio}");
        assert!(ratio < 0.1, "{ratio}");
        let by_light = search.light_explains(&frames);
        // What has nothing to do with how the sheet has turned.
        let mut blind = problem.at_level(0);
        for around in &mut around {
            around.iter_mut().for_each(|of| of.products = [[(0.3 * rng.signed()).exp(), 1.0]; 3]);
        }
        blind.update_light(&frames, &[around]);
        let by_chance = blind.light_explains(&frames);
        println!("the light explains {by_light:.3} of its own, {by_chance:.3} of chance");
        assert!(by_light > 0.8 && (0.0..0.4).contains(&by_chance));
        // A frame by itself is compared with the same.
        let all = search.looks[0].brightness[2].clone();
        search.update_brightness(0, (2, &frames[2]), &shown);
        for (a, b) in all.iter().zip(&search.looks[0].brightness[2]) {
            assert_eq!(a.is_some(), b.is_some());
            let Some((a, b)) = a.as_ref().zip(b.as_ref()) else { continue };
            assert_eq!(a, b);
        }
        assert!(all.iter().flatten().count() > template.len() / 2);
    }

    /// In a small image a sheet that turns one way looks like one that turns the other way; its brightness does not.
    #[test]
    fn brightness_tells_a_turn_from_its_mirror_image() {
        let scene = scene();
        let cloth = Cloth::new(&scene.template);
        let settings = SpacetimeSettings { resolution: 1e5, levels: 1, ..Default::default() };
        let problem = Problem::new(&scene, &cloth, settings).unwrap();
        let mut search = problem.at_level(0);
        search.light[0] = 1.0;
        let template = &scene.template.positions;
        let middle = template.iter().sum::<DVec3>() / template.len() as f64;
        let turned = |angle: f64| -> Positions {
            let turn = DQuat::from_rotation_y(angle);
            template.iter().map(|x| middle + turn * (*x - middle)).collect()
        };
        let [right, wrong] = [0.3, -0.3].map(turned);
        let (before, now) = (search.normals(template), search.normals(&right));
        let shown = |v: usize| {
            let brighter = brightness(&search.light, now[v]) - brightness(&search.light, before[v]);
            Around { products: [[brighter.exp(), 1.0]; 3], area: 100.0 }
        };
        let around: Vec<Around> = (0..template.len()).map(shown).collect();
        let value_at = |search: &LevelSearch, x: &Positions| search.terms(1).shading.value(x);
        search.update_brightness(0, (1, &right), &around);
        let values = [&right, &wrong].map(|x| value_at(&search, x));
        println!("turned as it is {:.3e}, the other way {:.3e}", values[0], values[1]);
        assert!(values[0] < 1e-6 * values[1]);
        // Seen from the wrong side of the mirror, the term falls on the way to the right one.
        let mut system = FrameSystem::zeros(&cloth);
        search.terms(1).shading.add_system(&turned(0.1), &mut system);
        let way: f64 =
            system.gradient.iter().zip(right.iter().zip(&wrong)).map(|(g, (a, b))| g.dot(*a - *b)).sum();
        assert!(way < 0.0, "{way}");
    }
}
