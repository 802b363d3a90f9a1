//! Motion of glTF nodes, against the formulas of the specification, and scenes that use it.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests may stop and report")]

use std::fs;
use std::path::Path;

use glam::{DMat3, DMat4, DQuat, DVec3};
use serde_json::{Value, json};
use splatblur::anim::{self, Chain, GltfAnimation, NodeMotion};
use splatblur::math::Bounds;
use splatblur::model::Surfels;
use splatblur::scene::pose::{ObjectPoser, jumps, object_pose};
use splatblur::scene::{AnimationBinding, Object};
use splatblur::scene_file;

use super::meshes::{data, floats, glb};
use crate::support;

fn open(path: &Path) -> Result<GltfAnimation, String> {
    match anim::open(path).map_err(|why| why.to_string())? {
        anim::AnimationFile::Gltf(animation) => Ok(animation),
        anim::AnimationFile::Maya(_) => panic!("{} is no .anim", path.display()),
    }
}

/// Keys of the axle, read by the crate `gltf`.
fn axle_keys() -> Vec<(f64, [f64; 4])> {
    let gltf::Gltf { document, blob } = gltf::Gltf::open(data("CesiumMilkTruck.glb")).unwrap();
    let blob = blob.unwrap();
    let animation = document.animations().next().unwrap();
    let channel = animation.channels().find(|channel| channel.target().node().index() == 2).unwrap();
    let reader = channel.reader(|_| Some(&blob));
    let gltf::animation::util::ReadOutputs::Rotations(turns) = reader.read_outputs().unwrap() else { panic!() };
    let turns = turns.into_f32().map(|turn| turn.map(f64::from));
    reader.read_inputs().unwrap().map(f64::from).zip(turns).collect()
}

/// Spherical interpolation by angles, as glTF 2.0, appendix C.4 writes it.
fn slerp(keys: &[(f64, [f64; 4])], t: f64) -> DQuat {
    let k = keys.iter().rposition(|(time, _)| *time <= t).unwrap_or(0).min(keys.len() - 2);
    let ((t0, a), (t1, b)) = (keys[k], keys[k + 1]);
    let u = ((t - t0) / (t1 - t0)).clamp(0.0, 1.0);
    let dot: f64 = (0..4).map(|i| a[i] * b[i]).sum();
    let angle = dot.abs().min(1.0).acos();
    let (p, q) = if angle < 1e-8 {
        (1.0 - u, u)
    } else {
        ((angle * (1.0 - u)).sin() / angle.sin(), (angle * u).sin() / angle.sin())
    };
    let q = q * dot.signum();
    let [x, y, z, w] = [0, 1, 2, 3].map(|i| p * a[i] + q * b[i]);
    DQuat::from_xyzw(x, y, z, w).normalize()
}

/// Angle of the rotation between two matrices.
fn angle(a: &DMat4, b: &DMat4) -> f64 {
    let between = DMat3::from_mat4(*a).transpose() * DMat3::from_mat4(*b);
    // Of a small angle the sine keeps more digits than the cosine.
    let axis = DVec3::new(
        between.y_axis.z - between.z_axis.y,
        between.z_axis.x - between.x_axis.z,
        between.x_axis.y - between.y_axis.x,
    );
    (0.5 * axis.length()).atan2(0.5 * (between.x_axis.x + between.y_axis.y + between.z_axis.z - 1.0))
}

