//! The outline of a fabric on a table, against the one that was drawn.

use glam::{DVec2, DVec3};
use tessuto::mesh::{boundary_edges, edge_uses, pieces};
use tessuto::template::table::{FromOutline, Plane, PlaneFrom, Side, from_outline};
use tessuto::{Camera, Image, Mesh};

use super::shapes::{Shape, Table, camera, drawn, lying, ring, round, shirt};

const WIDTH: usize = 640;

fn mask_of(shape: &Shape, table: &Table, camera: Camera) -> Image {
    drawn(&shape.mesh, &lying(shape, table), camera).1
}

fn made(mask: &Image, plane: PlaneFrom, side: f64) -> (FromOutline, Vec<String>) {
    let mut lines = Vec::new();
    let made =
        from_outline(&camera(mask.width), (mask, "mask_000.png"), plane, Side::Length(side), &mut |line| {
            lines.push(line);
        });
    (made.unwrap(), lines)
}

/// Distance of a point to the nearest of the closed lines.
fn distance(p: DVec2, lines: &[Vec<DVec2>]) -> f64 {
    let to = |a: DVec2, b: DVec2| {
        p.distance(a.lerp(b, ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0)))
    };
    let of = |line: &Vec<DVec2>| {
        (0..line.len()).map(|k| to(line[k], line[(k + 1) % line.len()])).fold(f64::INFINITY, f64::min)
    };
    lines.iter().map(of).fold(f64::INFINITY, f64::min)
}

/// Points of closed lines, a millimetre apart.
fn along(lines: &[Vec<DVec2>]) -> Vec<DVec2> {
    let of = |a: DVec2, b: DVec2| {
        let n = (a.distance(b) / 1e-3).ceil() as usize;
        (0..n).map(move |j| a.lerp(b, j as f64 / n as f64))
    };
    lines
        .iter()
        .flat_map(|line| (0..line.len()).flat_map(move |k| of(line[k], line[(k + 1) % line.len()])))
        .collect()
}

/// Mean and largest distance [m] between the true outlines and the mesh's border on the true table, both ways.
fn errors(mesh: &Mesh, shape: &Shape, table: &Table) -> [f64; 2] {
    let flat = |v: u32| {
        let p: DVec3 = table.within(mesh.positions[v as usize]);
        p.truncate()
    };
    let border: Vec<Vec<DVec2>> = boundary_edges(mesh).iter().map(|e| e.map(flat).to_vec()).collect();
    let off: Vec<f64> = along(&border)
        .iter()
        .map(|p| distance(*p, &shape.outlines))
        .chain(along(&shape.outlines).iter().map(|p| distance(*p, &border)))
        .collect();
    [off.iter().sum::<f64>() / off.len() as f64, off.iter().copied().fold(0.0, f64::max)]
}

/// Whether the mesh is a flat sheet of good triangles, all wound alike, with texture coordinates of one scale.
fn check(made: &FromOutline, smallest: f64) {
    let mesh = &made.mesh;
    assert_eq!(pieces(mesh).len(), 1);
    assert!(edge_uses(mesh).values().all(|uses| uses.ascending < 2 && uses.descending < 2));
    let Plane { point, normal } = made.plane.plane;
    assert!(mesh.positions.iter().all(|p| (*p - point).dot(normal).abs() < 1e-9));
    let mut scale = None;
    for face in &mesh.faces {
        let [a, b, c] = [0, 1, 2].map(|k| mesh.positions[face.vertices[k] as usize]);
        assert!((b - a).cross(c - a).dot(normal) > 0.0, "faces look at the camera");
        let [ta, tb, tc] = [0, 1, 2].map(|k| mesh.uvs[face.uvs[k] as usize]);
        for (length, texture) in [(a.distance(b), ta.distance(tb)), (b.distance(c), tb.distance(tc))] {
            let first = *scale.get_or_insert(texture / length);
            assert!((texture / length / first - 1.0).abs() < 1e-6);
        }
    }
    let (low, high) = mesh.uvs.iter().fold((DVec2::ONE, DVec2::ZERO), |(l, h), t| (l.min(*t), h.max(*t)));
    assert!(low.min_element() >= 0.0 && high.max_element() <= 1.0 && (high - low).max_element() > 0.99);
    assert!(made.smallest_angle.to_degrees() > smallest, "{}", made.smallest_angle.to_degrees());
}

