//! Camera paths: through the keys, between them against closed forms, speed, easing, targets, and what is refused.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::fs;

use glam::DVec3;
use splatblur::scene::Scene;
use splatblur::scene::pose::{camera_from_world, fovy, jumps, object_pose};
use splatblur::scene_file::{SceneLoadOptions, camera_path, load, load_model, to_xml};
use tempfile::TempDir;

const MODEL: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
     end_header\n0 0 0\n1 0 0\n0 1 0\n";

/// A scene with a camera of these words, and things that move.
fn written(camera: &str) -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("m.ply"), MODEL).unwrap();
    let objects = "<object name=\"still\"><pointModel>m.ply</pointModel></object>\n\
         <object name=\"ball\"><sphere radius=\"0.5\"/><transform translate=\"2 0.5 -1\"/>\
         <motion type=\"rotation\" axis=\"0 1 0.2\" degreesPerFrame=\"7\" centre=\"0 0 -3\"/>\
         <motion type=\"linear\" velocity=\"0.02 -0.03 0.01\"/></object>";
    fs::write(dir.path().join("s.xml"), format!("<scene>\n{camera}\n{objects}\n</scene>")).unwrap();
    dir
}

fn scene(camera: &str) -> Scene {
    let dir = written(camera);
    load(&dir.path().join("s.xml"), &SceneLoadOptions::default()).unwrap_or_else(|e| panic!("{e}")).scene
}

fn refusal(camera: &str) -> String {
    let dir = written(camera);
    match load(&dir.path().join("s.xml"), &SceneLoadOptions::default()) {
        Ok(_) => panic!("{camera} was taken"),
        Err(e) => e.to_string().replace(&dir.path().display().to_string(), ""),
    }
}

/// Frame, eye, at, up, degrees.
type Key = (f64, [f64; 3], [f64; 3], [f64; 3], f64);

/// Keys of a flight with uneven frames.
const KEYS: [Key; 5] = [
    (-3.0, [4.0, 1.0, 6.0], [0.0, 0.5, 0.0], [0.0, 1.0, 0.0], 40.0),
    (10.0, [1.0, 2.5, 5.0], [0.2, 0.5, 0.0], [0.1, 1.0, 0.0], 25.0),
    (17.5, [-2.0, 2.0, 4.0], [0.0, 0.0, -1.0], [0.0, 2.0, 0.3], 60.0),
    (40.0, [-3.5, 0.5, 1.0], [0.5, 0.0, -1.0], [0.0, 1.0, 0.0], 60.0),
    (41.0, [-3.7, 0.5, 0.5], [0.5, 0.0, -1.0], [0.0, 1.0, 0.0], 12.5),
];

fn words([x, y, z]: [f64; 3]) -> String {
    format!("{x} {y} {z}")
}

fn flight(attributes: &str) -> String {
    let keys = KEYS.iter().map(|&(frame, eye, at, up, degrees)| {
        let [eye, at, up] = [eye, at, up].map(words);
        format!("  <key frame=\"{frame}\" eye=\"{eye}\" at=\"{at}\" up=\"{up}\" fovy=\"{degrees}\"/>\n")
    });
    format!("<camera {attributes}>\n{}</camera>", keys.collect::<String>())
}

/// An error within its tolerance.
fn near(what: &str, error: f64, tolerance: f64) {
    println!("{what}: {error:.1e}");
    assert!(error < tolerance, "{what}: {error}");
}

fn eye(scene: &Scene, frame: f64) -> DVec3 {
    camera_from_world(scene, frame).inverse().transform_point3(DVec3::ZERO)
}

/// Length of the eye's path between frames, of many chords.
fn length(scene: &Scene, from: f64, to: f64, chords: u32) -> f64 {
    let frame = |i: u32| from + (to - from) * f64::from(i) / f64::from(chords);
    (0..chords).map(|i| eye(scene, frame(i)).distance(eye(scene, frame(i + 1)))).sum()
}

