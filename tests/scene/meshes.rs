//! Meshes of glTF and OBJ files: values that another reader finds too, and files that are refused.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may stop and report")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3, Mat4, Vec2, Vec3, Vec4};
use serde_json::{Value, json};
use splatblur::model::ModelFormat;
use splatblur::model::mesh::{self, AlphaMode, Mesh, Wrap};

/// A model: one that ships, or one for tests alone.
pub(crate) fn data(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let shipped = root.join("scenes/models").join(name);
    if shipped.exists() { shipped } else { root.join("tests/data/models").join(name) }
}

/// Texels of the truck's image, as Pillow decodes it.
const TRUCK_TEXELS: [([usize; 2], [u8; 4]); 3] =
    [([0, 0], [255; 4]), ([1000, 1000], [255; 4]), ([2000, 100], [38, 38, 38, 255])];

/// Mean colour of the bottle's image, as Pillow decodes it.
const FUZE_MEAN: [f64; 3] = [136.556, 124.437, 123.363];

fn read(path: &Path, node: Option<&str>) -> Result<Option<Mesh>, String> {
    let bytes = fs::read(path).unwrap();
    let format = ModelFormat::detect(&bytes, path).unwrap();
    mesh::read(&bytes, format, path, node).map_err(|why| why.to_string())
}

fn of(name: &str, node: Option<&str>) -> Mesh {
    read(&data(name), node).unwrap().unwrap()
}

/// A GLB of a text and its data.
pub(crate) fn glb(text: &Value, data: &[u8]) -> Vec<u8> {
    let mut text = serde_json::to_vec(text).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut data = data.to_vec();
    data.resize(data.len().next_multiple_of(4), 0);
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + text.len() as u32 + data.len() as u32).to_le_bytes());
    bytes.extend((text.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(text);
    bytes.extend((data.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(data);
    bytes
}

pub(crate) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Four corners of a square, (0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), as a strip, with their x and y as texture
/// coordinates of set 1.
fn square() -> (Value, Vec<u8>) {
    let mut data = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    data.extend(floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]));
    let text = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "square"}],
        "meshes": [{"name": "flat", "primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_1": 1}, "mode": 5}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 0, "byteOffset": 48, "componentType": 5126, "count": 4, "type": "VEC2"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 80}],
        "buffers": [{"byteLength": 80}],
    });
    (text, data)
}

fn parse(text: &Value, data: &[u8]) -> Result<Option<Mesh>, String> {
    mesh::read(&glb(text, data), ModelFormat::Glb, Path::new("x.glb"), None).map_err(|why| why.to_string())
}

/// The square after a change of its text.
fn changed(change: impl FnOnce(&mut Value)) -> Result<Option<Mesh>, String> {
    let (mut text, data) = square();
    change(&mut text);
    parse(&text, &data)
}

/// Triangles as positions of their corners.
fn corners(mesh: &Mesh) -> Vec<[DVec3; 3]> {
    mesh.triangles.iter().map(|t| t.corners.map(|c| mesh.position[c as usize])).collect()
}

