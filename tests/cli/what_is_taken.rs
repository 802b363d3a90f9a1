//! Questionable input: what is taken as meant, taken with a note, or refused. docs/what-is-taken.md is the table; every
//! line that is expected here stands there.

#![allow(clippy::unwrap_used, reason = "tests may stop and report")]

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use splatblur::math::srgb;
use splatblur::model::{LoadOptions, Surfels, load};
use tempfile::TempDir;

use crate::run;
use crate::support::surfels;

const TABLE: &str = include_str!("../../docs/what-is-taken.md");

/// Fails unless the table of the documents has this line.
fn is_in_table(line: &str) {
    assert!(TABLE.contains(line), "docs/what-is-taken.md lacks `{line}`");
}

/// A folder with these files.
fn folder<B: AsRef<[u8]>>(files: &[(&str, B)]) -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        fs::write(dir.path().join(name), bytes).unwrap();
    }
    dir
}

/// What `info` prints of a file that it takes.
fn info(dir: &Path, name: &str) -> String {
    let (status, said, errors) = run(dir, &format!("info {name}"));
    assert_eq!(status, Some(0), "{errors}");
    said
}

/// The surfels of a file.
fn read(path: &Path) -> Surfels {
    surfels(load(path, &LoadOptions::default(), &|_, _| {}).unwrap())
}

/// `info` takes the file, and prints the line if there is one, which the table has.
fn noted(name: &str, bytes: impl AsRef<[u8]>, line: &str) -> Surfels {
    let dir = folder(&[(name, bytes)]);
    let said = info(dir.path(), name);
    assert!(said.lines().any(|printed| printed == format!("note: {line}")), "expected {line}\n{said}");
    is_in_table(line);
    read(&dir.path().join(name))
}

/// `info` refuses the file with exit status 2 and one line, which ends in one of the table.
fn refused(dir: &Path, command: &str, line: &str) {
    let (status, said, errors) = run(dir, command);
    assert_eq!((status, said.as_str(), errors.lines().count()), (Some(2), "", 1), "{errors}");
    assert!(errors.trim_end().ends_with(line), "expected {line}\n{errors}");
    is_in_table(line);
}

/// A PLY text of these properties ("type name") and rows.
fn ply(properties: &[&str], rows: &[&[f64]]) -> String {
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", rows.len());
    for property in properties {
        writeln!(text, "property {property}").unwrap();
    }
    text += "end_header\n";
    for row in rows {
        let words: Vec<String> = row.iter().map(f64::to_string).collect();
        writeln!(text, "{}", words.join(" ")).unwrap();
    }
    text
}

/// Three points with more properties of one type.
fn three(kind: &str, names: &[&str], values: [&[f64]; 3]) -> String {
    let own: Vec<String> = names.iter().map(|name| format!("{kind} {name}")).collect();
    let properties: Vec<&str> =
        ["double x", "double y", "double z"].into_iter().chain(own.iter().map(String::as_str)).collect();
    let places = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let rows: Vec<Vec<f64>> = places.iter().zip(values).map(|(p, more)| [&p[..], more].concat()).collect();
    ply(&properties, &rows.iter().map(Vec::as_slice).collect::<Vec<_>>())
}

fn is_near(found: Vec3, expected: [f32; 3]) -> bool {
    (found - Vec3::from_array(expected)).abs().max_element() < 1e-6
}

/// Points of a ball of radius 1.
fn ball(count: usize) -> Vec<DVec3> {
    let place = |i: usize| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
        let (sine, cosine) = (2.399_963_229_728_653 * i as f64).sin_cos();
        DVec3::new(cosine * (1.0 - z * z).sqrt(), sine * (1.0 - z * z).sqrt(), z)
    };
    (0..count).map(place).collect()
}

