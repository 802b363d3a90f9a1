//! Meshes by their triangles: against a tracer that shares no code with the program, at rest and in motion.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};
use splatblur::Scene;
use splatblur::compare::flip;
use splatblur::film::{Aov, Picture};
use splatblur::options::{Look, PixelFilter};
use splatblur::reference::{self, Meshes, ReferenceOptions};
use splatblur::scene::Motion;
use splatblur::time::{Shutter, Weight};

use crate::support::triangles::{TriangleCamera, Triangles, blob, cube_sphere, png};
use crate::support::{Random, UNLIT};

const SIZE: [u32; 2] = [64, 48];
const BACKGROUND: DVec3 = DVec3::new(0.05, 0.12, 0.25);

fn view(eye: DVec3) -> TriangleCamera {
    TriangleCamera { eye, at: DVec3::ZERO, up: DVec3::Y, fovy: 40.0, size: SIZE }
}

/// A scene file for a view of a model, without light and shade.
fn scene_of(model: &Path, folder: &Path, eye: DVec3) -> Scene {
    let text = format!(
        concat!(
            "<scene><image width=\"{}\" height=\"{}\" background=\"{} {} {}\"/>",
            "<camera eye=\"{} {} {}\" at=\"0 0 0\" fovy=\"40\" near=\"1e-4\"/>",
            "<light type=\"ambient\" colour=\"1 1 1\" intensity=\"1\"/>",
            "<object><pointModel>{}</pointModel></object></scene>",
        ),
        SIZE[0],
        SIZE[1],
        BACKGROUND.x,
        BACKGROUND.y,
        BACKGROUND.z,
        eye.x,
        eye.y,
        eye.z,
        model.display()
    );
    let path = folder.join("scene.xml");
    fs::write(&path, text).unwrap();
    let mut scene = Scene::load(path).unwrap();
    scene.objects[0].shape.surface_mut().unwrap().material = Some(UNLIT);
    scene.shutter = Shutter { open: 0.0, close: 1.0, weight: Weight::Box, ..scene.shutter };
    scene
}

fn traced(scene: &Scene, meshes: Meshes, samples: u64) -> Picture {
    let look = Look { filter: PixelFilter::Box, ..Look::default() };
    let options = ReferenceOptions { samples, meshes, look, ..ReferenceOptions::default() };
    reference::picture(scene, 0, &options).unwrap()
}

/// The mean of pictures.
fn mean(pictures: &[Picture]) -> Picture {
    let mut mean = pictures[0].clone();
    for (i, pixel) in mean.rgba.iter_mut().enumerate() {
        *pixel = [0, 1, 2, 3].map(|k| pictures.iter().map(|of| of.rgba[i][k]).sum::<f32>() / pictures.len() as f32);
    }
    mean
}

/// Errors of the triangles, and of the surfels; both samplings have noise.
fn errors(name: &str, scene: &Scene, truth: &Picture, samples: u64) -> [f64; 2] {
    let errors =
        [Meshes::Triangles, Meshes::Surfels].map(|meshes| flip::mean(&traced(scene, meshes, samples), truth).unwrap());
    println!("{name}: FLIP of triangles {:.4}, of surfels {:.4}", errors[0], errors[1]);
    errors
}

fn shipped_box() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/models/BoxTextured.glb")
}

#[test]
fn a_textured_box_is_traced_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let model = shipped_box();
    let truth = Triangles::of_glb(&model);
    for eye in [DVec3::new(0.9, 0.7, 1.3), DVec3::new(-2.0, 1.5, 3.0)] {
        let [triangles, surfels] =
            errors("box", &scene_of(&model, folder.path(), eye), &truth.picture(&view(eye), 24, BACKGROUND), 1024);
        assert!(triangles < 0.0025, "{triangles}");
        assert!(surfels > 2.0 * triangles, "nothing tells them apart: {surfels}");
    }
}

/// A random shape, and a motion by a quarter of its width.
#[test]
#[ignore = "deep: many samples"]
fn a_random_mesh_in_motion_is_traced_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(77);
    let reach = blob(&mut random);
    let stripes = image::RgbImage::from_fn(32, 32, |x, y| image::Rgb([(x * 8) as u8, (y * 8) as u8, (x * y) as u8]));
    stripes.save(folder.path().join("t.png")).unwrap();
    fs::write(folder.path().join("m.mtl"), "newmtl a\nmap_Kd t.png\n").unwrap();
    let mut text = String::from("mtllib m.mtl\nusemtl a\n");
    for (i, corners) in cube_sphere(12, reach).into_iter().enumerate() {
        for (p, uv) in corners {
            writeln!(text, "v {} {} {}\nvt {} {}", p.x, p.y, p.z, 3.0 * uv.x, -1.5 * uv.y).unwrap();
        }
        let [a, b, c] = [3 * i + 1, 3 * i + 2, 3 * i + 3];
        writeln!(text, "f {a}/{a} {b}/{b} {c}/{c}").unwrap();
    }
    let model = folder.path().join("blob.obj");
    fs::write(&model, text).unwrap();
    let truth = Triangles::of_obj(&model, png(&fs::read(folder.path().join("t.png")).unwrap()));
    let eye = DVec3::new(1.0, 1.5, 4.0);
    let mut scene = scene_of(&model, folder.path(), eye);
    let velocity = DVec3::new(0.5, -0.2, 0.3);
    scene.objects[0].motions = vec![Motion::Linear { velocity }];
    // An object that moves is one at rest before a camera that moves the other way.
    let at = |i: u32| {
        let shift = velocity * (f64::from(i) + 0.5) / 32.0;
        truth.picture(&TriangleCamera { eye: eye - shift, at: -shift, ..view(eye) }, 16, BACKGROUND)
    };
    let pictures: Vec<Picture> = (0..32).map(at).collect();
    let [triangles, surfels] = errors("blob in motion", &scene, &mean(&pictures), 4096);
    assert!(triangles < 0.003, "{triangles}");
    assert!(surfels > 2.0 * triangles, "nothing tells them apart: {surfels}");
}

