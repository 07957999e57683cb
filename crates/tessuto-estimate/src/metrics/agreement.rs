//! How well one frame of a result agrees with the video and with what cloth can do; no truth is needed.

use std::collections::HashMap;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::similarity::{local_correlation, masked_psnr};
use tessuto_core::image::Image;
use tessuto_core::mesh::{Mesh, triangle_area};
use tessuto_core::video::{COVERED, Frame};

/// Normals of neighbouring triangles farther apart than this make a crease: cos 120°.
const CREASE: f64 = -0.5;

/// Agreement of one frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameAgreement {
    /// Number of the frame in the scene folder.
    pub frame: usize,
    /// Intersection over union of two sets of pixels: those whose mask is above one half, and those whose rendered
    /// coverage is; absent where both are empty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub silhouette: Option<f64>,
    /// Fraction of the pixels whose mask is above one half that the mesh does not cover; absent for an empty mask.
    /// Unlike the silhouette it does not suffer from things in front of the fabric that the mask leaves out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncovered: Option<f64>,
    /// PSNR `[dB]` of the mesh rendered with the recovered texture against the video's sRGB colours, over the
    /// pixels in which both mask and rendered coverage are above one half; absent where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psnr: Option<f64>,
    /// How well the texture's pattern lies on that of the video, over the same pixels: see [`local_correlation`];
    /// absent for plain cloth. Where the mesh moves, the best of the sharp rendering and those with the shutter
    /// open for a while: a blurred frame lacks what is fine in the print.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correlation: Option<f64>,
    /// Mean of |strain| over the threads, the edges of the template's polygons; strain = length / length in the
    /// template − 1.
    pub strain_mean: f64,
    /// |strain| that one thread in a hundred exceeds.
    pub strain_p99: f64,
    /// Largest |strain|.
    pub strain_max: f64,
    /// Fraction of the inner edges of the triangles at which the surface turns back by more than 120°, without
    /// those at which the template does so.
    pub creased: f64,
    /// Fraction of the area, as the template has it, in triangles turned by more than 90° against their
    /// neighbours: against the mean of these triangles' unit normals, weighted by area; without those turned so in
    /// the template. Folds are wider than a triangle and do not count; spikes and inverted corners do.
    #[serde(default)]
    pub flipped: f64,
    /// Standard deviation of the positions that the search itself expects `[m]`: root mean square over the
    /// vertices of the square root of the trace of each one's covariance; absent where the method estimates none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deviation: Option<f64>,
}

/// Measures frames of one mesh.
#[derive(Debug, Clone)]
pub struct AgreementMeter {
    /// Threads and their lengths `[m]` in the template.
    threads: Vec<([u32; 2], f64)>,
    triangles: Vec<[u32; 3]>,
    /// Two triangles on either side of an inner edge that is no crease of the template.
    neighbours: Vec<[u32; 2]>,
    /// Number of inner edges.
    inner_edges: usize,
    /// Areas of the triangles in the template, of sum 1; 0 for those [`turned`] against their neighbours there.
    areas: Vec<f64>,
}

impl AgreementMeter {
    /// For motions of `template`.
    pub fn new(template: &Mesh) -> Self {
        let p = &template.positions;
        let length = |[a, b]: [u32; 2]| p[a as usize].distance(p[b as usize]);
        let threads = template.edges().into_iter().map(|e| (e, length(e))).filter(|(_, l)| *l > 0.0);
        let triangles = template.triangles();
        let mut neighbours = neighbours(&triangles);
        let inner_edges = neighbours.len();
        let normals = normals(&triangles, p);
        neighbours.retain(|pair| !is_crease(&normals, *pair));
        let mut areas: Vec<f64> = triangles.iter().map(|t| triangle_area(p, *t)).collect();
        let whole = areas.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        areas.iter_mut().for_each(|a| *a /= whole);
        let turned_in_template = turned(&normals, &neighbours, &areas);
        areas.iter_mut().zip(turned_in_template).filter(|(_, turned)| *turned).for_each(|(a, _)| *a = 0.0);
        Self { threads: threads.collect(), triangles, neighbours, inner_edges, areas }
    }

    /// Agreement of frame number `frame`.
    ///
    /// - `positions`: of the vertices `[m]`, shape `[V]`
    /// - `rgb`, `coverage`: the mesh rendered at these positions, of the size of `observed`
    pub fn measure(
        &self,
        frame: usize,
        positions: &[DVec3],
        rgb: &Image,
        coverage: &Image,
        observed: &Frame,
    ) -> FrameAgreement {
        let common = common(coverage, observed);
        let [silhouette, uncovered] = overlaps(coverage, observed);
        FrameAgreement {
            silhouette,
            uncovered,
            psnr: masked_psnr(rgb, &observed.rgb, &common),
            correlation: local_correlation(rgb, &observed.rgb, &common),
            ..self.shape(frame, positions)
        }
    }