#[test]
fn names_of_columns_decide() {
    // Slow enough to be taken for normals, and fast enough to be refused as colours.
    for speed in [0.5, -3.0] {
        let line = "line 1 names the columns: x, y, z, vx, vy, vz";
        let text = format!("x,y,z,vx,vy,vz\n0,0,0,{speed},0,0\n1,0,0,{speed},0,0\n0,1,0,{speed},0,0\n");
        let found = noted("a.xyz", text, line);
        assert_eq!(found.velocity, [Vec3::X * speed as f32; 3]);
        // None of their own: the grey of surfaces without colours.
        assert_eq!(found.colour, [Vec3::splat(0.3); 3]);
    }
    // A comment names columns, too; the name of the file does not count.
    for text in ["# x y z vx vy vz\n0 0 0 1 0 0\n1 0 0 1 0 0\n", "//X;Y;Z;VX;VY;VZ\n0;0;0;1;0;0\n1;0;0;1;0;0\n"] {
        assert_eq!(noted("a.txt", text, "line 1 names the columns: x, y, z, vx, vy, vz").velocity, [Vec3::X; 2]);
    }
    // Any order, quotes, 16 bits, and columns of other names, which need not be numbers.
    let text = "\"b\",\"g\",\"r\",name,z,y,x,pressure\n0,0,65535,north,3,2,1,7\n65535,0,0,south,4,2,1,7\n";
    let found = noted("a.csv", text, "columns ignored: name, pressure");
    assert_eq!(found.origin, DVec3::new(1.0, 2.0, 3.5));
    assert_eq!(found.colour, [Vec3::X, Vec3::Z]);
    let found = noted(
        "a.csv",
        "x y z nx ny nz alpha\n0 0 0 0 0 2 51\n1 0 0 0 0 2 255\n",
        "opacities up to 255: taken as 0 to 255",
    );
    assert_eq!((found.normal, found.opacity), (vec![Vec3::Z; 2], vec![0.2, 1.0]));
    for (text, line) in [
        ("x,y,vx\n1,2,3\n", "line 1: found names of columns without z (x, y, vx), expected x, y and z among them"),
        ("x y z x\n1 2 3 4\n", "line 1: found two columns `x`, expected different names"),
        ("x y z vx\n1 2 3 4 5\n", "line 2: found 5 words, expected 4, as line 1 names them"),
        ("x y z r g b\n1 2 3 0 0 0\n1 2 3 fast 0 0\n", "line 3: found `fast`, expected a number (`r`)"),
        ("x y z vx vy vz\n1 2 3 0 nan 0\n", "line 2: found NaN, expected a finite number up to 1e18 (`vy`)"),
    ] {
        refused(folder(&[("a.xyz", text)]).path(), "info a.xyz", line);
    }
}

