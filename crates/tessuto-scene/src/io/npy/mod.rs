//! NumPy arrays (.npy) of floats: point clouds [n, 3] and moving meshes [N, V, 3].

mod header;

use std::path::Path;

use glam::DVec3;

use crate::io::{atomic_write, read_bounded, zip};
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::{Motion, Positions};

/// Largest file read `[bytes]`; 4 GiB is 10,000 frames of 17,000 vertices.
const MAX_BYTES: u64 = 4 << 30;

/// A float array in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Length of every axis.
    pub shape: Vec<usize>,
    /// Values in C order (the last axis runs fastest).
    pub data: Vec<f64>,
}

/// Reads an f32 or f64 array of any shape, C or Fortran order, either byte order.
pub fn read(path: &Path) -> Result<Array> {
    let bytes = read_bounded(path, MAX_BYTES)?;
    decode(&bytes, false).map_err(|problem| {
        Error::input(
            path.display().to_string(),
            problem,
            "write it again with numpy.save(path, array.astype(\"float32\"))",
        )
    })
}

/// The numbers of the array in `path`, which has this `shape`; `None` where there is no such file.
///
/// # Errors
/// As [`read`], and for another shape.
pub fn read_if_there(path: &Path, shape: &[usize]) -> Result<Option<Vec<f64>>> {
    if !path.is_file() {
        return Ok(None);
    }
    let array = read(path)?;
    if array.shape != shape {
        let problem = format!("has shape {:?}, expected {shape:?}", array.shape);
        return Err(Error::input(path.display().to_string(), problem, "use the file as tessuto wrote it"));
    }
    Ok(Some(array.data))
}

/// The array in the .npy file of these `bytes`, of floats or, if they are welcome, of `integers` (up to 2⁵³
/// exactly); or what is wrong with it.
pub fn decode(bytes: &[u8], integers: bool) -> std::result::Result<Array, String> {
    let (header, rest) = header::read(bytes)
        .map_err(|e| format!("is not a readable .npy file of {} bytes: {e}", bytes.len()))?;
    let (order, kind) = header.descr.split_at_checked(1).unwrap_or_default();
    let known = ["<", "=", ">", "|"].contains(&order)
        && match kind {
            "f4" | "f8" => order != "|",
            "i1" | "u1" | "i2" | "u2" | "i4" | "u4" | "i8" | "u8" => integers,
            _ => false,
        };
    if !known {
        let expected = if integers { "floats or integers" } else { "float32 or float64" };
        return Err(format!("holds '{}', expected {expected}", header.descr));
    }
    let (letter, size) = (&kind[..1], u64::from(kind.as_bytes()[1] - b'0'));
    // Check the promise of the header before any memory is set aside for it.
    let promised = header.shape.iter().try_fold(size, |product: u64, n| product.checked_mul(*n));
    if promised != Some(rest.len() as u64) {
        return Err(format!(
            "promises shape {:?} of {size}-byte values but holds {} bytes of them",
            header.shape,
            rest.len()
        ));
    }
    let shape: Vec<usize> = header.shape.iter().map(|n| *n as usize).collect();
    let big_endian = order == ">";
    let data = match (letter, size) {
        ("f", 4) => numbers(rest, if big_endian { f32::from_be_bytes } else { f32::from_le_bytes }),
        ("f", _) => numbers(rest, if big_endian { f64::from_be_bytes } else { f64::from_le_bytes }),
        (_, size) => whole_numbers(rest, size as usize, big_endian, letter == "i"),
    };
    let data = if header.fortran_order { c_order(&shape, &data) } else { data };
    Ok(Array { shape, data })
}

/// The integers stored as `size` bytes each, with a sign or without.
fn whole_numbers(bytes: &[u8], size: usize, big_endian: bool, signed: bool) -> Vec<f64> {
    let number = |bytes: &[u8]| {
        let join = |sum: u64, b: &u8| sum << 8 | u64::from(*b);
        let value = if big_endian { bytes.iter().fold(0, join) } else { bytes.iter().rev().fold(0, join) };
        let unused = 64 - 8 * size as u32;
        if signed { ((value << unused) as i64 >> unused) as f64 } else { value as f64 }
    };
    bytes.chunks_exact(size).map(number).collect()
}

/// The values stored as `N` bytes each.
fn numbers<const N: usize, T: Into<f64>>(bytes: &[u8], value: fn([u8; N]) -> T) -> Vec<f64> {
    bytes.as_chunks().0.iter().map(|b| value(*b).into()).collect()
}

/// `data`, stored with the first axis running fastest, in C order.
fn c_order(shape: &[usize], data: &[f64]) -> Vec<f64> {
    let mut out = Vec::with_capacity(data.len());
    for mut index in 0..data.len() {
        // Take the C-order index apart from the last axis on, and put it together from the first.
        let (mut source, mut stride) = (0, data.len());
        for n in shape.iter().rev() {
            stride /= n;
            source += (index % n) * stride;
            index /= n;
        }
        out.push(data[source]);
    }
    out
}

/// Reads points `[m]`, shape [n, 3], all finite.
pub fn read_points(path: &Path) -> Result<Vec<DVec3>> {
    let array = read(path)?;
    match array.shape[..] {
        [_, 3] => vectors(path, &array),
        _ => Err(wrong_shape(path, &array, "[n, 3]")),
    }
}