/// Positions, normals and texture coordinates of all corners, as the crate `gltf` reads them.
fn other_reader(path: &Path) -> Vec<(DVec3, Vec3, Vec2)> {
    let gltf::Gltf { document, blob } = gltf::Gltf::open(path).unwrap();
    let blob = blob.unwrap();
    let mut out = Vec::new();
    let mut open: Vec<(gltf::Node<'_>, Mat4)> =
        document.default_scene().unwrap().nodes().map(|node| (node, Mat4::IDENTITY)).collect();
    open.reverse();
    while let Some((node, parent)) = open.pop() {
        let place = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        let mut children: Vec<_> = node.children().map(|child| (child, place)).collect();
        children.reverse();
        open.extend(children);
        let Some(mesh) = node.mesh() else { continue };
        let turn = place.inverse().transpose();
        for primitive in mesh.primitives() {
            let reader = primitive.reader(|_| Some(&blob));
            let positions: Vec<_> = reader.read_positions().unwrap().collect();
            let normals: Vec<_> = reader.read_normals().unwrap().collect();
            let uvs: Vec<[f32; 2]> = reader
                .read_tex_coords(0)
                .map_or_else(|| vec![[0.0; 2]; positions.len()], |uvs| uvs.into_f32().collect());
            for index in reader.read_indices().unwrap().into_u32() {
                let i = index as usize;
                let position = place.transform_point3(positions[i].into()).as_dvec3();
                let normal = turn.transform_vector3(normals[i].into()).normalize();
                out.push((position, normal, uvs[i].into()));
            }
        }
    }
    out
}

#[test]
fn another_reader_sees_the_same_triangles() {
    for (name, triangles) in
        [("BoxTextured.glb", 12), ("BoxInterleaved.glb", 12), ("cubevc.glb", 48), ("CesiumMilkTruck.glb", 3624)]
    {
        let mesh = of(name, None);
        let truth = other_reader(&data(name));
        assert_eq!((mesh.triangles.len(), truth.len()), (triangles, 3 * triangles), "{name}");
        let ours = mesh.triangles.iter().flat_map(|t| t.corners).map(|c| c as usize);
        for (c, (position, normal, uv)) in ours.zip(truth) {
            // The other reader multiplies in f32.
            assert!((mesh.position[c] - position).length() < 2e-6, "{name}: {} {position}", mesh.position[c]);
            assert!((mesh.normal[c] - normal).length() < 1e-5, "{name}: {} {normal}", mesh.normal[c]);
            assert_eq!(mesh.uv.get(c).copied().unwrap_or_default(), uv, "{name}");
        }
    }
}

#[test]
fn materials_and_textures_are_those_of_the_file() {
    let mesh = of("BoxTextured.glb", None);
    let texture = &mesh.textures[0];
    assert_eq!((texture.size, texture.wrap), ([256, 256], [Wrap::Repeat; 2]));
    assert_eq!((mesh.materials[0].texture, mesh.materials[0].alpha), (Some(0), AlphaMode::Opaque));
    assert_eq!(texture.texels.len(), 65_536);
    let red = of("BoxInterleaved.glb", None);
    assert!((red.materials[0].colour - Vec4::new(0.8, 0.0, 0.0, 1.0)).length() < 1e-6);
    assert!(red.uv.is_empty() && red.textures.is_empty() && red.colour.is_empty());

    let truck = of("CesiumMilkTruck.glb", None);
    let names: Vec<&str> = truck.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["truck", "glass", "window_trim", "wheels"]);
    // Two textures of the file are one image.
    assert_eq!(truck.textures.len(), 1);
    assert_eq!(truck.textures[0].size, [2048, 2048]);
    // As Pillow decodes them.
    for ([x, y], texel) in TRUCK_TEXELS {
        assert_eq!(truck.textures[0].texels[y * 2048 + x], texel, "{x} {y}");
    }
    assert!(truck.notes.iter().any(|note| note.contains("animations")), "{:?}", truck.notes);

    // Six sides of eight triangles; Blender wrote float colours.
    let cube = of("cubevc.glb", None);
    assert_eq!(cube.colour.len(), cube.position.len());
    assert!(cube.colour.iter().all(|colour| colour.w == 1.0));
    assert!(cube.colour.iter().any(|colour| *colour != Vec4::ONE));
}

#[test]
fn one_node_is_in_its_own_space() {
    let wheels = of("CesiumMilkTruck.glb", Some("#2"));
    assert_eq!(wheels.triangles.len(), 768);
    let far = wheels.position.iter().fold(DVec3::ZERO, |most, p| most.max(p.abs()));
    assert!((far - DVec3::new(0.4278, 0.4278, 1.058)).length() < 1e-6, "{far}");
    // Two nodes of one mesh are one geometry.
    assert_eq!(of("CesiumMilkTruck.glb", Some("Wheels")).position, wheels.position);
    // The children of the body are not a part of it.
    assert_eq!(of("CesiumMilkTruck.glb", Some("Cesium_Milk_Truck")).triangles.len(), 2088);
    let says = |name: &str, part: &str| {
        let error = read(&data("CesiumMilkTruck.glb"), Some(name)).unwrap_err();
        assert!(error.contains(part), "{error}");
    };
    says("Wheel", "found no node `Wheel`, expected a node of the file: #0 (mesh Cesium_Milk_Truck), #1");
    says("#9", "no node `#9`");
    says("#1", "node #1 (`#1`) without a mesh");
    // Two meshes of one name.
    let (mut text, bytes) = square();
    text["meshes"] = json!([text["meshes"][0], text["meshes"][0]]);
    text["nodes"] = json!([{"mesh": 0, "children": [1]}, {"mesh": 1}]);
    let error = mesh::read(&glb(&text, &bytes), ModelFormat::Glb, Path::new("x.glb"), Some("flat")).unwrap_err();
    assert!(error.to_string().contains("found 2 nodes `flat`, expected one of #0, #1"), "{error}");
}

#[test]
fn nodes_are_listed() {
    let bytes = fs::read(data("CesiumMilkTruck.glb")).unwrap();
    let nodes = mesh::nodes(&bytes, &data("CesiumMilkTruck.glb")).unwrap();
    let parents: Vec<Option<usize>> = nodes.nodes.iter().map(|node| node.parent).collect();
    assert_eq!(parents, [None, Some(0), Some(1), Some(0), Some(3)]);
    let moved: Vec<bool> = nodes.nodes.iter().map(|node| node.animated).collect();
    assert_eq!(moved, [false, false, true, false, true]);
    let triangles: Vec<u64> = nodes.nodes.iter().map(|node| node.triangles).collect();
    assert_eq!(triangles, [2088, 0, 768, 0, 768]);
    assert_eq!(nodes.animations.len(), 1);
    assert_eq!((nodes.animations[0].seconds, nodes.animations[0].channels), (1.25, 2));
    assert_eq!(nodes.label(4), "#4");
}

