//! Numbers and images as text inside the page: base64 of little-endian arrays, positions as 16-bit steps of the
//! frame's bounding box, scalars as 8-bit steps of a colour scale.

use glam::DVec3;
use serde::Serialize;

use tessuto_core::mesh::{Mesh, Positions};
pub use tessuto_core::text::base64;

/// base64 of numbers, least significant byte first.
pub(crate) fn base64_of<T: bytemuck::NoUninit>(numbers: &[T]) -> String {
    // The page reads little-endian arrays; so does every machine this is built for.
    const { assert!(cfg!(target_endian = "little")) };
    base64(bytemuck::cast_slice(numbers))
}

/// A motion in steps of each frame's bounding box.
#[derive(Debug, Clone, Default, Serialize)]
pub struct EmbeddedMotion {
    /// Frames it has.
    pub frames: usize,
    /// Lower corner and extent `[m]`, f32 [N, 6].
    pub boxes: String,
    /// Steps of extent / 65535, u16 [N, V, 3].
    pub steps: String,
    /// Largest distance `[m]`, per axis, of an embedded position from its own.
    pub precision: f64,
}

impl EmbeddedMotion {
    /// Of a motion, `[N, V]` m.
    pub fn new(motion: &[Positions]) -> Self {
        let (mut boxes, mut steps, mut precision) = (Vec::new(), Vec::new(), 0.0f64);
        for positions in motion {
            let finite = || positions.iter().filter(|p| p.is_finite());
            let (low, high) =
                finite().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
            let (low, extent) =
                if low.cmple(high).all() { (low, high - low) } else { (DVec3::ZERO, DVec3::ZERO) };
            boxes.extend(low.as_vec3().to_array());
            boxes.extend(extent.as_vec3().to_array());
            let inverse = extent.map(|e| if e > 0.0 { 65535.0 / e } else { 0.0 });
            steps.extend(
                positions.iter().flat_map(|p| ((*p - low) * inverse).round().to_array().map(|s| s as u16)),
            );
            // Half a step, and the rounding of the corner to f32.
            let rounding = low.abs().max_element() * f64::from(f32::EPSILON);
            precision = precision.max(extent.max_element() / 65535.0 / 2.0 + rounding);
        }
        Self { frames: motion.len(), boxes: base64_of(&boxes), steps: base64_of(&steps), precision }
    }
}

/// A number at every vertex of every frame, for colouring.
#[derive(Debug, Clone, Serialize)]
pub struct Field {
    /// Key, for the script.
    pub key: &'static str,
    /// What it is, for people.
    pub label: &'static str,
    /// Its unit after scaling.
    pub unit: &'static str,
    /// Whether 0 is the middle of the scale.
    pub diverging: bool,
    /// The scale's ends, in `unit`; values beyond are cut off.
    pub range: [f64; 2],
    /// u8 [N, V]: 0 for no value, else 1 + 254 (value − low) / (high − low), rounded.
    pub steps: String,
}

impl Field {
    /// Of `values` [N, V] in `unit`, NaN where there is none. The scale ends where 98 % of the magnitudes do.
    pub fn new(
        [key, label, unit]: [&'static str; 3],
        diverging: bool,
        values: &[impl AsRef<[f32]>],
    ) -> Option<Self> {
        let all = || values.iter().flat_map(|v| v.as_ref());
        let mut magnitudes: Vec<f32> = all().map(|v| v.abs()).filter(|v| v.is_finite()).collect();
        if magnitudes.is_empty() {
            return None;
        }
        let rank = (magnitudes.len() - 1) * 98 / 100;
        let high = f64::from(*magnitudes.select_nth_unstable_by(rank, f32::total_cmp).1);
        let high = rounded_up(high.max(1e-9));
        let low = if diverging { -high } else { 0.0 };
        let step = |v: &f32| match v.is_finite() {
            true => 1 + (254.0 * ((f64::from(*v) - low) / (high - low)).clamp(0.0, 1.0)).round() as u8,
            false => 0,
        };
        let steps: Vec<u8> = all().map(step).collect();
        Some(Self { key, label, unit, diverging, range: [low, high], steps: base64(&steps) })
    }
}

/// Topology and texture coordinates. A corner is a vertex with one of its texture coordinates.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Surface {
    /// V.
    pub vertices: usize,
    /// Vertex of every corner, u32 `[C]`.
    pub corners: String,
    /// Texture coordinate of every corner, f32 [C, 2].
    pub uvs: String,
    /// Corners of every triangle, u32 [T, 3].
    pub triangles: String,
    /// Vertices of every polygon edge, u32 [E, 2].
    pub edges: String,
    /// Lengths of the edges in the template `[m]`, f32 `[E]`.
    pub lengths: String,
}