/// Reads a motion `[m]`, shape [N, V, 3].
pub fn read_motion(path: &Path) -> Result<Motion> {
    Motion::new(read_field(path)?).map_err(|error| match error {
        Error::Input { problem, hint, .. } => Error::input(path.display().to_string(), problem, hint),
        other => other,
    })
}

/// Reads a field of vectors over a mesh and time, shape [N, V, 3], all finite; N may be 0.
pub fn read_field(path: &Path) -> Result<Vec<Positions>> {
    let array = read(path)?;
    match array.shape[..] {
        [n, 0, 3] => Ok(vec![Vec::new(); n]),
        [_, vertex_count, 3] => {
            Ok(vectors(path, &array)?.chunks_exact(vertex_count).map(<[DVec3]>::to_vec).collect())
        }
        _ => Err(wrong_shape(path, &array, "[N, V, 3]")),
    }
}

fn wrong_shape(path: &Path, array: &Array, expected: &str) -> Error {
    Error::input(
        path.display().to_string(),
        format!("has shape {:?}, expected {expected}", array.shape),
        "transpose or reshape the array, so that x, y, z come last",
    )
}

fn vectors(path: &Path, array: &Array) -> Result<Vec<DVec3>> {
    if let Some(i) = array.data.iter().position(|v| !v.is_finite()) {
        let row = i / 3;
        return Err(Error::input(
            path.display().to_string(),
            format!("point {row} of {} is not finite ({})", array.data.len() / 3, array.data[i]),
            "leave invalid points out",
        ));
    }
    Ok(array.data.chunks_exact(3).map(DVec3::from_slice).collect())
}

/// A number that [`encode`] can store.
pub trait Number: Copy {
    /// What NumPy calls the type.
    const DESCR: &str;

    /// Appends the number's bytes, the lowest one first.
    fn append(self, bytes: &mut Vec<u8>);
}

macro_rules! numbers {
    ($($number:ty = $descr:literal),+) => {$(
        impl Number for $number {
            const DESCR: &str = $descr;

            fn append(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        }
    )+};
}
numbers!(f32 = "<f4", f64 = "<f8", u32 = "<u4");

/// Writes `data` (numbers in C order) with this shape.
pub fn write<T: Number>(path: &Path, shape: &[usize], data: &[T]) -> Result<()> {
    atomic_write(path, &encode(shape, data))
}

/// The bytes of a .npy file of `data` (numbers in C order) with this shape.
pub fn encode<T: Number>(shape: &[usize], data: &[T]) -> Vec<u8> {
    assert_eq!(
        shape.iter().product::<usize>(),
        data.len(),
        "shape {shape:?} does not fit {} values",
        data.len()
    );
    let mut bytes = header::write(T::DESCR, shape);
    bytes.reserve(size_of_val(data));
    data.iter().for_each(|v| v.append(&mut bytes));
    bytes
}

/// The bytes of an uncompressed .npz archive of arrays: names and the bytes of [`encode`].
pub fn archive(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let files: Vec<_> = arrays.iter().map(|(name, bytes)| (format!("{name}.npy"), bytes.clone())).collect();
    zip::write(&files)
}

/// Writes points `[m]` as f32, shape [n, 3].
pub fn write_points(path: &Path, points: &[DVec3]) -> Result<()> {
    let data: Vec<f32> = points.iter().flat_map(|p| p.as_vec3().to_array()).collect();
    write(path, &[points.len(), 3], &data)
}

/// Writes a moving mesh `[m]` as f32, shape [N, V, 3]; all shapes have as many vertices.
pub fn write_field(path: &Path, shapes: &[Positions]) -> Result<()> {
    let data: Vec<f32> = shapes.iter().flatten().flat_map(|p| p.as_vec3().to_array()).collect();
    write(path, &[shapes.len(), shapes.first().map_or(0, Vec::len), 3], &data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_of_any_size_and_order_are_read_where_they_are_welcome() {
        let file = |descr: &str, bytes: &[u8]| {
            let size = usize::from(descr.as_bytes()[2] - b'0');
            [header::write(descr, &[bytes.len() / size]), bytes.to_vec()].concat()
        };
        for (descr, bytes, expected) in [
            ("|i1", &[255, 2][..], [-1.0, 2.0]),
            ("|u1", &[255, 2], [255.0, 2.0]),
            ("<i2", &[254, 255, 1, 1], [-2.0, 257.0]),
            (">u2", &[1, 0, 0, 9], [256.0, 9.0]),
            ("<i4", &[255, 255, 255, 255, 7, 0, 0, 0], [-1.0, 7.0]),
            (">i8", &[255, 255, 255, 255, 255, 255, 255, 253, 0, 0, 0, 0, 0, 0, 1, 0], [-3.0, 256.0]),
        ] {
            let array = decode(&file(descr, bytes), true).unwrap();
            assert_eq!((array.shape, array.data), (vec![2], expected.to_vec()), "{descr}");
            assert!(decode(&file(descr, bytes), false).unwrap_err().contains("expected float32"));
        }
        for descr in ["<c8", "<f2", "|f4", "é", "", "<i3"] {
            let bytes = header::write(descr, &[0]);
            assert!(decode(&bytes, true).unwrap_err().contains("expected floats or integers"), "{descr}");
        }
    }
}