#[test]
fn strips_fans_and_lists_have_the_corners_of_the_specification() {
    let at = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let [a, b, c, d] = [at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(1.0, 1.0)];
    let mode = |mode: u32| changed(|text| text["meshes"][0]["primitives"][0]["mode"] = json!(mode));
    assert_eq!(corners(&mode(5).unwrap().unwrap()), [[a, b, c], [b, d, c]]);
    assert_eq!(corners(&mode(6).unwrap().unwrap()), [[b, c, a], [c, d, a]]);
    let list = mode(4).unwrap().unwrap();
    assert_eq!(corners(&list), [[a, b, c]]);
    assert!(list.notes.iter().any(|note| note.contains("corners at the end")), "{:?}", list.notes);
    // Points alone are no mesh.
    assert!(mode(0).unwrap().is_none());
}

#[test]
fn what_mirrors_turns_its_triangles() {
    let (mut text, mut bytes) = square();
    bytes.extend(floats(&[0.6, 0.0, 0.8].repeat(4)));
    text["buffers"][0]["byteLength"] = json!(128);
    text["bufferViews"][0]["byteLength"] = json!(128);
    let normals = json!({"bufferView": 0, "byteOffset": 80, "componentType": 5126, "count": 4, "type": "VEC3"});
    text["accessors"].as_array_mut().unwrap().push(normals);
    text["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(2);
    text["nodes"] = json!([{"children": [1], "translation": [5.0, 0.0, 0.0]}, {"mesh": 0, "scale": [-2.0, 1.0, 1.0]}]);
    let mesh = parse(&text, &bytes).unwrap().unwrap();
    let [a, b, c] = corners(&mesh)[0];
    assert!((b - a).cross(c - a).z > 0.0, "the front still shows");
    assert_eq!(mesh.position[0], DVec3::new(5.0, 0.0, 0.0));
    // (-0.6/2, 0, 0.8), at length 1: planes stay planes.
    let expected = Vec3::new(-0.3, 0.0, 0.8).normalize();
    assert!((mesh.normal[0] - expected).length() < 1e-6, "{}", mesh.normal[0]);
}

#[test]
fn texture_coordinates_are_scaled_then_turned_then_shifted() {
    let mut image = Vec::new();
    image::RgbImage::from_pixel(2, 1, image::Rgb([10, 20, 30]))
        .write_to(&mut std::io::Cursor::new(&mut image), image::ImageFormat::Png)
        .unwrap();
    let (mut text, mut bytes) = square();
    let (at, length) = (bytes.len(), image.len());
    bytes.extend(image);
    text["buffers"][0]["byteLength"] = json!(at + length);
    text["bufferViews"].as_array_mut().unwrap().push(json!({"buffer": 0, "byteOffset": at, "byteLength": length}));
    text["images"] = json!([{"bufferView": 1, "mimeType": "image/png"}]);
    text["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648}]);
    text["textures"] = json!([{"source": 0, "sampler": 0}]);
    text["meshes"][0]["primitives"][0]["material"] = json!(0);
    let transform = json!({"offset": [0.25, 0.5], "rotation": std::f64::consts::FRAC_PI_2, "scale": [2.0, 3.0],
        "texCoord": 1});
    text["extensionsRequired"] = json!(["KHR_texture_transform"]);
    text["materials"] = json!([{
        "name": "m", "alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": true,
        "normalTexture": {"index": 0},
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1.0, 0.75], "metallicFactor": 0.0,
            "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": transform}}},
    }]);
    let mesh = parse(&text, &bytes).unwrap().unwrap();
    let material = &mesh.materials[0];
    assert_eq!(material.colour, Vec4::new(0.5, 0.25, 1.0, 0.75));
    assert_eq!((material.alpha, material.two_sided, material.name.as_str()), (AlphaMode::Mask(0.3), true, "m"));
    assert_eq!(mesh.textures[0].wrap, [Wrap::Clamp, Wrap::Mirror]);
    assert_eq!(mesh.textures[0].texels, [[10, 20, 30, 255]; 2]);
    assert!(mesh.notes.iter().any(|note| note.contains("normal maps (1 materials)")), "{:?}", mesh.notes);
    // Seen with v downwards, a quarter turn counter-clockwise takes right to up, and down to right.
    for (corner, uv) in [(0, [0.25, 0.5]), (1, [0.25, -1.5]), (2, [3.25, 0.5])] {
        assert!((mesh.uv[corner] - Vec2::from(uv)).length() < 1e-6, "{corner}: {}", mesh.uv[corner]);
    }
    // A missing image is a note, and the rest is drawn.
    text["images"] = json!([{"uri": "nowhere.png"}]);
    let mesh = parse(&text, &bytes).unwrap().unwrap();
    assert_eq!(mesh.materials[0].texture, None);
    assert!(mesh.notes.iter().any(|note| note.contains("`nowhere.png` which is missing")), "{:?}", mesh.notes);
}