#[test]
fn the_path_goes_through_its_keys_at_their_frames() {
    let scene = scene(&flight(""));
    assert_eq!((scene.frames.first, scene.frames.last), (-3, 41));
    for (frame, from, at, up, degrees) in KEYS {
        let view = camera_from_world(&scene, frame);
        // Found: 1.8e-15.
        near("keys", eye(&scene, frame).distance(from.into()), 1e-6);
        let ahead = view.transform_point3(at.into());
        let distance = DVec3::from(at).distance(from.into());
        assert!(ahead.distance(DVec3::new(0.0, 0.0, -distance)) < 1e-6, "{ahead}");
        let up = view.transform_vector3(up.into());
        assert!(up.x.abs() < 1e-6 && up.y > 0.0, "{up}");
        assert!((fovy(&scene, frame) - degrees.to_radians()).abs() < 1e-6);
    }
    // Before the first and after the last it rests.
    assert_eq!(camera_from_world(&scene, -50.0), camera_from_world(&scene, -3.0));
    assert_eq!(camera_from_world(&scene, 500.0), camera_from_world(&scene, 41.0));
    assert!((fovy(&scene, 99.0) - 12.5_f64.to_radians()).abs() < 1e-12);
    assert!(jumps(&scene, -10.0, 50.0).is_empty());
    // No step is far longer than its neighbours: nothing flips.
    let turn = |frame: f64| camera_from_world(&scene, frame + 0.05) * camera_from_world(&scene, frame).inverse();
    for i in 0..880 {
        let z = turn(-3.0 + f64::from(i) * 0.05).transform_vector3(DVec3::Z);
        // Found: 2.7e-5.
        near("turn of a step", 1.0 - z.z, 1e-3);
    }
}

/// Even keys give the curve of Catmull and Rom (1974): (-a + 9b + 9c - d) / 16 in the middle, and the tangent
/// (c - a) / 2 at b. At the ends it begins along the chord.
#[test]
fn even_keys_give_the_curve_of_catmull_and_rom() {
    let points = [[0.0, 0.0, 5.0], [1.0, 2.0, 5.0], [3.0, 1.5, 4.0], [4.0, -1.0, 4.5]].map(DVec3::from);
    let key = |(i, p): (usize, &DVec3)| format!("<key frame=\"{}\" eye=\"{} {} {}\"/>", 10 * i, p.x, p.y, p.z);
    let keys: String = points.iter().enumerate().map(key).collect();
    let scene = scene(&format!("<camera at=\"0 0 -40\">{keys}</camera>"));
    let [a, b, c, d] = points;
    // Found: 9.9e-16.
    near("middle", eye(&scene, 15.0).distance((9.0 * (b + c) - a - d) / 16.0), 1e-12);
    let slope = (eye(&scene, 10.001) - eye(&scene, 9.999)) / 0.002;
    // Found: 6.7e-6, of the difference.
    near("slope", slope.distance((c - a) / 20.0), 1e-5);
    let start = (eye(&scene, 1e-5) - a) / 1e-5;
    assert!(start.distance((b - a) / 10.0) < 1e-4, "{start}");
}

#[test]
fn the_speed_is_constant_on_request() {
    let scene = scene(&flight("speed=\"constant\""));
    let mean = length(&scene, -3.0, 41.0, 40_000) / 44.0;
    for i in 1..1000 {
        let frame = -3.0 + 44.0 * f64::from(i) / 1000.0;
        let speed = length(&scene, frame - 0.005, frame + 0.005, 4) / 0.01;
        // Found: 2.8e-6, of the chords.
        near("speed", (speed / mean - 1.0).abs(), 1e-3);
    }
    let [first, .., last] = KEYS;
    assert!(eye(&scene, -3.0).distance(first.1.into()) < 1e-6 && eye(&scene, 41.0).distance(last.1.into()) < 1e-6);
    // Without it the speed differs by far more.
    let keyed = self::scene(&flight(""));
    let speeds = [0.0, 40.5].map(|frame| length(&keyed, frame - 0.1, frame + 0.1, 4));
    assert!(speeds[1] > 1.5 * speeds[0], "{speeds:?}");
}

