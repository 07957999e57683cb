//! .npy and .obj files: round trips, the forms other programs write, and hostile bytes.

use std::path::PathBuf;

use glam::DVec3;
use tessuto::io::{npy, obj};

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

/// A version 1 .npy file with this header and data.
fn raw_npy(header: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16 + 1).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.push(b'\n');
    bytes.extend(data);
    bytes
}

fn put(folder: &tempfile::TempDir, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join("a.npy");
    std::fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn arrays_are_read_back() {
    let folder = folder();
    let path = folder.path().join("a.npy");
    npy::write(&path, &[2, 1, 3], &[1.0_f64, 2.0, 3.0, 0.1, -1e300, 6.0]).unwrap();
    let array = npy::read(&path).unwrap();
    assert_eq!((array.shape, array.data), (vec![2, 1, 3], vec![1.0, 2.0, 3.0, 0.1, -1e300, 6.0]));
    let shapes = vec![vec![DVec3::new(0.5, 0.25, 1.0); 4], vec![DVec3::new(1.5, -0.25, 2.0); 4]];
    npy::write_field(&path, &shapes).unwrap();
    assert_eq!(npy::read_field(&path).unwrap(), shapes);
    npy::write_points(&path, &shapes[1]).unwrap();
    assert_eq!(npy::read_points(&path).unwrap(), shapes[1]);
    npy::write_points(&path, &[]).unwrap();
    assert_eq!(npy::read_points(&path).unwrap(), []);
}

#[test]
fn fortran_order_and_big_endian() {
    let folder = folder();
    let data: Vec<u8> = [1.0_f32, 4.0, 2.0, 5.0, 3.0, 6.0].iter().flat_map(|v| v.to_be_bytes()).collect();
    let path = put(&folder, &raw_npy("{'descr': '>f4', 'fortran_order': True, 'shape': (2, 3), }", &data));
    assert_eq!(npy::read_points(&path).unwrap(), [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)]);
}

#[test]
fn arrays_that_are_refused() {
    let folder = folder();
    let header = |descr: &str, shape: &str| {
        format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}")
    };
    let cases = [
        (header("<f4", "(1000000000000, 3)"), "promises shape"),
        (header("<f4", "(9223372036854775807, 9223372036854775807, 3)"), "promises shape"),
        (header("<f4", "(3, 3)"), "promises shape"),
        (header("<i8", "(1, 3)"), "expected float32 or float64"),
        (header("|O", "(1, 3)"), "a.npy"),
        (header("<f8", "(3,)"), "has shape [3], expected [n, 3]"),
        ("nonsense".into(), "is not a readable .npy file"),
    ];
    for (header, fragment) in cases {
        let error = npy::read_points(&put(&folder, &raw_npy(&header, &[0; 24]))).unwrap_err();
        assert_eq!(error.exit_code(), 3);
        assert!(error.to_string().contains(fragment) && error.to_string().contains("a.npy"), "{error}");
    }
}

#[test]
fn mesh_is_read_back_to_the_bit() {
    let folder = folder();
    let path = folder.path().join("a.obj");
    let mut mesh = tessuto::mesh::grid(4, 3, [0.1 + 0.2, 1.0 / 3.0].into(), 0.7);
    mesh.faces[2].uvs[1] = 0;
    obj::write(&path, &mesh, Some(obj::Material { library: "cloth.mtl", name: "cloth" })).unwrap();
    assert_eq!(obj::read(&path).unwrap(), mesh);
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.starts_with("mtllib cloth.mtl\n") && text.contains("usemtl cloth\n"));
}

#[test]
fn forms_of_other_programs() {
    let text = b"# caf\xe9 in Latin-1\r\nmtllib x.mtl\r\no sheet\r\nv 0 0 1 0.5 0.5 0.5\r\nv 1 0 1\r\nv 1 1 \
        1 \r\nv 0 1 1\r\nv 2 0.5 1e0\r\n\
        vt 0 0 0\r\nvt 1 0\r\n  vt 1 1\r\nvt 0 1 # corner\r\nvn 0 0 1\r\ns off\r\ng \xff\xfe\r\nf 1/1 2/2/1 \
        3/3 \\\r\n4/4\r\nf -4/-3 -1/-2/-1 -3/-1\r\nl 1 2\r\n";
    let mesh = obj::parse(text, "x.obj").unwrap();
    assert_eq!((mesh.positions.len(), mesh.uvs.len()), (5, 4));
    assert_eq!(mesh.faces[0].vertices, [0, 1, 2, 3]);
    assert_eq!((&mesh.faces[1].vertices[..], &mesh.faces[1].uvs[..]), (&[1, 4, 2][..], &[1, 2, 3][..]));
}

