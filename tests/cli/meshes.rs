//! glTF files on the command line: described, and turned into a scene.

#![allow(clippy::unwrap_used, reason = "tests may stop and report")]

use std::fs;
use std::path::Path;

use crate::run;

fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/models");
    fs::copy(models.join("CesiumMilkTruck.glb"), dir.path().join("truck.glb")).unwrap();
    dir
}

#[test]
fn nodes_and_animations_are_described() {
    let dir = folder();
    let (status, said, errors) = run(dir.path(), "info truck.glb --json");
    assert_eq!((status, errors.as_str()), (Some(0), ""));
    let report: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(report["model"]["triangles"], 3624);
    assert_eq!(report["model"]["textures"], serde_json::json!([{"width": 2048, "height": 2048}]));
    let nodes = report["nodes"].as_array().unwrap();
    assert_eq!(nodes.len(), 5);
    assert_eq!(
        (&nodes[4]["mesh"], &nodes[4]["parent"], &nodes[4]["animated"]),
        (&"Wheels".into(), &3.into(), &true.into())
    );
    assert_eq!(report["animations"], serde_json::json!([{"name": null, "seconds": 1.25, "channels": 2}]));
    let (_, said, _) = run(dir.path(), "info truck.glb");
    for part in [
        "  triangles: 3624\n",
        "node: name none, index 4, mesh Wheels, parent 3, animated yes, triangles 768\n",
        "animation: ",
        "seconds 1.25",
        "note: ignored: ",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let bytes = fs::read(dir.path().join("truck.glb")).unwrap();
    fs::write(dir.path().join("cut.glb"), &bytes[..bytes.len() - 1]).unwrap();
    let (status, said, errors) = run(dir.path(), "info cut.glb");
    assert_eq!((status, said.as_str(), errors.lines().count()), (Some(2), "", 1), "{errors}");
    assert!(errors.contains("cut.glb: byte 8: found a length of 542144 bytes"), "{errors}");
}

/// A picture that is there already is not made again, unless a file that the model names is another one.
#[test]
fn an_edited_texture_makes_a_new_picture() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let texture = |level: u8| image::RgbImage::from_pixel(4, 4, image::Rgb([level, 90, 200])).save(path("t.png"));
    fs::write(
        path("m.obj"),
        "mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n",
    )
    .unwrap();
    fs::write(path("m.mtl"), "newmtl a\nKd 1 1 1\n").unwrap();
    texture(10).unwrap();
    let is_skipped = || {
        let (status, said, errors) = run(dir.path(), "render m.obj --size 16x12 --backend cpu --resume --json --quiet");
        assert_eq!(status, Some(0), "{errors}");
        let report: serde_json::Value = serde_json::from_str(&said).unwrap();
        report["frames"][0]["skipped"].as_bool().unwrap()
    };
    assert_eq!([is_skipped(), is_skipped()], [false, true]);
    fs::write(path("m.mtl"), "newmtl a\nKd 1 1 1\nmap_Kd t.png\n").unwrap();
    assert_eq!([is_skipped(), is_skipped()], [false, true]);
    texture(240).unwrap();
    assert_eq!([is_skipped(), is_skipped()], [false, true]);
    // The texture goes, and comes again.
    fs::remove_file(path("t.png")).unwrap();
    assert_eq!([is_skipped(), is_skipped()], [false, true]);
    texture(240).unwrap();
    assert_eq!([is_skipped(), is_skipped()], [false, true]);
}

#[test]
fn a_file_becomes_a_folder_with_a_scene() {
    let dir = folder();
    let (status, said, _) = run(dir.path(), "convert truck.glb out");
    assert_eq!((status, said.as_str()), (Some(0), "3 objects: out/scene.xml\n"));
    let read = |name: &str| fs::read(dir.path().join(name)).unwrap();
    assert!(read("out/truck.glb") == read("truck.glb"));
    let scene = String::from_utf8(read("out/scene.xml")).unwrap();
    assert!(scene.contains("<animation node=\"#4\" fps=\"24\" loop=\"true\">truck.glb</animation>"), "{scene}");
    let (status, _, errors) = run(dir.path(), "convert truck.glb out");
    assert_eq!(status, Some(2));
    assert!(errors.contains("out/truck.glb exists already (--force replaces it)"), "{errors}");
    assert_eq!(run(dir.path(), "convert truck.glb out --force --quiet").0, Some(0));
    // Beside the file itself.
    assert_eq!(run(dir.path(), "convert truck.glb . --force").0, Some(0));
    assert!(read("out/truck.glb") == read("truck.glb"));
}

#[test]
fn a_text_brings_its_files_along() {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir_all(dir.path().join("in/data")).unwrap();
    let numbers = [0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
    fs::write(dir.path().join("in/data/a b.bin"), bytes).unwrap();
    let text = serde_json::json!({
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0, "name": "A & \"B\""}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "data/a%20b.bin"}],
    });
    fs::write(dir.path().join("in/t.gltf"), text.to_string()).unwrap();
    let (status, said, errors) = run(dir.path(), "convert in/t.gltf out");
    assert_eq!((status, said.as_str()), (Some(0), "1 objects: out/scene.xml\n"), "{errors}");
    for name in ["out/t.gltf", "out/data/a b.bin", "out/scene.xml"] {
        assert!(dir.path().join(name).is_file(), "{name}");
    }
    let scene = fs::read_to_string(dir.path().join("out/scene.xml")).unwrap();
    assert!(scene.contains("<object name=\"A &amp; &quot;B&quot;\">"), "{scene}");
    assert_eq!(run(dir.path(), "info out/t.gltf").0, Some(0));
}

#[test]
fn a_mesh_becomes_a_file_of_surfels() {
    let dir = folder();
    let (status, said, errors) = run(dir.path(), "sample truck.glb truck.ply --surfels 5000 --json");
    assert_eq!(status, Some(0), "{errors}");
    let report: serde_json::Value = serde_json::from_str(&said).unwrap();
    let surfels = report["surfels"].as_u64().unwrap();
    // Parts that rays miss have surfels beyond the wanted number.
    assert!((4000..10_000).contains(&surfels), "{report}");
    assert_eq!((&report["triangles"], &report["out"]), (&3624.into(), &"truck.ply".into()));
    assert_eq!(report["reduced"], true);
    let text = fs::read(dir.path().join("truck.ply")).unwrap();
    let header = String::from_utf8_lossy(&text[..1000]);
    assert!(header.contains(&format!("element vertex {surfels}\n")), "{header}");
    // Surfels, and no mesh any more.
    let (_, said, _) = run(dir.path(), "info truck.ply --json");
    let info: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!((&info["model"]["surfels"], &info["model"]["triangles"]), (&surfels.into(), &serde_json::Value::Null));
    for (line, part) in [
        ("sample truck.glb truck.ply", "truck.ply exists already (--force replaces it)"),
        ("sample truck.glb truck.xyz", "truck.xyz must end in .bin or .ply"),
        ("sample truck.ply again.bin", "truck.ply is no mesh"),
        ("sample truck.glb truck.glb", "truck.glb must end in .bin or .ply"),
    ] {
        let (status, said, errors) = run(dir.path(), line);
        assert_eq!((status, said.as_str(), errors.lines().count()), (Some(2), "", 1), "{line}: {errors}");
        assert!(errors.contains(part), "{line}: {errors}");
    }
}
