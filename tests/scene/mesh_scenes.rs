//! Meshes in scenes: opacities and normals of files, how finely they are sampled, what is kept in files, and the camera
//! that they get.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::fmt::Write as _;
use std::fs;
use std::io::Cursor;
use std::path::Path;

use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use splatblur::model::{self, LoadOptions, MeshOptions, Spacing, Surfels};
use splatblur::options::{BlurMode, RenderOptions};
use splatblur::scene::Light;
use splatblur::{Scene, scene_file};

use crate::meshes::{data, floats, glb};
use crate::support;

/// A square from (0, 0, 0) to (1, 1, 0) with normals that are not its own. Its texture is opaque on the left and
/// `opacity` on the right.
fn square(material: &Value, opacity: u8) -> Vec<u8> {
    let mut bytes = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    bytes.extend(floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]));
    bytes.extend(floats(&[0.6, 0.0, 0.8].repeat(4)));
    let pixel = |x: u32, _: u32| image::Rgba([200, 100, 50, if x < 32 { 255 } else { opacity }]);
    let mut png = Cursor::new(Vec::new());
    image::RgbaImage::from_fn(64, 4, pixel).write_to(&mut png, image::ImageFormat::Png).unwrap();
    let (at, length) = (bytes.len(), png.get_ref().len());
    bytes.extend(png.into_inner());
    let mut material = material.clone();
    material["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    let text = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "NORMAL": 2}, "mode": 5,
            "material": 0}]}],
        "materials": [material], "textures": [{"source": 0}], "images": [{"bufferView": 1, "mimeType": "image/png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 0, "byteOffset": 48, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 0, "byteOffset": 80, "componentType": 5126, "count": 4, "type": "VEC3"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": at}, {"buffer": 0, "byteOffset": at, "byteLength": length}],
        "buffers": [{"byteLength": at + length}],
    });
    glb(&text, &bytes)
}

fn sampled(path: &Path, spacing: Spacing) -> Surfels {
    let options = LoadOptions { mesh: MeshOptions { spacing, reduce: true }, ..LoadOptions::default() };
    support::surfels(model::load(path, &options, &|_, _| {}).unwrap())
}

fn of_square(material: &Value, opacity: u8) -> Surfels {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("square.glb");
    fs::write(&path, square(material, opacity)).unwrap();
    sampled(&path, Spacing::Of(0.02))
}

/// Opacities of the surfels, and of none where there is none, in a strip from `x` to `x + .1`.
fn opacities(surfels: &Surfels, x: f64) -> Vec<f32> {
    let at = |i: usize| surfels.origin.x + f64::from(surfels.position[i].x);
    let inside = (0..surfels.len()).filter(|&i| at(i) > x && at(i) < x + 0.1);
    inside.map(|i| surfels.opacity.get(i).copied().unwrap_or(1.0)).collect()
}

#[test]
fn a_mask_cuts_out_what_is_below_its_bound() {
    let mask = |cutoff: f64| json!({"alphaMode": "MASK", "alphaCutoff": cutoff});
    let cut = of_square(&mask(0.5), 100);
    assert!(cut.opacity.is_empty());
    assert!(opacities(&cut, 0.2).len() > 200);
    assert!(opacities(&cut, 0.7).is_empty());
    // 100 of 255 is more than 0.3.
    assert!(opacities(&of_square(&mask(0.3), 100), 0.7).len() > 200);
    // The factor counts, too.
    let mut faint = mask(0.3);
    faint["pbrMetallicRoughness"] = json!({"baseColorFactor": [1.0, 1.0, 1.0, 0.5]});
    assert!(opacities(&of_square(&faint, 100), 0.7).is_empty());
}

#[test]
fn blending_takes_the_opacity_and_opaque_materials_do_not() {
    let mut material = json!({"alphaMode": "BLEND"});
    material["pbrMetallicRoughness"] = json!({"baseColorFactor": [1.0, 1.0, 1.0, 0.5]});
    let blended = of_square(&material, 102);
    for (x, opacity) in [(0.2, 0.5), (0.7, 0.2)] {
        let found = opacities(&blended, x);
        assert!(found.len() > 200 && found.iter().all(|o| (o - opacity).abs() < 0.005), "{x}: {found:?}");
    }
    // Half transparent texels do not darken a colour.
    assert!(blended.colour.windows(2).all(|pair| (pair[0] - pair[1]).abs().max_element() < 0.01));
    material["alphaMode"] = json!("OPAQUE");
    assert!(of_square(&material, 102).opacity.is_empty());
}

