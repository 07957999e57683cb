//! The print, gathered from all frames: colours as the first frame's light shows them, on everything that was ever
//! seen.
//!
//! Each pixel of each frame is laid on the texels that it shows. Light that changes as the cloth moves is divided
//! out first: a factor by channel on a coarse grid of the cloth, from what is known of the print already
//! (`gains`). Pixels count the less the more obliquely they see the cloth, the faster it moves, the less its place
//! is known, and the less they agree with the others. The frames are gone through twice: forward from the first,
//! whose light the print keeps, then against that result.

use std::ops::Range;

use glam::DVec3;

use super::gains::Gains;
use super::observations::{inside, telling_sides};
use super::seen::{Seen, directions};
use super::splat::Splat;
use super::window::Window;
use tessuto_core::error::Result;
use tessuto_core::image::srgb;
use tessuto_core::mesh::Positions;
use tessuto_core::scene::Scene;
use tessuto_render::pbr::barycentrics;
use tessuto_render::raster::{Rasterizer, Rendering, Texture};

/// Frames whose pixels are held at once.
const TOGETHER: usize = 4;
/// Pixels count half where the cloth moves by this many pixels while the shutter, open half of the time, is open.
const SHARP: f64 = 1.0;
/// They count half where the standard deviation of the cloth's place is this long `[px]`.
const CERTAIN: f64 = 1.0;
/// They count half where their linear colour is this far from the others', relative to the print's brightness and 0.1.
const ALIKE: f32 = 0.2;

/// The print and how much of it was seen.
#[derive(Debug, Clone)]
pub struct Print {
    /// sRGB colours on all of uv space.
    pub texture: Texture,
    /// What was seen.
    pub seen: Seen,
}

/// A pixel on the cloth.
struct Pixel {
    /// Within the window.
    uv: [f32; 2],
    /// Linear.
    colour: [f32; 3],
    weight: f32,
}

/// What one frame shows.
struct View {
    pixels: Vec<Pixel>,
    /// Normals of the triangles that are seen, and by how many pixels.
    normals: Vec<(DVec3, f64)>,
    /// Whether each vertex is seen.
    vertices: Vec<bool>,
}

/// Gathers the print of `scene` moving as `motion`, shape [N, V], whose vertices have the standard deviations
/// `deviations` `[m]`, shape [N, V], where they are known, on maps of `size` over the part of uv space that the
/// template uses.
///
/// # Errors
/// Those of reading the frames.
pub fn gather(
    scene: &Scene,
    motion: &[Positions],
    deviations: Option<&[Vec<f64>]>,
    size: usize,
) -> Result<Print> {
    let rasterizer = &telling_sides(scene);
    let window = Window::of(&scene.template);
    let scenes: Vec<_> =
        (0..scene.view_count()).map(|v| (scene.seen_by(v), scene.when_seen_by(v, motion))).collect();
    let mut lookers = Vec::new();
    lookers.extend(scenes.iter().map(|(scene, motion)| Looker {
        scene,
        rasterizer,
        window,
        motion,
        deviations,
    }));
    // A few frames of one camera after another.
    let parts = || {
        let starts = || (0..motion.len()).step_by(TOGETHER);
        lookers.iter().flat_map(move |looker| starts().map(move |start| (looker, start)))
    };
    let mut print = Splat::new(size);
    let (mut normals, mut vertices) = (Vec::new(), vec![0.0f32; scene.template.positions.len()]);
    for (looker, start) in parts() {
        for view in looker.views(start..(start + TOGETHER).min(motion.len()))? {
            let gains = Gains::new(view.pixels.iter().map(|p| (p.uv, p.colour, print.at(p.uv), p.weight)));
            for p in &view.pixels {
                print.add(p.uv, gains.without(p.uv, p.colour), p.weight);
            }
            normals.extend(view.normals);
            vertices.iter_mut().zip(view.vertices).for_each(|(count, seen)| *count += f32::from(seen));
        }
    }
    let (mut agreed, mut texels) = (Splat::new(size), Splat::new(size));
    for (looker, start) in parts() {
        for view in looker.views(start..(start + TOGETHER).min(motion.len()))? {
            let gains = Gains::new(view.pixels.iter().map(|p| (p.uv, p.colour, print.at(p.uv), p.weight)));
            for p in &view.pixels {
                let colour = gains.without(p.uv, p.colour);
                let others = print.at(p.uv).unwrap_or(colour);
                agreed.add(p.uv, colour, p.weight * alike(colour, others));
                texels.add(p.uv, [0.0; 3], 1.0);
            }
        }
    }
    let counts = texels.weights().collect::<Vec<_>>();
    let planes: Vec<f32> = agreed.planes().into_iter().map(|l| srgb::encode(l).clamp(0.0, 1.0)).collect();
    let (side, planes) = window.spread_planes(size, &[planes, counts].concat());
    let n = side * side;
    let texels = (0..n).map(|i| [planes[i], planes[n + i], planes[2 * n + i], 1.0]).collect();
    Ok(Print {
        texture: Texture { width: side, height: side, texels },
        seen: Seen {
            size: side,
            texels: planes[3 * n..].to_vec(),
            vertices,
            directions: directions(&normals),
        },
    })
}