#[test]
fn data_lies_beside_the_text_or_in_it() {
    let (mut text, bytes) = square();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("square.gltf");
    fs::create_dir(folder.path().join("in")).unwrap();
    fs::write(folder.path().join("in/a b.bin"), &bytes).unwrap();
    fs::write(folder.path().join("50%.bin"), &bytes).unwrap();
    let mut with = |uri: &str| {
        text["buffers"][0]["uri"] = json!(uri);
        fs::write(&path, serde_json::to_vec(&text).unwrap()).unwrap();
        read(&path, None)
    };
    let encoded = base64(&bytes);
    let inline = format!("data:application/octet-stream;base64,{encoded}");
    for uri in ["in/a%20b.bin", "in/a b.bin", "./in/../in/a b.bin", "50%.bin", &inline] {
        assert_eq!(with(uri).unwrap_or_else(|why| panic!("{uri}: {why}")).unwrap().triangles.len(), 2);
    }
    fs::write(folder.path().join("short.bin"), b"abc").unwrap();
    for (uri, part) in [
        ("../square.bin", "which leads out of the folder"),
        ("in/../../x.bin", "which leads out of the folder"),
        ("/etc/hostname", "which leads out of the folder"),
        ("https://example.org/x.bin", "which leads out of the folder"),
        ("none.bin", "`none.bin` which is missing"),
        ("in", "`in` which is a directory, expected a regular file"),
        ("short.bin", "a buffer of 80 bytes"),
        ("data:,abc", "that is not base64"),
        ("data:;base64,a", "with bad base64"),
    ] {
        let error = with(uri).unwrap_err();
        assert!(error.contains(part), "{uri}: {error}");
        assert_eq!(error.lines().count(), 1);
    }
    #[cfg(unix)]
    {
        let outside = tempfile::tempdir().unwrap();
        fs::write(outside.path().join("x.bin"), &bytes).unwrap();
        std::os::unix::fs::symlink(outside.path().join("x.bin"), folder.path().join("link.bin")).unwrap();
        assert!(with("link.bin").unwrap_err().contains("leads out of the folder"));
    }
}

fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for group in bytes.chunks(3) {
        let bits = group.iter().fold(0_u32, |bits, byte| bits << 8 | u32::from(*byte)) << (8 * (3 - group.len()));
        for i in 0..=group.len() {
            text.push(LETTERS[(bits >> (18 - 6 * i) & 63) as usize].into());
        }
        text.push_str(&"=".repeat(3 - group.len()));
    }
    text
}

/// A change of the square's text.
type Change = fn(&mut Value);