#[test]
fn normals_of_the_file_are_those_of_the_surfels() {
    let s = of_square(&json!({}), 255);
    assert!(s.len() > 2000);
    for i in 0..s.len() {
        assert!((s.normal[i] - Vec3::new(0.6, 0.0, 0.8)).length() < 1e-6, "{}", s.normal[i]);
        let across = s.axis_u[i].cross(s.axis_v[i]).normalize();
        assert!((across - Vec3::Z).length() < 1e-6, "discs stay in their triangle: {across}");
    }
}

/// Surfels of the box with a texture before a camera at this distance, and the greatest radius of one, which is the
/// spacing.
fn at_distance(distance: f64, size: [u32; 2]) -> (usize, f64) {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(data("BoxTextured.glb"), folder.path().join("box.glb")).unwrap();
    let [width, height] = size;
    let text = format!(
        "<scene><image width='{width}' height='{height}'/><camera eye='0 0 {distance}' at='0 0 0'/>
         <object><pointModel>box.glb</pointModel></object></scene>"
    );
    fs::write(folder.path().join("scene.xml"), text).unwrap();
    let scene = Scene::load(folder.path().join("scene.xml")).unwrap();
    let surfels = &scene.objects[0].shape.surfels().unwrap().surfels().clone();
    (surfels.len(), (0..surfels.len()).map(|i| f64::from(surfels.radius(i))).fold(0.0, f64::max))
}

#[test]
fn a_close_camera_makes_more_surfels() {
    let found = [100.0, 6.0, 4.0, 2.0].map(|distance| at_distance(distance, [200, 150]));
    let counts = found.map(|(count, _)| count as f64);
    println!("{counts:?}");
    assert!(counts.is_sorted_by(|a, b| a < b), "{counts:?}");
    // The least.
    assert!((counts[0] / 2e4 - 1.0).abs() < 0.05, "{counts:?}");
    // The front is 3.5 away: a pixel is 2 tan(20 degrees) / 150 times as wide.
    let pixel = 3.5 * 2.0 * 20_f64.to_radians().tan() / 150.0;
    assert!((found[2].1 * 2.25 / pixel - 1.0).abs() < 1e-4, "{found:?}");
    // Six sides have 2.25^2 surfels for each square of it, and edges have at most three quarters more.
    let sides = 6.0 * (2.25 / pixel).powi(2);
    assert!((1.2 * sides..1.77 * sides).contains(&counts[2]), "{counts:?}, {sides}");
    // Twice as many rows, half the spacing.
    assert!((found[2].1 / at_distance(4.0, [400, 300]).1 - 2.0).abs() < 1e-4);
}

#[test]
#[ignore = "deep: fine meshes"]
fn a_camera_that_touches_a_mesh_makes_the_most_surfels() {
    let (count, _) = at_distance(0.51, [200, 150]);
    assert!((count as f64 / 3e6 - 1.0).abs() < 0.05, "{count}");
}

#[test]
fn the_size_that_is_asked_for_decides_the_spacing() {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(data("BoxTextured.glb"), folder.path().join("box.glb")).unwrap();
    let text = "<scene><image width='400' height='300'/><camera eye='0 0 4' at='0 0 0'/>\
                <object><pointModel>box.glb</pointModel></object></scene>";
    fs::write(folder.path().join("scene.xml"), text).unwrap();
    let small = scene_file::SceneLoadOptions { size: Some((200, 150)), ..scene_file::SceneLoadOptions::default() };
    let scene = scene_file::load(&folder.path().join("scene.xml"), &small).unwrap().scene;
    assert_eq!((scene.image.width, scene.image.height), (200, 150));
    assert_eq!(scene.objects[0].shape.elements(), at_distance(4.0, [200, 150]).0);
    // A model alone, too, whose camera then suits the shape of the image.
    let path = folder.path().join("box.glb");
    let radii = [(256, 192), (128, 96)].map(|size| {
        let options = scene_file::SceneLoadOptions { size: Some(size), ..scene_file::SceneLoadOptions::default() };
        let surfels = &scene_file::load_model(&path, &options).unwrap().scene.objects[0]
            .shape
            .surfels()
            .unwrap()
            .surfels()
            .clone();
        (0..surfels.len()).map(|i| f64::from(surfels.radius(i))).fold(0.0, f64::max)
    });
    // Twice the rows.
    assert!((radii[1] / radii[0] - 2.0).abs() < 0.1, "{radii:?}");
}

#[test]
fn colours_of_texture_come_back_from_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let first = sampled(&data("BoxTextured.glb"), Spacing::Of(0.03));
    assert!(first.colour.iter().any(|colour| *colour != first.colour[0]));
    let path = folder.path().join("box.bin");
    model::write_bin(&path, &first).unwrap();
    let second = support::surfels(model::load(&path, &LoadOptions::default(), &|_, _| {}).unwrap());
    assert!(second.colour == first.colour && second.axis_v == first.axis_v);
}