#[test]
fn whole_numbers_that_are_not_what_their_type_says() {
    let rgb = ["red", "green", "blue"];
    for kind in ["ushort", "int", "uint", "short"] {
        let text = three(kind, &rgb, [&[200.0, 100.0, 50.0]; 3]);
        let line = format!("colours of type {kind} are not above 200: taken as 0 to 255, as bytes are");
        let found = if kind == "ushort" {
            noted("a.ply", text, &line)
        } else {
            let dir = folder(&[("a.ply", text)]);
            assert!(info(dir.path(), "a.ply").contains(&line), "{kind}");
            read(&dir.path().join("a.ply"))
        };
        let linear = [200.0_f32, 100.0, 50.0].map(|byte| srgb::to_linear(byte / 255.0));
        assert!(is_near(found.colour[0], linear), "{kind}: {}", found.colour[0]);
    }
    // All channels of all points decide together.
    let dir = folder(&[("a.ply", three("ushort", &rgb, [&[200.0, 100.0, 50.0], &[0.0; 3], &[0.0, 0.0, 256.0]]))]);
    assert!(!info(dir.path(), "a.ply").contains("colours of type"));

    let normals = ["nx", "ny", "nz"];
    let line = "normals of type uchar: 0 to 255 taken as -1 to 1";
    let found = noted(
        "a.ply",
        three("uchar", &normals, [&[128.0, 128.0, 255.0], &[0.0, 127.0, 128.0], &[127.0, 128.0, 127.0]]),
        line,
    );
    assert!(
        (found.normal[0] - Vec3::Z).length() < 0.01 && (found.normal[1] + Vec3::X).length() < 0.01,
        "{:?}",
        found.normal
    );
    let found = noted(
        "a.ply",
        three("uchar", &normals, [&[0.0, 0.0, 1.0]; 3]),
        "normals of type uchar are 0 or 1: taken as they are",
    );
    assert_eq!(found.normal, [Vec3::Z; 3]);
    // The length does not count, so signed bytes need no note.
    let dir = folder(&[("a.ply", three("char", &normals, [&[0.0, 0.0, -127.0]; 3]))]);
    assert!(!info(dir.path(), "a.ply").contains("normals"));
    let found = read(&dir.path().join("a.ply"));
    assert_eq!(found.normal, [-Vec3::Z; 3]);

    let line = "opacities of type uchar are 0 or 1: 1 is taken as opaque";
    let found = noted("a.ply", three("uchar", &["alpha"], [&[1.0]; 3]), line);
    assert!(found.opacity.is_empty());
    let found = noted("a.ply", three("uchar", &["alpha"], [&[1.0], &[0.0], &[1.0]]), line);
    assert_eq!(found.opacity, [1.0, 0.0, 1.0]);
    let line = "opacities of type ushort are not above 255: taken as 0 to 255, as bytes are";
    let found = noted("a.ply", three("ushort", &["alpha"], [&[255.0], &[51.0], &[255.0]]), line);
    assert_eq!(found.opacity, [1.0, 0.2, 1.0]);

    let text = three("float", &rgb, [&[-0.5, 0.5, 1.0], &[0.0; 3], &[1.0; 3]]);
    let found = noted("a.ply", text, "1 points have a negative colour (taken as 0)");
    assert!(is_near(found.colour[0], [0.0, 0.5, 1.0]), "{}", found.colour[0]);
}

#[test]
fn coordinates_that_are_too_coarse() {
    let northing = 5_000_000.0;
    let fine: Vec<[f64; 3]> = ball(300).iter().map(|p| [p.x, p.y + northing, p.z]).collect();
    let rows: Vec<[f64; 3]> = fine.iter().map(|row| row.map(|x| f64::from(x as f32))).collect();
    let [fine, rows] = [&fine, &rows].map(|rows| rows.iter().map(|row| &row[..]).collect::<Vec<&[f64]>>());
    let line =
        "float coordinates up to 5000001 have steps of 0.5, for an extent of 2: write doubles, or take an offset off";
    let found = noted("a.ply", ply(&["float x", "float y", "float z"], &rows), line);
    assert!(found.position.iter().all(|p| (f64::from(p.y) + found.origin.y).fract().abs() % 0.5 == 0.0));
    let said = |text: String| info(folder(&[("a.ply", text)]).path(), "a.ply");
    assert!(!said(ply(&["double x", "double y", "double z"], &rows)).contains("have steps of"));
    // A text whose numbers are finer than its type.
    assert!(!said(ply(&["float x", "float y", "float z"], &fine)).contains("have steps of"));
    let near: Vec<[f64; 3]> = ball(300).iter().map(|p| [p.x, p.y + 1000.0, p.z]).collect();
    let near: Vec<&[f64]> = near.iter().map(|row| &row[..]).collect();
    assert!(!said(ply(&["float x", "float y", "float z"], &near)).contains("have steps of"));
}

/// A closed model inside out, seen from outside and from inside.
#[test]
fn normals_that_point_inward() {
    let text = |sign: f64| {
        let rows: Vec<[f64; 7]> =
            ball(2000).iter().map(|p| [p.x, p.y, p.z, sign * p.x, sign * p.y, sign * p.z, 0.08]).collect();
        let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
        let names = ["float x", "float y", "float z", "float nx", "float ny", "float nz", "float radius"];
        ply(&names, &rows)
    };
    let line = "normals point inward, as those of a room: from outside the inside of the far wall shows \
                (twoSided=\"true\" shows both sides)";
    noted("a.ply", text(-1.0), line);
    let dir = folder(&[("a.ply", text(-1.0)), ("out.ply", text(1.0))]);
    assert!(!info(dir.path(), "out.ply").contains("inward"));
    let scene = |camera: &str, object: &str| {
        let text = format!(
            "<scene><camera eye='{camera}' at='0 0 0.5'/>\
             <object {object}><pointModel>a.ply</pointModel></object></scene>"
        );
        fs::write(dir.path().join("s.xml"), text).unwrap();
        info(dir.path(), "s.xml")
    };
    assert!(scene("0 0 5", "").contains("note: a.ply: normals point inward"));
    assert!(!scene("0 0 0", "").contains("inward"));
    assert!(!scene("0 0 5", "twoSided='true'").contains("inward"));
}

