//! Made-up fabrics that lie on a tilted table, as the rasteriser shows them.
#![allow(dead_code, reason = "the tests of the library and of the program each use their own part")]

use std::f64::consts::TAU;

use tessuto::glam::{DMat3, DVec2, DVec3};
use tessuto::mesh::Face;
use tessuto::raster::{Rasterizer, Rendering, Texture};
use tessuto::template::table::Plane;
use tessuto::{Camera, Image, Mesh};

/// Curvature of the lifted side in the end [1/m].
const CURLED: f64 = 4.0;
/// Points along a circle.
const AROUND: usize = 360;

/// A flat fabric in its own plane `[m]`, rows downwards.
pub struct Shape {
    /// Closed lines: the outer one, then holes.
    pub outlines: Vec<Vec<DVec2>>,
    /// What is drawn, z = 0.
    pub mesh: Mesh,
}

/// A table: where points of its plane are in the camera's frame.
#[derive(Clone, Copy)]
pub struct Table {
    pub rotation: DMat3,
    pub origin: DVec3,
}

impl Table {
    /// 35° off the view, turned a little, about a metre away.
    pub fn tilted() -> Self {
        let rotation =
            DMat3::from_rotation_x(0.6) * DMat3::from_rotation_y(-0.12) * DMat3::from_rotation_z(0.2);
        Self { rotation, origin: DVec3::new(0.02, -0.01, 1.0) }
    }

    pub fn at(&self, p: DVec3) -> DVec3 {
        self.rotation * p + self.origin
    }

    /// In the table's axes.
    pub fn within(&self, p: DVec3) -> DVec3 {
        self.rotation.transpose() * (p - self.origin)
    }

    pub fn plane(&self) -> Plane {
        Plane::new(self.origin, self.rotation.z_axis).unwrap()
    }
}

/// The camera of images with this many columns.
pub fn camera(width: usize) -> Camera {
    let f = 0.95 * width as f64;
    let height = width * 3 / 4;
    let [cx, cy] = [width, height].map(|n| (n as f64 - 1.0) / 2.0);
    Camera { fx: f, fy: f, cx, cy, width, height }
}

/// Between an upper and a lower line with common columns: quads.
fn strips(columns: &[[DVec2; 2]]) -> (Vec<DVec2>, Vec<[u32; 4]>) {
    let points = columns.iter().flatten().copied().collect();
    let quads = (0..columns.len() as u32 - 1).map(|k| [2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2]).collect();
    (points, quads)
}

fn mesh(parts: Vec<(Vec<DVec2>, Vec<[u32; 4]>)>) -> Mesh {
    let mut mesh = Mesh { positions: Vec::new(), uvs: Vec::new(), faces: Vec::new() };
    for (points, quads) in parts {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(points.iter().map(|p| p.extend(0.0)));
        mesh.uvs.extend(points.iter().map(|p| DVec2::new(p.x + 0.5, 0.5 - p.y)));
        mesh.faces.extend(quads.iter().map(|q| {
            let corners: Vec<u32> = q.iter().map(|v| v + first).collect();
            Face { vertices: corners.clone(), uvs: corners }
        }));
    }
    mesh
}

/// A T-shirt of 86×69 cm: eleven corners and a round neck.
pub fn shirt() -> Shape {
    let neck = |x: f64| -0.25 - 0.08 * (x / 0.09).powi(2);
    let lerp = |a: [f64; 2], b: [f64; 2], n: usize| {
        (0..=n).map(move |k| DVec2::from_array(a).lerp(DVec2::from_array(b), k as f64 / n as f64))
    };
    let necks = (0..=24).map(|k| -0.09 + 0.18 * f64::from(k) / 24.0).map(|x| DVec2::new(x, neck(x)));
    let over = |top: Vec<DVec2>, bottom: &dyn Fn(f64) -> f64| {
        strips(&top.iter().map(|p| [*p, DVec2::new(p.x, bottom(p.x))]).collect::<Vec<_>>())
    };
    let sleeve = |x: f64| match x.abs() {
        a if a < 0.34 => -0.11 + (a - 0.25) / 0.09 * 0.08,
        a => -0.03 - (a - 0.34) / 0.09 * 0.10,
    };
    let hem = |_: f64| 0.36;
    let left: Vec<DVec2> = lerp([-0.43, -0.13], [-0.25, -0.29], 4).collect();
    let right: Vec<DVec2> = lerp([0.25, -0.29], [0.43, -0.13], 4).collect();
    let body: Vec<DVec2> = lerp([-0.25, -0.29], [-0.09, -0.33], 2)
        .take(2)
        .chain(necks.clone())
        .chain(lerp([0.09, -0.33], [0.25, -0.29], 2).skip(1))
        .collect();
    let corners = [[0.25, -0.29], [0.43, -0.13], [0.34, -0.03], [0.25, -0.11], [0.25, 0.36], [-0.25, 0.36]];
    let more = [[-0.25, -0.11], [-0.34, -0.03], [-0.43, -0.13], [-0.25, -0.29]];
    let outline = necks.chain(corners.into_iter().chain(more).map(DVec2::from_array)).collect();
    Shape {
        outlines: vec![outline],
        mesh: mesh(vec![over(left, &sleeve), over(body, &hem), over(right, &sleeve)]),
    }
}

