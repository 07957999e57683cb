//! The sheet in front of itself: points that it hides, parts of its boundary that are not its outline, folds that
//! are, and how much of the image every triangle fills.

use glam::{DVec2, DVec3};

use super::outline_distance::OutlineDistance;
use super::pyramid::Level;
use super::samples::{EdgePoint, SurfaceSamples};
use super::silhouette::{FoldPoint, InnerEdge, beyond, explained_by, folds, inner};
use tessuto_core::camera::Viewpoint;
use tessuto_core::mesh::Side;
use tessuto_render::raster::{Rasterizer, Rendering, Texture};

/// The mesh, as far as it stays the same.
pub struct Sheet<'a> {
    /// Draws it.
    pub rasterizer: &'a Rasterizer,
    /// Points of its boundary.
    pub boundary: &'a [EdgePoint],
    /// Its other edges.
    pub edges: &'a [InnerEdge],
    /// Positions in the first frame `[m]`, shape `[V]`.
    pub first: &'a [DVec3],
    /// How the first frame is seen, at the resolution at which the mesh is drawn.
    pub first_view: &'a Viewpoint,
    /// Its front, where its sides differ.
    pub front: Option<Side>,
    /// The triangle of every point of its boundary.
    pub border: &'a [u32],
}

/// What a frame shows.
pub struct Shown<'a> {
    /// The frame at the resolution at which the mesh is drawn.
    pub level: &'a Level,
    /// Outline of its mask.
    pub outline: &'a OutlineDistance,
    /// How the frame is seen, in pixels of that.
    pub view: &'a Viewpoint,
}

/// What of a frame's mesh does not count, or counts less; held fixed while a step is taken.
#[derive(Debug, Clone, Default)]
pub struct Occlusion {
    /// Whether a surface point is hidden; empty if none is.
    pub hidden: Vec<bool>,
    /// Whether a boundary point is no outline; empty if all are.
    pub inner: Vec<bool>,
    /// Where the sheet turns away from the camera with nothing of it behind: outlines as well.
    pub folds: Vec<FoldPoint>,
    /// Area of every triangle in the image over that in the first frame, at most 1 unless motions are compared,
    /// shape `[T]`; empty: 1.
    pub shares: Vec<f64>,
    /// Number of pixels that mask or mesh cover alone, where that was asked for.
    pub uncovered: f64,
    /// Whether a boundary point that is no outline lies over the other side of the sheet; empty if none does, or both
    /// sides are alike.
    pub laid: Vec<bool>,
    /// Whether a triangle shows its back, shape `[T]`; empty where none does, or both sides are alike.
    pub turned: Vec<bool>,
}

impl Occlusion {
    /// Of the mesh at `x`; `samples` are points of it. What mask or mesh cover alone is counted where it is to be
    /// `compared`.
    pub fn new(sheet: &Sheet, shown: &Shown, samples: &SurfaceSamples, x: &[DVec3], compared: bool) -> Self {
        let view = &shown.level.view;
        let triangles = sheet.rasterizer.triangles();
        let shares = triangles.iter().map(|t| {
            let area = |view, x: &[DVec3]| area(view, t.map(|v| x[v as usize]));
            let (now, before) = (area(view, x), area(sheet.first_view, sheet.first));
            if now < before || compared && before > 0.0 { now / before } else { 1.0 }
        });
        let turned = sheet.front.map(|front| turned(front, triangles, view, x));
        let turned = turned.filter(|turned| turned.contains(&true)).unwrap_or_default();
        let mut out = Self { shares: shares.collect(), turned, ..Self::default() };
        let folded = turned_over(triangles, view, x);
        if !folded && !compared {
            return out;
        }
        let mut rendering = Rendering::new();
        sheet.rasterizer.render(view, x, &Texture::uniform(1, 1, [0.0; 3]), &mut rendering);
        if compared {
            out.uncovered = uncovered(&rendering, shown.level) as f64;
        }
        if folded {
            let front = |p: DVec2| front(&rendering, p);
            let hides = |triangle: u32, p: DVec3| {
                let other = |t: &u32| {
                    let corners = triangles[*t as usize];
                    !corners.iter().any(|v| triangles[triangle as usize].contains(v))
                };
                let before = |t: u32| {
                    let corners = triangles[t as usize].map(|v| view.offset(x[v as usize]));
                    is_before(corners, view.offset(p))
                };
                view.project_in_front(p).and_then(front).filter(other).is_some_and(before)
            };
            let hidden = samples.points.iter().map(|point| hides(point.triangle, samples.position(point, x)));
            out.hidden = hidden.collect();
            let seen = |p: DVec2| front(p).is_some();
            out.inner = inner(sheet.boundary, view, x, seen);
            out.folds = folds(sheet.edges, view, x, seen);
            explained_by(&out.folds, sheet.boundary, shown.outline, shown.view, x, &mut out.inner);
            if !out.turned.is_empty() {
                let laid = |(point, triangle): (&EdgePoint, &u32)| {
                    let under = front(beyond(point, view, x));
                    let other =
                        under.is_some_and(|t| out.turned[t as usize] != out.turned[*triangle as usize]);
                    other && !hides(*triangle, point.position(x))
                };
                out.laid = sheet.boundary.iter().zip(sheet.border).map(laid).collect();
            }
        }
        out
    }
}