#[test]
fn a_wheel_turns_as_its_keys_say() {
    let animation = open(&data("CesiumMilkTruck.glb")).unwrap();
    let keys = axle_keys();
    assert_eq!(keys.len(), 31);
    let axle = DVec3::new(-1.352_329_969_406_128, 0.427_722_007_036_209_1, -2.980_229_925_055_64e-8);
    let once = animation.bind(Some("#2"), 24.0, false).unwrap();
    let again = animation.bind(Some("#2"), 24.0, true).unwrap();
    let mut turned = 0.0;
    for time in [0.0, 0.01, 0.1, 0.2, 0.333, 0.5, 0.62, 0.9, 1.1, 1.249] {
        let truth = DMat4::from_rotation_translation(slerp(&keys, time), axle);
        for (chain, at) in [(&once, time), (&again, time), (&again, time + 2.5), (&again, time - 1.25)] {
            let pose = chain.at(at);
            // Keys that miss a frame by the rounding of f32 are put on it.
            assert!(angle(&pose, &truth) < 1e-5, "{at}: {}", angle(&pose, &truth));
            assert!((pose.w_axis.truncate() - axle).length() < 1e-12);
        }
        turned += angle(&once.at(time), &once.at(0.0));
    }
    assert!(turned > 5.0, "it turns at all: {turned}");
    // Before the first key and after the last the value holds.
    assert_eq!(once.at(-3.0), once.at(0.0));
    assert_eq!(once.at(99.0), once.at(1.25));
    assert_eq!((once.range(), once.has_scale(), once.moves()), ((0.0, 1.25), false, true));
    // The file begins 10 degrees beside where it ends.
    assert_eq!(again.breaks(-1.3, 2.6), [-1.25, 0.0, 1.25, 2.5]);
    assert!(again.breaks(0.1, 1.2).is_empty() && once.breaks(-9.0, 9.0).is_empty());
    assert!(!animation.bind(Some("#0"), 24.0, false).unwrap().moves());
    let error = animation.bind(Some("Wheels"), 24.0, false).unwrap_err().to_string();
    assert!(error.contains("2 nodes `Wheels`, expected one of #2, #4"), "{error}");
    assert_eq!(animation.bind(None, 24.0, false).unwrap().label, "#2");
}

/// A file of a parent (scale 2, shifted by x = 10) and a child with one channel.
fn file(path: &str, interpolation: &str, times: &[f32], values: &[f32]) -> (Value, Vec<u8>) {
    let mut bytes = floats(times);
    bytes.extend(floats(values));
    let width = if path == "rotation" { 4 } else { 3 };
    let text = json!({
        "asset": {"version": "2.0"},
        "nodes": [
            {"name": "parent", "translation": [10.0, 0.0, 0.0], "scale": [2.0, 2.0, 2.0], "children": [1]},
            {"name": "child", "translation": [0.0, 1.0, 0.0]},
        ],
        "animations": [{
            "channels": [{"sampler": 0, "target": {"node": 1, "path": path}}],
            "samplers": [{"input": 0, "output": 1, "interpolation": interpolation}],
        }],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": times.len(), "type": "SCALAR"},
            {"bufferView": 0, "byteOffset": 4 * times.len(), "componentType": 5126, "count": values.len() / width,
                "type": if width == 4 { "VEC4" } else { "VEC3" }},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": bytes.len()}],
        "buffers": [{"byteLength": bytes.len()}],
    });
    (text, bytes)
}

fn bind((text, bytes): &(Value, Vec<u8>), looped: bool) -> Result<Chain, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    fs::write(&path, glb(text, bytes)).unwrap();
    open(&path)?.bind(Some("child"), 24.0, looped).map_err(|why| why.to_string())
}

fn shift(chain: &Chain, time: f64) -> DVec3 {
    chain.at(time).w_axis.truncate()
}