/// On a line of 10 units in 40 frames with 8 and 16 frames of easing, the speed in the middle is 10 / (40 - 12), and
/// easing covers half of what that speed does.
#[test]
fn easing_starts_and_ends_at_rest() {
    let camera = "<camera at=\"0 0 -50\" speed=\"constant\" easeIn=\"8\" easeOut=\"16\">\
         <key frame=\"4\" eye=\"-5 0 3\"/><key frame=\"44\" eye=\"5 0 3\"/></camera>";
    let scene = scene(camera);
    let x = |frame: f64| eye(&scene, frame).x + 5.0;
    let speed = 10.0 / 28.0;
    for (frame, wanted) in
        [(4.0, 0.0), (12.0, 4.0 * speed), (20.0, 12.0 * speed), (28.0, 10.0 - 8.0 * speed), (44.0, 10.0)]
    {
        // Found: 1.8e-15.
        near("easing", (x(frame) - wanted).abs(), 1e-9);
    }
    // In the middle of the rise it has half the speed, and covers 3/32 of what the full speed does in those 8 frames.
    assert!(((x(8.01) - x(7.99)) / 0.02 - 0.5 * speed).abs() < 1e-6);
    assert!((x(8.0) - 8.0 * speed * 3.0 / 32.0).abs() < 1e-9);
    assert!(x(4.01) < 1e-6 && 10.0 - x(43.99) < 1e-6);
}

#[test]
fn the_field_of_view_runs_evenly_in_the_focal_length() {
    let keys = "<key frame=\"0\" fovy=\"90\"/><key frame=\"20\" fovy=\"10\"/>";
    let scene = scene(&format!("<camera eye=\"0 0 5\" at=\"0 0 0\">{keys}</camera>"));
    let focal = |degrees: f64| 1.0 / (0.5 * degrees.to_radians()).tan();
    for share in [0.0, 0.25, 0.5, 0.8, 1.0] {
        let wanted = focal(90.0).powf(1.0 - share) * focal(10.0).powf(share);
        let found = 1.0 / (0.5 * fovy(&scene, 20.0 * share)).tan();
        // Found: 4.4e-16.
        near("focal length", (found / wanted - 1.0).abs(), 1e-12);
    }
}

#[test]
fn a_camera_follows_an_object() {
    let keyed = "<camera atObject=\"ball\"><key frame=\"0\" eye=\"0 2 8\"/><key frame=\"30\" eye=\"6 1 5\"/></camera>";
    for camera in [keyed, "<camera eye=\"0 2 8\" atObject=\"ball\"/>"] {
        let scene = scene(camera);
        for i in 0..120 {
            let frame = f64::from(i) * 0.25;
            let ball = object_pose(&scene, &scene.objects[1], frame).world_from_model.w_axis.truncate();
            let seen = camera_from_world(&scene, frame).transform_point3(ball);
            // Found: 1.3e-15.
            near("followed", seen.truncate().length(), 1e-9);
            assert!(seen.z < -1.0, "{frame}: {seen}");
        }
        assert!(!scene.camera.rests());
    }
}

#[test]
fn a_path_is_written_and_read_again() {
    for attributes in
        ["", "speed=\"constant\" easeIn=\"2.5\" easeOut=\"7\" near=\"0.05\"", "atObject=\"ball\" easeIn=\"3\""]
    {
        let dir = written(&flight(attributes));
        let first = load(&dir.path().join("s.xml"), &SceneLoadOptions::default()).unwrap().scene;
        let text = to_xml(&first, dir.path());
        fs::write(dir.path().join("again.xml"), &text).unwrap();
        let again = load(&dir.path().join("again.xml"), &SceneLoadOptions::default()).unwrap().scene;
        assert_eq!(to_xml(&again, dir.path()), text);
        // As a file of its own it flies the same way, in this scene and before a model alone.
        let (path, other) = (dir.path().join("path.xml"), written("<frames first=\"3\" last=\"5\"/>"));
        fs::write(&path, camera_path(&first.camera)).unwrap();
        let flown = SceneLoadOptions { camera_path: Some(&path), ..SceneLoadOptions::default() };
        let flown = load(&other.path().join("s.xml"), &flown).unwrap().scene;
        assert_eq!((flown.frames.first, flown.frames.last), (-3, 41));
        for i in 0..90 {
            let frame = -4.0 + f64::from(i) * 0.51;
            let view = camera_from_world(&first, frame);
            for scene in [&again, &flown] {
                assert!(camera_from_world(scene, frame).abs_diff_eq(view, 1e-12), "{attributes} {frame}");
                assert!((fovy(scene, frame) - fovy(&first, frame)).abs() < 1e-12);
            }
            assert_eq!(flown.camera.near, first.camera.near);
        }
    }
    let dir = written("");
    fs::write(dir.path().join("path.xml"), flight("")).unwrap();
    let path = dir.path().join("path.xml");
    let flown = SceneLoadOptions { camera_path: Some(&path), ..SceneLoadOptions::default() };
    let alone = load_model(&dir.path().join("m.ply"), &flown).unwrap().scene;
    assert_eq!((alone.frames.first, alone.frames.last), (-3, 41));
    assert!(eye(&alone, 10.0).distance(DVec3::new(1.0, 2.5, 5.0)) < 1e-6);
    assert!(alone.files.keys().any(|file| *file == path));
}

