//! GLB captures: glTF in one file, with Gaussians.

use std::path::Path;

use glam::{Quat, Vec3};
use serde_json::{Value, json};
use splatblur::model::{ColourStorage, Gaussians, ModelFormat, parse_capture};

use super::support::{cloud, refused};

const OWN: &str = "KHR_gaussian_splatting";

/// A file in the making.
#[derive(Clone)]
struct Glb {
    text: Value,
    data: Vec<u8>,
}

impl Glb {
    /// One node with one mesh of one primitive without attributes.
    fn empty() -> Self {
        let extension = json!({"kernel": "ellipse", "colorSpace": "srgb_rec709_display"});
        let primitive = json!({"mode": 0, "attributes": {}, "extensions": {OWN: extension}});
        let text = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [primitive]}], "buffers": [{}], "bufferViews": [], "accessors": [],
        });
        Self { text, data: Vec::new() }
    }

    /// Two Gaussians without harmonics.
    fn pair() -> Self {
        let mut glb = Self::empty();
        glb.floats("POSITION", "VEC3", &[1.0, 2.0, 3.0, -4.0, 5.0, -6.0]);
        glb.floats("ROTATION", "VEC4", &[0.0, 0.0, 0.0, 1.0, 0.1, 0.2, 0.4, 0.8]);
        glb.floats("SCALE", "VEC3", &[0.5, 0.25, 0.125, 0.0, 2.0, 3.0]);
        glb.floats("OPACITY", "SCALAR", &[1.0, 0.25]);
        glb.floats("SH_DEGREE_0_COEF_0", "VEC3", &[1.5, -0.5, 0.25, 4.0, 0.0, -1.0]);
        glb
    }

    fn floats(&mut self, name: &str, shape: &str, values: &[f32]) {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.column(name, shape, 5126, false, &bytes, 4 * width(shape));
    }

    /// Adds an attribute in a buffer view of its own, each value in `stride` bytes.
    fn column(&mut self, name: &str, shape: &str, component: u32, normalized: bool, bytes: &[u8], stride: usize) {
        let views = self.text["bufferViews"].as_array_mut().unwrap();
        let index = views.len();
        let mut view = json!({"buffer": 0, "byteOffset": self.data.len(), "byteLength": bytes.len()});
        if component != 5126 {
            view["byteStride"] = json!(stride);
        }
        views.push(view);
        self.data.extend(bytes);
        let accessor = json!({"bufferView": index, "componentType": component, "normalized": normalized,
            "count": bytes.len() / stride, "type": shape});
        self.text["accessors"].as_array_mut().unwrap().push(accessor);
        let name = if name == "POSITION" { name.to_owned() } else { format!("{OWN}:{name}") };
        self.primitive()["attributes"][name] = json!(index);
    }

    fn primitive(&mut self) -> &mut Value {
        &mut self.text["meshes"][0]["primitives"][0]
    }

    fn extension(&mut self) -> &mut Value {
        &mut self.primitive()["extensions"][OWN]
    }

    fn bytes(&self) -> Vec<u8> {
        let mut text = self.text.clone();
        if text["buffers"][0].get("byteLength").is_none() {
            text["buffers"][0]["byteLength"] = json!(self.data.len());
        }
        pack(text.to_string().into_bytes(), &self.data)
    }

    fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self
    }

    fn node(self, node: Value) -> Self {
        self.with(|glb| {
            glb.text["nodes"][0] = node;
            glb.text["nodes"][0]["mesh"] = json!(0);
        })
    }

    fn read(&self) -> Gaussians {
        parse_capture(&self.bytes(), ModelFormat::Glb).unwrap().unwrap()
    }

    fn says(&self, part: &str) {
        says(&self.bytes(), part);
    }
}