#[test]
fn hostile_files_are_refused_in_one_line() {
    let cases: &[(&str, Change)] = &[
        ("node 0 a second time", |t| t["nodes"] = json!([{"mesh": 0, "children": [0]}])),
        ("node 1 a second time, below the nodes 0 and 2", |t| {
            t["nodes"] = json!([{"children": [1, 2]}, {"mesh": 0}, {"children": [1]}]);
        }),
        ("node 1 a second time, expected a tree", |t| {
            t["nodes"] = json!([{"mesh": 0}, {"children": [2]}, {"children": [1]}]);
        }),
        ("node 7, expected below 1", |t| t["nodes"][0]["children"] = json!([7])),
        ("node 7, expected below 1", |t| t["scenes"][0]["nodes"] = json!([7])),
        ("scene 3, expected below 1", |t| t["scene"] = json!(3)),
        ("mesh 5, expected below 1", |t| t["nodes"][0]["mesh"] = json!(5)),
        ("accessor 9, expected below 2", |t| t["meshes"][0]["primitives"][0]["indices"] = json!(9)),
        ("material 2, expected below 0", |t| t["meshes"][0]["primitives"][0]["material"] = json!(2)),
        ("a primitive of mode 9", |t| t["meshes"][0]["primitives"][0]["mode"] = json!(9)),
        ("1000000000 values from byte 0", |t| t["accessors"][0]["count"] = json!(1_000_000_000)),
        ("18446744073709551615 values", |t| t["accessors"][0]["count"] = json!(u64::MAX)),
        ("4 values from byte 77", |t| t["accessors"][0]["byteOffset"] = json!(77)),
        ("sparse values", |t| t["accessors"][0]["sparse"] = json!({"count": 1})),
        ("no buffer view", |t| t["accessors"][0]["bufferView"] = Value::Null),
        ("type Vec2, expected Vec3", |t| t["accessors"][0]["type"] = json!("VEC2")),
        ("component type 7", |t| t["accessors"][0]["componentType"] = json!(7)),
        ("buffer view 0 of 999 bytes", |t| t["bufferViews"][0]["byteLength"] = json!(999)),
        ("a stride of 4 bytes", |t| t["bufferViews"][0]["byteStride"] = json!(4)),
        ("a buffer of 999 bytes", |t| t["buffers"][0]["byteLength"] = json!(999)),
        ("`KHR_draco_mesh_compression`, an extension", |t| {
            t["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
        }),
        ("`EXT_meshopt_compression`, an extension", |t| t["extensionsRequired"] = json!(["EXT_meshopt_compression"])),
        ("packed by `EXT_meshopt_compression`", |t| {
            t["bufferViews"][0]["extensions"] = json!({"EXT_meshopt_compression": {}});
        }),
        ("packed by `KHR_draco_mesh_compression`", |t| {
            t["accessors"][0]["bufferView"] = Value::Null;
            t["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_draco_mesh_compression": {}});
        }),
        ("`X_future`, an extension", |t| t["extensionsRequired"] = json!(["X_future"])),
        ("node 0, a matrix whose last row", |t| t["nodes"][0]["matrix"] = json!(vec![1.0; 16])),
        ("node 0, a rotation without direction", |t| t["nodes"][0]["rotation"] = json!([0, 0, 0, 0])),
        ("a text that fails at", |t| t["nodes"] = json!("many")),
        ("3 values of an attribute, expected 4", |t| {
            t["accessors"][1]["count"] = json!(3);
            t["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": 0, "TEXCOORD_0": 1});
        }),
        ("texture 4, expected below 0", |t| {
            t["meshes"][0]["primitives"][0]["material"] = json!(0);
            t["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 4}}}]);
        }),
        ("no number, expected four numbers", |t| {
            t["meshes"][0]["primitives"][0]["material"] = json!(0);
            t["materials"] = json!([{"pbrMetallicRoughness": {"baseColorFactor": [-1.0, 0.0, 0.0, 1.0]}}]);
        }),
    ];
    for (part, change) in cases {
        let result = changed(*change).map(|mesh| mesh.map(|mesh| mesh.triangles.len()));
        let error = result.expect_err(part);
        assert!(error.contains(part), "{part}: {error}");
        assert_eq!(error.lines().count(), 1, "{error}");
    }
    // Indices beyond the vertices, and a count that no list of triangles has.
    let (mut text, mut bytes) = square();
    bytes.extend([0, 1, 9, 0]);
    text["buffers"][0]["byteLength"] = json!(84);
    text["bufferViews"][0]["byteLength"] = json!(84);
    let indices = json!({"bufferView": 0, "byteOffset": 80, "componentType": 5121, "count": 3, "type": "SCALAR"});
    text["accessors"].as_array_mut().unwrap().push(indices);
    text["meshes"][0]["primitives"][0]["indices"] = json!(2);
    assert!(parse(&text, &bytes).unwrap_err().contains("index 9, expected below 4"));
    // Positions that are no numbers are noted.
    let (text, mut bytes) = square();
    bytes[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let mesh = parse(&text, &bytes).unwrap().unwrap();
    assert_eq!(mesh.triangles.len(), 1);
    assert!(mesh.notes.iter().any(|note| note.contains("positions that are no numbers")), "{:?}", mesh.notes);
}

#[test]
fn one_mesh_in_millions_of_places_is_refused() {
    let (mut text, mut bytes) = square();
    let count = 40_000_usize;
    bytes = bytes.into_iter().cycle().take(48 * count).collect();
    text["buffers"][0]["byteLength"] = json!(bytes.len());
    text["bufferViews"][0]["byteLength"] = json!(bytes.len());
    text["accessors"][0]["count"] = json!(count);
    text["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": 0});
    text["nodes"] = json!(vec![json!({"mesh": 0}); 200]);
    text["scenes"][0]["nodes"] = json!((0..200).collect::<Vec<_>>());
    assert!(parse(&text, &bytes).unwrap_err().contains("more triangles in all places"));
}

#[test]
fn deep_trees_are_read_without_recursion() {
    for depth in [30, 100_000] {
        let mesh = changed(|text| {
            let node = |index: usize| {
                let children: Vec<usize> = if index + 1 < depth { vec![index + 1] } else { Vec::new() };
                json!({"children": children, "translation": [1.0, 0.0, 0.0]})
            };
            let mut nodes: Vec<Value> = (0..depth).map(node).collect();
            nodes[depth - 1] = json!({"mesh": 0});
            text["nodes"] = json!(nodes);
        });
        let mesh = mesh.unwrap().unwrap();
        assert_eq!(mesh.position[0], DVec3::new((depth - 1) as f64, 0.0, 0.0));
    }
}

