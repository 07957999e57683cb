//! The moving cloth, prepared for visibility tests.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use wide::f32x8;

use super::bvh::Bvh;
use super::horizon::{Horizon, SECTORS, Sectors, horizon};
use super::surface::SurfacePoint;
use tessuto_core::camera::Viewpoint;
use tessuto_core::mesh::{Mesh, Positions};

/// One triangle in one frame, on the side that the camera sees.
#[derive(Debug, Clone, Copy)]
struct Patch {
    normal: Vec3,
    tangent: Vec3,
    horizon: Horizon,
}

/// All frames' triangles, with what decides which directions the cloth itself blocks.
#[derive(Debug, Clone)]
pub struct Geometry {
    triangle_count: usize,
    trees: Vec<Bvh>,
    /// Where every frame is seen from `[m]`, shape `[N]`.
    eyes: Vec<Vec3>,
    /// Shape [N · T].
    patches: Vec<Patch>,
}

impl Geometry {
    /// The triangles of `mesh` with vertices at `motion` `[m]`, shape [N, V], seen by a camera at the origin.
    pub fn new(mesh: &Mesh, motion: &[Positions]) -> Self {
        Self::seen_from(mesh, motion, &vec![DVec3::ZERO; motion.len()])
    }

    /// The same, every frame as one of the `views` sees it, shape `[N]`.
    pub fn seen(mesh: &Mesh, motion: &[Positions], views: &[Viewpoint]) -> Self {
        assert_eq!(motion.len(), views.len(), "a view for every frame");
        Self::seen_from(mesh, motion, &views.iter().map(Viewpoint::eye).collect::<Vec<_>>())
    }

    fn seen_from(mesh: &Mesh, motion: &[Positions], eyes: &[DVec3]) -> Self {
        let triangles = mesh.triangles();
        let sectors = Sectors::new();
        let frames: Vec<(Bvh, Vec<Patch>)> = motion
            .par_iter()
            .zip(eyes)
            .map(|(positions, eye)| {
                let bvh = Bvh::new(&triangles, positions);
                let patches = (0..triangles.len() as u32)
                    .map(|t| patch(&sectors, &triangles, (positions, *eye), &bvh, t))
                    .collect();
                (bvh, patches)
            })
            .collect();
        let (trees, patches): (Vec<_>, Vec<_>) = frames.into_iter().unzip();
        let eyes = eyes.iter().map(|eye| eye.as_vec3()).collect();
        Self { triangle_count: triangles.len(), trees, eyes, patches: patches.concat() }
    }

    /// The same, with every ray traced: slow, to prove that horizons change nothing.
    pub fn without_horizons(mut self) -> Self {
        self.patches.iter_mut().for_each(|p| p.horizon = [f32::INFINITY; SECTORS]);
        self
    }

    /// Unit normal of a patch (frame · number of triangles + triangle), on the side that the camera sees.
    pub fn normal(&self, patch: usize) -> Vec3 {
        self.patches[patch].normal
    }

    /// From the eye that its frame is seen from to `point` `[m]`.
    pub(super) fn offset(&self, point: &SurfacePoint) -> Vec3 {
        point.position - self.eyes[point.patch as usize / self.triangle_count]
    }

    /// Unit vector from `point` to that eye.
    pub fn to_viewer(&self, point: &SurfacePoint) -> Vec3 {
        -self.offset(point).normalize()
    }

    /// Which of eight unit `directions` from `point`, those with `wanted` set, reach the light: in front of the
    /// triangle, and not blocked by another. `set` holds several times eight directions; all those that lie
    /// below the horizon are traced together. Clears `wanted` where not.
    #[inline]
    pub(super) fn keep_visible<const N: usize>(
        &self,
        point: &SurfacePoint,
        directions: &[[f32x8; 3]; N],
        wanted: &mut [f32x8; N],
    ) {
        let patch = &self.patches[point.patch as usize];
        let bitangent = patch.normal.cross(patch.tangent);
        let axes = [patch.tangent, bitangent, patch.normal].map(|a| a.to_array().map(f32x8::splat));
        let mut doubtful = [0u32; N];
        for n in 0..N {
            let d = &directions[n];
            let [x, y, z] = [0, 1, 2].map(|k| axes[k][0] * d[0] + axes[k][1] * d[1] + axes[k][2] * d[2]);
            wanted[n] &= z.simd_gt(f32x8::ZERO);
            // The pseudo-angle, as in `horizon`.
            let s = y / (x.abs() + y.abs()).fast_max(f32x8::splat(1e-12));
            let right = y.simd_lt(f32x8::ZERO).select(s + f32x8::splat(4.0), s);
            let angle = x.simd_lt(f32x8::ZERO).select(f32x8::splat(2.0) - s, right);
            let sectors = (angle * f32x8::splat(SECTORS as f32 / 4.0)).trunc_int().to_array();
            let slopes: [f32; 8] =
                std::array::from_fn(|k| patch.horizon[sectors[k].clamp(0, SECTORS as i32 - 1) as usize]);
            let clear = z.simd_gt(f32x8::from(slopes) * (x * x + y * y).sqrt());
            doubtful[n] = (wanted[n] & !clear).to_bitmask();
        }
        if doubtful.iter().any(|mask| *mask != 0) {
            self.trace(point, directions, wanted, doubtful);
        }
    }

    fn trace<const N: usize>(
        &self,
        point: &SurfacePoint,
        directions: &[[f32x8; 3]; N],
        wanted: &mut [f32x8; N],
        mut doubtful: [u32; N],
    ) {
        let frame = point.patch as usize / self.triangle_count;
        let own = (point.patch as usize - frame * self.triangle_count) as u32;
        let values: [[[f32; 8]; 3]; N] = directions.map(|d| d.map(f32x8::to_array));
        loop {
            // Pack what is left into one bundle of eight.
            let mut bundle = [[0.0f32; 8]; 3];
            let mut places = [(0usize, 0u32); 8];
            let mut active = [0.0f32; 8];
            let mut count = 0;
            for n in 0..N {
                while doubtful[n] != 0 && count < 8 {
                    let lane = doubtful[n].trailing_zeros();
                    doubtful[n] &= doubtful[n] - 1;
                    for axis in 0..3 {
                        bundle[axis][count] = values[n][axis][lane as usize];
                    }
                    active[count] = f32::from_bits(u32::MAX);
                    places[count] = (n, lane);
                    count += 1;
                }
            }
            if count == 0 {
                return;
            }
            let direction = bundle.map(f32x8::from);
            let blocked =
                self.trees[frame].blocked(point.position, own, &direction, f32x8::from(active)).to_bitmask();
            for (slot, (n, lane)) in places[..count].iter().enumerate() {
                if blocked >> slot & 1 == 1 {
                    let mut lanes = wanted[*n].to_array();
                    lanes[*lane as usize] = 0.0;
                    wanted[*n] = f32x8::from(lanes);
                }
            }
        }
    }
}

fn patch(
    sectors: &Sectors,
    triangles: &[[u32; 3]],
    (positions, eye): (&[DVec3], DVec3),
    bvh: &Bvh,
    t: u32,
) -> Patch {
    let [a, b, c] = triangles[t as usize].map(|v| positions[v as usize]);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let normal = if normal.dot(a - eye) > 0.0 { -normal } else { normal };
    let tangent = (b - a).normalize_or_zero();
    let horizon = horizon(sectors, triangles, positions, bvh, t, normal, tangent);
    Patch { normal: normal.as_vec3(), tangent: tangent.as_vec3(), horizon }
}
