//! The image of a check: masks and template drawn over the frames.

use glam::DVec2;

use tessuto_core::error::Result;
use tessuto_core::image::Image;
use tessuto_core::scene::Scene;
use tessuto_core::video::Frame;

const TEMPLATE: [f32; 3] = [0.0, 0.9, 1.0];
const OUTLINE: [f32; 3] = [1.0, 0.85, 0.0];

const GAP: f32 = 0.25;
/// Between two frames `[px]`.
const GAP_WIDTH: usize = 4;

/// What every camera shows, one below the other: the crops of the first, middle and last frame side by side, with the
/// outlines of their masks; the first with the edges of the template.
///
/// # Errors
/// Those of reading the frames.
pub(super) fn draw(scene: &Scene) -> Result<Image> {
    let rows = (0..scene.view_count()).map(|v| row(&scene.seen_by(v))).collect::<Result<Vec<_>>>()?;
    let width = rows.iter().map(|row| row.width).max().unwrap_or(1);
    let height = rows.iter().map(|row| row.height + GAP_WIDTH).sum::<usize>() - GAP_WIDTH;
    let mut sheet = Image::new(width, height, 3);
    sheet.data.fill(GAP);
    let mut top = 0;
    for row in &rows {
        for (y, pixels) in row.data.chunks_exact(3 * row.width).enumerate() {
            let start = 3 * (top + y) * width;
            sheet.data[start..start + pixels.len()].copy_from_slice(pixels);
        }
        top += row.height + GAP_WIDTH;
    }
    Ok(sheet)
}

/// What the only camera of `scene` shows.
fn row(scene: &Scene) -> Result<Image> {
    let last = scene.frames.len() - 1;
    let mut shown = vec![0, last / 2, last];
    shown.dedup();
    let mut images: Vec<Image> =
        shown.into_iter().map(|n| Ok(outlined(&*scene.frames.frame(n)?))).collect::<Result<_>>()?;
    let (mesh, view) = (&scene.template, scene.viewpoint(0));
    for edge in mesh.edges() {
        let ends = edge.map(|v| mesh.positions[v as usize]);
        if ends.iter().all(|p| view.depth(*p) > 0.0) {
            let [a, b] = ends.map(|p| view.project(p));
            line(&mut images[0], a, b);
        }
    }
    let (w, h) = (images[0].width, images[0].height);
    let mut sheet = Image::new(images.len() * (w + GAP_WIDTH) - GAP_WIDTH, h, 3);
    sheet.data.fill(GAP);
    for (k, image) in images.iter().enumerate() {
        for (y, row) in image.data.chunks_exact(3 * w).enumerate() {
            let start = 3 * (y * sheet.width + k * (w + GAP_WIDTH));
            sheet.data[start..start + 3 * w].copy_from_slice(row);
        }
    }
    Ok(sheet)
}

/// A frame with the outline of its mask.
fn outlined(frame: &Frame) -> Image {
    let mut image = frame.rgb.clone();
    let (w, h) = (image.width, image.height);
    let fabric = |x: usize, y: usize| frame.mask.pixel(x, y)[0] >= 0.5;
    for y in 0..h {
        for x in 0..w {
            // Fabric with a neighbour that is not fabric.
            let border =
                |dx: usize, dy: usize| x + dx < w && y + dy < h && fabric(x, y) != fabric(x + dx, y + dy);
            if border(1, 0) || border(0, 1) {
                image.pixel_mut(x, y).copy_from_slice(&OUTLINE);
            }
        }
    }
    image
}

/// A thin line between two points `[px]`, as far as it is inside the image.
fn line(image: &mut Image, a: DVec2, b: DVec2) {
    let size = DVec2::new(image.width as f64, image.height as f64);
    // The part of a + t (b − a) inside the image, so that a far end costs nothing.
    let (mut t0, mut t1) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        let (start, step) = (a[axis], b[axis] - a[axis]);
        if step == 0.0 {
            if start < -0.5 || start >= size[axis] - 0.5 {
                return;
            }
            continue;
        }
        let (u, v) = ((-0.5 - start) / step, (size[axis] - 0.5 - start) / step);
        (t0, t1) = (t0.max(u.min(v)), t1.min(u.max(v)));
    }
    if t0 > t1 {
        return;
    }
    let steps = ((b - a).abs().max_element() * (t1 - t0)).ceil() as usize + 1;
    for k in 0..=steps {
        let q = (a + (b - a) * (t0 + (t1 - t0) * k as f64 / steps as f64)).round();
        if q.x >= 0.0 && q.y >= 0.0 && q.x < size.x && q.y < size.y {
            image.pixel_mut(q.x as usize, q.y as usize).copy_from_slice(&TEMPLATE);
        }
    }
}