/// A cube with a colour for each side, of half the light of a channel or of all.
fn coloured_cube(folder: &Path) -> std::path::PathBuf {
    let (mut text, mut library) = (String::from("mtllib cube.mtl\n"), String::new());
    for i in 0..8 {
        writeln!(text, "v {} {} {}", i & 1, i >> 1 & 1, i >> 2).unwrap();
    }
    let sides = [("left", [1, 5, 7, 3]), ("right", [2, 4, 8, 6]), ("bottom", [1, 2, 6, 5]), ("top", [3, 7, 8, 4])];
    let ends = [("back", [1, 3, 4, 2]), ("front", [5, 6, 8, 7])];
    for (i, (name, [a, b, c, d])) in sides.into_iter().chain(ends).enumerate() {
        let bits = i + 1;
        writeln!(library, "newmtl {name}\nKd {} {} {}", bits & 1, bits >> 1 & 1, bits >> 2).unwrap();
        writeln!(text, "usemtl {name}\nf {a} {b} {c} {d}").unwrap();
    }
    fs::write(folder.join("cube.mtl"), library).unwrap();
    fs::write(folder.join("cube.obj"), text).unwrap();
    folder.join("cube.obj")
}

/// Pixels of each of the eight colours of full channels.
fn pixels_by_colour(scene: &Scene) -> [usize; 8] {
    let quality = BlurMode::Still { pixel_samples: 1 }.into();
    let picture = support::render(scene, &RenderOptions { quality, ..RenderOptions::default() });
    let mut counts = [0; 8];
    for [r, g, b, _] in picture.rgba {
        if [r, g, b].iter().all(|c| *c < 0.01 || *c > 0.99) {
            counts[usize::from(r > 0.5) + 2 * usize::from(g > 0.5) + 4 * usize::from(b > 0.5)] += 1;
        }
    }
    counts
}

#[test]
fn three_sides_of_a_mesh_show_and_of_a_cloud_the_front() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = coloured_cube(folder.path());
    // Twice as fine as the pictures below need.
    let size = scene_file::SceneLoadOptions { size: Some((320, 240)), ..scene_file::SceneLoadOptions::default() };
    let mut scene = scene_file::load_model(&mesh, &size).unwrap().scene;
    assert!(scene.camera.automatic);
    (scene.image.width, scene.image.height) = (160, 120);
    scene.objects[0].shape.surface_mut().unwrap().material = Some(support::UNLIT);
    scene.lights = vec![Light::Ambient { colour: DVec3::ONE }];
    // Nothing, left, right, bottom, top, back, front.
    let counts = pixels_by_colour(&scene);
    println!("{counts:?}");
    assert!([2, 4, 6].iter().all(|&side| counts[side] > 700), "{counts:?}");
    assert_eq!((counts[1], counts[3], counts[5]), (0, 0, 0));
    // All of it shows.
    let quality = BlurMode::Still { pixel_samples: 4 }.into();
    let picture = support::render(&scene, &RenderOptions { quality, ..RenderOptions::default() });
    let edge = |i: usize| [0, 159].contains(&(i % 160)) || [0, 119].contains(&(i / 160));
    assert!((0..picture.rgba.len()).filter(|&i| edge(i)).all(|i| picture.rgba[i][..3] == [0.0; 3]));
    // The same surfels as a cloud.
    let path = folder.path().join("cube.bin");
    model::write_bin(&path, &sampled(&mesh, Spacing::Of(0.02))).unwrap();
    let cloud = scene_file::load_model(&path, &scene_file::SceneLoadOptions::default()).unwrap().scene.camera;
    assert_eq!((cloud.eye.x, cloud.eye.y), (cloud.at.x, cloud.at.y));
}

