//! Our PLY reader against the crate `ply-rs-bw`, which shares no code with it.

use glam::{DVec3, Vec3};
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Ply as Theirs, Property};
use splatblur::model::ModelFormat;

use super::support::{ENCODINGS, Ply, cloud, read};

fn number(element: &DefaultElement, name: &str) -> f64 {
    match element[name] {
        Property::Float(v) => f64::from(v),
        Property::Double(v) => v,
        Property::UChar(v) => f64::from(v),
        Property::UShort(v) => f64::from(v),
        Property::Short(v) => f64::from(v),
        ref other => panic!("{other:?}"),
    }
}

fn theirs(bytes: &[u8]) -> Theirs<DefaultElement> {
    Parser::<DefaultElement>::new().read_ply(&mut &*bytes).unwrap()
}

fn vector(e: &DefaultElement, names: [&str; 3]) -> DVec3 {
    DVec3::from_array(names.map(|n| number(e, n)))
}

#[test]
fn ascii_with_normals_and_colours() {
    let bytes = read("spot_1500_ascii.ply");
    let (ours, theirs) = (cloud(&bytes, ModelFormat::Ply), theirs(&bytes));
    let vertices = &theirs.payload["vertex"];
    assert_eq!((ours.position.len(), vertices.len()), (1500, 1500));
    for (i, v) in vertices.iter().enumerate() {
        // Text is read to f64 here and to f32 there.
        assert_eq!(ours.position[i].as_vec3(), vector(v, ["x", "y", "z"]).as_vec3());
        assert!((ours.normal[i] - vector(v, ["nx", "ny", "nz"]).as_vec3()).length() < 1e-4);
        let colour = vector(v, ["red", "green", "blue"]).as_vec3() / 255.0;
        assert!((ours.colour[i] - colour).length() < 1e-6);
    }
}

#[test]
fn big_endian_mesh() {
    let bytes = read("spot_mesh_be.ply");
    let (ours, theirs) = (cloud(&bytes, ModelFormat::Ply), theirs(&bytes));
    let positions: Vec<DVec3> = theirs.payload["vertex"].iter().map(|v| vector(v, ["x", "y", "z"])).collect();
    assert_eq!(ours.position, positions);
    // Area-weighted normals, the short way.
    let mut normals = vec![DVec3::ZERO; positions.len()];
    for face in &theirs.payload["face"] {
        let Property::ListInt(ref corners) = face["vertex_indices"] else { panic!("{face:?}") };
        let [a, b, c] = [0, 1, 2].map(|k| corners[k] as usize);
        let area = (positions[b] - positions[a]).cross(positions[c] - positions[a]);
        for i in [a, b, c] {
            normals[i] += area;
        }
    }
    for (ours, theirs) in ours.normal.iter().zip(normals) {
        assert!((*ours - theirs.normalize().as_vec3()).length() < 1e-6);
    }
}

#[test]
fn generated_files() {
    let properties =
        [("ushort", "red"), ("double", "x"), ("short", "y"), ("float", "z"), ("ushort", "green"), ("ushort", "blue")];
    let rows: Vec<Vec<f64>> = (0..50)
        .map(|i| {
            let i = f64::from(i);
            vec![i * 1000.0, i.sin(), -i, 0.25 * i, 65535.0 - i, 7.0]
        })
        .collect();
    for encoding in ENCODINGS {
        let bytes = Ply::new(encoding)
            .lists("other", "ids", "uchar", "short", &[vec![1.0, -2.0]])
            .element("vertex", &properties, &rows)
            .bytes();
        let (ours, theirs) = (cloud(&bytes, ModelFormat::Ply), theirs(&bytes));
        for (i, v) in theirs.payload["vertex"].iter().enumerate() {
            assert_eq!(ours.position[i], vector(v, ["x", "y", "z"]), "{encoding:?}");
            let colour: Vec3 = (vector(v, ["red", "green", "blue"]) / 65535.0).as_vec3();
            assert_eq!(ours.colour[i], colour, "{encoding:?}");
        }
    }
}
