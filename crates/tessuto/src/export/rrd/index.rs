//! The index at the end of a whole recording: what is in which chunk, so that viewers need not read all of it.
//!
//! Source: rerun, `re_log_encoding` 0.36.3, "RRD manifest".

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use arrow_array::{ArrayRef, BooleanArray, FixedSizeBinaryArray, StringArray, UInt64Array};
use arrow_schema::{DataType, Field, Schema};
use sha2::{Digest, Sha256};

use super::chunk::{Chunk, Times, big_endian, field, ipc_of_batch, ipc_of_schema, row_id_field};
use super::wire::{Id, Manifest};

/// Name and metadata of a component.
type Component = (String, Vec<(&'static str, String)>);

/// What is said of one chunk.
struct Row {
    entity: String,
    id: Id,
    rows: u64,
    /// Offset of its message's body in the stream, length of it, and length of the Arrow data in it.
    bytes: [u64; 3],
    /// First and last time on each timeline.
    times: Vec<Times>,
    /// Names of the components it has.
    components: BTreeSet<String>,
}

/// See the module.
#[derive(Default)]
pub(super) struct Index {
    rows: Vec<Row>,
    components: BTreeMap<String, Component>,
    /// The columns of the recording as one table, by name.
    columns: BTreeMap<String, Field>,
}

impl Index {
    /// Records `chunk`. `bytes`: offset and length of its message's body, length of the Arrow data.
    pub fn add(&mut self, chunk: &Chunk, id: Id, bytes: [u64; 3]) {
        for times in &chunk.times {
            let index = [("rerun:kind", "index"), ("rerun:index_name", times.name())];
            self.columns.insert(
                times.name().to_owned(),
                field(times.name(), times.array().data_type(), true, &index),
            );
        }
        for column in &chunk.columns {
            let (name, about) = (column.full_name(), column.about());
            let mut described: Vec<(&str, &str)> = about.iter().map(|(k, v)| (*k, v.as_str())).collect();
            let entity = format!("/{}", chunk.entity);
            described.extend([("rerun:kind", "data"), ("rerun:entity_path", &entity)]);
            if chunk.times.is_empty() {
                described.push(("rerun:is_static", "true"));
            }
            let column_name = match chunk.entity.strip_prefix("__properties") {
                Some(_) => format!("property:{name}"),
                None => format!("{entity}:{name}"),
            };
            let described = field(&column_name, column.data_type(), true, &described);
            self.columns.insert(column_name, described);
            self.components.insert(name.clone(), (name, about));
        }
        self.rows.push(Row {
            entity: format!("/{}", chunk.entity),
            id,
            rows: chunk.rows() as u64,
            bytes,
            times: chunk.times.iter().map(Times::ends).collect(),
            components: chunk.columns.iter().map(|c| c.full_name()).collect(),
        });
    }

    /// The index, encoded.
    pub fn finish(mut self) -> Manifest {
        let row_id = row_id_field(&[]);
        self.columns.insert(row_id.name().clone(), row_id);
        let schema = ipc_of_schema(&Schema::new(self.columns.values().cloned().collect::<Vec<_>>()));
        let digest = Sha256::digest(&schema).to_vec();
        let table = self.table();
        let (fields, arrays) = table.into_iter().unzip::<_, _, Vec<_>, Vec<_>>();
        Manifest { schema, digest, table: ipc_of_batch(Schema::new(fields), arrays) }
    }

    /// A row per chunk.
    fn table(&self) -> Vec<(Field, ArrayRef)> {
        let numbers = |of: &dyn Fn(&Row) -> u64| -> ArrayRef {
            Arc::new(self.rows.iter().map(|r| Some(of(r))).collect::<UInt64Array>())
        };
        let flags = |of: &dyn Fn(&Row) -> bool| -> ArrayRef {
            Arc::new(self.rows.iter().map(|r| Some(of(r))).collect::<BooleanArray>())
        };
        let ids = FixedSizeBinaryArray::try_from_iter(self.rows.iter().map(|r| big_endian(r.id)));
        let entities: StringArray = self.rows.iter().map(|r| Some(r.entity.as_str())).collect();
        let first: [(&str, ArrayRef); 7] = [
            ("chunk_entity_path", Arc::new(entities)),
            ("chunk_id", Arc::new(ids.expect("a recording has chunks, their ids 16 bytes"))),
            ("chunk_is_static", flags(&|r| r.times.is_empty())),
            ("chunk_num_rows", numbers(&|r| r.rows)),
            ("chunk_byte_offset", numbers(&|r| r.bytes[0])),
            ("chunk_byte_size", numbers(&|r| r.bytes[1])),
            ("chunk_byte_size_uncompressed", numbers(&|r| r.bytes[2])),
        ];
        let plain = |(name, array): (&str, ArrayRef)| (field(name, array.data_type(), false, &[]), array);
        let mut table: Vec<_> = first.into_iter().map(plain).collect();
        for (name, about) in self.components.values() {
            let has = flags(&|r| r.times.is_empty() && r.components.contains(name));
            let about = described(about, "rerun:static");
            table.push((field(&format!("{name}:has_static_data"), &DataType::Boolean, false, &about), has));
        }
        let timelines: BTreeMap<&str, &Times> =
            self.rows.iter().flat_map(|r| &r.times).map(|t| (t.name(), t)).collect();
        for (timeline, kind) in &timelines {
            table.extend(self.ends(kind, None, &[("rerun:index", timeline)]));
        }
        for (timeline, kind) in &timelines {
            for (name, about) in self.components.values() {
                let has =
                    |r: &Row| r.components.contains(name) && r.times.iter().any(|t| t.name() == *timeline);
                if !self.rows.iter().any(has) {
                    continue;
                }
                let about = described(about, timeline);
                table.extend(self.ends(kind, Some(name), &about));
                let count = format!("{timeline}:{name}:num_rows");
                let counts = numbers(&|r| if has(r) { r.rows } else { 0 });
                table.push((field(&count, &DataType::UInt64, true, &about), counts));
            }
        }
        table
    }

    /// First and last time of every chunk, or of those with the component `name`, on the timeline of `kind`.
    fn ends(&self, kind: &Times, name: Option<&str>, about: &[(&str, &str)]) -> [(Field, ArrayRef); 2] {
        [("start", 0), ("end", 1)].map(|(end, k)| {
            let at = |r: &Row| {
                let times = r.times.iter().find(|t| t.name() == kind.name());
                times.filter(|_| name.is_none_or(|n| r.components.contains(n))).map(|t| t.values()[k])
            };
            let array = kind.array_of(self.rows.iter().map(at));
            let column =
                [Some(kind.name()), name, Some(end)].into_iter().flatten().collect::<Vec<_>>().join(":");
            (field(&column, array.data_type(), true, about), array)
        })
    }
}

fn described<'a>(about: &'a [(&'static str, String)], index: &'a str) -> Vec<(&'a str, &'a str)> {
    about.iter().map(|(k, v)| (*k, v.as_str())).chain([("rerun:index", index)]).collect()
}