/// A glTF text of one triangle with a texture; `change` changes it.
fn gltf(change: impl Fn(&mut Value)) -> String {
    let data: Vec<u8> = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    // A red pixel.
    let png = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4z8AAAAMBAQDJ/pLvAAAAAElFTkSuQmCC";
    let view = |offset: usize, length: usize| json!({"buffer": 0, "byteOffset": offset, "byteLength": length});
    let accessor =
        |view: usize, shape: &str| json!({"bufferView": view, "componentType": 5126, "count": 3, "type": shape});
    let mut text = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"uri": format!("data:image/png;base64,{png}")}],
        "accessors": [accessor(0, "VEC3"), accessor(1, "VEC2")],
        "bufferViews": [view(0, 36), view(36, 24)],
        "buffers": [{"byteLength": 60, "uri": format!("data:application/octet-stream;base64,{}", base64(&data))}]
    });
    change(&mut text);
    text.to_string()
}

fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    assert_eq!(bytes.len() % 3, 0);
    let letters = bytes.chunks(3).flat_map(|three| {
        let bits = u32::from(three[0]) << 16 | u32::from(three[1]) << 8 | u32::from(three[2]);
        [18, 12, 6, 0].map(|shift| char::from(LETTERS[(bits >> shift & 63) as usize]))
    });
    letters.collect()
}

#[test]
fn textures_and_versions_of_gltf() {
    let red = |found: &Surfels| found.colour.iter().all(|c| is_near(*c, [1.0, 0.0, 0.0]));
    let dir = folder(&[("a.gltf", gltf(|_| {}))]);
    assert!(!info(dir.path(), "a.gltf").contains("TEXCOORD"));
    let found = read(&dir.path().join("a.gltf"));
    assert!(red(&found), "{:?}", found.colour[0]);
    let other_set =
        gltf(|text| text["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = json!(1));
    let line = "ignored: textures of primitives without their coordinates, TEXCOORD_1 (1)";
    assert_eq!(noted("a.gltf", other_set, line).colour[0], Vec3::ONE);
    let far = gltf(|text| text["asset"]["version"] = json!("2.1"));
    info(folder(&[("a.gltf", far)]).path(), "a.gltf");
    for (asset, line) in [
        (json!({"version": "1.0"}), "found glTF version `1.0`, expected 2.0"),
        (json!({"version": "2.0", "minVersion": "3.0"}), "found glTF that needs version `3.0`, expected 2.0"),
        (json!({}), "found an `asset` without `version`, expected `\"version\": \"2.0\"`"),
    ] {
        let text = gltf(|text| text["asset"] = asset.clone());
        refused(folder(&[("a.gltf", text)]).path(), "info a.gltf", line);
    }
    // The same in a GLB, and one that shows nothing.
    let glb = |text: &str| {
        let text = format!("{text}{}", " ".repeat((4 - text.len() % 4) % 4));
        let [length, of_text] = [20 + text.len(), text.len()].map(|size| (size as u32).to_le_bytes());
        [b"glTF\x02\0\0\0".as_slice(), &length, &of_text, b"JSON", text.as_bytes()].concat()
    };
    let empty =
        json!({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"name": "empty"}]});
    let line = "found a scene that shows no mesh, expected nodes with meshes of triangles, or of Gaussians \
                (`KHR_gaussian_splatting`)";
    refused(folder(&[("a.glb", glb(&empty.to_string()))]).path(), "info a.glb", line);

    let obj = "mtllib a.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let png = fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/scenes/e.png")).unwrap();
    let files = [("a.obj", obj.as_bytes()), ("a.mtl", b"newmtl red\nKd 1 0 0\nmap_Kd e.png\n"), ("e.png", &png)];
    let line = "1 faces with a texture have corners without coordinates in it (vt)";
    let said = info(folder(&files).path(), "a.obj");
    assert!(said.contains(line), "{said}");
    is_in_table(line);
}

