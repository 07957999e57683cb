//! The rasteriser written plainly: every pixel against every triangle, f64 throughout. It defines what
//! the fast one has to return, and finite differences of it are what the adjoint has to return.

use glam::{DVec2, DVec3};

use super::{NEAR, Rasterizer};
use tessuto_core::camera::{Camera, Viewpoint};

/// Texture with f64 texels; see [`super::Texture`].
#[derive(Debug, Clone)]
pub struct PlainTexture {
    /// Width `[texel]`.
    pub width: usize,
    /// Height `[texel]`.
    pub height: usize,
    /// Red, green, blue and 1.0, shape [height, width].
    pub texels: Vec<[f64; 4]>,
}

/// See [`super::Rendering`].
#[derive(Debug, Clone)]
pub struct PlainRendering {
    /// Triangle of each pixel.
    pub triangle: Vec<Option<usize>>,
    /// Number of triangles over each pixel centre.
    pub hits: Vec<usize>,
    /// Depth z `[m]` of each pixel, 0 where there is no triangle.
    pub depth: Vec<f64>,
    /// Antialiased colour and coverage of each pixel.
    pub rgba: Vec<[f64; 4]>,
}

/// Rows of M⁻¹ times det M, and det M, of triangle `t`; `None` if it is not drawn.
fn inverse(rasterizer: &Rasterizer, positions: &[DVec3], t: usize) -> Option<([DVec3; 3], f64)> {
    let [a, b, c] = rasterizer.triangles()[t].map(|v| positions[v as usize]);
    let det = a.dot((b - a).cross(c - a));
    let drawn = a.z.min(b.z).min(c.z) > NEAR && det != 0.0;
    drawn.then(|| ([b.cross(c), c.cross(a), a.cross(b)], det))
}

/// n·r times the sign of det, and whether that is inside the edge.
fn side(n: DVec3, det: f64, r: DVec3) -> (f64, bool) {
    let m = n * det.signum();
    let e = m.x * r.x + (m.y * r.y + m.z);
    let owned = m.x > 0.0 || (m.x == 0.0 && (m.y > 0.0 || (m.y == 0.0 && m.z > 0.0)));
    (e, e > 0.0 || (e == 0.0 && owned))
}

fn bilinear(texture: &PlainTexture, uv: DVec2) -> [f64; 4] {
    let x = (uv.x * texture.width as f64 - 0.5).clamp(0.0, (texture.width - 1) as f64);
    let y = ((1.0 - uv.y) * texture.height as f64 - 0.5).clamp(0.0, (texture.height - 1) as f64);
    let (x0, y0) = (x.floor() as usize, y.floor() as usize);
    let (x1, y1) = ((x0 + 1).min(texture.width - 1), (y0 + 1).min(texture.height - 1));
    let (fx, fy) = (x - x0 as f64, y - y0 as f64);
    let texel = |x: usize, y: usize, c: usize| texture.texels[y * texture.width + x][c];
    std::array::from_fn(|c| {
        (texel(x0, y0, c) * (1.0 - fx) + texel(x1, y0, c) * fx) * (1.0 - fy)
            + (texel(x0, y1, c) * (1.0 - fx) + texel(x1, y1, c) * fx) * fy
    })
}

/// The image of `rasterizer`'s mesh at `positions` `[m]` as `view` sees it.
pub fn render(
    rasterizer: &Rasterizer,
    view: impl Into<Viewpoint>,
    positions: &[DVec3],
    texture: &PlainTexture,
) -> PlainRendering {
    let view = view.into();
    let (camera, positions) = (&view.camera, &view.all_in_camera(positions)[..]);
    let (w, h) = (camera.width, camera.height);
    let mut out = PlainRendering {
        triangle: vec![None; w * h],
        hits: vec![0; w * h],
        depth: vec![0.0; w * h],
        rgba: vec![[0.0; 4]; w * h],
    };
    let mut nearest = vec![0.0; w * h];
    for t in 0..rasterizer.triangles().len() {
        let Some((n, det)) = inverse(rasterizer, positions, t) else { continue };
        let [a, b, c] = rasterizer.triangles()[t].map(|v| positions[v as usize]);
        let uvs = rasterizer.triangle_uvs()[t].map(|u| rasterizer.uvs()[u as usize]);
        for (pixel, nearest) in nearest.iter_mut().enumerate() {
            let r = ray(camera, pixel);
            if !n.iter().all(|&n| side(n, det, r).1) {
                continue;
            }
            out.hits[pixel] += 1;
            let s = (b - a).cross(c - a).dot(r) / det;
            if s > *nearest {
                *nearest = s;
                out.triangle[pixel] = Some(t);
                out.depth[pixel] = 1.0 / s;
                let uv = (0..3).map(|k| uvs[k] * (n[k].dot(r) / det / s)).sum();
                out.rgba[pixel] = match rasterizer.back {
                    Some((front, back)) if f64::from(front.sign()) != det.signum() => {
                        [back[0].into(), back[1].into(), back[2].into(), 1.0]
                    }
                    _ => bilinear(texture, uv),
                };
            }
        }
    }
    antialias(rasterizer, camera, positions, &nearest, &mut out);
    out
}