/// A square of two triangles, left half cut out and right half half transparent, before a white one.
#[test]
fn what_is_cut_out_or_see_through_lets_the_light_pass() {
    let folder = tempfile::tempdir().unwrap();
    let square = |z: f64| {
        let corner = |x: f64, y: f64| (DVec3::new(x, y, z), DVec2::new(0.5 + 0.5 * x, 0.5 - 0.5 * y));
        [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]
    };
    for (mode, want) in [("MASK", [1.0, 0.0, 0.0]), ("BLEND", [1.0, 0.5, 0.5])] {
        // 4 x 1 texels: two without any opacity, two with a half of it.
        let texture = image::RgbaImage::from_fn(4, 1, |x, _| image::Rgba([255, 0, 0, if x < 2 { 0 } else { 128 }]));
        texture.save(folder.path().join("t.png")).unwrap();
        let mut bytes = Vec::new();
        for (p, _) in square(0.0) {
            p.to_array().iter().for_each(|x| bytes.extend((*x as f32).to_le_bytes()));
        }
        for (_, uv) in square(0.0) {
            uv.to_array().iter().for_each(|x| bytes.extend((*x as f32).to_le_bytes()));
        }
        bytes.extend([0_u16, 1, 2, 0, 2, 3].map(u16::to_le_bytes).as_flattened());
        fs::write(folder.path().join("b.bin"), &bytes).unwrap();
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"indices":2,"material":0}}]}}],
            "materials":[{{"alphaMode":"{mode}","alphaCutoff":0.4,"doubleSided":true,
                "pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],
            "textures":[{{"source":0,"sampler":0}}],"samplers":[{{"wrapS":33071,"wrapT":33071}}],
            "images":[{{"uri":"t.png"}}],"buffers":[{{"uri":"b.bin","byteLength":{}}}],
            "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":48}},
                {{"buffer":0,"byteOffset":48,"byteLength":32}},{{"buffer":0,"byteOffset":80,"byteLength":12}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3",
                    "min":[-1,-1,0],"max":[1,1,0]}},
                {{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"}},
                {{"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"}}]}}"#,
            bytes.len()
        );
        let model = folder.path().join("m.gltf");
        fs::write(&model, text).unwrap();
        let mut scene = scene_of(&model, folder.path(), DVec3::new(0.0, 0.0, 4.0));
        scene.image.background = DVec3::ONE;
        let picture = traced(&scene, Meshes::Triangles, 1024);
        let at = |x: u32, y: u32| picture.rgba[(y * SIZE[0] + x) as usize];
        // The square is 33 pixels wide. Its four texels are 8 pixels wide, and blend about the middle.
        for (x, want) in [(20, [1.0; 3]), (43, want)] {
            for (got, want) in at(x, 24).iter().zip(want) {
                assert!((got - want).abs() < 0.01, "{mode}: {x}: {:?}", at(x, 24));
            }
        }
    }
}

/// The layers of a mesh: depth and normal of a side that faces the camera.
#[test]
fn layers_are_those_of_the_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let model = shipped_box();
    let mut scene = scene_of(&model, folder.path(), DVec3::new(0.0, 0.0, 2.0));
    scene.objects[0].motions = vec![Motion::Linear { velocity: DVec3::new(0.1, 0.0, 0.0) }];
    let look = Look { aovs: vec![Aov::Depth, Aov::Normal, Aov::Velocity], ..Look::default() };
    let options = ReferenceOptions { samples: 16, look, ..ReferenceOptions::default() };
    let picture = reference::picture(&scene, 0, &options).unwrap();
    let middle = (24 * SIZE[0] + 32) as usize;
    // The side is half a unit before the middle of the box, and a pixel at that depth is 2 (1.5) tan 20 / 48 wide.
    let pixels = 0.1 * 24.0 / (1.5 * 20_f64.to_radians().tan());
    let want = [1.5, 0.0, 0.0, 1.0, pixels, 0.0];
    let layer = |aov: Aov| picture.layers.iter().find(|layer| layer.aov == aov).unwrap().planes.iter();
    let wanted = [Aov::Depth, Aov::Normal, Aov::Velocity].into_iter().flat_map(layer);
    let layers: Vec<f32> = wanted.map(|plane| plane[middle]).collect();
    for (got, want) in layers.iter().zip(want) {
        assert!((f64::from(*got) - want).abs() < 1e-3, "{layers:?}");
    }
}
