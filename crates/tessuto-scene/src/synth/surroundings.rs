//! What a camera films around a sheet: a room, uneven light, noise. Synthetic scenes are black there unless that is
//! asked for; real ones never are.

use glam::DVec2;
use tessuto_core::parallel;

use super::texture::Lattice;
use tessuto_core::camera::{Camera, Viewpoint};
use tessuto_core::error::Result;
use tessuto_core::image::Image;
use tessuto_core::math::rng::Rng;
use tessuto_core::scene::Scene;

/// Standard deviation of the sensor's noise, sRGB in [0, 1]: that of a phone's video in a room.
const NOISE: f32 = 0.012;
/// Distance of the wall from the camera in the first frame `[m]`.
const WALL_DISTANCE: f64 = 2.2;
/// Where the floor begins [fraction of the height].
const FLOOR: f64 = 0.86;
/// sRGB colours of wall, skirting, floor, frame and picture on the wall.
const WALL: [f32; 3] = [0.36, 0.40, 0.45];
const SKIRTING: [f32; 3] = [0.86, 0.85, 0.82];
const BOARDS: [f32; 3] = [0.50, 0.37, 0.25];
const FRAME: [f32; 3] = [0.22, 0.16, 0.12];
const PICTURE: [f32; 3] = [0.45, 0.53, 0.58];
/// Places within a pixel, a power of two.
const WITHIN: usize = 16;
/// Random streams: of the room, and of frame n from the second on.
const STREAMS: [u64; 2] = [900, 1000];

/// The frames of `scene` with a room behind the sheet, as a camera records them: sRGB, shape [height, width, 3]
/// each, in order. The same `seed` makes the same frames.
///
/// # Errors
/// Those of reading the frames.
pub fn filmed(scene: &Scene, seed: u64) -> Result<Vec<Image>> {
    filmed_by(scene, seed, 0)
}

/// The same by camera `v`, which sees `scene` alone: each has noise of its own, in one room.
///
/// # Errors
/// Those of reading the frames.
pub fn filmed_by(scene: &Scene, seed: u64, v: usize) -> Result<Vec<Image>> {
    let room = Room::new(scene.camera, seed);
    let still = room.seen_from(&Viewpoint::from(scene.camera));
    parallel::try_map(scene.frames.len(), |n| {
        let moved = scene.poses.as_ref().map(|_| room.seen_from(&scene.viewpoint(n)));
        let room = moved.as_ref().unwrap_or(&still);
        let frame = scene.frames.frame(n)?;
        let mut rng = Rng::new(seed, STREAMS[1] + (v * scene.frames.len() + n) as u64);
        let mut image = frame.rgb.clone();
        for (k, value) in image.data.iter_mut().enumerate() {
            // The colours of the sheet are weighted with its coverage already.
            let behind = (1.0 - frame.mask.data[k / 3]) * room.data[k];
            *value = (*value + behind + NOISE * rng.normal() as f32).clamp(0.0, 1.0);
        }
        Ok(image)
    })
}

/// A plastered wall with a picture, a skirting board and a floor of boards, lit from one side; described by where each
/// of its points is in the first frame's image.
struct Room {
    /// In the first frame, at the world's origin.
    camera: Camera,
    octaves: [(Lattice, f64); 3],
    grain: Lattice,
}

impl Room {
    fn new(camera: Camera, seed: u64) -> Self {
        let mut rng = Rng::new(seed, STREAMS[0]);
        let octaves =
            [(5, 0.5), (37, 0.3), (151, 0.2)].map(|(n, weight)| (Lattice::new(n, &mut rng), weight));
        Self { camera, octaves, grain: Lattice::new(90, &mut rng) }
    }

    /// Pixels are means over their area: an edge of the room moves evenly through the image, not by whole pixels.
    fn seen_from(&self, view: &Viewpoint) -> Image {
        let (width, height) = (self.camera.width, self.camera.height);
        let mut image = Image::new(width, height, 3);
        for y in 0..height {
            for x in 0..width {
                let pixel = image.pixel_mut(x, y);
                for k in 0..WITHIN {
                    let at = DVec2::new(x as f64, y as f64) + within(k);
                    let colour = self.colour(view, at);
                    (0..3).for_each(|c| pixel[c] += colour[c] / WITHIN as f32);
                }
            }
        }
        image
    }