#[test]
fn what_is_no_path_is_refused_with_its_line() {
    let key = |frame: &str, rest: &str| format!("<key frame=\"{frame}\" eye=\"{frame} 0 5\" {rest}/>");
    let two = |second: &str| format!("<camera at=\"0 0 0\">\n{}\n{second}\n</camera>", key("3", ""));
    for (camera, wanted) in [
        (two(&key("3", "")), "s.xml:4:6: `frame` is 3, expected more than that of the key before, 3"),
        (two(&key("x", "")), "s.xml:4:6: `frame` is `x`, expected a number from -1000000000"),
        (two("<key eye=\"1 2 3\"/>"), "s.xml:4:1: <key> needs the attribute `frame`"),
        (two("<key frame=\"9\"/>"), "s.xml:4:1: `eye` is missing, expected `eye` of this <key>, or of <camera>"),
        (two("<key frame=\"9\" eye=\"0 0 0\"/>"), "s.xml:4:1: the view from `eye` to `at` of <key> is 0 long"),
        (two("<key frame=\"9\" eye=\"0 5 0\"/>"), "s.xml:4:1: the view from `eye` to `at` of <key> is along `up`"),
        (two(&key("9", "fov=\"3\"")), "s.xml:4:28: <key> has no attribute `fov`, did you mean `fovy`?"),
        (
            "<camera eye=\"0 0 1\" atObject=\"bal\"/>".to_owned(),
            "s.xml:2:21: `atObject` is `bal`, expected the name of an object: `still`, `ball`",
        ),
        (
            "<camera eye=\"0 0 1\" at=\"0 0 0\" speed=\"constant\"/>".to_owned(),
            "s.xml:2:32: `speed` is without <key>, expected two <key> or more",
        ),
        (
            format!("<camera at=\"0 0 0\" easeIn=\"4\" easeOut=\"3\">{}{}</camera>", key("0", ""), key("6", "")),
            "s.xml:2:20: `easeIn` is 7 frames with `easeIn` and `easeOut`, expected together at most the 6 frames",
        ),
        (
            "<camera at=\"0 0 0\" speed=\"constant\"><key frame=\"0\" eye=\"1 0 5\"/>\n\
             <key frame=\"5\" eye=\"1 0 5\" at=\"1 1 1\"/></camera>"
                .to_owned(),
            "s.xml:3:16: `eye` is [1, 0, 5], expected another than that of the key before",
        ),
        (
            two(&(key("5", "") + "\n<track format=\"tum\">t.txt</track>")),
            "s.xml:5:1: <track> is beside <key>, expected one of the two",
        ),
    ] {
        let found = refusal(&camera);
        assert!(found.contains(wanted), "{camera}\n{found}\n{wanted}");
    }
    let dir = written("");
    let path = dir.path().join("path.xml");
    let flown = SceneLoadOptions { camera_path: Some(&path), ..SceneLoadOptions::default() };
    for (text, wanted) in [
        ("<scene/>", "path.xml:1:1: the root element `scene`, expected <camera>"),
        ("<camera><track format=\"tum\">t</track></camera>", "path.xml:1:9: <track> is in a camera path"),
        ("<camera eye=\"1 2\" at=\"0 0 0\"/>", "path.xml:1:9: `eye` is `1 2`, expected three numbers"),
    ] {
        fs::write(&path, text).unwrap();
        for model in [false, true] {
            let place = dir.path().join(if model { "m.ply" } else { "s.xml" });
            let loaded = if model { load_model(&place, &flown) } else { load(&place, &flown) };
            let found = loaded.map(|_| ()).unwrap_err().to_string();
            assert!(found.contains(wanted), "{found}\n{wanted}");
        }
    }
}