fn pack(mut text: Vec<u8>, data: &[u8]) -> Vec<u8> {
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut data = data.to_vec();
    data.resize(data.len().next_multiple_of(4), 0);
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + text.len() as u32 + data.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", text), (b"BIN\0", data)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

fn says(bytes: &[u8], part: &str) {
    let e = refused(bytes, ModelFormat::Glb).to_string();
    assert!(e.contains(part), "{e}\n  expected {part}");
}

fn width(shape: &str) -> usize {
    match shape {
        "SCALAR" => 1,
        "VEC3" => 3,
        _ => 4,
    }
}

#[test]
fn each_attribute() {
    let g = Glb::pair().read();
    assert_eq!((g.len(), g.degree, g.dropped, g.antialiased, g.linear), (2, 0, 0, false, false));
    assert_eq!(g.position, [Vec3::new(-1.0, -2.0, 3.0), Vec3::new(4.0, -5.0, -6.0)]);
    assert_eq!(g.sigma, [Vec3::new(0.5, 0.25, 0.125), Vec3::new(0.0, 2.0, 3.0)]);
    assert_eq!(g.opacity, [1.0, 0.25]);
    assert_eq!(g.base, [Vec3::new(1.5, -0.5, 0.25), Vec3::new(4.0, 0.0, -1.0)]);
    // The turn about z alone, and before (0.1, 0.2, 0.4; 0.8): k q = (-y, x, w; -z).
    assert!(g.rotation[0].abs_diff_eq(Quat::from_xyzw(0.0, 0.0, 1.0, 0.0), 1e-6));
    let length = 0.85_f32.sqrt();
    assert!(g.rotation[1].abs_diff_eq(Quat::from_xyzw(-0.2, 0.1, 0.8, -0.4) * length.recip(), 1e-6));
    assert!(g.notes.is_empty(), "{:?}", g.notes);
}

#[test]
fn small_types_and_strides() {
    let mut glb = Glb::empty();
    let padded: Vec<u8> =
        [[1.0_f32, 2.0, 3.0, 99.0], [4.0, 5.0, 6.0, 99.0]].concat().iter().flat_map(|v| v.to_le_bytes()).collect();
    glb.column("POSITION", "VEC3", 5126, false, &padded, 16);
    glb.text["bufferViews"][0]["byteStride"] = json!(16);
    // The last value has no padding behind it.
    glb.text["bufferViews"][0]["byteLength"] = json!(28);
    glb.column("ROTATION", "VEC4", 5120, true, &[0, 0, 0, 127, 127, 0x80, 0, 0], 4);
    let scales: Vec<u8> = [0, 65535, 13107, 0, 65535, 1, 2, 0_u16].iter().flat_map(|v| v.to_le_bytes()).collect();
    glb.column("SCALE", "VEC3", 5123, true, &scales, 8);
    glb.column("OPACITY", "SCALAR", 5121, true, &[0, 51, 255, 9], 2);
    glb.text["accessors"][3]["byteOffset"] = json!(1);
    let base: Vec<u8> = [3, -32768, 32767, 0, 1, 2, 3, 0_i16].iter().flat_map(|v| v.to_le_bytes()).collect();
    glb.column("SH_DEGREE_0_COEF_0", "VEC3", 5122, false, &base, 8);
    let g = glb.read();
    assert_eq!(g.position, [Vec3::new(-1.0, -2.0, 3.0), Vec3::new(-4.0, -5.0, 6.0)]);
    assert_eq!(g.sigma[0], Vec3::new(0.0, 1.0, 0.2));
    assert_eq!(g.opacity, [0.2, 9.0 / 255.0]);
    assert_eq!(g.base[0], Vec3::new(3.0, -32768.0, 32767.0));
    // (1, -1, 0; 0) after the turn: k (i - j) = j + i.
    let h = 0.5_f32.sqrt();
    assert!(g.rotation[1].abs_diff_eq(Quat::from_xyzw(h, h, 0.0, 0.0), 1e-6), "{}", g.rotation[1]);
}

fn with_harmonics(degree: usize) -> Glb {
    let mut glb = Glb::pair();
    let mut k = 0.0;
    for l in 1..=degree {
        for n in 0..=2 * l {
            glb.floats(&format!("SH_DEGREE_{l}_COEF_{n}"), "VEC3", &[k, k + 0.25, k + 0.5, -k, 1.0, 2.0]);
            k += 1.0;
        }
    }
    glb
}

#[test]
fn harmonics_with_the_signs_of_the_turn() {
    let signs: Vec<f32> = "-+-+-+-+-+-+-+-".chars().map(|c| if c == '-' { -1.0 } else { 1.0 }).collect();
    for (degree, each) in [(1, 3), (2, 8), (3, 15)] {
        let g = with_harmonics(degree).read();
        assert_eq!((usize::from(g.degree), g.harmonics.len()), (degree, 2 * each));
        for k in 0..each {
            let first = k as f32 + Vec3::new(0.0, 0.25, 0.5);
            assert_eq!(g.harmonics[k], signs[k] * first, "{k}");
            assert_eq!(g.harmonics[each + k], signs[k] * Vec3::new(-(k as f32), 1.0, 2.0), "{k}");
        }
    }
    let mut glb = with_harmonics(2);
    glb.primitive()["attributes"].as_object_mut().unwrap().remove(&format!("{OWN}:SH_DEGREE_2_COEF_3"));
    let g = glb.read();
    assert_eq!(g.degree, 1);
    assert_eq!(g.notes, ["Gaussian splats: harmonics of degree 2 are incomplete: ignored"]);
}

#[test]
fn one_negative_scale_means_logarithms() {
    let glb = Glb::pair().with(|glb| {
        glb.floats("SCALE", "VEC3", &[0.0, 1.0, 2.0, 0.5, -1.0, 0.0]);
    });
    let g = glb.clone().node(json!({"scale": [2.0, 2.0, 2.0]})).read();
    let expected = [1.0, 1.0_f64.exp(), 2.0_f64.exp(), 0.5_f64.exp(), (-1.0_f64).exp(), 1.0].map(|s| 2.0 * s as f32);
    assert!(g.sigma[0].abs_diff_eq(Vec3::from_slice(&expected[..3]), 1e-5), "{}", g.sigma[0]);
    assert!(g.sigma[1].abs_diff_eq(Vec3::from_slice(&expected[3..]), 1e-5), "{}", g.sigma[1]);
    assert_eq!(g.notes, ["Gaussian splats: negative scales, so all are taken as logarithms"]);
}

#[test]
fn colour_spaces() {
    let linear = Glb::pair().with(|glb| glb.extension()["colorSpace"] = json!("lin_rec709_display"));
    assert!(linear.read().linear);
    let drawn = cloud(&linear.bytes(), ModelFormat::Glb);
    assert_eq!(drawn.colour_storage, ColourStorage::Float);
    assert!(drawn.notes.iter().any(|note| note.contains("colours taken as linear light")), "{:?}", drawn.notes);
    let drawn = cloud(&Glb::pair().bytes(), ModelFormat::Glb);
    assert_eq!(drawn.colour_storage, ColourStorage::Integer);
    assert!(drawn.notes.iter().any(|note| note.contains("colours taken as sRGB")), "{:?}", drawn.notes);

    let unsaid = Glb::pair().with(|glb| *glb.extension() = json!({"kernel": "ellipse"})).read();
    assert!(!unsaid.linear);
    assert_eq!(unsaid.notes, ["Gaussian splats: the file does not say the colour space"]);
    let mixed = linear.with(|glb| {
        let mut other = glb.primitive().clone();
        other["extensions"][OWN]["colorSpace"] = json!("srgb_rec709_display");
        glb.text["meshes"][0]["primitives"].as_array_mut().unwrap().push(other);
    });
    mixed.says("byte 20: found Gaussians of two colour spaces, expected one for all");
}

#[test]
fn nodes_place_their_meshes() {
    // Scale 2, then a quarter turn about x (y to z), then a translation.
    let h = 0.5_f64.sqrt();
    let node = json!({"translation": [10.0, 20.0, 30.0], "rotation": [h, 0.0, 0.0, h], "scale": [2.0, 2.0, 2.0]});
    let matrix = json!({"matrix":
        [2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, -2.0, 0.0, 0.0, 10.0, 20.0, 30.0, 1.0]});
    for glb in [Glb::pair().node(node), Glb::pair().node(matrix)] {
        let g = glb.read();
        // (1, 2, 3) by 2 (x, -z, y) and the translation: (12, 14, 34).
        assert!(g.position[0].abs_diff_eq(Vec3::new(-12.0, -14.0, 34.0), 1e-5), "{}", g.position[0]);
        assert!(g.sigma[0].abs_diff_eq(Vec3::new(1.0, 0.5, 0.25), 1e-6));
        // Local y is z of the world; the turn leaves z alone.
        assert!((g.rotation[0] * Vec3::Y).abs_diff_eq(Vec3::Z, 1e-6));
        assert!((g.rotation[0] * Vec3::X).abs_diff_eq(-Vec3::X, 1e-6));
    }
    // A child in a parent: translation of the child by the parent's scale. The mesh stands in both.
    let glb = Glb::pair().with(|glb| {
        glb.text["nodes"] = json!([{"mesh": 0, "scale": [3.0, 3.0, 3.0], "children": [1]},
            {"mesh": 0, "translation": [1.0, 0.0, 0.0]}, {"mesh": 7}]);
    });
    let g = glb.read();
    assert_eq!(g.len(), 4);
    assert!(g.position[0].abs_diff_eq(Vec3::new(-3.0, -6.0, 9.0), 1e-5), "{}", g.position[0]);
    assert!(g.position[2].abs_diff_eq(Vec3::new(-6.0, -6.0, 9.0), 1e-5), "{}", g.position[2]);
    // Without scenes, all nodes that are no children count.
    let unplaced = glb.with(|glb| {
        for key in ["scene", "scenes"] {
            glb.text.as_object_mut().unwrap().remove(key);
        }
        glb.text["nodes"].as_array_mut().unwrap().pop();
    });
    assert_eq!(unplaced.read(), g);
}

#[test]
fn transforms_that_gaussians_cannot_follow() {
    for (node, part) in [
        (json!({"scale": [1.0, 2.0, 1.0]}), "node 0, a scale that is not the same along all axes"),
        (json!({"scale": [1.0, 1.0, -1.0]}), "node 0, a scale that mirrors"),
        (json!({"scale": [0.0, 1.0, 1.0]}), "node 0, a scale of 0 or without bounds"),
        (json!({"scale": [1e300, 1e300, 1e300]}), "node 0, a scale of 0 or without bounds"),
        (json!({"rotation": [0.0, 0.0, 0.0, 0.0]}), "node 0, a rotation without direction"),
        (json!({"matrix": vec![1.0; 16]}), "node 0, a matrix whose last row is not 0 0 0 1"),
        (json!({"matrix": [1.0]}), "byte 20: found a text that fails at line 1 column"),
        (json!({"children": [0]}), "node 0 a second time, expected a tree without cycles"),
        (json!({"children": [1]}), "node 1, expected below 1, the number there are"),
    ] {
        Glb::pair().node(node).says(part);
    }
    let quarter = json!({"rotation": [1.0, 0.0, 0.0, 1.0]});
    assert_eq!(Glb::pair().node(quarter.clone()).read().len(), 2);
    with_harmonics(1).node(quarter).says("a node that rotates Gaussians with harmonics");
    assert_eq!(
        with_harmonics(1).node(json!({"translation": [1.0, 0.0, 0.0], "scale": [2.0, 2.0, 2.0]})).read().len(),
        2
    );
}

#[test]
fn what_is_refused_by_name() {
    type Change = fn(&mut Glb);
    let cases: [(Change, &str); 18] = [
        (|g| g.extension()["kernel"] = json!("cube"), "found kernel `cube`, expected `ellipse`"),
        (|g| g.extension()["projection"] = json!("parallel"), "found projection `parallel`, expected `perspective`"),
        (|g| g.extension()["colorSpace"] = json!(3), "found colorSpace `?`, expected `srgb_rec709_display` or `lin_"),
        (|g| g.primitive()["mode"] = json!(1), "found Gaussians of mode 1, expected mode 0 (points)"),
        (|g| drop(g.primitive()["extensions"].take()), "found a text that fails"),
        (|g| g.primitive()["extensions"] = json!({}), "found a mesh without Gaussians, expected primitives with"),
        (|g| g.text["nodes"] = json!([{}]), "found a scene that shows no mesh"),
        (
            |g| g.extension()["extensions"] = json!({"KHR_gaussian_splatting_compression_spz_2": {"bufferView": 0}}),
            "found `KHR_gaussian_splatting_compression_spz_2`, expected Gaussians that are not packed",
        ),
        (
            |g| g.primitive()["extensions"]["KHR_gaussian_splatting_compression_spz"] = json!({}),
            "found `KHR_gaussian_splatting_compression_spz`",
        ),
        (|g| g.primitive()["attributes"] = json!({"POSITION": 0}), "without `KHR_gaussian_splatting:ROTATION`"),
        (|g| g.text["accessors"][1]["type"] = json!("VEC3"), "accessor 1, type Vec3, expected Vec4 (KHR_"),
        (|g| g.text["accessors"][1]["sparse"] = json!({}), "accessor 1, sparse values"),
        (|g| g.text["accessors"][0]["componentType"] = json!(5124), "accessor 0, component type 5124"),
        (|g| g.text["accessors"][3]["count"] = json!(1), "found 1 values of an attribute, expected 2, as many as"),
        (|g| g.text["buffers"][0]["uri"] = json!("a.bin"), "found buffer view 0 in another file"),
        (|g| g.text["scene"] = json!(1), "found scene 1, expected below 1"),
        (|g| g.text["nodes"][0]["mesh"] = json!(1), "found mesh 1, expected below 1"),
        (|g| g.primitive()["attributes"]["POSITION"] = json!(9), "found accessor 9, expected below 5"),
    ];
    for (change, part) in cases {
        Glb::pair().with(change).says(part);
    }
}

#[test]
fn numbers_that_lie() {
    let most = u64::MAX;
    for (path, key, value, part) in [
        ("accessors", "count", 3, "accessor 0, 3 values from byte 0, expected values inside buffer view 0 of 24 bytes"),
        ("accessors", "count", most, "accessor 0, 18446744073709551615 values"),
        ("accessors", "count", most / 12, "accessor 0, 1537228672809129301 values"),
        ("accessors", "byteOffset", 1, "accessor 0, 2 values from byte 1"),
        ("accessors", "byteOffset", most, "from byte 18446744073709551615"),
        ("accessors", "bufferView", 5, "found buffer view 5, expected below 5"),
        ("bufferViews", "byteStride", 0, "a stride of 0 bytes, expected at least 12"),
        ("bufferViews", "byteStride", 11, "a stride of 11 bytes"),
        ("bufferViews", "byteStride", most, "2 values from byte 0"),
        ("bufferViews", "byteLength", most, "buffer view 0 of 18446744073709551615 bytes at 0, expected inside the"),
        ("bufferViews", "byteOffset", most, "buffer view 0 of 24 bytes at 18446744073709551615"),
        ("bufferViews", "buffer", 1, "found buffer 1, expected below 1"),
        ("buffers", "byteLength", 10_000, "found a buffer of 10000 bytes, expected at most the"),
        ("buffers", "byteLength", most, "found a buffer of 18446744073709551615 bytes"),
    ] {
        let glb = Glb::pair().with(|glb| glb.text[path][0][key] = json!(value));
        glb.says(part);
    }
    let bytes = Glb::pair().bytes();
    for (at, value, part) in [
        (0, 0_u32, "byte 0: found"),
        (4, 1, "byte 4: found glTF version 1, expected 2"),
        (8, u32::MAX, "byte 8: found a length of 4294967295 bytes"),
        (8, 11, "byte 12: found the end of the file"),
        (12, u32::MAX, "byte 12: found a chunk of 4294967295 bytes"),
        (16, 0, "byte 16: found chunk"),
    ] {
        let mut bytes = bytes.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        says(&bytes, part);
    }
    says(&pack(vec![b'['; 100_000], &[]), "byte 20: found a text that fails");
}

/// A mesh in many places would fill memory from a small file.
#[test]
fn many_places_are_limited() {
    let glb = Glb::pair().with(|glb| {
        let primitive = glb.primitive().clone();
        // 2 Gaussians in 1000 primitives of 300 nodes.
        glb.text["meshes"][0]["primitives"] = json!(vec![primitive; 1000]);
        glb.text["nodes"] = json!(vec![json!({"mesh": 0}); 300]);
        glb.text["scenes"] = json!([{"nodes": (0..300).collect::<Vec<_>>()}]);
    });
    glb.says("found more Gaussians than the file can mean, expected at most");
}

#[test]
fn cut_short_at_every_byte_and_damaged() {
    let bytes = with_harmonics(1).bytes();
    for length in 0..bytes.len() {
        refused(&bytes[..length], ModelFormat::Glb);
    }
    for at in 0..bytes.len() {
        for value in [0, b'9', 0xff] {
            let mut damaged = bytes.clone();
            damaged[at] = value;
            let _ = parse_capture(&damaged, ModelFormat::Glb);
        }
    }
}

#[test]
fn values_that_cannot_be_drawn_are_dropped() {
    let glb = Glb::pair().with(|glb| glb.floats("OPACITY", "SCALAR", &[f32::NAN, 0.5]));
    let g = glb.read();
    assert_eq!((g.len(), g.dropped), (1, 1));
    assert_eq!(ModelFormat::detect(&glb.bytes(), Path::new("a.dat")), Some(ModelFormat::Glb));
}
