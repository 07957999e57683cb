//! The numbers of an accessor, dense or sparse.

use serde_json::Value;

use super::super::MAX_COUNT;
use super::{AGAIN, Outcome, Reader};

/// Where items of the same type stand in the buffers.
struct Items<'a> {
    view: &'a Value,
    /// Offset in the view `[bytes]`.
    offset: usize,
    count: usize,
    /// Components of an item.
    width: usize,
    kind: u64,
}

fn number(v: &Value) -> usize {
    v.as_u64().unwrap_or(0) as usize
}

fn lacks(what: &str) -> (String, &'static str) {
    (format!("lacks {what}"), AGAIN)
}

impl Reader<'_> {
    /// The numbers of an accessor with `width` components, one item after the other.
    pub(super) fn accessor(&self, index: &Value, width: usize) -> Outcome<Vec<f64>> {
        let index = index.as_u64().ok_or_else(|| lacks("positions or indices of a primitive"))? as usize;
        let accessor = &self.document["accessors"][index];
        let count = accessor["count"].as_u64().ok_or_else(|| lacks("an accessor it names"))? as usize;
        let components = match accessor["type"].as_str() {
            Some("SCALAR") => 1,
            Some("VEC2") => 2,
            Some("VEC3") => 3,
            Some("VEC4") => 4,
            Some("MAT4") => 16,
            _ => 0,
        };
        if components != width || count > 3 * MAX_COUNT {
            return Err((format!("accessor {index} has {count} items of type {}", accessor["type"]), AGAIN));
        }
        let kind = accessor["componentType"].as_u64().unwrap_or(0);
        let offset = number(&accessor["byteOffset"]);
        let mut values = match accessor["bufferView"].as_u64() {
            Some(view) => {
                let view = &self.document["bufferViews"][view as usize];
                self.items(&Items { view, offset, count, width, kind }, index)?
            }
            // All are 0 but those that a sparse accessor names: few bytes must not take much memory.
            None if accessor["sparse"].is_object() && count <= MAX_COUNT && width <= 4 => {
                vec![0.0; width * count]
            }
            None => return Err(lacks("a buffer view")),
        };
        if let Some(sparse) = accessor["sparse"].as_object() {
            let part = |key: &str, kind: u64, width: usize| {
                let part = sparse.get(key).unwrap_or(&Value::Null);
                let view = &self.document["bufferViews"][part["bufferView"].as_u64()? as usize];
                let kind = part["componentType"].as_u64().unwrap_or(kind);
                let count = number(sparse.get("count").unwrap_or(&Value::Null));
                Some(Items { view, offset: number(&part["byteOffset"]), count, width, kind })
            };
            let broken = || lacks("indices or values of a sparse accessor");
            let indices = self.items(&part("indices", 0, 1).ok_or_else(broken)?, index)?;
            let given = self.items(&part("values", kind, width).ok_or_else(broken)?, index)?;
            for (at, item) in indices.iter().zip(given.chunks_exact(width)) {
                let at = *at as usize;
                let place = values.get_mut(at.saturating_mul(width)..).and_then(|rest| rest.get_mut(..width));
                let place =
                    place.ok_or_else(|| (format!("accessor {index} names item {at} of {count}"), AGAIN))?;
                place.copy_from_slice(item);
            }
        }
        if accessor["normalized"].as_bool() == Some(true) && (5120..=5123).contains(&kind) {
            let largest = [127.0, 255.0, 32_767.0, 65_535.0][kind as usize - 5120];
            values.iter_mut().for_each(|v| *v = (*v / largest).max(-1.0));
        }
        Ok(values)
    }

    /// The numbers of `items` of the accessor `index`.
    fn items(&self, items: &Items, index: usize) -> Outcome<Vec<f64>> {
        let Items { view, offset, count, width, kind } = *items;
        let size = match kind {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            5125 | 5126 => 4,
            _ => return Err((format!("accessor {index} has the component type {kind}"), AGAIN)),
        };
        if view.is_null() {
            return Err(lacks("a buffer view"));
        }
        let buffer = self.buffers.get(number(&view["buffer"])).ok_or_else(|| lacks("a buffer"))?;
        let start = number(&view["byteOffset"]).saturating_add(offset);
        let stride = if view["byteStride"].is_null() { size * width } else { number(&view["byteStride"]) };
        let end =
            start.saturating_add(stride.saturating_mul(count.saturating_sub(1))).saturating_add(size * width);
        if stride < size * width || end > buffer.len() && count > 0 {
            let problem = format!("accessor {index} reaches to byte {end} of a buffer of {}", buffer.len());
            return Err((problem, "the file is truncated: copy or export it again"));
        }
        let value = |b: &[u8]| match kind {
            5120 => f64::from(b[0] as i8),
            5121 => f64::from(b[0]),
            5122 => f64::from(i16::from_le_bytes([b[0], b[1]])),
            5123 => f64::from(u16::from_le_bytes([b[0], b[1]])),
            5125 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            _ => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        };
        let item =
            |k: usize| buffer[start + k * stride..start + k * stride + size * width].chunks_exact(size);
        Ok((0..count).flat_map(item).map(value).collect())
    }
}