    /// What `positions` alone say of frame number `frame`.
    pub fn shape(&self, frame: usize, positions: &[DVec3]) -> FrameAgreement {
        let [strain_mean, strain_p99, strain_max] = self.strain(positions);
        let normals = normals(&self.triangles, positions);
        FrameAgreement {
            frame,
            strain_mean,
            strain_p99,
            strain_max,
            creased: self.creased(&normals),
            flipped: self.flipped(&normals),
            ..Default::default()
        }
    }

    /// Mean, 99th percentile and maximum of |strain|.
    pub fn strain(&self, positions: &[DVec3]) -> [f64; 3] {
        let strain = |([a, b], length): &([u32; 2], f64)| {
            (positions[*a as usize].distance(positions[*b as usize]) / length - 1.0).abs()
        };
        let mut strains: Vec<f64> = self.threads.iter().map(strain).collect();
        let count = strains.len();
        if count == 0 {
            return [0.0; 3];
        }
        let mean = strains.iter().sum::<f64>() / count as f64;
        strains.sort_unstable_by(f64::total_cmp);
        [mean, strains[(99 * count).div_ceil(100) - 1], strains[count - 1]]
    }

    fn creased(&self, normals: &[DVec3]) -> f64 {
        let count = self.neighbours.iter().filter(|pair| is_crease(normals, **pair)).count();
        count as f64 / self.inner_edges.max(1) as f64
    }

    fn flipped(&self, normals: &[DVec3]) -> f64 {
        let turned = turned(normals, &self.neighbours, &self.areas);
        self.areas.iter().zip(turned).filter(|(_, turned)| *turned).fold(0.0, |sum, (area, _)| sum + area)
    }
}

/// [`local_correlation`] of `rgb`, rendered with `coverage`, with the video, over the pixels that both cover.
pub fn print_correlation(rgb: &Image, coverage: &Image, observed: &Frame) -> Option<f64> {
    local_correlation(rgb, &observed.rgb, &common(coverage, observed))
}

/// The pixels that both mask and rendered coverage fill.
fn common(coverage: &Image, observed: &Frame) -> Vec<bool> {
    let pixels = coverage.data.iter().zip(&observed.mask.data);
    pixels.map(|(a, b)| *a >= COVERED && *b >= COVERED).collect()
}

/// [`silhouette`](FrameAgreement::silhouette) and [`uncovered`](FrameAgreement::uncovered) of a frame.
pub fn overlaps(coverage: &Image, observed: &Frame) -> [Option<f64>; 2] {
    let (mut both, mut union, mut masked) = (0usize, 0usize, 0usize);
    for (a, b) in coverage.data.iter().zip(&observed.mask.data) {
        let (a, b) = (*a >= COVERED, *b >= COVERED);
        both += usize::from(a && b);
        union += usize::from(a || b);
        masked += usize::from(b);
    }
    let part = |part: usize, of: usize| (of > 0).then(|| part as f64 / of as f64);
    [part(both, union), part(masked - both, masked)]
}

/// Unit normals of the triangles; zero for those without area.
fn normals(triangles: &[[u32; 3]], p: &[DVec3]) -> Vec<DVec3> {
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| p[v as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    };
    triangles.iter().map(normal).collect()
}

fn is_crease(normals: &[DVec3], [a, b]: [u32; 2]) -> bool {
    normals[a as usize].dot(normals[b as usize]) < CREASE
}

/// Whether each triangle's normal is more than 90° from the mean of its neighbours', weighted by `areas`.
fn turned(normals: &[DVec3], neighbours: &[[u32; 2]], areas: &[f64]) -> Vec<bool> {
    let mut around = vec![DVec3::ZERO; normals.len()];
    for [a, b] in neighbours.iter().map(|pair| pair.map(|t| t as usize)) {
        around[a] += areas[b] * normals[b];
        around[b] += areas[a] * normals[a];
    }
    around.iter().zip(normals).map(|(mean, normal)| mean.dot(*normal) < 0.0).collect()
}