fn ray(camera: &Camera, pixel: usize) -> DVec3 {
    camera.ray(DVec2::new((pixel % camera.width) as f64, (pixel / camera.width) as f64))
}

/// Blends as described in `silhouette.rs`.
fn antialias(
    rasterizer: &Rasterizer,
    camera: &Camera,
    positions: &[DVec3],
    nearest: &[f64],
    out: &mut PlainRendering,
) {
    let unblended = out.rgba.clone();
    for p in 0..nearest.len() {
        let right = (p % camera.width + 1 < camera.width).then_some((p + 1, true));
        let below = (p + camera.width < nearest.len()).then_some((p + camera.width, false));
        for (q, horizontal) in [right, below].into_iter().flatten() {
            if out.triangle[p] == out.triangle[q] {
                continue;
            }
            let (occluder, other) = if nearest[p] >= nearest[q] { (p, q) } else { (q, p) };
            let rays = [ray(camera, occluder), ray(camera, other)];
            let (start, target) = (out.triangle[occluder].expect("nearer"), out.triangle[other]);
            let Some((n, d)) = crossing(rasterizer, positions, start, target, rays) else { continue };
            if ((n.x / camera.fx).abs() > (n.y / camera.fy).abs()) != horizontal {
                continue;
            }
            let (to, from) = if d > 0.5 { (other, occluder) } else { (occluder, other) };
            if rasterizer.one_sided && out.triangle[to].is_none() {
                continue;
            }
            for (c, out) in out.rgba[to].iter_mut().enumerate() {
                *out += (d - 0.5).abs() * (unblended[from][c] - unblended[to][c]);
            }
        }
    }
}

/// Plane of the silhouette edge between two rays, and where it lies between them.
fn crossing(
    rasterizer: &Rasterizer,
    positions: &[DVec3],
    start: usize,
    target: Option<usize>,
    [r0, r1]: [DVec3; 2],
) -> Option<(DVec3, f64)> {
    let across = |t: usize, k: usize| {
        Some(rasterizer.across[t][k].triangle as usize).filter(|&t| t != u32::MAX as usize)
    };
    // Two triangles that meet in an edge show its two sides unless the surface folds there.
    let smooth = |t: usize, k: usize| {
        let (n, det) = inverse(rasterizer, positions, t)?;
        let neighbour = across(t, k)?;
        inverse(rasterizer, positions, neighbour)?;
        let far_corner = rasterizer.triangles()[neighbour][rasterizer.across[t][k].corner as usize];
        (n[k].dot(positions[far_corner as usize]) * det < 0.0).then_some(neighbour)
    };
    if target.is_some() && (0..3).any(|k| smooth(start, k) == target) {
        return None;
    }
    let (mut t, mut from) = (start, None);
    for _ in 0..super::silhouette::MAX_STEPS {
        let (n, det) = inverse(rasterizer, positions, t)?;
        let exits = (0..3).filter(|&k| from.is_none() || across(t, k) != from).filter_map(|k| {
            let ((e0, _), (e1, inside)) = (side(n[k], det, r0), side(n[k], det, r1));
            (!inside && e0 > e1).then(|| (e0 / (e0 - e1), k))
        });
        let (d, k) = exits.min_by(|a, b| a.0.total_cmp(&b.0))?;
        match smooth(t, k) {
            None => return Some((n[k], d.clamp(0.0, 1.0))),
            next if next == target => return None,
            next => (t, from) = (next.expect("smooth"), Some(t)),
        }
    }
    None
}