#[test]
fn shirts_round_cloths_and_rings_are_found_to_half_a_millimetre() {
    let table = Table::tilted();
    for (name, shape, side, corners, smallest) in [
        ("shirt", shirt(), 0.03, 10..=12, 18.0),
        ("round", round(), 0.025, 0..=0, 22.0),
        ("ring", ring(), 0.025, 0..=0, 20.0),
    ] {
        let mask = mask_of(&shape, &table, camera(WIDTH));
        let binary = Image {
            data: mask.data.iter().map(|v| f32::from(u8::from(*v >= 0.5))).collect(),
            ..mask.clone()
        };
        for (kind, mask, [mean, most]) in
            [("soft", &mask, [0.3e-3, 3e-3]), ("binary", &binary, [0.5e-3, 3e-3])]
        {
            let (made, lines) = made(mask, PlaneFrom::Given(table.plane()), side);
            let found = errors(&made.mesh, &shape, &table);
            let area = made.mesh.area() / shape.mesh.area();
            println!(
                "{name}, {kind}: {:.3} mm in the mean, {:.2} mm at most, area {area:.4}, {} vertices, {:.1}°",
                1e3 * found[0],
                1e3 * found[1],
                made.mesh.positions.len(),
                made.smallest_angle.to_degrees()
            );
            check(&made, smallest);
            assert!(found[0] < mean && found[1] < most, "{name}: {found:?}");
            assert!((area - 1.0).abs() < 0.01, "{name}: {area}");
            assert_eq!(made.holes, shape.outlines.len() - 1);
            let line = lines.iter().find(|line| line.starts_with("outline of")).unwrap();
            let found: usize =
                line.split("with ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
            assert!(corners.contains(&found), "{name}, {kind}: {line}");
            assert_eq!(lines.iter().filter(|line| line.contains("treated as one sheet")).count(), 1);
        }
    }
}

#[test]
fn a_sheet_of_paper_says_where_the_table_is() {
    let (table, shape) = (Table::tilted(), round());
    let camera = camera(WIDTH);
    let mask = mask_of(&shape, &table, camera);
    let size = DVec2::new(0.297, 0.21);
    let mut rng = tessuto::math::rng::Rng::new(3, 0);
    let mut within = 0;
    for _ in 0..10 {
        let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|c| {
            let p = DVec2::from_array(c) * size + DVec2::new(0.31, 0.18);
            camera.project(table.at(p.extend(0.0))) + DVec2::new(rng.normal(), rng.normal()) * 0.7
        });
        let (made, _) = made(&mask, PlaneFrom::Paper { size, corners }, 0.03);
        let length = (made.mesh.area() / shape.mesh.area()).sqrt() - 1.0;
        let deviation = made.plane.length_deviation.unwrap();
        println!("lengths off by {:.2} %, ± {:.2} % expected", 100.0 * length, 100.0 * deviation);
        within += usize::from(length.abs() < 2.0 * deviation);
        assert!(length.abs() < 0.08);
    }
    assert!(within >= 8, "{within} of 10 within two deviations");
}

#[test]
fn masks_and_planes_of_no_use_say_what_to_do() {
    let (table, shape) = (Table::tilted(), ring());
    let camera = camera(WIDTH);
    let mask = mask_of(&shape, &table, camera);
    let refused = |mask: &Image, plane: PlaneFrom, side: Side| {
        let made = from_outline(&camera, (mask, "mask_000.png"), plane, side, &mut |_| ());
        made.map(|made| made.side).unwrap_err().to_string()
    };
    let given = PlaneFrom::Given(table.plane());
    let count = refused(&mask, given, Side::Length(0.001));
    assert!(count.contains("16 to 4000 are possible") && count.contains("400 vertices are usual"), "{count}");
    let hole = refused(&mask, given, Side::Length(0.2));
    assert!(hole.contains("too small for the mesh") || hole.contains("16 to 4000"), "{hole}");
    let level = Plane::new(DVec3::new(0.0, 0.05, 1.0), DVec3::new(0.0, -1.0, 0.02)).unwrap();
    let edge_on = refused(&mask, PlaneFrom::Given(level), Side::Longer(20));
    assert!(edge_on.contains("edge-on") || edge_on.contains("horizon"), "{edge_on}");
    let mut cut = mask.clone();
    (0..90).for_each(|x| (235..245).for_each(|y| cut.pixel_mut(x, y)[0] = 1.0));
    assert!(refused(&cut, given, Side::Longer(20)).contains("pieces"), "a strip beside it");
    (0..320).for_each(|x| (200..245).for_each(|y| cut.pixel_mut(x, y)[0] = 1.0));
    assert!(refused(&cut, given, Side::Longer(20)).contains("touches the border of the image"));
}

#[test]
fn the_same_mesh_for_any_number_of_threads() {
    let (table, shape) = (Table::tilted(), shirt());
    let mask = mask_of(&shape, &table, camera(320));
    let meshes = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| made(&mask, PlaneFrom::Given(table.plane()), 0.03).0.mesh)
    });
    assert_eq!(meshes[0], meshes[1]);
}