/// The triangles on either side of each edge that has two, in the order of the second.
fn neighbours(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut first: HashMap<[u32; 2], u32> = HashMap::new();
    let mut out = Vec::new();
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            match first.insert([a.min(b), a.max(b)], t as u32) {
                Some(other) => out.push([other, t as u32]),
                None => continue,
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::mesh::grid;

    /// A frame whose mask is columns `from..to` of a 20×10 image, all of it of one grey.
    fn columns(from: usize, to: usize, grey: f32) -> Frame {
        let mut frame = Frame { rgb: Image::new(20, 10, 3), mask: Image::new(20, 10, 1) };
        for y in 0..10 {
            for x in from..to {
                frame.rgb.pixel_mut(x, y).fill(grey);
                frame.mask.pixel_mut(x, y)[0] = 1.0;
            }
        }
        frame
    }

    #[test]
    fn silhouette_and_colours_count_the_pixels_that_they_say() {
        let mesh = grid(3, 3, glam::DVec2::ONE, 1.0);
        let meter = AgreementMeter::new(&mesh);
        let (drawn, observed) = (columns(2, 12, 0.5), columns(4, 14, 0.6));
        let found = meter.measure(7, &mesh.positions, &drawn.rgb, &drawn.mask, &observed);
        assert_eq!((found.frame, found.silhouette), (7, Some(8.0 / 12.0)));
        // Inside both, all differ by a tenth; outside, by far more.
        assert!((found.psnr.unwrap() - 20.0).abs() < 1e-5, "{found:?}");
        let nothing = columns(0, 0, 0.0);
        let found = meter.measure(0, &mesh.positions, &nothing.rgb, &nothing.mask, &observed);
        assert_eq!((found.silhouette, found.psnr), (Some(0.0), None));
        let found = meter.measure(0, &mesh.positions, &nothing.rgb, &nothing.mask, &nothing);
        assert_eq!((found.silhouette, found.psnr), (None, None));
    }

    #[test]
    fn strain_of_a_cloth_pulled_along_x() {
        let mesh = grid(5, 4, glam::DVec2::ONE, 1.0);
        let meter = AgreementMeter::new(&mesh);
        let pulled: Vec<DVec3> = mesh.positions.iter().map(|p| DVec3::new(1.25 * p.x, p.y, p.z)).collect();
        let [mean, p99, largest] = meter.strain(&pulled);
        // 16 of the 31 threads run along x.
        assert!((mean - 0.25 * 16.0 / 31.0).abs() < 1e-12 && (largest - 0.25).abs() < 1e-12);
        assert!((p99 - 0.25).abs() < 1e-12);
        // One of a hundred and more threads does not count for the percentile.
        let mesh = grid(12, 12, glam::DVec2::ONE, 1.0);
        let meter = AgreementMeter::new(&mesh);
        let mut torn = mesh.positions.clone();
        torn[0].x -= 1.0;
        let [_, p99, largest] = meter.strain(&torn);
        assert!(p99 < 1e-9 && largest > 5.0, "{p99} {largest}");
    }

    #[test]
    fn a_fold_creases_one_line_of_edges_and_a_folded_template_none() {
        let mut mesh = grid(5, 5, glam::DVec2::ONE, 1.0);
        let folded: Vec<DVec3> = mesh.positions.iter().map(|p| DVec3::new(p.x.abs(), p.y, p.z)).collect();
        let meter = AgreementMeter::new(&mesh);
        let creased = |meter: &AgreementMeter, p: &[DVec3]| meter.creased(&normals(&meter.triangles, p));
        assert_eq!(creased(&meter, &mesh.positions), 0.0);
        // 16 diagonals and 24 inner threads; the fold runs along 4 of these.
        assert!((creased(&meter, &folded) - 4.0 / 40.0).abs() < 1e-12);
        mesh.positions.clone_from(&folded);
        assert_eq!(creased(&AgreementMeter::new(&mesh), &folded), 0.0);
    }

    #[test]
    fn spikes_are_flipped_triangles_and_folds_are_none() {
        let mesh = grid(9, 9, glam::DVec2::ONE, 1.0);
        let meter = AgreementMeter::new(&mesh);
        let flipped = |p: &[DVec3]| meter.flipped(&normals(&meter.triangles, p));
        let folded: Vec<DVec3> = mesh.positions.iter().map(|p| DVec3::new(p.x.abs(), p.y, p.z)).collect();
        assert_eq!((flipped(&mesh.positions), flipped(&folded)), (0.0, 0.0));
        // A vertex pulled over two of its neighbours turns the triangles there inside out.
        let mut spiked = mesh.positions.clone();
        spiked[4 * 9 + 4].x += 0.3;
        let found = flipped(&spiked);
        assert!((1.0 / 128.0..=4.0 / 128.0 + 1e-12).contains(&found), "{found}");
        // A sheet that turns its back on the camera as a whole is not inside out.
        let turned: Vec<DVec3> = mesh.positions.iter().map(|p| DVec3::new(-p.x, p.y, 2.0 - p.z)).collect();
        assert_eq!(flipped(&turned), 0.0);
        // A template with a spike is taken as it is.
        let template = Mesh { positions: spiked.clone(), ..mesh.clone() };
        let meter = AgreementMeter::new(&template);
        assert_eq!(meter.flipped(&normals(&meter.triangles, &spiked)), 0.0);
    }

    #[test]
    fn what_hides_the_fabric_uncovers_nothing() {
        let mesh = grid(3, 3, glam::DVec2::ONE, 1.0);
        let meter = AgreementMeter::new(&mesh);
        let drawn = columns(2, 12, 0.5);
        // A hand over columns 2 to 4, and a mesh two columns too far right.
        for (from, to, silhouette, uncovered) in [(5, 12, 0.7, 0.0), (0, 10, 8.0 / 12.0, 0.2)] {
            let found = meter.measure(0, &mesh.positions, &drawn.rgb, &drawn.mask, &columns(from, to, 0.5));
            assert_eq!((found.silhouette, found.uncovered), (Some(silhouette), Some(uncovered)));
        }
    }
}
