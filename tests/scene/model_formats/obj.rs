//! Wavefront OBJ.

use std::fmt::Write as _;

use glam::{DVec3, Vec3};
use splatblur::model::{ColourStorage, ModelFormat};

use super::support::{cloud, load_as, refused};
use crate::support::surfels;

const QUAD: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn forms_of_faces() {
    for face in [
        "f 1 2 3 4",
        "f 1/1 2/2 3/3 4/4",
        "f 1//1 2//1 3//1 4//1",
        "f 1/9/9 2/9/9 3/9/9 4/9/9",
        "f -4 -3 -2 -1",
        "f 1 2 3\r\nf 1 3 4",
        "f 1 2 \\\n 3 4 # a comment",
        "g a b\ns off\nusemtl caf\u{e9}\nf 1 2 3 4",
    ] {
        let c = cloud(
            format!("# quad\nmtllib x.mtl\no name\n{QUAD}vt 0 0\nvn 1 0 0\n{face}\n").as_bytes(),
            ModelFormat::Obj,
        );
        assert_eq!(c.normal, [Vec3::Z; 4], "{face}");
        assert!(c.colour.is_empty());
    }
}

#[test]
fn vertices_with_colours_and_weights() {
    let c = cloud(b"v 1 2 3 1\r\nv 4 5 6 1 0.5 0\r\n\tv  7 8 9 1 0 0.5 1\r\n", ModelFormat::Obj);
    assert_eq!(c.position, [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0), DVec3::new(7.0, 8.0, 9.0)]);
    assert_eq!(c.colour, [Vec3::ONE, Vec3::new(1.0, 0.5, 0.0), Vec3::new(0.0, 0.5, 1.0)]);
    assert_eq!(c.colour_storage, ColourStorage::Integer);
    assert!(c.normal.is_empty());
}

#[test]
fn normals_of_a_point_cloud_are_used() {
    let c = cloud(b"v 0 0 0\nvn 0 0 2\nv 1 0 0\nvn 0 -1 0\n", ModelFormat::Obj);
    assert_eq!(c.normal, [Vec3::Z, Vec3::NEG_Y]);
    let c = cloud(b"v 0 0 0\nv 1 0 0\nvn 0 -1 0\n", ModelFormat::Obj);
    assert!(c.normal.is_empty());
}

#[test]
fn bad_statements_are_named() {
    let message = |text: &str| refused(text.as_bytes(), ModelFormat::Obj).to_string();
    assert_eq!(message("v 1 2\n"), "line 1: found 2 numbers, expected `v x y z [w] [r g b]`");
    assert_eq!(message("v 0 0 0\nv 1 2 three\n"), "line 2: found `three`, expected a number");
    assert!(message("hello\n").contains("no vertex in the whole file"));
    let face = |corners: &str| message(&format!("{QUAD}f {corners}\n"));
    let index = "expected a vertex index from 1 to 4, or from -4 to -1";
    assert_eq!(face("1 2 5"), format!("line 5: found face corner `5`, {index}"));
    assert_eq!(face("0 1 2"), format!("line 5: found face corner `0`, {index}"));
    assert_eq!(face("1 2 -5"), format!("line 5: found face corner `-5`, {index}"));
    assert_eq!(face("1 2 99999999999999999999"), format!("line 5: found face corner `99999999999999999999`, {index}"));
    assert_eq!(face("/1 2 3"), format!("line 5: found face corner `/1`, {index}"));
    assert_eq!(face("1 2"), "line 5: found a face of 2 corners, expected 3 or more");
}

#[test]
fn known_by_its_extension_only() {
    assert_eq!(surfels(load_as("quad.OBJ", QUAD.as_bytes()).unwrap()).len(), 4);
    assert!(load_as("quad.txt", QUAD.as_bytes()).unwrap_err().to_string().contains("no known format (known: PLY"));
}

#[test]
fn a_mesh_of_few_vertices_is_noted() {
    let mut cube = String::new();
    for i in 0..8 {
        writeln!(cube, "v {} {} {}", i & 1, i >> 1 & 1, i >> 2).unwrap();
    }
    for face in ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"] {
        writeln!(cube, "f {face}").unwrap();
    }
    let notes = cloud(cube.as_bytes(), ModelFormat::Obj).notes;
    let expected = "8 vertices for 6 faces: faces are not drawn, so sample points on the mesh";
    assert!(notes.iter().any(|note| note == expected), "{notes:?}");
    // Points alone are no mesh, and many vertices are a surface.
    let many = "v 0 0 0\nv 1 0 0\n".repeat(500) + "v 0 1 0\nf 999 1000 1001\n";
    for text in [cube.split("f ").next().unwrap().to_owned(), many] {
        let notes = cloud(text.as_bytes(), ModelFormat::Obj).notes;
        assert!(!notes.iter().any(|note| note.contains("faces are not drawn")), "{notes:?}");
    }
}