fn circle(radius: f64) -> Vec<DVec2> {
    (0..AROUND).map(|k| DVec2::from_angle(TAU * k as f64 / AROUND as f64) * radius).collect()
}

/// Rings of quads between these radii, ascending.
pub fn rings(radii: &[f64]) -> Mesh {
    let around = |pair: &[f64]| {
        let at = |k: usize| DVec2::from_angle(-TAU * (k % AROUND) as f64 / AROUND as f64);
        strips(&(0..=AROUND).map(|k| [at(k) * pair[1], at(k) * pair[0]]).collect::<Vec<_>>())
    };
    mesh(radii.windows(2).map(around).collect())
}

/// A round cloth of 50 cm.
pub fn round() -> Shape {
    Shape {
        outlines: vec![circle(0.25)],
        mesh: rings(&(0..=25).map(|k| 0.01 * f64::from(k)).collect::<Vec<_>>()),
    }
}

/// The same with a hole of 16 cm.
pub fn ring() -> Shape {
    Shape { outlines: vec![circle(0.25), circle(0.08)], mesh: rings(&[0.08, 0.25]) }
}

/// Where a point of the flat cloth is at a time from 0 to 1: one side curls up along a cylinder, whose length
/// stays, while the whole is pulled aside.
pub fn lifted(p: DVec3, time: f64) -> DVec3 {
    let (curvature, from) = (CURLED * time, -0.05);
    let s = p.x - from;
    let (x, z) = match s > 0.0 && curvature > 1e-9 {
        true => (from + (curvature * s).sin() / curvature, -(1.0 - (curvature * s).cos()) / curvature),
        false => (p.x, 0.0),
    };
    DVec3::new(x - 0.03 * time, p.y + 0.02 * time, z)
}

/// A print with detail of all sizes.
pub fn texture() -> Texture {
    let side = 256;
    let mut image = Image::new(side, side, 3);
    for k in 0..side * side {
        let (x, y) = ((k % side) as f64 / side as f64, (k / side) as f64 / side as f64);
        let wave = |a: f64, b: f64, c: f64| (TAU * (a * x + b * y) + c).sin();
        let channels = [
            wave(3.0, 5.0, 0.3) + 0.6 * wave(17.0, -9.0, 1.0) + 0.4 * wave(31.0, 23.0, 0.0),
            wave(-4.0, 6.0, 2.0) + 0.6 * wave(11.0, 19.0, 0.5) + 0.4 * wave(-29.0, 27.0, 1.5),
            wave(7.0, 1.0, 1.1) + 0.6 * wave(-15.0, 13.0, 2.5) + 0.4 * wave(25.0, -33.0, 0.7),
        ];
        for (c, value) in channels.into_iter().enumerate() {
            image.data[3 * k + c] = (0.5 + 0.2 * value).clamp(0.05, 0.95) as f32;
        }
    }
    Texture::from_image(&image)
}

/// Colour and mask of `shape`'s mesh with vertices at `positions` `[m]`.
pub fn drawn(mesh: &Mesh, positions: &[DVec3], camera: Camera) -> (Image, Image) {
    let large = camera.magnified(2);
    let mut out = Rendering::new();
    Rasterizer::new(mesh).render(large, positions, &texture(), &mut out);
    let (mut rgb, mut mask) =
        (Image::new(large.width, large.height, 3), Image::new(large.width, large.height, 1));
    for (k, [r, g, b, a]) in out.rgba.iter().enumerate() {
        rgb.data[3 * k..3 * k + 3].copy_from_slice(&[*r, *g, *b]);
        mask.data[k] = *a;
    }
    (rgb.downsampled(2), mask.downsampled(2))
}

/// `shape` flat on the table.
pub fn lying(shape: &Shape, table: &Table) -> Vec<DVec3> {
    shape.mesh.positions.iter().map(|p| table.at(*p)).collect()
}