/// Weight of a colour among `others`.
fn alike(colour: [f32; 3], others: [f32; 3]) -> f32 {
    let spread = ALIKE * (others.iter().sum::<f32>() / 3.0 + 0.1);
    let square: f32 = (0..3).map(|c| (colour[c] - others[c]).powi(2)).sum();
    1.0 / (1.0 + square / (3.0 * spread * spread))
}

/// Looks at frames.
struct Looker<'a> {
    scene: &'a Scene,
    rasterizer: &'a Rasterizer,
    window: Window,
    motion: &'a [Positions],
    deviations: Option<&'a [Vec<f64>]>,
}

impl Looker<'_> {
    fn views(&self, frames: Range<usize>) -> Result<Vec<View>> {
        self.scene.frames.map(frames, Rendering::new, |rendering, n| self.view(rendering, n))
    }

    fn view(&self, rendering: &mut Rendering, n: usize) -> Result<View> {
        let (scene, positions) = (self.scene, &self.motion[n]);
        let view = scene.viewpoint(n);
        let camera = &view.camera;
        let frame = scene.frames.frame(n)?;
        let blank = Texture::uniform(1, 1, [0.0; 3]);
        self.rasterizer.render(view, positions, &blank, rendering);
        let triangles = self.rasterizer.triangles();
        let mut counts = vec![0.0; triangles.len()];
        let mut pixels = Vec::new();
        let facing: Vec<(DVec3, f32)> = (0..triangles.len()).map(|t| self.facing(t, n)).collect();
        for pixel in 0..rendering.triangle.len() {
            if !inside(&frame.mask, rendering, pixel) {
                continue;
            }
            let t = rendering.triangle[pixel] as usize;
            let (x, y) = (pixel % camera.width, pixel / camera.width);
            let ray = camera.ray(glam::DVec2::new(x as f64, y as f64));
            let corners = barycentrics(triangles[t].map(|v| view.in_camera(positions[v as usize])), ray);
            let uvs = self.rasterizer.triangle_uvs()[t];
            let uv: glam::DVec2 = (0..3).map(|k| self.rasterizer.uvs()[uvs[k] as usize] * corners[k]).sum();
            if !uv.is_finite() {
                continue;
            }
            let rgb = frame.rgb.pixel(x, y);
            pixels.push(Pixel {
                uv: self.window.inside(uv.as_vec2().to_array()),
                colour: [rgb[0], rgb[1], rgb[2]].map(srgb::decode),
                weight: facing[t].1,
            });
            counts[t] += 1.0;
        }
        let normals = facing.iter().zip(&counts).filter(|(_, count)| **count > 0.0);
        let vertices = positions.iter().map(|p| {
            let (at, depth) = (view.project(*p).round(), view.depth(*p));
            let within =
                at.x >= 0.0 && at.y >= 0.0 && at.x < camera.width as f64 && at.y < camera.height as f64;
            // Nothing in front of it by more than a hundredth of its distance.
            within && depth > 0.0 && {
                let (x, y) = (at.x as usize, at.y as usize);
                let hidden = rendering.depth(x, y).is_some_and(|z| z < 0.99 * depth);
                frame.mask.pixel(x, y)[0] > 0.5 && !hidden
            }
        });
        let vertices = vertices.collect();
        Ok(View {
            pixels,
            normals: normals.map(|((normal, _), count)| (*normal, *count)).collect(),
            vertices,
        })
    }

    /// Unit normal of triangle `t` in frame `n`, on the side that the camera sees, and how much its pixels count.
    fn facing(&self, t: usize, n: usize) -> (DVec3, f32) {
        let corners = self.rasterizer.triangles()[t].map(|v| v as usize);
        let view = self.scene.viewpoint(n);
        let [a, b, c] = corners.map(|v| self.motion[n][v]);
        let centre = |n: usize| corners.iter().map(|v| self.motion[n][*v]).sum::<DVec3>() / 3.0;
        let here = centre(n);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let normal = if normal.dot(view.offset(here)) > 0.0 { -normal } else { normal };
        let cosine = normal.dot(view.direction(here)).abs();
        let next = if n + 1 < self.motion.len() { n + 1 } else { n.saturating_sub(1) };
        let way = 0.5 * view.project(here).distance(self.scene.viewpoint(next).project(centre(next)));
        let pixels_per_metre = view.camera.fx.max(view.camera.fy) / view.depth(here).abs().max(1e-6);
        let deviation = self.deviations.map_or(0.0, |frames| {
            corners.iter().map(|v| frames[n][*v]).sum::<f64>() / 3.0 * pixels_per_metre
        });
        let half = |value: f64, at: f64| 1.0 / (1.0 + (value / at).powi(2));
        let weight = cosine * cosine * half(way, SHARP) * half(deviation, CERTAIN);
        (normal, if weight.is_finite() { weight as f32 } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use tessuto_core::camera::{Camera, Rect};
    use tessuto_core::image::Image;
    use tessuto_core::mesh::grid;
    use tessuto_core::video::Frame;

    /// A sheet with a print, lit less and less, whose right half the first frame does not show.
    fn scene() -> (Scene, Vec<Positions>, Texture) {
        let mut template = grid(6, 6, DVec2::splat(0.3), 0.5);
        template.uvs.iter_mut().for_each(|uv| *uv = *uv * 0.5 + DVec2::splat(0.25));
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 39.5, cy: 39.5, width: 80, height: 80 };
        let mut print = Texture::uniform(64, 64, [0.0; 3]);
        for (i, texel) in print.texels.iter_mut().enumerate() {
            let (x, y) = (i % 64, i / 64);
            *texel = if (x / 8 + y / 8) % 2 == 0 { [0.8, 0.5, 0.2, 1.0] } else { [0.2, 0.4, 0.7, 1.0] };
        }
        let rasterizer = Rasterizer::new(&template);
        let motion: Vec<Positions> = (0..4)
            .map(|n| template.positions.iter().map(|p| *p + DVec3::X * 0.004 * f64::from(n)).collect())
            .collect();
        let frames: Vec<Frame> = (0..4)
            .map(|n| {
                let mut rendering = Rendering::new();
                rasterizer.render(camera, &motion[n], &print, &mut rendering);
                let light = 1.0 - 0.15 * n as f32;
                let covered = |i: usize, c: &[f32; 4]| c[3] > 0.5 && (n > 0 || i % 80 < 40);
                let pixels = || rendering.rgba.iter().enumerate();
                let shade = |v: f32| srgb::encode(light * srgb::decode(v));
                let image = |channels, data| Image { width: 80, height: 80, channels, data };
                Frame {
                    rgb: image(3, pixels().flat_map(|(_, c)| [c[0], c[1], c[2]].map(shade)).collect()),
                    mask: image(1, pixels().map(|(i, c)| f32::from(covered(i, c))).collect()),
                }
            })
            .collect();
        let scene = Scene {
            name: String::new(),
            folder: std::path::PathBuf::new(),
            fps: 25.0,
            camera,
            crop: Rect { x0: 0, y0: 0, x1: 80, y1: 80 },
            poses: None,
            pose_unit: Default::default(),
            depths: None,
            more: Vec::new(),
            full_size: [80, 80],
            first_frame: 0,
            template,
            frames: frames.into(),
            known: Default::default(),
            truth: tessuto_core::scene::Truth::default(),
        };
        (scene, motion, print)
    }

    #[test]
    fn what_comes_into_view_is_printed_in_the_light_of_the_first_frame() {
        let (scene, motion, truth) = scene();
        let found = gather(&scene, &motion, None, 64).unwrap();
        let side = found.texture.width;
        assert_eq!((side, found.seen.size, found.seen.texels.len()), (128, 128, 128 * 128));
        let mut errors = [Vec::new(), Vec::new()];
        for (i, texel) in found.texture.texels.iter().enumerate() {
            let (x, y) = (i % side, i / side);
            // Inside of the cloth, away from the borders of the checks.
            let inner = |k: usize| (k / 2) % 8 > 1 && (k / 2) % 8 < 6 && (38..90).contains(&k);
            if inner(x) && inner(y) {
                let expected = truth.texels[y / 2 * 64 + x / 2];
                let worst = (0..3).map(|c| (texel[c] - expected[c]).abs()).fold(0.0, f32::max);
                errors[usize::from(x > 66)].push(worst);
            }
        }
        let mean = errors.map(|e| e.iter().sum::<f32>() / e.len() as f32);
        assert!(mean[0] < 0.03 && mean[1] < 0.05, "{mean:?}");
        // The left half was seen in all frames, the right one in all but the first.
        let seen = &found.seen.vertices;
        assert_eq!((seen[14], seen[16]), (4.0, 3.0), "{seen:?}");
        assert!(found.seen.texels[0] == 0.0 && found.seen.texels[64 * side + 64] > 0.0);
    }
}