#[test]
fn keys_are_joined_as_the_specification_says() {
    let values = [1.0, 0.0, 0.0, 3.0, 4.0, 0.0];
    // The parent doubles and shifts.
    let up = |v: [f64; 3]| DVec3::from_array(v) * 2.0 + DVec3::new(10.0, 0.0, 0.0);
    let near = |a: DVec3, b: DVec3| assert!((a - b).length() < 1e-12, "{a} {b}");
    let linear = bind(&file("translation", "LINEAR", &[1.0, 2.0], &values), false).unwrap();
    near(shift(&linear, 0.0), up([1.0, 0.0, 0.0]));
    near(shift(&linear, 1.25), up([1.5, 1.0, 0.0]));
    near(shift(&linear, 7.0), up([3.0, 4.0, 0.0]));
    let step = bind(&file("translation", "STEP", &[1.0, 2.0], &values), false).unwrap();
    near(shift(&step, 1.999), up([1.0, 0.0, 0.0]));
    near(shift(&step, 2.0), up([3.0, 4.0, 0.0]));
    assert_eq!(step.breaks(0.0, 9.0), [2.0]);
    // In-tangent, value, out-tangent of both keys, 2 seconds apart. At the middle: (v0 + v1)/2 + 2/8 (b0 - a1).
    let spline = [9.0, 9.0, 9.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 3.0, 3.0, 4.0, 0.0, 9.0, 9.0, 9.0];
    let cubic = bind(&file("translation", "CUBICSPLINE", &[1.0, 3.0], &spline), false).unwrap();
    near(shift(&cubic, 2.0), up([2.0, 2.25, -0.75]));
    near(shift(&cubic, 1.0), up([1.0, 0.0, 0.0]));
    near(shift(&cubic, 3.0), up([3.0, 4.0, 0.0]));
    // The longer way round is written, the shorter is taken: from 0 to -90 degrees about z.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turn =
        bind(&file("rotation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, -half]), false).unwrap();
    let x = turn.at(0.5).transform_vector3(DVec3::X) / 2.0;
    assert!((x - DVec3::new(0.5_f64.sqrt(), -(0.5_f64.sqrt()), 0.0)).length() < 1e-7, "{x}");
    // A spline of rotations is brought to length 1.
    let zero = [0.0; 4];
    let keys = [zero, [0.0, 0.0, 0.0, 1.0], zero, zero, [0.0, 0.0, half, half], zero].concat();
    let turn = bind(&file("rotation", "CUBICSPLINE", &[0.0, 1.0], &keys), false).unwrap();
    let x = turn.at(0.5).transform_vector3(DVec3::X) / 2.0;
    assert!((x - DVec3::new(0.5_f64.sqrt(), 0.5_f64.sqrt(), 0.0)).length() < 1e-7, "{x}");
    assert!((turn.at(0.3).transform_vector3(DVec3::X).length() - 2.0).abs() < 1e-12);
}

#[test]
fn a_loop_repeats_from_0_to_the_last_key() {
    let (mut text, bytes) = file("translation", "LINEAR", &[0.5, 1.0], &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    let chain = bind(&(text.clone(), bytes.clone()), true).unwrap();
    for (time, x) in [(0.25, 0.0), (0.75, 2.0), (1.25, 0.0), (1.75, 2.0), (-0.25, 2.0), (100.75, 2.0), (3.0, 0.0)] {
        assert!((shift(&chain, time).x - 10.0 - 2.0 * x).abs() < 1e-9, "{time}");
    }
    assert_eq!(chain.breaks(0.5, 3.5), [1.0, 2.0, 3.0]);
    assert_eq!(chain.range(), (0.0, 1.0));
    // Keys that rounding put beside a frame are on it: a step happens on its frame.
    let frames: Vec<f32> = (0..200).map(|frame| frame as f32 / 24.0).collect();
    let places: Vec<f32> = (0..200).flat_map(|frame| [frame as f32, 0.0, 0.0]).collect();
    let stepped = file("translation", "STEP", &frames, &places);
    let (once, again) = (bind(&stepped, false).unwrap(), bind(&stepped, true).unwrap());
    for frame in 0..199 {
        let x = 10.0 + 2.0 * f64::from(frame);
        assert_eq!(shift(&once, f64::from(frame) / 24.0).x, x);
        assert_eq!(shift(&again, f64::from(frame + 199 * 7) / 24.0).x, x, "{frame}");
    }
    // Another animation of the node is said.
    let clips = text["animations"][0].clone();
    text["animations"] =
        json!([clips, {"name": "other", "channels": clips["channels"], "samplers": clips["samplers"]}]);
    assert_eq!(bind(&(text, bytes), true).unwrap().unused, ["other"]);
}

#[test]
fn bad_animations_are_refused_in_one_line() {
    type Change = fn(&mut Value);
    let values = [0.0, 0.0, 0.0, 4.0, 0.0, 0.0];
    let good = || file("translation", "LINEAR", &[0.5, 1.0], &values);
    let cases: &[(&str, Change)] = &[
        ("node 8, expected below 2", |t| t["animations"][0]["channels"][0]["target"]["node"] = json!(8)),
        ("sampler 8, expected below 1", |t| t["animations"][0]["channels"][0]["sampler"] = json!(8)),
        ("accessor 8, expected below 2", |t| t["animations"][0]["samplers"][0]["output"] = json!(8)),
        ("interpolation `SLOW`", |t| t["animations"][0]["samplers"][0]["interpolation"] = json!("SLOW")),
        ("2 values for 2 keys, expected 6 values", |t| {
            t["animations"][0]["samplers"][0]["interpolation"] = json!("CUBICSPLINE");
        }),
        ("type Scalar, expected Vec3", |t| t["animations"][0]["samplers"][0]["output"] = json!(0)),
        ("2 values for 1 keys", |t| t["accessors"][0]["count"] = json!(1)),
        ("without keys", |t| t["accessors"][0]["count"] = json!(0)),
        ("moved twice", |t| {
            let channel = t["animations"][0]["channels"][0].clone();
            t["animations"][0]["channels"].as_array_mut().unwrap().push(channel);
        }),
        ("a matrix that shears", |t| {
            t["nodes"][1] = json!({"name": "child", "matrix": [1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]});
        }),
        ("a second time", |t| t["nodes"][1]["children"] = json!([0])),
        ("no node `child`", |t| t["nodes"][1]["name"] = json!("other")),
    ];
    for (part, change) in cases {
        let (mut text, bytes) = good();
        change(&mut text);
        let error = bind(&(text, bytes), false).unwrap_err();
        assert!(error.contains(part), "{part}: {error}");
        assert!(error.contains("a.glb: byte 20: found") && error.lines().count() == 1, "{error}");
    }
    for (times, part) in [([1.0, 0.5], "time 0.5 of key 1"), ([f32::NAN, 1.0], "time NaN of key 0")] {
        assert!(bind(&file("translation", "LINEAR", &times, &values), false).unwrap_err().contains(part));
    }
    let still = file("rotation", "LINEAR", &[0.0, 1.0], &[0.0; 8]);
    assert!(bind(&still, false).unwrap_err().contains("a rotation with a direction"));
    // A matrix without shear may move.
    let (mut text, bytes) = good();
    text["nodes"][1] = json!({"name": "child", "matrix": [0, 3, 0, 0, -2, 0, 0, 0, 0, 0, 1, 0, 7, 8, 9, 1]});
    let m = bind(&(text, bytes), false).unwrap().at(1.0);
    assert!((m.transform_point3(DVec3::X) - DVec3::new(18.0, 6.0, 0.0)).length() < 1e-9, "{m}");
}

#[test]
fn bounds_hold_the_node_at_every_time() {
    let (centre, radius) = (DVec3::new(0.3, -0.5, 0.2), 0.4);
    let values = [1.0, 0.0, 0.0, 3.0, 4.0, 0.0, -2.0, 0.5, 1.0];
    let spline: Vec<f32> = (0..27).map(|i| ((i * 7) % 11) as f32 - 5.0).collect();
    let turns = [[0.0, 0.0, 0.6, 0.8], [0.5, 0.5, 0.5, -0.5], [1.0, 0.0, 0.0, 0.0]].concat();
    let mut chains = Vec::new();
    for looped in [false, true] {
        let times = [0.0, 0.7, 1.5];
        chains.push(bind(&file("translation", "LINEAR", &times, &values), looped).unwrap());
        chains.push(bind(&file("translation", "CUBICSPLINE", &times, &spline), looped).unwrap());
        chains.push(bind(&file("scale", "LINEAR", &times, &values), looped).unwrap());
        chains.push(bind(&file("rotation", "LINEAR", &times, &turns), looped).unwrap());
        chains.push(bind(&file("translation", "STEP", &times, &values), looped).unwrap());
        chains.push(open(&data("CesiumMilkTruck.glb")).unwrap().bind(Some("#4"), 24.0, looped).unwrap());
    }
    let (mut known, mut all) = (0, 0);
    for chain in chains {
        let mut object: Object = support::object(Surfels::default());
        let interpolation = anim::Interpolation::default();
        object.animation = Some(AnimationBinding { path: "a".into(), node: NodeMotion::from(chain), interpolation });
        let scene = support::scene(vec![object], [8, 8], DVec3::ZERO, 40.0);
        let poser = ObjectPoser::new(&scene, &scene.objects[0]);
        for i in 0..200 {
            let from = -10.0 + 0.41 * f64::from(i);
            let to = from + [0.0, 1e-3, 0.02, 0.5, 3.0][i as usize % 5];
            all += 1;
            let Some((x, r)) = poser.swept_sphere(centre, radius, from, to) else { continue };
            known += 1;
            for k in 0..=32 {
                let m = poser.at(from + (to - from) * f64::from(k) / 32.0).unwrap();
                for e in [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z] {
                    let p = m.transform_point3(centre + e * radius);
                    assert!((p - x).length() <= r * (1.0 + 1e-9) + 1e-12, "{i} {k}: {} {r}", (p - x).length());
                }
            }
        }
    }
    assert!(known * 10 > all * 8, "{known} of {all}");
}

/// A scene of `truck.glb` in a folder, with surfels for its wheels.
fn scene(body: &str) -> Result<scene_file::LoadedScene, String> {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(data("CesiumMilkTruck.glb"), folder.path().join("truck.glb")).unwrap();
    fs::copy(data("tiny_full.sfl"), folder.path().join("a.sfl")).unwrap();
    fs::copy("animations/spin_y.anim", folder.path().join("spin.anim")).unwrap();
    let path = folder.path().join("s.xml");
    fs::write(&path, format!("<scene>{body}</scene>")).unwrap();
    let loaded = scene_file::load(&path, &scene_file::SceneLoadOptions::default()).map_err(|why| why.to_string())?;
    // Written and read again it is the same.
    let text = scene_file::to_xml(&loaded.scene, folder.path());
    fs::write(&path, &text).unwrap();
    let again = scene_file::load(&path, &scene_file::SceneLoadOptions::default()).unwrap();
    assert_eq!(scene_file::to_xml(&again.scene, folder.path()), text);
    assert!(body.contains(".anim<") || text.contains("<animation node=\"#2\" fps=\""), "{text}");
    for time in [0.0, 0.3, 17.0, 100.5] {
        let [a, b] = [&loaded.scene, &again.scene].map(|scene| object_pose(scene, &scene.objects[0], time));
        assert_eq!(a, b);
    }
    Ok(loaded)
}

#[test]
fn a_scene_binds_a_node() {
    let object = |attributes: &str, file: &str| {
        format!("<object><pointModel>a.sfl</pointModel><animation {attributes}>{file}</animation></object>")
    };
    let loaded = scene(&object("node='#2' fps='30' loop='true'", "truck.glb")).unwrap();
    let frames = loaded.scene.frames;
    assert_eq!((frames.first, frames.last, frames.rate), (0, 37, 30.0));
    let chain = open(&data("CesiumMilkTruck.glb")).unwrap().bind(Some("#2"), 30.0, true).unwrap();
    for frame in [0.0, 3.5, 50.0] {
        let pose = object_pose(&loaded.scene, &loaded.scene.objects[0], frame);
        assert!(pose.visible && pose.world_from_model.abs_diff_eq(chain.at(frame / 30.0), 1e-12));
    }
    assert_eq!(jumps(&loaded.scene, 1.0, 80.0), [37.5, 75.0]);
    // 24 frames a second where nothing is said, and the first node that moves.
    let frames = scene(&object("", "truck.glb")).unwrap().scene.frames;
    assert_eq!((frames.first, frames.last, frames.rate), (0, 30, 24.0));
    let notes = |attributes: &str, file: &str| scene(&object(attributes, file)).unwrap().notes.join("\n");
    assert!(notes("interpolation='linear'", "truck.glb").contains("`interpolation` is for Maya files"));
    assert!(notes("loop='true'", "spin.anim").contains("`fps` and `loop` are for glTF files"));
    let error = scene(&object("node='Wheels'", "truck.glb")).unwrap_err();
    assert!(error.contains("s.xml:1:"), "{error}");
    let refused = |attributes: &str| scene(&object(attributes, "truck.glb")).is_err();
    assert!(refused("fps='0'") && refused("loop='maybe'") && refused("node=''"));
}

#[test]
fn a_camera_follows_a_node_without_its_scale() {
    let (mut text, bytes) = file("translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    text["nodes"][0]["rotation"] = json!([0.0, std::f64::consts::FRAC_1_SQRT_2, 0.0, std::f64::consts::FRAC_1_SQRT_2]);
    text["nodes"][0]["scale"] = json!([2.0, 3.0, -4.0]);
    let m = bind(&(text, bytes), false).unwrap().rigid_at(0.5);
    let r = DMat3::from_mat4(m);
    assert!((r.determinant() - 1.0).abs() < 1e-12 && (r * r.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12));
    // -z of the node, which its mirror turned to +z, after a quarter turn about y.
    assert!((r.z_axis - DVec3::NEG_X).length() < 1e-12, "{r}");
}

#[test]
fn a_file_becomes_a_scene_that_plays_it() {
    let play = scene_file::play(&data("CesiumMilkTruck.glb")).unwrap();
    assert_eq!(play.objects, 3);
    assert_eq!(play.files[0].1, Path::new("CesiumMilkTruck.glb"));
    let count = |text: &str| play.xml.matches(text).count();
    assert_eq!(count("<pointModel node=\"Wheels\">CesiumMilkTruck.glb</pointModel>"), 2, "{}", play.xml);
    assert_eq!(count("<pointModel node=\"Cesium_Milk_Truck\">"), 1);
    for node in ["#0", "#2", "#4"] {
        assert_eq!(count(&format!("<animation node=\"{node}\" fps=\"24\" loop=\"true\">")), 1);
    }
    assert!(play.xml.contains("<frames first=\"0\" last=\"29\" rate=\"24\"/>"));
    scene_file::validate(Path::new("scene.xml"), play.xml.as_bytes(), false).unwrap();
    // The camera sees all of it: the box of the truck, as the accessors' bounds say.
    let line = play.xml.lines().find(|line| line.contains("<camera")).unwrap();
    let vector = |name: &str| -> DVec3 {
        let text = line.split(&format!("{name}=\"")).nth(1).unwrap().split('"').next().unwrap();
        let numbers: Vec<f64> = text.split(' ').map(|word| word.parse().unwrap()).collect();
        DVec3::from_slice(&numbers)
    };
    let (eye, at) = (vector(" eye"), vector(" at"));
    let back = (eye - at).normalize();
    let right = DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    let seen = Bounds { min: DVec3::new(-2.431, 0.0, -1.396), max: DVec3::new(2.438, 2.585, 1.396) };
    for corner in seen.corners() {
        let p = corner - eye;
        let depth = -p.dot(back);
        let tan = 20.0_f64.to_radians().tan();
        assert!(p.dot(up).abs() < depth * tan && p.dot(right).abs() < depth * tan * 4.0 / 3.0, "{corner} {line}");
    }
    assert!(scene_file::play(Path::new("animations/spin_y.anim")).is_err());
}