#[test]
fn every_cut_and_every_changed_byte_is_read_or_refused() {
    let bytes = fs::read(data("BoxInterleaved.glb")).unwrap();
    let path = Path::new("x.glb");
    for length in 0..bytes.len() {
        assert!(mesh::read(&bytes[..length], ModelFormat::Glb, path, None).is_err(), "{length}");
    }
    for at in 0..bytes.len() {
        for change in [1, 0x20, 0x80] {
            let mut changed = bytes.clone();
            changed[at] ^= change;
            let _ = mesh::read(&changed, ModelFormat::Glb, path, None);
            let _ = mesh::nodes(&changed, path);
        }
    }
}

#[test]
fn a_bottle_has_its_texture() {
    let mesh = of("fuze.obj", None);
    assert_eq!(mesh.triangles.len(), 1000);
    let texture = &mesh.textures[0];
    assert_eq!(texture.size, [1024, 1024]);
    let mean = [0, 1, 2].map(|c| texture.texels.iter().map(|t| f64::from(t[c])).sum::<f64>() / 1_048_576.0);
    for (mean, truth) in mean.iter().zip(FUZE_MEAN) {
        assert!((mean - truth).abs() < 0.5, "{mean} {truth}");
    }
    let bottle = &mesh.materials[mesh.triangles[0].material as usize];
    assert_eq!((bottle.name.as_str(), bottle.texture), ("a-super-duper-material", Some(0)));
    // `Tr 1` would hide it.
    assert_eq!((bottle.colour, bottle.alpha), (Vec4::ONE, AlphaMode::Opaque));
    assert!(mesh.notes.iter().any(|note| note.contains("Tr 1")), "{:?}", mesh.notes);
    // The first face of the file: its numbers from the text.
    let text = fs::read_to_string(data("fuze.obj")).unwrap();
    let list = |key: &str| -> Vec<Vec<f64>> {
        let lines = text.lines().filter_map(|line| line.strip_prefix(key));
        lines.map(|line| line.split_whitespace().map(|word| word.parse().unwrap()).collect()).collect()
    };
    let (positions, uvs) = (list("v "), list("vt "));
    let face = text.lines().find_map(|line| line.strip_prefix("f ")).unwrap();
    for (word, corner) in face.split_whitespace().zip(mesh.triangles[0].corners) {
        let [v, vt, _] = [0, 1, 2].map(|i| word.split('/').nth(i).unwrap().parse::<usize>().unwrap() - 1);
        assert_eq!(mesh.position[corner as usize].to_array()[..], positions[v][..3]);
        let uv = mesh.uv[corner as usize];
        assert_eq!((uv.x, uv.y), (uvs[vt][0] as f32, 1.0 - uvs[vt][1] as f32));
    }
}

fn obj(text: &str) -> Result<Option<Mesh>, String> {
    mesh::read(text.as_bytes(), ModelFormat::Obj, Path::new("x.obj"), None).map_err(|why| why.to_string())
}

#[test]
fn faces_of_obj_files() {
    let mesh = of("polygonfaces.obj", None);
    // Five vertices, of which the faces share four at creases: there each face has its own.
    let places: BTreeSet<[u64; 3]> = mesh.position.iter().map(|p| p.to_array().map(f64::to_bits)).collect();
    assert_eq!((mesh.triangles.len(), mesh.position.len(), places.len()), (3, 9, 5));
    assert!(mesh.notes.iter().any(|note| note.contains("`surface.mtl` is missing")), "{:?}", mesh.notes);
    // Vertices without faces are no mesh.
    assert!(obj("v 1 2 3\nv 4 5 6\n").unwrap().is_none());
    let mesh = obj("v 0 0 0 1 0.5 0\nv 1 0 0\nv 0 1 0\nvn 0 0 2\nf -3//-1 -2//1 -1//-1 # a comment\nl 1 2\n");
    let mesh = mesh.unwrap().unwrap();
    assert_eq!(corners(&mesh), [[DVec3::ZERO, DVec3::X, DVec3::Y]]);
    assert_eq!(mesh.normal, [Vec3::Z; 3]);
    assert!(mesh.uv.is_empty());
    // 0.5 in sRGB is 0.2140 of the light.
    assert!((mesh.colour[0] - Vec4::new(1.0, 0.214_041, 0.0, 1.0)).length() < 1e-5, "{}", mesh.colour[0]);
    assert_eq!(mesh.colour[1], Vec4::ONE);
    for (text, part) in [
        ("v 0 0 0\nf 1 1 2\n", "line 2: found face corner `2`, expected a vertex index from 1 to 1"),
        ("v 0 0 0\nf 1 1 0\n", "line 2"),
        ("v 0 0 0\nf 1/1 1 1\n", "line 2: found face corner `1/1`, expected an index of texture coordinates"),
        ("v 0 0 0\nf 1 1\n", "line 2: found a face of 2 corners"),
        ("v 0 0\nf 1 1 1\n", "line 1: found 2 numbers"),
        ("v 0 nan 0\nf 1 1 1\n", "line 1: found the position"),
        ("v 0 1e99 0\nf 1 1 1\n", "line 1: found the position"),
        ("vt nan 0\nv 0 0 0\nf 1/1 1 1\n", "line 1: found the texture coordinates"),
        ("vt 0 1e39\nv 0 0 0\nf 1/1 1 1\n", "line 1: found the texture coordinates"),
        ("v 0 0 0\nvt x\nf 1 1 1\n", "line 2: found `x`"),
    ] {
        let error = obj(text).unwrap_err();
        assert!(error.contains(part), "{error}");
        assert_eq!(error.lines().count(), 1);
    }
}