    fn colour(&self, view: &Viewpoint, p_pixel: DVec2) -> [f32; 3] {
        let (width, height) = (self.camera.width as f64, self.camera.height as f64);
        let first = match view.camera_from_world {
            None => p_pixel,
            Some(_) => self.in_first_frame(view, p_pixel),
        };
        let (u, v) = ((first.x + 0.5) / width, (first.y + 0.5) / height);
        // What the first frame does not show continues it.
        let [s, t] = [u, v].map(|t| if (0.0..1.0).contains(&t) { t } else { mirrored(t) });
        let plaster: f64 = self.octaves.iter().map(|(lattice, weight)| weight * lattice.at(s, t)).sum();
        let (colour, shade) = surface(u, v, plaster, &self.grain);
        let light = 1.0 - 0.30 * s + 0.08 * (1.0 - t);
        colour.map(|c| (c * (shade * light) as f32).clamp(0.0, 1.0))
    }

    /// Where the first frame shows what `view` has at `p_pixel`: a point of the wall, or of the floor before it.
    fn in_first_frame(&self, view: &Viewpoint, p_pixel: DVec2) -> DVec2 {
        let (eye, ray) = (view.eye(), view.ray(p_pixel));
        let edge = FLOOR * self.camera.height as f64 - 0.5;
        let floor = WALL_DISTANCE * (edge - self.camera.cy) / self.camera.fy;
        let at_wall = (WALL_DISTANCE - eye.z) / ray.z;
        let at_floor = if ray.y > 0.0 { (floor - eye.y) / ray.y } else { f64::INFINITY };
        let far = if at_wall > 0.0 { at_wall.min(at_floor) } else { at_floor };
        self.camera.project(eye + ray * far.min(1e3))
    }
}

/// Place `k` within a pixel, from its centre `[px]`: no two share a row or a column (J. Hammersley, 1960).
fn within(k: usize) -> DVec2 {
    let reversed = (0..WITHIN.ilog2()).fold(0, |sum, bit| 2 * sum + (k >> bit & 1));
    let along = |k: usize| (k as f64 + 0.5) / WITHIN as f64 - 0.5;
    DVec2::new(along(k), along(reversed))
}

/// A place beyond [0, 1) as of an image that goes on as its mirror image.
fn mirrored(t: f64) -> f64 {
    let t = t.rem_euclid(2.0);
    (if t < 1.0 { t } else { 2.0 - t }).min(1.0 - 1e-9)
}

/// Colour of what is at (u, v) of the image, in [0, 1], and how bright it is.
fn surface(u: f64, v: f64, plaster: f64, grain: &Lattice) -> ([f32; 3], f64) {
    let inside =
        |[left, right, top, bottom]: [f64; 4]| (left..right).contains(&u) && (top..bottom).contains(&v);
    if v >= FLOOR {
        // Boards run away from the camera; their joints are dark.
        let board = (u - 0.5) / (v - 0.6) * 3.0;
        let joint = if board.rem_euclid(1.0) < 0.04 { 0.6 } else { 1.0 };
        return (
            BOARDS,
            joint * (0.75 + 0.4 * grain.at((board * 0.13).rem_euclid(1.0), (7.0 * v).rem_euclid(1.0))),
        );
    }
    if v >= FLOOR - 0.035 {
        return (SKIRTING, 0.9 + 0.1 * plaster);
    }
    match [[0.03, 0.16, 0.10, 0.40], [0.04, 0.15, 0.11, 0.39]].map(inside) {
        [_, true] => (PICTURE, 0.6 + 0.8 * plaster),
        [true, false] => (FRAME, 1.0),
        _ => (WALL, 0.82 + 0.3 * plaster),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::{Mover, Settings, make};

    #[test]
    fn the_sheet_stays_and_around_it_nothing_is_black() {
        let settings = Settings::default().with(|s| {
            (s.frames, s.size, s.grid, s.mover) = (2, 64, [5, 5], Mover::Paper);
        });
        let scene = make(&settings).unwrap();
        let frames = filmed(&scene, 3).unwrap();
        assert_eq!(frames, filmed(&scene, 3).unwrap());
        assert_ne!(frames[0], filmed(&scene, 4).unwrap()[0]);
        let plain = scene.frames.frame(1).unwrap();
        let (mut outside, mut noise, mut count) = (1f32, 0f64, 0);
        for (k, value) in frames[1].data.iter().enumerate() {
            match plain.mask.data[k / 3] {
                0.0 => outside = outside.min(*value),
                m if m >= 1.0 && (0.1..0.9).contains(&plain.rgb.data[k]) => {
                    noise += f64::from(value - plain.rgb.data[k]).powi(2);
                    count += 1;
                }
                _ => {}
            }
        }
        let deviation = (noise / f64::from(count)).sqrt();
        assert!(outside > 0.02 && (deviation / f64::from(NOISE) - 1.0).abs() < 0.2, "{outside} {deviation}");
    }
}
