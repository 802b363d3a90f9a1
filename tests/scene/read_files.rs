//! The files that were read for a scene, whoever named them.

#![allow(clippy::unwrap_used, reason = "tests may stop")]

use std::fs;
use std::path::Path;

use serde_json::json;
use splatblur::scene_file::{self, SceneLoadOptions};

const SCENE: &str = r#"<scene>
  <image width="8" height="6"/>
  <environment>sky.png</environment>
  <camera eye="0 0 8" at="0 0 0"/>
  <object><pointModel>square.obj</pointModel><animation>a.anim</animation></object>
  <object><pointModel>square.gltf</pointModel></object>
  <object><pointModel sequence="m.%d.ply" first="1" last="2"/></object>
</scene>
"#;

/// A square of two triangles whose numbers lie in another file, and its texture in a third.
fn gltf(dir: &Path) {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0_f32]];
    let places = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0_f32]];
    let numbers = corners.as_flattened().iter().chain(places.as_flattened());
    fs::write(dir.join("square.bin"), numbers.flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>()).unwrap();
    let text = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [
            { "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "mode": 5, "material": 0 }
        ] }],
        "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
        "textures": [{ "source": 0 }], "images": [{ "uri": "of%20gltf.png" }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 0, "byteOffset": 48, "componentType": 5126, "count": 4, "type": "VEC2" },
        ],
        "bufferViews": [{ "buffer": 0, "byteLength": 80 }],
        "buffers": [{ "byteLength": 80, "uri": "square.bin" }],
    });
    fs::write(dir.join("square.gltf"), text.to_string()).unwrap();
}

#[test]
fn all_that_is_read_is_listed() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let place = |name: &str| dir.join(name);
    image::RgbImage::from_pixel(4, 2, image::Rgb([9, 99, 200])).save(place("sky.png")).unwrap();
    fs::copy(place("sky.png"), place("of obj.png")).unwrap();
    fs::copy(place("sky.png"), place("of gltf.png")).unwrap();
    fs::copy(place("sky.png"), place("nobody's.png")).unwrap();
    let square = "mtllib square.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n";
    fs::write(place("square.obj"), square).unwrap();
    fs::write(place("square.mtl"), "newmtl a\nmap_Kd of obj.png\n").unwrap();
    gltf(dir);
    fs::write(place("a.anim"), include_str!("../data/scenes/a.anim")).unwrap();
    for number in 1..=2 {
        fs::write(place(&format!("m.{number}.ply")), include_str!("../data/scenes/m.ply")).unwrap();
    }
    fs::write(place("scene.xml"), SCENE).unwrap();
    let loaded = scene_file::load(&place("scene.xml"), &SceneLoadOptions::default()).unwrap();
    let mut names = [
        "a.anim",
        "m.1.ply",
        // Points are matched by row: whether rows of the next file stand for the same points is looked at.
        "m.2.ply",
        "of gltf.png",
        "of obj.png",
        "scene.xml",
        "sky.png",
        "square.bin",
        "square.gltf",
        "square.mtl",
        "square.obj",
    ]
    .map(place);
    names.sort();
    assert_eq!(loaded.scene.files.into_keys().collect::<Vec<_>>(), names);
    // A model alone.
    let small = SceneLoadOptions { size: Some((8, 6)), ..SceneLoadOptions::default() };
    let loaded = scene_file::load_model(&place("square.obj"), &small).unwrap();
    assert_eq!(
        loaded.scene.files.into_keys().collect::<Vec<_>>(),
        ["of obj.png", "square.mtl", "square.obj"].map(place)
    );
}