/// The triangle in front at the pixel around `p`.
fn front(rendering: &Rendering, p: DVec2) -> Option<u32> {
    let at = p.round();
    let within =
        at.x >= 0.0 && at.y >= 0.0 && at.x < rendering.width as f64 && at.y < rendering.height as f64;
    let triangle = |()| rendering.triangle[at.y as usize * rendering.width + at.x as usize];
    within.then_some(()).map(triangle).filter(|t| *t != Rendering::NO_TRIANGLE)
}

/// Whether the plane of a triangle crosses the ray to `p` before it; one that is seen edge-on does. All seen from
/// the origin.
fn is_before([a, b, c]: [DVec3; 3], p: DVec3) -> bool {
    let normal = (b - a).cross(c - a);
    let part = normal.dot(a) / normal.dot(p);
    part < 1.0 || part.is_nan()
}

/// Number of pixels that only one of mask and mesh covers.
fn uncovered(rendering: &Rendering, level: &Level) -> usize {
    let (w, h) = (rendering.width, rendering.height);
    let alone = |k: &usize| {
        (rendering.triangle[*k] != Rendering::NO_TRIANGLE) != level.texel(*k % w, *k / w).is_some()
    };
    (0..w * h).filter(alone).count()
}

/// Area of a triangle in the image `[px]`; 0 of one that comes up to the camera.
fn area(view: &Viewpoint, corners: [DVec3; 3]) -> f64 {
    if corners.iter().any(|p| view.depth(*p) <= 0.0) {
        return 0.0;
    }
    let [a, b, c] = corners.map(|p| view.project(p));
    0.5 * (b - a).perp_dot(c - a).abs()
}

/// Whether each triangle shows the camera its back.
pub fn turned(front: Side, triangles: &[[u32; 3]], view: &Viewpoint, x: &[DVec3]) -> Vec<bool> {
    triangles.iter().map(|t| front.turned(view, t.map(|v| x[v as usize]))).collect()
}

