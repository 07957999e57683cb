//! What the camera sees of a sheet: colours, mask and depth measurements.

use glam::{DVec2, DVec3};

use super::occluder::Occluder;
use super::shade;
use tessuto_core::camera::{Camera, Viewpoint};
use tessuto_core::image::{Image, srgb};
use tessuto_core::mesh::Positions;
use tessuto_core::video::Frame;
use tessuto_render::raster::{Rasterizer, Rendering, Texture};

/// Images are drawn this much larger and averaged, so that fine texture does not alias.
const OVERSAMPLING: usize = 2;
/// Points that the made-up depth sensor sees in each frame.
const POINT_COUNT: usize = 4000;

/// The sheet, its light, the camera and what is in front.
pub struct Studio {
    /// Draws the sheet.
    pub rasterizer: Rasterizer,
    /// The camera.
    pub camera: Camera,
    /// The print.
    pub texture: Texture,
    /// How much darker the sheet is where it turns away from the light, in [0, 1].
    pub shading: f64,
    /// What moves in front of the sheet.
    pub occluders: Vec<Occluder>,
    /// Masks show the whole sheet.
    pub amodal: bool,
}

/// One exposure.
pub struct View {
    /// Colour, black around the sheet, and mask.
    pub frame: Frame,
    /// What the camera recorded: occluders keep their colour where they are in front of nothing. `None` if it is
    /// the same.
    pub filmed: Option<Image>,
    /// Points `[m]` of the world that a depth sensor at the camera would see of the sheet.
    pub points: Vec<DVec3>,
    /// Depth `[m]` of the sheet at half the image's size, NaN beside it.
    pub depth: Vec<f32>,
}

impl Studio {
    /// The sheet at `positions` `[m]`, `time` `[s]` after the first frame, seen by the camera where `from` is.
    pub fn view(
        &self,
        positions: &Positions,
        from: &Viewpoint,
        time: f64,
        rendering: &mut Rendering,
    ) -> View {
        let large = enlarged(&self.camera);
        let from = from.with_camera(large);
        self.rasterizer.render(from, positions, &self.texture, rendering);
        let [mut rgb, mut mask] = shade::shaded(&self.rasterizer, &from, positions, self.shading, rendering);
        let mut filmed = (!self.occluders.is_empty()).then(|| rgb.clone());
        for (i, alpha, colour) in self.occluders.iter().flat_map(|o| o.pixels(&large, time)) {
            let a = mask.data[i];
            // Where masks are amodal the occluder belongs to what they show.
            let shown = if self.amodal { alpha * a } else { 0.0 };
            for c in 0..3 {
                let over = |below: f32, alpha_shown: f32| (1.0 - alpha) * below + alpha_shown * colour[c];
                rgb.data[3 * i + c] = over(rgb.data[3 * i + c], shown);
                if let Some(filmed) = &mut filmed {
                    filmed.data[3 * i + c] = over(filmed.data[3 * i + c], alpha);
                }
            }
            if !self.amodal {
                mask.data[i] = (1.0 - alpha) * a;
            }
            if alpha > 0.5 {
                rendering.inverse_depth[i] = 0.0;
            }
        }
        let small = |image: Image| image.downsampled(OVERSAMPLING);
        View {
            frame: Frame { rgb: small(rgb), mask: small(mask) },
            filmed: filmed.map(small),
            points: seen_points(&from, rendering),
            depth: depth_map(rendering),
        }
    }
}

/// What a shutter that stays open sees: the mean of `views`, at least one, in linear light. The points are those of
/// the one in the middle.
pub fn exposed(views: impl ExactSizeIterator<Item = View>) -> View {
    let count = views.len();
    let mut views = views.enumerate();
    let (_, mut sum) = views.next().expect("an exposure has a view");
    if count == 1 {
        return sum;
    }
    let linear = |image: &mut Image| image.data.iter_mut().for_each(|v| *v = srgb::decode(*v));
    let images = |view: &mut View| {
        linear(&mut view.frame.rgb);
        view.filmed.iter_mut().for_each(linear);
    };
    images(&mut sum);
    let add = |to: &mut Image, from: &Image| to.data.iter_mut().zip(&from.data).for_each(|(a, b)| *a += b);
    for (k, mut view) in views {
        images(&mut view);
        add(&mut sum.frame.rgb, &view.frame.rgb);
        add(&mut sum.frame.mask, &view.frame.mask);
        if let (Some(to), Some(from)) = (&mut sum.filmed, &view.filmed) {
            add(to, from);
        }
        if k == count / 2 {
            (sum.points, sum.depth) = (view.points, view.depth);
        }
    }
    let scale = 1.0 / count as f32;
    let mean = |image: &mut Image| image.data.iter_mut().for_each(|v| *v = srgb::encode(*v * scale));
    mean(&mut sum.frame.rgb);
    sum.filmed.iter_mut().for_each(mean);
    sum.frame.mask.data.iter_mut().for_each(|v| *v *= scale);
    sum
}