#[test]
fn materials_of_obj_files_are_found_as_people_name_them() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    fs::create_dir(place("textures")).unwrap();
    let red = image::RgbaImage::from_pixel(1, 1, image::Rgba([255, 0, 0, 9]));
    red.save(place("textures/a b.png")).unwrap();
    fs::write(
        place("my model.mtl"),
        concat!(
            "newmtl  two  words\r\nKd 0.5 0.25 1\r\nd 0.5\r\nmap_Kd -clamp on C:\\Users\\me\\textures\\a b.png\r\n",
            "newmtl see\r\nTr 0.25\r\nmap_Kd ..\\..\\a%20b.png\r\nnewmtl short\r\nKd 0.5\r\n",
        ),
    )
    .unwrap();
    let text = concat!(
        "mtllib my model.mtl\nmtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n",
        "usemtl two words\nf 1 2 3\nusemtl see\nf 1 2 3\nusemtl short\nf 1 2 3\nusemtl unknown\nf 3 2 1\n",
    );
    let with = |text: &str| mesh::read(text.as_bytes(), ModelFormat::Obj, &place("x.obj"), None);
    let mesh = with(text).unwrap().unwrap();
    let used: Vec<_> = mesh.triangles.iter().map(|t| &mesh.materials[t.material as usize]).collect();
    assert_eq!((used[0].colour, used[0].alpha), (Vec4::new(0.5, 0.25, 1.0, 0.5), AlphaMode::Blend));
    let texture = &mesh.textures[used[0].texture.unwrap() as usize];
    assert_eq!((texture.texels[0], texture.wrap), ([255, 0, 0, 9], [Wrap::Clamp; 2]));
    assert_eq!((used[1].colour.w, used[1].texture), (0.75, None));
    assert_eq!(used[2].colour, Vec4::new(0.5, 0.5, 0.5, 1.0));
    assert_eq!(used[3].name, "");
    for part in ["`none.mtl` is missing", "a%20b.png` is missing", "no material `unknown`"] {
        assert!(mesh.notes.iter().any(|note| note.contains(part)), "{part}: {:?}", mesh.notes);
    }
    fs::write(place("bad.mtl"), "newmtl a\nKd x 1 2\n").unwrap();
    let error = with("mtllib bad.mtl\nv 0 0 0\nf 1 1 1\n").unwrap_err().to_string();
    assert!(error.starts_with("line 1: found `bad.mtl`, line 2: `x`"), "{error}");
    fs::write(place("cut.png"), &fs::read(place("textures/a b.png")).unwrap()[..40]).unwrap();
    fs::write(place("cut.mtl"), "newmtl a\nmap_Kd cut.png\n").unwrap();
    let error = with("mtllib cut.mtl\nv 0 0 0\nusemtl a\nf 1 1 1\n").unwrap_err().to_string();
    assert!(error.starts_with("line 3: found texture `cut.png`, a PNG with damage"), "{error}");
}

/// A folder for a square whose image is `bytes`.
fn square_with(bytes: &[u8]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("image"), bytes).unwrap();
    fs::write(folder.path().join("m.mtl"), "newmtl a\nmap_Kd image\n").unwrap();
    folder
}

/// The texture of a square whose image is `bytes`.
fn textured(bytes: &[u8]) -> Result<Option<mesh::Texture>, String> {
    texture_in(&square_with(bytes))
}

fn texture_in(folder: &tempfile::TempDir) -> Result<Option<mesh::Texture>, String> {
    let text = b"mtllib m.mtl\nv 0 0 0\nusemtl a\nf 1 1 1\n";
    let mesh = mesh::read(text, ModelFormat::Obj, &folder.path().join("x.obj"), None).map_err(|why| why.to_string())?;
    Ok(mesh.unwrap().textures.first().cloned())
}

