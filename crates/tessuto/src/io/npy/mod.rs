//! NumPy arrays (.npy) of floats: point clouds [n, 3] and moving meshes [N, V, 3].

mod header;

use std::path::Path;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::io::{atomic_write, read_bounded};
use crate::mesh::{Motion, Positions};

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
    let fail = |problem: String| {
        Error::input(
            path.display().to_string(),
            problem,
            "write it again with numpy.save(path, array.astype(\"float32\"))",
        )
    };
    let (header, rest) = header::read(&bytes)
        .map_err(|e| fail(format!("is not a readable .npy file of {} bytes: {e}", bytes.len())))?;
    let (big_endian, size) = match &*header.descr {
        "<f4" | "=f4" => (false, 4),
        "<f8" | "=f8" => (false, 8),
        ">f4" => (true, 4),
        ">f8" => (true, 8),
        other => return Err(fail(format!("holds '{other}', expected float32 or float64"))),
    };
    // Check the promise of the header before any memory is set aside for it.
    let promised = header.shape.iter().try_fold(size, |product: u64, n| product.checked_mul(*n));
    if promised != Some(rest.len() as u64) {
        return Err(fail(format!(
            "promises shape {:?} of {size}-byte values but holds {} bytes of them",
            header.shape,
            rest.len()
        )));
    }
    let shape: Vec<usize> = header.shape.iter().map(|n| *n as usize).collect();
    let data = match size {
        4 => numbers(rest, if big_endian { f32::from_be_bytes } else { f32::from_le_bytes }),
        _ => numbers(rest, if big_endian { f64::from_be_bytes } else { f64::from_le_bytes }),
    };
    let data = if header.fortran_order { c_order(&shape, &data) } else { data };
    Ok(Array { shape, data })
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