/// Whether some triangles show the camera their other side: where none do, the sheet can hardly be in front of itself.
fn turned_over(triangles: &[[u32; 3]], view: &Viewpoint, x: &[DVec3]) -> bool {
    let mut sides = [false; 2];
    for t in triangles {
        let [a, b, c] = t.map(|v| x[v as usize]);
        if [a, b, c].iter().any(|p| view.depth(*p) <= 0.0) {
            continue;
        }
        let [a, b, c] = [a, b, c].map(|p| view.project(p));
        sides[usize::from((b - a).perp_dot(c - a) > 0.0)] = true;
    }
    sides == [true; 2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::observed::pyramid::pyramid;
    use crate::motion::observed::samples::boundary_points;
    use crate::motion::observed::silhouette::inner_edges;
    use tessuto_core::camera::{Camera, Pose};
    use tessuto_core::image::Image;
    use tessuto_core::math::rng::Rng;
    use tessuto_core::mesh::{Mesh, grid};
    use tessuto_core::video::Frame;
    use tessuto_sim::Cloth;

    /// Occlusion of a flat sheet of 400 × 200 mm whose part right of 80 mm is turned over, to lie in front of the
    /// rest by `nearer` `[m]`, or behind it, beside the mask of the left part; with its samples and boundary, and
    /// the flat positions.
    fn folded(nearer: f64) -> (Occlusion, Vec<DVec3>, Vec<DVec3>, Vec<[DVec3; 2]>) {
        let camera = Camera { fx: 300.0, fy: 300.0, cx: 79.5, cy: 79.5, width: 160, height: 160 };
        folded_before(nearer, camera, None)
    }

    /// The same before some `camera`, with a `pose` that the sheet is moved with.
    fn folded_before(
        nearer: f64,
        camera: Camera,
        pose: Option<Pose>,
    ) -> (Occlusion, Vec<DVec3>, Vec<DVec3>, Vec<[DVec3; 2]>) {
        let flat = grid(21, 11, DVec2::new(0.4, 0.2), 1.0).positions;
        let there = |p: DVec3| pose.map_or(p, |pose| pose.in_world(p));
        let mesh = grid(21, 11, DVec2::new(0.4, 0.2), 1.0);
        let mesh = Mesh { positions: flat.iter().map(|p| there(*p)).collect(), ..mesh };
        let view = Viewpoint { camera, camera_from_world: pose };
        let samples = SurfaceSamples::new(&mesh, &mesh.positions, &view, 1.0);
        let boundary = boundary_points(&mesh, &mesh.positions, &view, 2.0);
        let rasterizer = Rasterizer::new(&mesh);
        let edges = inner_edges(&mesh, &Cloth::new(&mesh));
        let first = &mesh.positions;
        let sheet = Sheet {
            rasterizer: &rasterizer,
            boundary: &boundary,
            edges: &edges,
            first,
            first_view: &view,
            front: None,
            border: &[],
        };
        let mut mask = Image::new(160, 160, 1);
        for (k, m) in mask.data.iter_mut().enumerate() {
            let [x, y] = [(k % 160) as f64, (k / 160) as f64].map(|p| (p - camera.cx) / camera.fx);
            *m = f32::from(x.abs() < 0.2 && x < 0.08 && y.abs() < 0.1);
        }
        let outline = OutlineDistance::new(&mask, 1);
        let level = pyramid(&Frame { rgb: Image::new(160, 160, 3), mask }, &view, [0, 0]).remove(0);
        let shown = Shown { level: &level, outline: &outline, view: &view };
        let of = |x: &[DVec3]| Occlusion::new(&sheet, &shown, &samples, x, true);
        let unfolded = of(first);
        assert!(unfolded.hidden.is_empty() && unfolded.inner.is_empty() && unfolded.folds.is_empty());
        assert!(unfolded.shares.iter().all(|share| (share - 1.0).abs() < 1e-12));
        // The right part: 36 × 60 px of the first camera.
        let right = 0.12 * 0.2 * camera.fx * camera.fx;
        assert!((unfolded.uncovered - right).abs() < 100.0, "{}", unfolded.uncovered);
        let fold = |p: &DVec3| if p.x > 0.08 { DVec3::new(0.16 - p.x, p.y, p.z - nearer) } else { *p };
        let x: Vec<DVec3> = flat.iter().map(|p| there(fold(p))).collect();
        let places = samples.points.iter().map(|point| samples.position(point, &flat)).collect();
        let ends = boundary.iter().map(|point| point.vertices.map(|v| flat[v as usize])).collect();
        (of(&x), flat, places, ends)
    }

    #[test]
    fn a_sheet_moved_with_its_camera_hides_the_same() {
        let pose = Pose::random(&mut Rng::new(1, 0));
        for nearer in [0.03, -0.03] {
            // Nothing lies exactly between two pixels, and no edge is a whole number of spacings long: rounding
            // decides nothing.
            let camera = Camera { fx: 293.0, fy: 293.0, cx: 79.73, cy: 79.73, width: 160, height: 160 };
            let [here, there] = [None, Some(pose)].map(|pose| folded_before(nearer, camera, pose).0);
            assert!(here.hidden.contains(&true) && here.hidden.contains(&false) && !here.folds.is_empty());
            // Except for points beside a triangle of their own plane, which is neither before nor behind them.
            let differ = |a: &[bool], b: &[bool]| a.iter().zip(b).filter(|(a, b)| a != b).count();
            let apart = [differ(&here.hidden, &there.hidden), differ(&here.inner, &there.inner)];
            let counts = [here.hidden.len(), here.inner.len()];
            assert_eq!(counts, [there.hidden.len(), there.inner.len()]);
            let length = |of: &Occlusion| of.folds.iter().map(|fold| fold.point.length).sum::<f64>();
            let lengths = [length(&here), length(&there)];
            println!("{apart:?} of {counts:?} differ, folds of {lengths:?} px");
            assert!(apart[0] * 1000 <= counts[0] && apart[1] * 100 <= counts[1]);
            assert!((lengths[0] / lengths[1] - 1.0).abs() < 0.01);
            assert!((here.uncovered - there.uncovered).abs() <= 2.0);
            let off = here.shares.iter().zip(&there.shares).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-9, "{off}");
        }
    }

    #[test]
    fn a_flap_hides_what_is_behind_it_and_its_edge_is_no_outline() {
        for nearer in [0.03, 1e-4] {
            let (folded, _, places, ends) = folded(nearer);
            for (p, hidden) in places.iter().zip(&folded.hidden) {
                // A margin of a cell about the edge of the flap and the fold.
                if (p.x + 0.04).abs() > 0.03 && (p.x - 0.08).abs() > 0.03 && p.y.abs() < 0.08 {
                    assert_eq!(*hidden, p.x > -0.04 && p.x < 0.08, "{p}, {nearer} m nearer");
                }
            }
            for ([a, b], inner) in ends.iter().zip(&folded.inner) {
                if a.x == b.x && a.y.abs() < 0.08 && b.y.abs() < 0.08 {
                    assert_eq!(*inner, a.x > 0.0, "{a} {b}");
                }
            }
            assert!(folded.inner.contains(&true) && folded.inner.contains(&false));
        }
    }

    #[test]
    fn a_flap_behind_is_hidden_and_its_fold_is_the_outline() {
        let (folded, first, places, ends) = folded(-1e-4);
        for (p, hidden) in places.iter().zip(&folded.hidden) {
            if (p.x - 0.08).abs() > 0.03 && (p.x - 0.2).abs() > 1e-3 && p.y.abs() < 0.08 {
                assert_eq!(*hidden, p.x > 0.08, "{p}");
            }
        }
        let right = ends.iter().zip(&folded.inner).filter(|([a, b], _)| a.x == b.x && a.x > 0.0);
        assert!(right.clone().count() > 10 && right.clone().all(|(_, inner)| *inner));
        // All along the fold, which is 60 px long; nothing else is one.
        let length: f64 = folded.folds.iter().map(|fold| fold.point.length).sum();
        assert!((length - 60.0).abs() < 3.0, "{length}");
        let x: Vec<f64> = folded.folds.iter().map(|fold| fold.point.position(&first).x).collect();
        assert!(x.iter().all(|x| (x - 0.08).abs() < 0.021), "{x:?}");
        assert!(folded.uncovered < 100.0, "{}", folded.uncovered);
    }

    #[test]
    fn what_turns_away_fills_less_of_the_image() {
        let camera = Camera { fx: 300.0, fy: 300.0, cx: 79.5, cy: 79.5, width: 160, height: 160 };
        let view = Viewpoint::from(camera);
        let flat = [DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.1, 0.0, 1.0), DVec3::new(0.0, 0.1, 1.0)];
        assert!((area(&view, flat) - 450.0).abs() < 1e-9);
        let edge_on = flat.map(|p| if p.x > 0.0 { DVec3::new(0.0, 0.0, 1.1) } else { p });
        assert!(area(&view, edge_on) < 1e-9);
        assert_eq!(area(&view, flat.map(|p| p - DVec3::Z)), 0.0);
    }

    #[test]
    fn where_motions_are_compared_a_nearer_sheet_fills_more_of_the_image() {
        let mesh = grid(3, 3, DVec2::splat(0.1), 1.0);
        let camera = Camera { fx: 300.0, fy: 300.0, cx: 79.5, cy: 79.5, width: 160, height: 160 };
        let view = Viewpoint::from(camera);
        let samples = SurfaceSamples::new(&mesh, &mesh.positions, &view, 1.0);
        let (rasterizer, first) = (Rasterizer::new(&mesh), &mesh.positions);
        let sheet = Sheet {
            rasterizer: &rasterizer,
            boundary: &[],
            edges: &[],
            first,
            first_view: &view,
            front: None,
            border: &[],
        };
        let frame = Frame { rgb: Image::new(160, 160, 3), mask: Image::new(160, 160, 1) };
        let outline = OutlineDistance::new(&frame.mask, 1);
        let level = pyramid(&frame, &view, [0, 0]).remove(0);
        let shown = Shown { level: &level, outline: &outline, view: &view };
        // Twice as near, and twice as far.
        for (part, alone, compared) in [(0.5, 1.0, 4.0), (2.0, 0.25, 0.25)] {
            let x: Vec<DVec3> = first.iter().map(|p| DVec3::new(p.x, p.y, part * p.z)).collect();
            for (compares, expected) in [(false, alone), (true, compared)] {
                let shares = Occlusion::new(&sheet, &shown, &samples, &x, compares).shares;
                assert!(
                    shares.iter().all(|share| (share - expected).abs() < 1e-9),
                    "{part} {compares}: {shares:?}"
                );
            }
        }
    }

    #[test]
    fn a_plane_is_before_what_lies_behind_it() {
        let near = [DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.1, 0.0, 1.0), DVec3::new(0.0, 0.1, 1.0)];
        assert!(is_before(near, DVec3::new(0.3, 0.2, 1.01)) && !is_before(near, DVec3::new(0.3, 0.2, 0.99)));
    }
}