/// The camera whose image, averaged over blocks, is that of `camera`.
fn enlarged(camera: &Camera) -> Camera {
    let s = OVERSAMPLING as f64;
    let centre = |c: f64| s * c + (s - 1.0) / 2.0;
    Camera {
        fx: s * camera.fx,
        fy: s * camera.fy,
        cx: centre(camera.cx),
        cy: centre(camera.cy),
        width: OVERSAMPLING * camera.width,
        height: OVERSAMPLING * camera.height,
    }
}

/// Depth where four times four pixels of the drawing meet, which is one of a map of half the image's size.
fn depth_map(rendering: &Rendering) -> Vec<f32> {
    let block = 2 * OVERSAMPLING;
    let (columns, rows) = (rendering.width / block, rendering.height / block);
    let at = |k: usize| {
        let corner = [k % columns, k / columns].map(|n| n * block + block / 2);
        // The four pixels around the middle: all of the sheet, or none is known.
        let around =
            [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| rendering.depth(corner[0] - i, corner[1] - j));
        around.iter().copied().sum::<Option<f64>>().map_or(f32::NAN, |sum| (0.25 * sum) as f32)
    };
    (0..columns * rows).map(at).collect()
}

/// Surface points `[m]` on a regular grid of pixels, as a depth sensor at the camera would see them.
fn seen_points(view: &Viewpoint, rendering: &Rendering) -> Vec<DVec3> {
    let covered = rendering.inverse_depth.iter().filter(|d| **d > 0.0).count();
    let spacing = (covered as f64 / POINT_COUNT as f64).sqrt().max(1.0);
    let chosen = |length: usize| {
        let count = (length as f64 / spacing) as usize;
        (0..count).map(move |k| ((k as f64 + 0.5) * spacing) as usize)
    };
    let mut points = Vec::with_capacity(POINT_COUNT);
    for y in chosen(rendering.height) {
        for x in chosen(rendering.width) {
            if let Some(depth) = rendering.depth(x, y) {
                points.push(view.eye() + view.ray(DVec2::new(x as f64, y as f64)) * depth);
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(value: f32) -> View {
        let image = |channels: usize, value: f32| Image {
            width: 1,
            height: 1,
            channels,
            data: vec![value; channels],
        };
        View {
            frame: Frame { rgb: image(3, value), mask: image(1, value) },
            filmed: Some(image(3, 0.5 * value)),
            points: vec![DVec3::splat(f64::from(value))],
            depth: Vec::new(),
        }
    }

    #[test]
    fn an_exposure_is_the_mean_in_linear_light() {
        let mean = exposed([0.2, 0.9, 0.4].map(view).into_iter());
        let expected = srgb::encode([0.2, 0.9, 0.4].map(srgb::decode).iter().sum::<f32>() / 3.0);
        assert!((mean.frame.rgb.data[2] - expected).abs() < 1e-6 && expected > 0.55);
        assert!((mean.frame.mask.data[0] - 0.5).abs() < 1e-6, "coverage is linear already");
        assert!(mean.points[0].x == f64::from(0.9f32), "the points are those at the frame's time");
        // Of the same it is the same.
        for value in [0.0, 0.01, 0.3, 1.0] {
            let mean = exposed((0..7).map(|_| view(value)));
            assert!((mean.frame.rgb.data[0] - value).abs() < 1e-6);
            assert!((mean.filmed.unwrap().data[1] - 0.5 * value).abs() < 1e-6);
        }
    }
}