/// Rectangle of uv space that the embedded maps show: lower corner, upper corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Lower left.
    pub low: [f64; 2],
    /// Upper right.
    pub high: [f64; 2],
}

impl Window {
    /// All of uv space.
    pub const WHOLE: Self = Self { low: [0.0; 2], high: [1.0; 2] };
    /// Borders lie on multiples of this, which are between texels of all maps of 2ⁿ texels.
    const GRID: f64 = 64.0;

    /// Around the texture coordinates of `mesh`; the whole if some lie outside.
    pub fn of(mesh: &Mesh) -> Self {
        let start = [glam::DVec2::INFINITY, glam::DVec2::NEG_INFINITY];
        let [low, high] = mesh.uvs.iter().fold(start, |[l, h], uv| [l.min(*uv), h.max(*uv)]);
        if !(low.min_element() >= 0.0 && high.max_element() <= 1.0 && low.cmplt(high).all()) {
            return Self::WHOLE;
        }
        // One more step, so that filtering finds texels beyond the border.
        let down = |v: f64| (((v * Self::GRID).floor() - 1.0) / Self::GRID).max(0.0);
        let up = |v: f64| (((v * Self::GRID).ceil() + 1.0) / Self::GRID).min(1.0);
        Self { low: low.to_array().map(down), high: high.to_array().map(up) }
    }

    /// `uv` within the window, 0 to 1.
    fn inside(&self, uv: glam::DVec2) -> [f32; 2] {
        let at = |k: usize| ((uv[k] - self.low[k]) / (self.high[k] - self.low[k])) as f32;
        [at(0), at(1)]
    }

    /// Column, row, width and height `[px]` in an image of this size, whose row 0 is v = 1.
    pub fn pixels(&self, width: u32, height: u32) -> [u32; 4] {
        let at = |fraction: f64, n: u32| (fraction * f64::from(n)).round() as u32;
        let (x0, x1) = (at(self.low[0], width), at(self.high[0], width));
        let (y0, y1) = (at(1.0 - self.high[1], height), at(1.0 - self.low[1], height));
        [x0, y0, (x1 - x0).max(1), (y1 - y0).max(1)]
    }
}

impl Surface {
    /// Of `mesh`, with texture coordinates within `window`.
    pub fn new(mesh: &Mesh, window: Window) -> Self {
        let pairs: Vec<[u32; 2]> = mesh
            .triangles()
            .concat()
            .into_iter()
            .zip(mesh.triangle_uvs().concat())
            .map(|(vertex, uv)| [vertex, uv])
            .collect();
        let mut corners = pairs.clone();
        corners.sort_unstable();
        corners.dedup();
        let triangles: Vec<u32> =
            pairs.iter().map(|pair| corners.binary_search(pair).expect("one of them") as u32).collect();
        let vertices: Vec<u32> = corners.iter().map(|[v, _]| *v).collect();
        let uvs: Vec<[f32; 2]> =
            corners.iter().map(|[_, uv]| window.inside(mesh.uvs[*uv as usize])).collect();
        let edges = mesh.edges();
        let length =
            |[a, b]: &[u32; 2]| mesh.positions[*a as usize].distance(mesh.positions[*b as usize]) as f32;
        Self {
            vertices: mesh.positions.len(),
            corners: base64_of(&vertices),
            uvs: base64_of(&uvs),
            triangles: base64_of(&triangles),
            lengths: base64_of(&edges.iter().map(length).collect::<Vec<f32>>()),
            edges: base64_of(&edges),
        }
    }
}

