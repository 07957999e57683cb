//! The shape of a mesh at rest: morph targets by their weights, then joints by their pose.
//!
//! Source: glTF 2.0 §3.7.2.2 (morph targets), §3.7.3 (skins): the transform of the node that has the skin does not
//! count.

use glam::{DMat4, DVec3};
use serde_json::Value;

use super::super::MAX_COUNT;
use super::{AGAIN, MAX_DEPTH, MAX_NODES, Outcome, Reader, indices, local};

/// Vertices times morph targets, or times influences, that are worked on at most.
const MAX_WORK: usize = 40 * MAX_COUNT;
/// Sets of four joints a vertex that are read.
const MAX_SETS: usize = 8;

/// The parent of every node of `document`, where it has one.
pub(super) fn parents(document: &Value) -> Vec<Option<usize>> {
    let nodes = document["nodes"].as_array().map_or(&[][..], Vec::as_slice);
    let mut parents = vec![None; nodes.len()];
    for (n, node) in nodes.iter().enumerate() {
        for child in indices(&node["children"]) {
            if let Some(parent) = parents.get_mut(child) {
                *parent = Some(n);
            }
        }
    }
    parents
}

impl Reader<'_> {
    /// Moves `positions`, three numbers each, by the `targets` that have a weight; how many have.
    pub(super) fn morph(&self, positions: &mut [f64], targets: &Value, weights: &Value) -> Outcome<usize> {
        let weights = weights.as_array().map_or(&[][..], Vec::as_slice);
        let targets = targets.as_array().map_or(&[][..], Vec::as_slice);
        let weighted = targets.iter().zip(weights.iter().filter_map(Value::as_f64));
        let moving: Vec<(&Value, f64)> = weighted
            .filter(|(target, weight)| *weight != 0.0 && !target["POSITION"].is_null())
            .map(|(target, weight)| (&target["POSITION"], weight))
            .collect();
        if moving.len().saturating_mul(positions.len() / 3) > MAX_WORK {
            return Err((
                format!("has {} morph targets with a weight", moving.len()),
                "apply them, and export again",
            ));
        }
        for (target, weight) in &moving {
            let offsets = self.accessor(target, 3)?;
            if offsets.len() != positions.len() {
                let problem =
                    format!("a morph target moves {} of {} vertices", offsets.len() / 3, positions.len() / 3);
                return Err((problem, AGAIN));
            }
            positions.iter_mut().zip(&offsets).for_each(|(p, offset)| *p += weight * offset);
        }
        Ok(moving.len())
    }

    /// The transform of every joint of a skin from the mesh's space as bound to the scene, and on to `axes`.
    pub(super) fn joints(&self, skin: usize, axes: DMat4) -> Outcome<Vec<DMat4>> {
        let skin = &self.document["skins"][skin];
        let joints = indices(&skin["joints"]);
        if joints.is_empty() || joints.len() > MAX_NODES {
            return Err((format!("has a skin of {} joints", joints.len()), AGAIN));
        }
        let bound = match &skin["inverseBindMatrices"] {
            Value::Null => vec![DMat4::IDENTITY; joints.len()],
            accessor => self.accessor(accessor, 16)?.chunks_exact(16).map(DMat4::from_cols_slice).collect(),
        };
        if bound.len() < joints.len() {
            return Err((format!("binds {} of the {} joints of a skin", bound.len(), joints.len()), AGAIN));
        }
        joints.iter().zip(bound).map(|(joint, bound)| Ok(axes * self.pose(*joint)? * bound)).collect()
    }

    /// Where a node stands in the scene.
    fn pose(&self, node: usize) -> Outcome<DMat4> {
        let (mut pose, mut above) = (DMat4::IDENTITY, Some(node));
        for _ in 0..=MAX_DEPTH {
            let Some(n) = above else { return Ok(pose) };
            if n >= self.parents.len() {
                return Err((format!("has a skin that names node {n} of {}", self.parents.len()), AGAIN));
            }
            pose = local(&self.document["nodes"][n]) * pose;
            above = self.parents[n];
        }
        Err((format!("nests nodes deeper than {MAX_DEPTH}"), AGAIN))
    }

    /// The `points` as the `joints` pose them, by the weights among the `attributes`.
    pub(super) fn posed(
        &self,
        points: impl Iterator<Item = DVec3>,
        attributes: &Value,
        joints: &[DMat4],
    ) -> Outcome<Vec<DVec3>> {
        let points: Vec<DVec3> = points.collect();
        // Sums of weight times transformed point, and of the weights, which are often rounded.
        let mut sums = vec![(DVec3::ZERO, 0.0); points.len()];
        let sets = (0..MAX_SETS).take_while(|n| !attributes[format!("JOINTS_{n}")].is_null());
        for n in sets {
            let of = self.accessor(&attributes[format!("JOINTS_{n}")], 4)?;
            let by = self.accessor(&attributes[format!("WEIGHTS_{n}")], 4)?;
            if of.len() != 4 * points.len() || by.len() != of.len() {
                return Err((
                    format!("has joints or weights for {} of {} vertices", of.len() / 4, points.len()),
                    AGAIN,
                ));
            }
            for (k, (joint, weight)) in
                of.iter().zip(&by).enumerate().filter(|(_, (_, weight))| **weight != 0.0)
            {
                let transform = joints
                    .get(*joint as usize)
                    .ok_or_else(|| (format!("names joint {joint} of a skin of {}", joints.len()), AGAIN))?;
                let sum = &mut sums[k / 4];
                sum.0 += *weight * transform.transform_point3(points[k / 4]);
                sum.1 += weight;
            }
        }
        let held = |(k, (sum, weight)): (usize, (DVec3, f64))| match weight > 0.0 {
            true => Ok(sum / weight),
            false => Err((format!("has a skin whose vertex {k} no joint holds"), AGAIN)),
        };
        sums.into_iter().enumerate().map(held).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use serde_json::json;

    use super::super::parse;
    use super::*;
    use crate::io::model::Model;
    use tessuto_core::error::Result;
    use tessuto_core::text::base64;

    /// A triangle with uv; two morph targets, of which the second is sparse; weights of two joints. One view for each
    /// accessor.
    fn file(node: Value, mesh_weights: &[f64], more: Value) -> Value {
        let floats: [&[f32]; 8] = [
            &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            &[0.0, 0.0, 1.0, 1.0, 0.5, 0.5],
            &[0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 3.0],
            &[1.0, 0.0, 0.0, 0.0, 0.25, 0.75, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            // Where both joints were when the mesh was bound: at x = −1 and at x = −2.
            &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0],
            &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.0, 1.0],
            &[10.0, 0.0, 0.0],
            &[],
        ];
        let mut bytes: Vec<u8> =
            floats.iter().flat_map(|list| list.iter().flat_map(|v| v.to_le_bytes())).collect();
        let sparse_index = bytes.len();
        bytes.extend(1u16.to_le_bytes());
        bytes.extend([0, 0]);
        let joints = bytes.len();
        bytes.extend([0u8, 1, 0, 0].repeat(3));
        let at = |k: usize| 4 * floats[..k].iter().map(|list| list.len()).sum::<usize>();
        let view = |offset: usize| json!({"buffer": 0, "byteOffset": offset, "byteLength": 4});
        let float = |view: usize, count: usize, kind: &str| {
            json!({
                "bufferView": view, "componentType": 5126, "count": count, "type": kind
            })
        };
        let mut document = json!({
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": [0]}],
            "nodes": [node],
            "meshes": [{"weights": mesh_weights, "primitives": [{
                "attributes": {"POSITION": 0, "TEXCOORD_0": 1, "WEIGHTS_0": 3, "JOINTS_0": 5},
                "targets": [{"POSITION": 2}, {"POSITION": 6}],
            }]}],
            "skins": [{"joints": [2, 3], "inverseBindMatrices": 4}],
            "buffers": [{"byteLength": bytes.len(), "uri": format!("data:;base64,{}", base64(&bytes))}],
            "bufferViews": [
                view(at(0)), view(at(1)), view(at(2)), view(at(3)), view(at(4)),
                view(joints), view(sparse_index), view(at(6)),
            ],
            "accessors": [
                float(0, 3, "VEC3"), float(1, 3, "VEC2"), float(2, 3, "VEC3"), float(3, 3, "VEC4"), float(4, 2, "MAT4"),
                {"bufferView": 5, "componentType": 5121, "count": 3, "type": "VEC4"},
                {"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {
                    "count": 1, "indices": {"bufferView": 6, "componentType": 5123}, "values": {"bufferView": 7}}},
            ],
        });
        for (key, value) in more.as_object().unwrap() {
            document[key] = value.clone();
        }
        document
    }

    fn read(document: &Value) -> Result<Model> {
        parse(document.to_string().as_bytes(), Path::new("a.gltf"))
    }

    #[test]
    fn morph_targets_count_by_the_weights_of_the_node_or_the_mesh() {
        let places = |node: Value, weights: &[f64]| {
            read(&file(node, weights, json!({})))
                .unwrap()
                .mesh
                .positions
                .iter()
                .map(|p| p.to_array())
                .collect::<Vec<_>>()
        };
        let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]];
        assert_eq!(places(json!({"mesh": 0}), &[]), flat);
        assert_eq!(places(json!({"mesh": 0}), &[0.0, 0.0]), flat);
        // z and y are turned.
        let first = [[0.0, 0.0, -0.5], [1.0, 0.0, -1.0], [0.0, -1.0, -1.5]];
        assert_eq!(places(json!({"mesh": 0}), &[0.5, 0.0]), first);
        let both = [[0.0, 0.0, -1.0], [21.0, 0.0, -2.0], [0.0, -1.0, -3.0]];
        assert_eq!(places(json!({"mesh": 0, "weights": [1, 2]}), &[0.5, 0.0]), both);
        let model = read(&file(json!({"mesh": 0}), &[0.5, 0.0], json!({}))).unwrap();
        assert_eq!(model.notes, ["1 morph targets have a weight in the file, and count by it"]);
    }

    #[test]
    fn joints_pose_a_skin_and_its_node_does_not_count() {
        let nodes = json!([
            {"mesh": 0, "skin": 0, "translation": [100, 100, 100]},
            {"children": [2], "translation": [0, 1, 0]},
            {"children": [3], "translation": [-1, 0, 0]},
            // A quarter turn about z.
            {"translation": [-1, 0, 0], "rotation": [0.0, 0.0, 0.5f64.sqrt(), 0.5f64.sqrt()]},
        ]);
        let more = json!({"nodes": nodes, "scenes": [{"nodes": [0, 1]}]});
        let model = read(&file(json!({}), &[], more)).unwrap();
        // The first joint lifts by 1; the second turns about x = −2, and lifts as well: (x, y) → (−2 − y, 1 + x + 2).
        let by_second = |x: f64, y: f64| [-2.0 - y, 3.0 + x];
        let [x, y] = by_second(1.0, 0.0);
        let expected = [[0.0, 1.0], [0.25 + 0.75 * x, 0.25 + 0.75 * y], by_second(0.0, 1.0)];
        for (p, [x, y]) in model.mesh.positions.iter().zip(expected) {
            assert!((p.x - x).abs() < 1e-12 && (p.y + y).abs() < 1e-12 && p.z == 0.0, "{p} {x} {y}");
        }
        assert!(model.notes[0].contains("1 meshes have a skin"), "{:?}", model.notes);
    }

    #[test]
    fn broken_shapes_are_refused() {
        let refused = |change: &dyn Fn(&mut Value)| {
            let nodes = json!([{"mesh": 0, "skin": 0}, {}, {"children": [3]}, {}]);
            let mut document = file(json!({}), &[1.0, 1.0], json!({ "nodes": nodes }));
            change(&mut document);
            read(&document).unwrap_err().to_string()
        };
        let joints = |list: Value| move |d: &mut Value| d["skins"][0]["joints"] = list.clone();
        assert!(refused(&joints(json!([2, 9]))).contains("names node 9 of 4"));
        assert!(refused(&joints(json!([2]))).contains("names joint 1 of a skin of 1"));
        assert!(refused(&joints(json!([2, 3, 1]))).contains("binds 2 of the 3 joints"));
        assert!(refused(&|d| d["nodes"][3]["children"] = json!([2])).contains("deeper than 64"));
        assert!(refused(&|d| d["accessors"][2]["count"] = json!(2)).contains("moves 2 of 3 vertices"));
        let sparse = |d: &mut Value| d["accessors"][6]["count"] = json!(1);
        assert!(refused(&sparse).contains("names item 1 of 1"));
        assert!(refused(&|d| d["accessors"][6]["sparse"] = json!({"count": 1})).contains("sparse accessor"));
        assert!(
            refused(&|d| d["accessors"][6] = json!({"componentType": 5126, "count": 3, "type": "VEC3"}))
                .contains("buffer view")
        );
    }
}