#[test]
fn images_of_all_depths_become_texels() {
    let png = |image: &image::DynamicImage| {
        let mut bytes = Vec::new();
        image.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
        textured(&bytes).unwrap().unwrap().texels
    };
    assert_eq!(png(&image::GrayImage::from_pixel(1, 1, image::Luma([7])).into()), [[7, 7, 7, 255]]);
    assert_eq!(png(&image::GrayAlphaImage::from_pixel(1, 1, image::LumaA([7, 8])).into()), [[7, 7, 7, 8]]);
    assert_eq!(png(&image::RgbaImage::from_pixel(1, 1, image::Rgba([1, 2, 3, 4])).into()), [[1, 2, 3, 4]]);
    let deep: image::ImageBuffer<image::Rgb<u16>, Vec<u16>> =
        image::ImageBuffer::from_pixel(1, 1, image::Rgb([65_535, 257 * 5 + 128, 257 * 5 + 129]));
    assert_eq!(png(&image::DynamicImage::ImageRgb16(deep)), [[255, 5, 6, 255]]);
    let mut palette = Vec::new();
    let mut encoder = png::Encoder::new(&mut palette, 2, 1);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::One);
    encoder.set_palette(vec![9, 8, 7, 200, 100, 50]);
    encoder.set_trns(vec![0, 90]);
    encoder.write_header().unwrap().write_image_data(&[0b0100_0000]).unwrap();
    assert_eq!(textured(&palette).unwrap().unwrap().texels, [[9, 8, 7, 0], [200, 100, 50, 90]]);
}

#[cfg(feature = "formats")]
#[test]
fn jpeg_and_webp_become_texels() {
    let grey = textured(&fs::read(data("grey.jpg")).unwrap()).unwrap().unwrap();
    assert_eq!((grey.size, grey.texels), ([9, 5], vec![[77, 77, 77, 255]; 45]));
    let six = textured(&fs::read(data("six.webp")).unwrap()).unwrap().unwrap();
    assert_eq!(six.size, [3, 2]);
    let truth = [[255, 0, 0, 255], [0, 255, 0, 128], [0, 0, 255, 0], [1, 2, 3, 255], [40, 50, 60, 70]];
    assert_eq!(six.texels[..5], truth);
    let error = textured(&fs::read(data("cmyk.jpg")).unwrap()).unwrap_err();
    assert!(error.contains("CMYK"), "{error}");
    let jpeg = fs::read(data("fuze uv.jpg")).unwrap();
    let error = textured(&jpeg[..500]).unwrap_err();
    assert!(error.contains("a JPEG with damage") && error.lines().count() == 1, "{error}");
    for name in ["grey.jpg", "cmyk.jpg", "six.webp"] {
        let bytes = fs::read(data(name)).unwrap();
        // All are written before one is read: a file is opened when it has been at rest for a while.
        let folders: Vec<_> = (0..bytes.len()).map(|length| square_with(&bytes[..length])).collect();
        for folder in &folders {
            let _ = texture_in(folder);
        }
    }
}

#[test]
fn images_that_promise_too_much_are_refused() {
    let bomb = |width: u32, height: u32| {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Rgba);
        drop(encoder.write_header());
        textured(&bytes).unwrap_err()
    };
    assert!(bomb(20_000, 1).contains("20000 x 1 texels, expected 1 to 16384 each"));
    assert!(bomb(16_384, 16_384).contains("16384 x 16384 texels, expected at most"));
    assert!(textured(b"BM").unwrap().is_none());
}

#[test]
fn a_capture_stays_one() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/glb/ok-three.glb");
    assert!(read(&path, None).unwrap().is_none());
    assert!(splatblur::model::parse_capture(&fs::read(path).unwrap(), ModelFormat::Glb).unwrap().is_some());
}

#[test]
fn matrices_and_parts_are_the_same() {
    let turn = glam::DQuat::from_xyzw(0.1, -0.2, 0.3, 0.4).normalize();
    let (scale, shift) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0));
    let matrix = DMat4::from_scale_rotation_translation(scale, turn, shift);
    let parts = changed(|text| {
        text["nodes"][0] = json!({"mesh": 0, "scale": scale.to_array(), "rotation": turn.to_array(),
            "translation": shift.to_array()});
    });
    let whole = changed(|text| text["nodes"][0] = json!({"mesh": 0, "matrix": matrix.to_cols_array()}));
    let (parts, whole) = (parts.unwrap().unwrap(), whole.unwrap().unwrap());
    for (i, corner) in [DVec3::ZERO, DVec3::X, DVec3::Y].into_iter().enumerate() {
        assert!((parts.position[i] - matrix.transform_point3(corner)).length() < 1e-12);
        assert!((whole.position[i] - parts.position[i]).length() < 1e-12);
    }
}