/// The next of 1, 2, 5, 10, 20, 50 … (times powers of ten).
fn rounded_up(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|s| s * power).into_iter().find(|s| *s >= value * 0.999).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(text: &str) -> Vec<u8> {
        let digit = |c: u8| match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => panic!("{c}"),
        };
        let bits: Vec<u8> = text.trim_end_matches('=').bytes().map(digit).collect();
        let bytes = bits.chunks(4).flat_map(|c| {
            let word = c.iter().fold(0u32, |w, d| w << 6 | u32::from(*d)) << (6 * (4 - c.len()));
            word.to_be_bytes()[1..c.len()].to_vec()
        });
        bytes.collect()
    }

    #[test]
    fn embedded_positions_are_as_near_as_stated() {
        let mut rng = tessuto_core::math::rng::Rng::new(3, 0);
        let shapes: Vec<Positions> =
            (0..3).map(|_| (0..50).map(|_| rng.vector() * 0.4 + DVec3::Z * 1.3).collect()).collect();
        let motion = EmbeddedMotion::new(&shapes);
        assert!(motion.precision < 3e-5, "{}", motion.precision);
        let boxes: Vec<f32> = bytemuck::pod_collect_to_vec(&decoded(&motion.boxes));
        let steps: Vec<u16> = bytemuck::pod_collect_to_vec(&decoded(&motion.steps));
        for (i, p) in shapes.iter().flatten().enumerate() {
            for (axis, value) in p.to_array().into_iter().enumerate() {
                let at = |k: usize| f64::from(boxes[6 * (i / 50) + k + axis]);
                let read = at(0) + at(3) * f64::from(steps[3 * i + axis]) / 65535.0;
                assert!((read - value).abs() <= motion.precision, "{read} {value}");
            }
        }
        // A flat shape has no extent along z.
        assert!(EmbeddedMotion::new(&[vec![DVec3::ONE; 4]]).precision < 1e-6);
    }

    #[test]
    fn scalars_without_value_are_told_apart_from_the_lowest() {
        let values = vec![vec![-0.004f32, 0.0, f32::NAN, 0.005]];
        let field = Field::new(["e", "error", "m"], true, &values).unwrap();
        assert_eq!(field.range, [-0.005, 0.005]);
        assert_eq!(decoded(&field.steps), [26, 128, 0, 255]);
        assert!(Field::new(["e", "", ""], true, &[vec![f32::NAN]]).is_none());
    }

    #[test]
    fn window_keeps_texels_under_their_coordinates() {
        let mut mesh = tessuto_core::mesh::grid(3, 2, glam::DVec2::ONE, 1.0);
        mesh.uvs.iter_mut().for_each(|uv| *uv = *uv * 0.25 + glam::DVec2::new(0.5, 0.125));
        let window = Window::of(&mesh);
        let [x, y, w, h] = window.pixels(512, 512);
        assert_eq!([x, y, w, h], [248, 312, 144, 144]);
        let uv = mesh.uvs[1];
        let [u, v] = window.inside(uv).map(f64::from);
        let whole = glam::DVec2::new(uv.x * 512.0, (1.0 - uv.y) * 512.0);
        let cut = glam::DVec2::new(f64::from(x) + u * f64::from(w), f64::from(y) + (1.0 - v) * f64::from(h));
        assert!((whole - cut).length() < 1e-3, "{whole} {cut}");
        mesh.uvs[0].x = -0.1;
        assert_eq!(Window::of(&mesh), Window::WHOLE);
    }

    #[test]
    fn seams_split_corners_not_vertices() {
        let mut mesh = tessuto_core::mesh::grid(3, 2, glam::DVec2::ONE, 1.0);
        // The right quad gets texture coordinates of its own.
        let first = mesh.uvs.len() as u32;
        let own: Vec<_> = mesh.faces[1].uvs.iter().map(|uv| mesh.uvs[*uv as usize]).collect();
        mesh.uvs.extend(own);
        mesh.faces[1].uvs = (first..first + 4).collect();
        let surface = Surface::new(&mesh, Window::WHOLE);
        assert_eq!(surface.vertices, 6);
        assert_eq!(decoded(&surface.corners).len() / 4, 8);
        assert_eq!(decoded(&surface.triangles).len() / 4, 12);
        assert_eq!(decoded(&surface.edges).len() / 8, 7);
    }
}
