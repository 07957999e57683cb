//! Chunks: rows of one entity over some timelines, as Arrow IPC streams with rerun's metadata.
//!
//! Source: rerun, `re_sorbet` and `re_sdk_types` 0.36.3.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::{
    Array, ArrayRef, DurationNanosecondArray, FixedSizeBinaryArray, FixedSizeListArray, Float32Array,
    Float64Array, Int64Array, ListArray, RecordBatch, StringArray, StructArray, UInt8Array, UInt32Array,
};
use arrow_buffer::OffsetBuffer;
use arrow_ipc::writer::StreamWriter;
use arrow_schema::{DataType, Field, Schema};

use super::wire::Id;

/// Version of the metadata.
const SORBET: &str = "0.1.3";

/// Where rows lie on one timeline.
pub(super) enum Times {
    /// Whole numbers.
    Sequence(&'static str, Vec<i64>),
    /// Durations `[ns]`.
    Duration(&'static str, Vec<i64>),
}

/// One component: a list of values in every row.
pub(super) struct Column {
    /// Archetype it belongs to, and its name there.
    name: [&'static str; 2],
    /// Type of the values.
    component: &'static str,
    lists: ListArray,
}

/// Rows of `entity`. Without times they hold always.
pub(super) struct Chunk<'a> {
    pub entity: &'a str,
    pub times: Vec<Times>,
    pub columns: Vec<Column>,
}

impl Times {
    /// Name of the timeline.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Sequence(name, _) | Self::Duration(name, _) => name,
        }
    }

    /// Numbers or nanoseconds, ascending.
    pub fn values(&self) -> &[i64] {
        match self {
            Self::Sequence(_, values) | Self::Duration(_, values) => values,
        }
    }

    /// The first and the last.
    pub fn ends(&self) -> Self {
        let ends = |values: &[i64]| [values.first(), values.last()].into_iter().flatten().copied().collect();
        match self {
            Self::Sequence(name, values) => Self::Sequence(name, ends(values)),
            Self::Duration(name, values) => Self::Duration(name, ends(values)),
        }
    }

    /// As Arrow array.
    pub fn array(&self) -> ArrayRef {
        self.array_of(self.values().iter().map(|v| Some(*v)))
    }

    /// Other values, of the same kind.
    pub fn array_of(&self, values: impl Iterator<Item = Option<i64>>) -> ArrayRef {
        match self {
            Self::Sequence(..) => Arc::new(values.collect::<Int64Array>()),
            Self::Duration(..) => Arc::new(values.collect::<DurationNanosecondArray>()),
        }
    }
}

impl Chunk<'_> {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |c| c.lists.len())
    }

    /// As Arrow IPC stream. Rows are numbered from `row` on.
    pub fn encode(&self, id: Id, row: Id) -> Vec<u8> {
        let ids = (0..self.rows() as u64).map(|k| big_endian([row[0], row[1] + k]));
        let ids = FixedSizeBinaryArray::try_from_iter(ids).expect("rows of 16 bytes, one at least");
        let mut fields = vec![row_id_field(&[("rerun:is_sorted", "true")])];
        let mut arrays: Vec<ArrayRef> = vec![Arc::new(ids)];
        for times in &self.times {
            let (name, array) = (times.name(), times.array());
            let index = [("rerun:kind", "index"), ("rerun:index_name", name), ("rerun:is_sorted", "true")];
            fields.push(field(name, array.data_type(), true, &index));
            arrays.push(array);
        }
        for column in &self.columns {
            let about = column.about();
            let mut data: Vec<(&str, &str)> = about.iter().map(|(k, v)| (*k, v.as_str())).collect();
            data.push(("rerun:kind", "data"));
            fields.push(field(&column.full_name(), column.data_type(), true, &data));
            arrays.push(Arc::new(column.lists.clone()));
        }
        let [high, low] = id;
        let about = [
            ("rerun:entity_path", format!("/{}", self.entity)),
            ("rerun:id", format!("chunk_{high:016X}{low:016x}")),
            ("sorbet:version", SORBET.to_owned()),
        ];
        let about = about.into_iter().map(|(k, v)| (k.to_owned(), v)).collect();
        ipc_of_batch(Schema::new_with_metadata(fields, about), arrays)
    }
}

/// A stream of one batch.
pub(super) fn ipc_of_batch(schema: Schema, arrays: Vec<ArrayRef>) -> Vec<u8> {
    let schema = Arc::new(schema);
    let batch = RecordBatch::try_new(schema.clone(), arrays).expect("columns of one length");
    let mut out = Vec::new();
    let mut writer = StreamWriter::try_new(&mut out, &schema).expect("a vector takes every byte");
    writer.write(&batch).expect("a vector takes every byte");
    writer.finish().expect("a vector takes every byte");
    drop(writer);
    out
}

/// The message that starts a stream.
pub(super) fn ipc_of_schema(schema: &Schema) -> Vec<u8> {
    let mut out = Vec::new();
    StreamWriter::try_new(&mut out, schema).expect("a vector takes every byte");
    out
}

/// `id` as Arrow arrays have it.
pub(super) fn big_endian([high, low]: Id) -> [u8; 16] {
    (u128::from(high) << 64 | u128::from(low)).to_be_bytes()
}

/// A column of type `data` with metadata.
pub(super) fn field(name: &str, data: &DataType, nullable: bool, about: &[(&str, &str)]) -> Field {
    let about: HashMap<String, String> = about.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
    Field::new(name, data.clone(), nullable).with_metadata(about)
}

