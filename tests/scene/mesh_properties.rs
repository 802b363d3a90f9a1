//! Any mesh comes back from every format, and any words are read or refused.

#![allow(clippy::unwrap_used, reason = "tests may stop and report")]

use std::fmt::Write as _;
use std::path::Path;

use glam::DVec3;
use proptest::collection::vec;
use proptest::prelude::*;
use splatblur::model::mesh::{self, Mesh};
use splatblur::model::{ModelFormat, parse_mesh};

use crate::meshes::{floats, glb};

/// Corners of all triangles, in their order.
fn corners(mesh: &Mesh) -> Vec<[DVec3; 3]> {
    mesh.triangles.iter().map(|t| t.corners.map(|corner| mesh.position[corner as usize])).collect()
}

fn obj(text: &str) -> Result<Option<Mesh>, splatblur::model::ParseError> {
    mesh::read(text.as_bytes(), ModelFormat::Obj, Path::new("nowhere/m.obj"), None)
}

/// A word of an OBJ, mostly a good one.
fn word() -> impl Strategy<Value = String> {
    prop_oneof![
        prop::sample::select(vec!["v", "vt", "vn", "f", "usemtl", "mtllib", "l", "#", "\\\n", "\n", "\n", "\n"])
            .prop_map(str::to_owned),
        (-9_i32..9).prop_map(|i| i.to_string()),
        (-9_i32..9, -9_i32..9).prop_map(|(a, b)| format!("{a}/{b}")),
        (-9_i32..9, -9_i32..9).prop_map(|(a, b)| format!("{a}//{b}")),
        any::<f32>().prop_map(|x| x.to_string()),
        "[ -~]{0,4}",
    ]
}

proptest! {
    #[test]
    fn words_of_an_obj_are_read_or_refused(words in vec(word(), 0..200)) {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1 2 3\n{}", words.join(" "));
        match obj(&text) {
            Ok(mesh) => {
                let mesh = mesh.unwrap();
                let count = mesh.position.len() as u32;
                prop_assert!(mesh.triangles.iter().all(|t| t.corners.iter().all(|&corner| corner < count)));
                prop_assert!(mesh.triangles.iter().all(|t| (t.material as usize) < mesh.materials.len()));
            }
            Err(why) => prop_assert!(why.to_string().starts_with("line "), "{why}"),
        }
    }

    #[test]
    fn triangles_come_back_from_every_format(
        points in vec([-1e6_f32..1e6, -1e6_f32..1e6, -1e6_f32..1e6], 3..20),
        picks in vec([0_usize..1000, 0..1000, 0..1000], 1..30),
    ) {
        let faces: Vec<[usize; 3]> = picks.iter().map(|pick| pick.map(|i| i % points.len())).collect();
        let at = |i: usize| DVec3::from_array(points[i].map(f64::from));
        let wanted: Vec<[DVec3; 3]> = faces.iter().map(|face| face.map(at)).collect();
        let (mut text, mut from_end) = (String::new(), String::new());
        let mut ply = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
             element face {}\nproperty list uchar uint vertex_indices\nend_header\n", points.len(), faces.len());
        for [x, y, z] in &points {
            // All digits, as numbers of an OBJ are read in f64.
            let [x, y, z] = [x, y, z].map(|x| f64::from(*x));
            writeln!(text, "v {x} {y} {z}").unwrap();
            writeln!(ply, "{x} {y} {z}").unwrap();
        }
        from_end.push_str(&text);
        for [a, b, c] in &faces {
            writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).unwrap();
            let [i, j, k] = [a, b, c].map(|i| points.len() - i);
            writeln!(from_end, "f -{i} -{j} -{k}").unwrap();
            writeln!(ply, "3 {a} {b} {c}").unwrap();
        }
        prop_assert_eq!(&corners(&obj(&text).unwrap().unwrap()), &wanted);
        prop_assert_eq!(&corners(&obj(&from_end).unwrap().unwrap()), &wanted);
        prop_assert_eq!(&corners(&parse_mesh(ply.as_bytes(), ModelFormat::Ply).unwrap().unwrap()), &wanted);
        let mut bytes = floats(points.as_flattened());
        let split = bytes.len();
        bytes.extend(faces.as_flattened().iter().flat_map(|&i| (i as u32).to_le_bytes()));
        let json = serde_json::json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": points.len(), "type": "VEC3"},
                {"bufferView": 1, "componentType": 5125, "count": 3 * faces.len(), "type": "SCALAR"},
            ],
            "bufferViews": [
                {"buffer": 0, "byteLength": split},
                {"buffer": 0, "byteOffset": split, "byteLength": bytes.len() - split},
            ],
            "buffers": [{"byteLength": bytes.len()}],
        });
        let read = mesh::read(&glb(&json, &bytes), ModelFormat::Glb, Path::new("nowhere/m.glb"), None);
        prop_assert_eq!(&corners(&read.unwrap().unwrap()), &wanted);
    }
}