/// A sequence of these files, as a scene.
fn sequence(files: &[String]) -> TempDir {
    let names: Vec<String> = (1..=files.len()).map(|number| format!("s.{number}.ply")).collect();
    let all: Vec<(&str, &String)> = names.iter().map(String::as_str).zip(files).collect();
    let dir = folder(&all);
    let text = format!(
        "<scene><image width='32' height='24'/><camera eye='0 0 5' at='0 0 0'/>\
         <object name='drops'><pointModel sequence='s.%d.ply' first='1' last='{}'/></object></scene>",
        files.len()
    );
    fs::write(dir.path().join("s.xml"), text).unwrap();
    dir
}

fn places(points: &[DVec3]) -> String {
    let rows: Vec<[f64; 3]> = points.iter().map(DVec3::to_array).collect();
    ply(&["double x", "double y", "double z"], &rows.iter().map(|row| &row[..]).collect::<Vec<_>>())
}

#[test]
fn files_of_sequences() {
    let here = ball(400);
    let moved: Vec<DVec3> = here.iter().map(|p| DVec3::new(-p.y, p.x, p.z) + DVec3::X).collect();
    let shuffled = |points: &[DVec3]| (0..400).map(|i| points[i * 149 % 400]).collect::<Vec<_>>();
    let said = |files: &[Vec<DVec3>]| {
        let dir = sequence(&files.iter().map(|points| places(points)).collect::<Vec<_>>());
        info(dir.path(), "s.xml")
    };
    let line = "rows of this file and the next may stand for different points";
    is_in_table(line);
    assert!(said(&[here.clone(), shuffled(&here)]).contains(line));
    assert!(said(&[here.clone(), shuffled(&moved)]).contains(line));
    // A quarter turn, and points that fly apart, keep their rows.
    assert!(!said(&[here.clone(), moved]).contains(line));
    let apart: Vec<DVec3> = here.iter().enumerate().map(|(i, p)| *p * (1.0 + 0.01 * (i * 7 % 10) as f64)).collect();
    assert!(!said(&[here.clone(), apart]).contains(line));

    let good = places(&here);
    let dir = sequence(&[good.clone(), good.clone(), String::new(), good.clone()]);
    refused(dir.path(), "render s.xml --frames 1", "model s.3.ply is empty (0 bytes)");
    // A file whose points are all unusable is an empty frame, and says so; one without points is meant so.
    let lost = ply(&["double x", "double y", "double z"], &[[f64::NAN; 3].as_slice(); 2]);
    let dir = sequence(&[lost, good.clone()]);
    let line = "an empty frame, without usable points: 2 points dropped: a coordinate is not finite or beyond 1e18";
    let said = info(dir.path(), "s.xml");
    assert!(said.contains(line), "{said}");
    is_in_table(line);
    let none = ply(&["double x", "double y", "double z"], &[]);
    assert!(!info(sequence(&[none, good]).path(), "s.xml").contains("note"));
}

#[test]
fn a_transfer_function_for_other_units() {
    let mut grid = b"NRRD0001\ntype: uint8\ndimension: 3\nsizes: 4 4 4\nencoding: raw\n\n".to_vec();
    grid.extend((0..64_u32).map(|i| (i * 200 / 63) as u8));
    let dir = folder(&[("a.nrrd", grid)]);
    let said = |most: f64| {
        let text = format!(
            "<scene><object><pointModel>a.nrrd</pointModel><transferFunction><stop value='0' opacity='0'/>\
             <stop value='{most}' opacity='4'/></transferFunction></object></scene>"
        );
        fs::write(dir.path().join("s.xml"), text).unwrap();
        info(dir.path(), "s.xml")
    };
    let line = "transfer function: its stops go from 0 to 1, the values from 0 to 200";
    assert!(said(1.0).contains(line));
    is_in_table(line);
    assert!(!said(255.0).contains("its stops go"));
}

