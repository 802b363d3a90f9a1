//! Triangles and surfels that coincide are merged: models that say the same thing a million times cost little.

#![allow(clippy::unwrap_used, reason = "tests may stop")]

use std::fmt::Write as _;

use splatblur::model::{LoadOptions, MeshOptions, Spacing, Surfels, load};

use crate::support::surfels;

/// Reads bytes as a model under this name: its surfels, and its notes.
fn read(name: &str, bytes: &[u8], spacing: Spacing) -> (Surfels, Vec<String>) {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let mesh = MeshOptions { spacing, ..MeshOptions::default() };
    let loaded = load(&path, &LoadOptions { mesh, ..LoadOptions::default() }, &|_, _| {}).unwrap();
    let notes = loaded.notes.clone();
    (surfels(loaded), notes)
}

fn sampled(obj: &str) -> (Surfels, Vec<String>) {
    read("m.obj", obj.as_bytes(), Spacing::Of(0.02))
}

/// All that is drawn.
fn drawn(s: &Surfels) -> (&[splatblur::glam::Vec3], &[splatblur::glam::Vec3], &[splatblur::glam::Vec3], bool) {
    (&s.position, &s.axis_u, &s.colour, s.two_sided)
}

fn merged(notes: &[String]) -> Option<&str> {
    notes.iter().map(String::as_str).find(|note| note.starts_with("merged what coincides"))
}

const VERTICES: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0.5\n";

#[test]
fn a_triangle_that_repeats_another_is_left_out() {
    let (one, notes) = sampled(&format!("{VERTICES}f 1 2 3\n"));
    let (many, notes_of_many) = sampled(&format!("{VERTICES}{}", "f 1 2 3\nf 2 3 1\nf 3 1 2\n".repeat(500)));
    assert!(one.len() > 1000 && merged(&notes).is_none(), "{notes:?}");
    assert_eq!(drawn(&many), drawn(&one));
    let note = merged(&notes_of_many).unwrap();
    assert!(note.contains("1499 triangles that repeat another, 0 surfels"), "{note}");
    // Equal vertices that are listed twice are equal.
    let (again, _) = sampled(&format!("{VERTICES}v 0 0 -0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 6 7 5\n"));
    assert_eq!(drawn(&again), drawn(&one));
}

#[test]
fn the_other_side_and_another_look_stay() {
    // The same corners the other way round.
    let (both, notes) = sampled(&format!("{VERTICES}f 1 2 3\nf 1 3 2\n"));
    let ups = both.normal.iter().filter(|normal| normal.z > 0.0).count();
    assert!(ups > 1000 && both.len() - ups > 1000, "{ups} of {}", both.len());
    assert!(merged(&notes).is_none(), "{notes:?}");
    // Other colours, and other normals, at the same places.
    let coloured = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nv 0 0 0 0 0 1\nv 1 0 0 0 0 1\nv 0 1 0 0 0 1\n";
    let (two, notes) = sampled(&format!("{coloured}f 1 2 3\nf 4 5 6\n"));
    let reds = two.colour.iter().filter(|colour| colour.x > 0.5).count();
    assert!(merged(&notes).is_none() && reds > 1000 && two.len() - reds > 1000, "{reds}: {notes:?}");
    let normals = "vn 0 0 1\nvn 1 0 1\n";
    let (two, notes) = sampled(&format!("{VERTICES}{normals}f 1//1 2//1 3//1\nf 1//2 2//2 3//2\n"));
    let turned = two.normal.iter().filter(|normal| normal.x > 0.5).count();
    assert!(merged(&notes).is_none() && turned > 1000 && two.len() - turned > 1000, "{turned}: {notes:?}");
}

/// Large triangles of one plane, no two of them equal: each ray meets all of them at one place.
#[test]
fn surfels_of_one_ray_plane_and_colour_are_one() {
    let mut obj = String::new();
    for i in 0..2000 {
        let x = f64::from(i) * 1e-4;
        writeln!(obj, "v {} -1 0\nv 1 {x} 0\nv -1 {x} 0\nf {} {} {}", -x, 3 * i + 1, 3 * i + 2, 3 * i + 3).unwrap();
    }
    let (surfels, notes) = read("m.obj", obj.as_bytes(), Spacing::Of(0.05));
    let note = merged(&notes).unwrap();
    // An area of 1.3 has 520 rays, and edges have surfels of their own. Without merging there are 900,000.
    assert!(surfels.len() < 20_000, "{} surfels; {note}", surfels.len());
}

/// Each of these took a minute of processor time. Counts are exact where times are not.
#[test]
fn what_says_the_same_many_times_costs_little() {
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 .5\n";
    let corners = |count: usize| " 1 2 3 4".repeat(count / 4);
    let primitives = vec![r#"{"attributes":{"POSITION":0}}"#; 20_000].join(",");
    let gltf = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{primitives}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,"uri":
        "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}]}}"#
    );
    let mut ply = b"ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        .to_vec();
    ply.extend([0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes).as_flattened());
    ply.push(255);
    ply.extend((0..255_i32).flat_map(|i| (i % 4).to_le_bytes()));
    let inputs = [
        ("face.ply", ply),
        ("faces.obj", format!("{vertices}{}", "f 1 2 3\n".repeat(100_000)).into_bytes()),
        ("corners.obj", format!("{vertices}f{}\n", corners(120_000)).into_bytes()),
        ("primitives.gltf", gltf.into_bytes()),
    ];
    for (name, bytes) in inputs {
        let (surfels, notes) = read(name, &bytes, Spacing::Surfels(10_000));
        assert!(surfels.len() < 25_000, "{name}: {}", surfels.len());
        assert!(merged(&notes).is_some(), "{name}: {notes:?}");
    }
}
