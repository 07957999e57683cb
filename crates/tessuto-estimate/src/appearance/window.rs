//! The part of uv space that the template uses: maps are estimated on it alone, at their full resolution.

use tessuto_core::mesh::Mesh;
use tessuto_render::pbr::{CHANNELS, Material};

/// Largest side of a written map `[texel]`.
const LARGEST: usize = 2048;

/// Rectangle of uv space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    low: [f32; 2],
    size: [f32; 2],
}

impl Window {
    /// Around all texture coordinates of `mesh`.
    pub fn of(mesh: &Mesh) -> Self {
        let start = [glam::DVec2::INFINITY, glam::DVec2::NEG_INFINITY];
        let [low, high] = mesh.uvs.iter().fold(start, |[l, h], uv| [l.min(*uv), h.max(*uv)]);
        let size = (high - low).max(glam::DVec2::splat(1e-6));
        Self { low: low.as_vec2().to_array(), size: size.as_vec2().to_array() }
    }

    /// Coordinates within the window, 0 to 1.
    pub fn inside(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        [(u - self.low[0]) / self.size[0], (v - self.low[1]) / self.size[1]]
    }

    /// The maps on all of uv space; outside the window they go on constantly. A smaller window makes for larger maps,
    /// so that no detail is lost as long as they stay within the largest size.
    pub fn spread(&self, material: &Material) -> Material {
        let (width, height) = (self.side(material.width), self.side(material.height));
        let mut planes = vec![0.0; CHANNELS * width * height];
        for row in 0..height {
            for column in 0..width {
                let u = (column as f32 + 0.5) / width as f32;
                let v = 1.0 - (row as f32 + 0.5) / height as f32;
                let texel = material.sample(self.inside([u, v]));
                (0..CHANNELS).for_each(|c| planes[(c * height + row) * width + column] = texel[c]);
            }
        }
        Material { back: material.back, ..Material::from_planes(width, height, &planes) }
    }

    /// The same for square planes of `size`; returns their new size.
    pub fn spread_planes(&self, size: usize, planes: &[f32]) -> (usize, Vec<f32>) {
        let side = self.side(size);
        let at = |s: f32| (s * size as f32 - 0.5).clamp(0.0, (size - 1) as f32);
        let mut spread = Vec::with_capacity(planes.len() / (size * size) * side * side);
        for plane in planes.chunks_exact(size * size) {
            for row in 0..side {
                for column in 0..side {
                    let centre = [column, side - 1 - row].map(|k| (k as f32 + 0.5) / side as f32);
                    let [u, v] = self.inside(centre);
                    let (x, y) = (at(u), at(1.0 - v));
                    let (fx, fy) = (x.fract(), y.fract());
                    let value = |dx: usize, dy: usize| {
                        let (c, r) = ((x as usize + dx).min(size - 1), (y as usize + dy).min(size - 1));
                        plane[r * size + c]
                    };
                    let upper = value(0, 0) * (1.0 - fx) + value(1, 0) * fx;
                    let lower = value(0, 1) * (1.0 - fx) + value(1, 1) * fx;
                    spread.push(upper * (1.0 - fy) + lower * fy);
                }
            }
        }
        (side, spread)
    }

    /// Side of the map on all of uv space, of one of `n` texels on the window.
    fn side(&self, n: usize) -> usize {
        let fraction = self.size[0].min(self.size[1]).min(1.0);
        let factor = ((1.0 / fraction).ceil() as usize).next_power_of_two();
        (n * factor).min(LARGEST.max(n))
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use tessuto_core::mesh::grid;

    #[test]
    fn spread_maps_look_up_what_the_window_holds() {
        let mut mesh = grid(3, 3, DVec2::ONE, 1.0);
        mesh.uvs.iter_mut().for_each(|uv| *uv = *uv * 0.25 + DVec2::new(0.5, 0.25));
        let window = Window::of(&mesh);
        let planes: Vec<f32> = (0..CHANNELS * 64).map(|k| (k % 8) as f32 / 8.0).collect();
        let material = Material::from_planes(8, 8, &planes);
        let spread = window.spread(&material);
        assert_eq!((spread.width, spread.height), (32, 32));
        let uv = [0.6, 0.3];
        let (a, b) = (spread.sample(uv)[0], material.sample(window.inside(uv))[0]);
        assert!((a - b).abs() < 1e-5, "{a} {b}");
        let (side, again) = window.spread_planes(8, &planes);
        assert_eq!(side, 32);
        assert!(again.iter().zip(spread.to_planes()).all(|(a, b)| (a - b).abs() < 1e-5));
    }
}