/// The column of the rows' numbers.
pub(super) fn row_id_field(more: &[(&str, &str)]) -> Field {
    let control = [
        ("rerun:kind", "control"),
        ("ARROW:extension:name", "rerun.datatypes.TUID"),
        ("ARROW:extension:metadata", r#"{"namespace":"row"}"#),
    ];
    field("rerun.controls.RowId", &DataType::FixedSizeBinary(16), false, &[&control[..], more].concat())
}

/// Lists of `lengths` values each, made of `values` in order.
fn lists(lengths: impl IntoIterator<Item = usize>, values: ArrayRef, nullable: bool) -> ListArray {
    let item = Field::new("item", values.data_type().clone(), nullable);
    ListArray::new(Arc::new(item), OffsetBuffer::from_lengths(lengths), values, None)
}

/// Vectors of N numbers each.
fn vectors(numbers: ArrayRef, n: i32) -> ArrayRef {
    let item = Field::new("item", numbers.data_type().clone(), false);
    Arc::new(FixedSizeListArray::new(Arc::new(item), n, numbers, None))
}

impl Column {
    /// Archetype and name, as the column is called.
    pub fn full_name(&self) -> String {
        self.name.join(":")
    }

    /// Type of the lists.
    pub fn data_type(&self) -> &DataType {
        self.lists.data_type()
    }

    /// Metadata: what it is.
    pub fn about(&self) -> Vec<(&'static str, String)> {
        vec![
            ("rerun:archetype", format!("rerun.archetypes.{}", self.name[0])),
            ("rerun:component", self.full_name()),
            ("rerun:component_type", format!("rerun.components.{}", self.component)),
        ]
    }

    /// The same number of `values` in each of `rows` rows.
    fn even(name: [&'static str; 2], component: &'static str, rows: usize, values: ArrayRef) -> Self {
        let length = values.len() / rows.max(1);
        Self { name, component, lists: lists(std::iter::repeat_n(length, rows), values, true) }
    }

    /// Vectors of N floats, the same number in each row.
    pub fn floats<const N: usize>(
        name: [&'static str; 2],
        component: &'static str,
        rows: usize,
        values: &[[f32; N]],
    ) -> Self {
        let numbers = Float32Array::from(values.concat());
        Self::even(name, component, rows, vectors(Arc::new(numbers), N as i32))
    }

    /// Points, any number in each row.
    pub fn points(name: [&'static str; 2], rows: &[Vec<[f32; 3]>]) -> Self {
        let numbers = Float32Array::from(rows.concat().concat());
        let values = vectors(Arc::new(numbers), 3);
        Self { name, component: "Position3D", lists: lists(rows.iter().map(Vec::len), values, true) }
    }

    /// One float.
    pub fn float(name: [&'static str; 2], component: &'static str, value: f32) -> Self {
        Self::even(name, component, 1, Arc::new(Float32Array::from(vec![value])))
    }

    /// One number in each row.
    pub fn scalars(values: Vec<f64>) -> Self {
        let rows = values.len();
        Self::even(["Scalars", "scalars"], "Scalar", rows, Arc::new(Float64Array::from(values)))
    }

    /// One text in each row.
    pub fn texts(name: [&'static str; 2], component: &'static str, texts: &[&str]) -> Self {
        Self::even(name, component, texts.len(), Arc::new(StringArray::from(texts.to_vec())))
    }

    /// A file's bytes in each row.
    pub fn blobs(name: [&'static str; 2], component: &'static str, blobs: &[Vec<u8>]) -> Self {
        let bytes = Arc::new(UInt8Array::from(blobs.concat()));
        let values = lists(blobs.iter().map(Vec::len), bytes, false);
        Self::even(name, component, blobs.len(), Arc::new(values))
    }

    /// Which way the axes point; 1 up, 2 down, 3 right, 4 left, 5 forward, 6 back.
    pub fn axes(name: [&'static str; 2], directions: [u8; 3]) -> Self {
        let numbers = UInt8Array::from(directions.to_vec());
        Self::even(name, "ViewCoordinates", 1, vectors(Arc::new(numbers), 3))
    }

    /// Corners of triangles.
    pub fn triangles(triangles: &[[u32; 3]]) -> Self {
        let numbers = UInt32Array::from(triangles.concat());
        let values = vectors(Arc::new(numbers), 3);
        Self::even(["Mesh3D", "triangle_indices"], "TriangleIndices", 1, values)
    }

    /// One colour, red in the highest byte, opacity in the lowest.
    pub fn colour(name: [&'static str; 2], rgba: u32) -> Self {
        Self::even(name, "Color", 1, Arc::new(UInt32Array::from(vec![rgba])))
    }

    /// Format of an image of 8-bit RGB.
    pub fn rgb_format(name: [&'static str; 2], [width, height]: [u32; 2]) -> Self {
        const RGB: u8 = 2;
        const U8: u8 = 6;
        let byte = |name, value: Option<u8>| -> (Arc<Field>, ArrayRef) {
            (Arc::new(Field::new(name, DataType::UInt8, true)), Arc::new(UInt8Array::from(vec![value])))
        };
        let side = |name, value: u32| -> (Arc<Field>, ArrayRef) {
            (Arc::new(Field::new(name, DataType::UInt32, false)), Arc::new(UInt32Array::from(vec![value])))
        };
        let format = StructArray::from(vec![
            side("width", width),
            side("height", height),
            byte("pixel_format", None),
            byte("color_model", Some(RGB)),
            byte("channel_datatype", Some(U8)),
        ]);
        Self::even(name, "ImageFormat", 1, Arc::new(format))
    }
}