#[test]
fn meshes_that_are_refused() {
    let start = "v 0 0 1\nv 1 0 1\nv 1 1 1\nvt 0 0\n";
    let cases = [
        ("f 1/1 2/1\n", "x.obj:5: a face with 2 corners"),
        ("f 1/1 2/1 2/1\n", "x.obj:5: the face names vertex 2 twice"),
        ("f 1/1 2/1 4/1\n", "x.obj:5: vertex 4 does not exist; 3 are defined"),
        ("f 1/1 2/1 -4/1\n", "x.obj:5: vertex -4 does not exist"),
        ("f 1/1 2/1 99999999999999999999/1\n", "x.obj:5: vertex 9999"),
        ("f 1/1 2/1 -9223372036854775808/1\n", "x.obj:5: vertex -9223372036854775808"),
        ("f 1/1 2/1 3/2\n", "x.obj:5: texture coordinate 2 does not exist"),
        ("f 1 2 3\n", "x.obj:5: corner \"1\" has no texture coordinate"),
        ("f 1//1 2//1 3//1\n", "x.obj:5: corner \"1//1\" has no texture coordinate"),
        ("\n\nv 0,5 1 1\n", "x.obj:7: \"0,5\" is not a number"),
        ("v 0 1\n", "x.obj:5: 2 numbers where 3 are needed"),
        ("v inf 1 1\n", "x.obj:5: \"inf\""),
        ("vt 1e99 1\n", "x.obj:5: \"1e99\""),
        ("vt NaN 1\n", "x.obj:5: \"NaN\""),
        ("", "x.obj: has 3 vertices but no face"),
    ];
    for (end, expected) in cases {
        let error = obj::parse(format!("{start}{end}").as_bytes(), "x.obj").unwrap_err();
        assert_eq!(error.exit_code(), 3);
        assert!(error.to_string().starts_with(expected) && error.to_string().contains("hint: "), "{error}");
    }
    let long = format!("{start}# {}\n", "x".repeat(70_000));
    let error = obj::parse(long.as_bytes(), "x.obj").unwrap_err().to_string();
    assert!(error.starts_with("x.obj:5: the line is longer"), "{error}");
    let endless = "\\\n".repeat(70_000);
    assert!(obj::parse(endless.as_bytes(), "x.obj").is_err());
}

/// Changes, cuts and repeats bytes at random; a reader may answer anything but must not panic.
#[test]
fn hostile_bytes_do_not_panic() {
    let folder = folder();
    let path = folder.path().join("a.bin");
    obj::write(&path, &tessuto::mesh::grid(3, 3, [1.0, 1.0].into(), 1.0), None).unwrap();
    let mesh = std::fs::read(&path).unwrap();
    npy::write_points(&path, &[DVec3::ONE; 4]).unwrap();
    let array = std::fs::read(&path).unwrap();
    let image = tessuto::Image::new(5, 4, 3);
    tessuto::io::image::write_png(&path, &image).unwrap();
    let png = std::fs::read(&path).unwrap();

    let mut state = 1u64;
    let mut random = move |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % n.max(1)
    };
    let mut refused = 0;
    for round in 0..3000 {
        let mut bytes = [&mesh, &array, &png][round % 3].clone();
        for _ in 0..=random(4) {
            let at = random(bytes.len());
            match random(4) {
                0 => bytes.truncate(at),
                1 => bytes.insert(at, b"\0\xff/-19 \\\n"[random(9)]),
                2 => bytes.extend_from_within(at..),
                _ => bytes[at] = random(256) as u8,
            }
            if bytes.is_empty() {
                bytes.push(b'v');
            }
        }
        std::fs::write(&path, &bytes).unwrap();
        refused += usize::from(match round % 3 {
            0 => obj::read(&path).is_err(),
            1 => npy::read(&path).is_err(),
            _ => tessuto::io::image::read(&path).is_err(),
        });
    }
    assert!(refused > 1000, "only {refused} of 3000 damaged files were refused");
}