#[test]
fn a_foreign_backend_is_not_replayed() {
    let dir = folder(&[("a.ply", places(&ball(50)))]);
    let text = "<scene><image width='16' height='12'/><object><pointModel>a.ply</pointModel></object></scene>";
    fs::write(dir.path().join("s.xml"), text).unwrap();
    let (status, _, errors) =
        run(dir.path(), "dataset s.xml --out d --frames 0 --error draft --sharp 1 --no-flow --backend cpu");
    assert_eq!(status, Some(0), "{errors}");
    let path = dir.path().join("d/transforms.json");
    let mut said: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    assert_eq!(said["splatblur"]["backend"], "cpu");
    said["splatblur"]["backend"] = json!("xxxx");
    fs::write(&path, said.to_string()).unwrap();
    let line = "found the backend `xxxx`, expected `cpu`, `gpu` or `reference`";
    refused(dir.path(), "dataset --replay d/transforms.json --out e", line);
    assert!(!dir.path().join("e").exists());
}

/// Each scene shows nothing, and the cause that is named is its own.
#[test]
fn causes_of_pictures_without_anything() {
    let moving = |velocity: f64| {
        let rows: Vec<[f64; 6]> = ball(300).iter().map(|p| [p.x, p.y, p.z, velocity, 0.0, 0.0]).collect();
        let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
        ply(&["double x", "double y", "double z", "double vx", "double vy", "double vz"], &rows)
    };
    let dir = folder(&[("still.ply", moving(0.0)), ("fast.ply", moving(1e6))]);
    let camera = "<camera eye='0 0 5' at='0 0 0'/>";
    let object =
        |model: &str, more: &str| format!("<object name='ball'><pointModel>{model}</pointModel>{more}</object>");
    let motion = |velocity: &str| format!("<motion type='linear' velocity='{velocity}'/>");
    let still = object("still.ply", "");
    let slow = object("still.ply", &motion("0.1 0 0"));
    for (scene, cause) in [
        (format!("{camera}{}", object("fast.ply", "")), "outside the image"),
        (format!("{camera}{}", object("still.ply", &motion("1e30 0 0"))), "outside the image"),
        (format!("{camera}<shutter open='-1e6' close='1e6'/>{slow}"), "outside the image"),
        (
            format!(
                "{camera}<shutter open='-0.25' close='0.25' readout='10000'/>{}",
                object("still.ply", &motion("50 30 0"))
            ),
            "outside the image",
        ),
        (
            format!("<camera eye='0 0 5e-6' at='0 0 0'/>{}", object("still.ply", "<transform scale='1e-6'/>")),
            "nearer than the camera's `near`",
        ),
        (format!("<camera eye='0 0 5' at='0 0 0' near='1e30'/>{still}"), "nearer than the camera's `near`"),
        (format!("<camera eye='0 0 5' at='0 0 9'/>{still}"), "behind the camera"),
        (
            format!("{camera}<light type='ambient' intensity='0'/>{still}"),
            "of the background's colour (does light reach it?)",
        ),
    ] {
        let text = format!("<scene><image width='32' height='24'/><frames first='0' last='0'/>{scene}</scene>");
        fs::write(dir.path().join("s.xml"), text).unwrap();
        let (status, _, said) = run(dir.path(), "render s.xml --samples 4 --backend cpu --out out");
        assert_eq!(status, Some(0), "{said}");
        let expected = format!("warning: no frame shows anything; likely causes in frame 0: {cause}: `ball`");
        assert!(said.contains(&expected), "{scene}\nexpected {expected}\n{said}");
        is_in_table(cause);
    }
    let none = ply(&["double x", "double y", "double z"], &[]);
    let dir = sequence(&[places(&ball(300)), none]);
    let (_, _, said) = run(dir.path(), "render s.xml --frames 2 --mode still:1 --backend cpu --out out");
    let cause = "without points in this frame's file";
    assert!(said.contains(&format!("in frame 2: {cause}: `drops`")), "{said}");
    is_in_table(cause);
}