#[test]
fn concave_faces_are_cut_alike_in_both_formats() {
    // An L on a slope; a fan from its first corner would cover the notch.
    let corners = [(2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0), (0.0, 0.0), (2.0, 0.0)];
    let rows: Vec<String> = corners.iter().map(|(x, y)| format!("{x} {y} {}", 0.5 * x + 0.25 * y)).collect();
    let folder = tempfile::tempdir().unwrap();
    let obj = format!("v {}\nf 1 2 3 4 5 6\n", rows.join("\nv "));
    fs::write(folder.path().join("l.obj"), obj).unwrap();
    let header = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    fs::write(folder.path().join("l.ply"), format!("{header}{}\n6 0 1 2 3 4 5\n", rows.join("\n"))).unwrap();
    for name in ["l.obj", "l.ply"] {
        let s = sampled(&folder.path().join(name), Spacing::Of(0.05));
        let places = || s.position.iter().map(|p| (s.origin + p.as_dvec3()).truncate());
        let inside = |x: f64, y: f64| x < 1.01 || y < 1.01;
        assert!(places().all(|p| inside(p.x, p.y)), "{name}: surfels in the notch");
        // Three units of area: 400 a unit, and those at edges.
        assert!((1150..2150).contains(&s.len()), "{name}: {}", s.len());
    }
    // A face that crosses itself is a fan, and a note.
    let bow = format!("{header}0 0 0\n1 1 0\n1 0 0\n0 1 0\n5 5 0\n6 6 0\n4 0 1 2 3\n");
    fs::write(folder.path().join("bow.ply"), bow).unwrap();
    let loaded = model::load(&folder.path().join("bow.ply"), &LoadOptions::default(), &|_, _| {}).unwrap();
    assert!(loaded.notes.iter().any(|note| note.contains("drawn as fans (1)")), "{:?}", loaded.notes);
}

/// An OBJ with a library and a texture of one colour, in a folder of its own.
fn textured_square(folder: &Path, name: &str, red: u8) {
    let folder = folder.join(name);
    fs::create_dir(&folder).unwrap();
    image::RgbImage::from_pixel(4, 4, image::Rgb([red, 100, 50])).save(folder.join("t.png")).unwrap();
    fs::write(folder.join("m.mtl"), "newmtl a\nmap_Kd t.png\n").unwrap();
    let corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    fs::write(folder.join("m.obj"), format!("mtllib m.mtl\nusemtl a\n{corners}f 1/1 2/2 3/3 4/4\n")).unwrap();
}

#[test]
fn files_with_the_same_mesh_share_its_surfels() {
    let folder = tempfile::tempdir().unwrap();
    for (name, red) in [("first", 200), ("copy", 200), ("other", 201)] {
        textured_square(folder.path(), name, red);
    }
    let objects = [
        ("first", "", "0 0 0"),
        ("copy", "", "0 0 3"),
        // The same OBJ and library beside another texture.
        ("other", "", "0 0 0"),
        ("first", " spacing='0.1'", "0 0 0"),
        ("copy", " spacing='0.1'", "0 0 0"),
        ("copy", " spacing='0.1' radiusScale='2'", "0 0 0"),
    ];
    let object = |(name, how, at): &(&str, &str, &str)| {
        format!("<object><pointModel{how}>{name}/m.obj</pointModel><transform translate='{at}'/></object>")
    };
    let body: String = objects.iter().map(object).collect();
    let path = folder.path().join("scene.xml");
    fs::write(&path, format!("<scene><camera eye='0.5 0.5 9' at='0.5 0.5 0'/>{body}</scene>")).unwrap();
    let loaded = scene_file::load(&path, &scene_file::SceneLoadOptions::default()).unwrap();
    let shown = |i: usize| loaded.scene.objects[i].shape.surfels().unwrap().surfels();
    let shares = |i: usize, j: usize| std::sync::Arc::ptr_eq(shown(i), shown(j));
    let sharing: Vec<[usize; 2]> =
        (0..6).flat_map(|i| (0..i).map(move |j| [j, i])).filter(|&[j, i]| shares(i, j)).collect();
    assert_eq!(sharing, [[0, 1], [3, 4]]);
    // The nearest of those that share decides: the third object is as far away as the first.
    assert!(shown(1).len() > shown(2).len(), "{} {}", shown(1).len(), shown(2).len());
    let said = loaded.notes.iter().filter(|note| note.contains("the same mesh as") && note.contains("sampled once"));
    assert_eq!(said.count(), 2, "{:?}", loaded.notes);
}

#[test]
fn animations_are_ignored_only_where_nothing_plays_them() {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(data("CesiumMilkTruck.glb"), folder.path().join("truck.glb")).unwrap();
    let says = |animation: &str| {
        let path = folder.path().join("scene.xml");
        let object = format!("<object><pointModel node='#2' spacing='0.1'>truck.glb</pointModel>{animation}</object>");
        fs::write(&path, format!("<scene>{object}</scene>")).unwrap();
        let notes = scene_file::load(&path, &scene_file::SceneLoadOptions::default()).unwrap().notes;
        notes.iter().filter(|note| note.contains("ignored: animations")).count()
    };
    assert_eq!(says(""), 1);
    assert_eq!(says("<animation node='#2'>truck.glb</animation>"), 0);
}
