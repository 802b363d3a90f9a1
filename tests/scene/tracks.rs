//! Camera tracks: poses at keys, between keys against the formulas, every format, and what is refused.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may stop and report")]

use std::fs;

use glam::{DMat3, DMat4, DQuat, DVec3};
use splatblur::scene::Scene;
use splatblur::scene::pose::camera_from_world;
use splatblur::scene_file::{SceneLoadOptions, load, to_xml};
use tempfile::TempDir;

const MODEL: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
     end_header\n0 0 0\n1 0 0\n0 1 0\n";

/// Poses that turn and move: camera to world, our axes.
fn truth() -> Vec<(DQuat, DVec3)> {
    (0..5)
        .map(|i| {
            let t = f64::from(i);
            let turn = DQuat::from_rotation_y(0.3 * t) * DQuat::from_rotation_x(-0.1 * t + 0.05 * t * t);
            (turn, DVec3::new(0.5 * t, 1.0 + (0.9 * t).sin(), 4.0 - 0.2 * t * t))
        })
        .collect()
}

/// The same pose in axes of `OpenCV`.
fn open_cv(turn: DQuat) -> DMat3 {
    DMat3::from_quat(turn) * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0))
}

fn numbers(values: impl IntoIterator<Item = f64>, between: &str) -> String {
    values.into_iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(between)
}

/// Rows of a matrix as JSON.
fn rows(m: DMat3, place: Option<DVec3>) -> String {
    let row = |i: usize| {
        let values = m.row(i).to_array().into_iter().chain(place.map(|p| p[i]));
        format!("[{}]", numbers(values, ","))
    };
    [0, 1, 2].map(row).join(",")
}

/// A file of the format's own, and files beside it. Poses are written in another order than that of their names.
fn written(format: &str) -> Vec<(&'static str, Vec<u8>)> {
    let poses = truth();
    let order = [3, 0, 4, 1, 2];
    match format {
        "nerfstudio" => {
            let frame = |&i: &usize| {
                let (turn, place) = poses[i];
                let m = rows(DMat3::from_quat(turn), Some(place));
                format!("{{\"file_path\":\"images/f_{}.png\",\"transform_matrix\":[{m},[0,0,0,1]]}}", 8 + i)
            };
            let frames = order.iter().map(frame).collect::<Vec<_>>().join(",");
            let lens = "\"fl_x\":300,\"fl_y\":300,\"cx\":150,\"cy\":130,\"w\":320,\"h\":240,\"k1\":0.0";
            vec![("t.json", format!("{{{lens},\"frames\":[{frames}]}}").into_bytes())]
        }
        "3dgs" => {
            let camera = |&i: &usize| {
                let (turn, place) = poses[i];
                format!(
                    "{{\"id\":{i},\"img_name\":\"f{}\",\"width\":320,\"height\":240,\"position\":[{}],\
                     \"rotation\":[{}],\"fx\":300.0,\"fy\":300.0}}",
                    8 + i,
                    numbers(place.to_array(), ","),
                    rows(open_cv(turn), None)
                )
            };
            vec![("t.json", format!("[{}]", order.iter().map(camera).collect::<Vec<_>>().join(",")).into_bytes())]
        }
        "tum" => {
            let line = |(i, &(turn, place)): (usize, &(DQuat, DVec3))| {
                let q = DQuat::from_mat3(&open_cv(turn));
                let time = 1.3e9 + i as f64 / 24.0;
                let rest = numbers([place.x, place.y, place.z, q.x, q.y, q.z, q.w], " ");
                format!("{time:.9} {rest}")
            };
            let lines: Vec<String> = poses.iter().enumerate().map(line).collect();
            vec![("t.txt", format!("# timestamp tx ty tz qx qy qz qw\n{}\n", lines.join("\n")).into_bytes())]
        }
        "colmap text" => {
            let image = |&i: &usize| {
                let (q, t) = to_colmap(poses[i]);
                let rest = numbers([q.w, q.x, q.y, q.z, t.x, t.y, t.z], " ");
                format!("{} {rest} 7 a name {}.png\n{}", i + 1, 8 + i, if i == 1 { "" } else { "10.5 11.5 -1" })
            };
            let images = order.iter().map(image).collect::<Vec<_>>().join("\n");
            vec![
                ("images.txt", format!("# comment\n{images}\n").into_bytes()),
                ("cameras.txt", b"# comment\n7 PINHOLE 320 240 300 300 150 130\n".to_vec()),
            ]
        }
        _ => {
            let mut images = 5_u64.to_le_bytes().to_vec();
            for &i in &order {
                let (q, t) = to_colmap(poses[i]);
                images.extend((i as i32 + 1).to_le_bytes());
                images.extend([q.w, q.x, q.y, q.z, t.x, t.y, t.z].map(f64::to_le_bytes).as_flattened());
                images.extend(7_i32.to_le_bytes());
                images.extend(format!("f{}.png\0", 8 + i).bytes());
                images.extend((i as u64).to_le_bytes());
                images.extend(vec![0; 24 * i]);
            }
            let mut cameras = 1_u64.to_le_bytes().to_vec();
            cameras.extend([7_i32, 1].map(i32::to_le_bytes).as_flattened());
            cameras.extend([320_u64, 240].map(u64::to_le_bytes).as_flattened());
            cameras.extend([300.0, 300.0, 150.0, 130.0].map(f64::to_le_bytes).as_flattened());
            vec![("images.bin", images), ("cameras.bin", cameras)]
        }
    }
}

/// World to camera.
fn to_colmap((turn, place): (DQuat, DVec3)) -> (DQuat, DVec3) {
    let q = DQuat::from_mat3(&open_cv(turn).transpose());
    (q, -(q * place))
}

const FORMATS: [&str; 5] = ["nerfstudio", "3dgs", "tum", "colmap text", "colmap binary"];

/// A scene whose camera has the track, with these attributes of it.
fn scene_file(format: &str, attributes: &str, image: &str) -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    let files = written(format);
    for (name, bytes) in &files {
        fs::write(dir.path().join(name), bytes).unwrap();
    }
    fs::write(dir.path().join("m.ply"), MODEL).unwrap();
    let (word, name) = (format.split(' ').next().unwrap(), files[0].0);
    let camera = format!("<camera><track format='{word}' {attributes}>{name}</track></camera>");
    let text = format!("<scene>{image}{camera}<object><pointModel>m.ply</pointModel></object></scene>");
    fs::write(dir.path().join("s.xml"), text).unwrap();
    dir
}

fn loaded(dir: &TempDir) -> Scene {
    load(&dir.path().join("s.xml"), &SceneLoadOptions::default()).unwrap_or_else(|e| panic!("{e:?}")).scene
}

fn error(dir: &TempDir) -> String {
    match load(&dir.path().join("s.xml"), &SceneLoadOptions::default()) {
        Ok(_) => "loaded".to_owned(),
        Err(e) => format!("{:#}", anyhow::Error::from(e)).replace(&format!("{}/", dir.path().display()), ""),
    }
}

fn pose(scene: &Scene, frame: f64) -> DMat4 {
    camera_from_world(scene, frame).inverse()
}

#[test]
fn poses_at_keys_are_those_of_the_file() {
    for format in FORMATS {
        for (attributes, start) in [("", 0.0), ("start='10.5'", 10.5)] {
            let scene = loaded(&scene_file(format, attributes, ""));
            for (i, &(turn, place)) in truth().iter().enumerate() {
                let m = pose(&scene, start + i as f64);
                let want = DMat4::from_rotation_translation(turn, place);
                let worst = (m - want).to_cols_array().into_iter().fold(0.0_f64, |a, b| a.max(b.abs()));
                // Times of TUM files are rounded to nine digits of a second.
                assert!(worst < if format == "tum" { 1e-5 } else { 1e-9 }, "{format} pose {i}: {worst:e}");
            }
            if start == 0.0 {
                assert_eq!([scene.frames.first, scene.frames.last], [0, 4], "{format}");
            }
            // Before the first and after the last pose the camera rests.
            let ends = [pose(&scene, start - 7.0), pose(&scene, start + 99.0)];
            assert!((ends[0].w_axis.truncate() - truth()[0].1).length() < 1e-9, "{format}");
            assert!((ends[1].w_axis.truncate() - truth()[4].1).length() < 1e-9, "{format}");
        }
    }
}

/// Between keys: slerp, and the Catmull-Rom spline of four poses, or straight lines.
#[test]
fn poses_between_keys_follow_the_formulas() {
    let poses = truth();
    let curve = |i: usize, t: f64| {
        let p = |k: i64| match k {
            -1 => poses[0].1 * 2.0 - poses[1].1,
            5 => poses[4].1 * 2.0 - poses[3].1,
            k => poses[k as usize].1,
        };
        let k = i as i64;
        let (a, b, c, d) = (p(k - 1), p(k), p(k + 1), p(k + 2));
        0.5 * (b * 2.0
            + (c - a) * t
            + (a * 2.0 - b * 5.0 + c * 4.0 - d) * t * t
            + (b * 3.0 - a - c * 3.0 + d) * t * t * t)
    };
    for format in ["nerfstudio", "colmap binary"] {
        for linear in [false, true] {
            let scene = loaded(&scene_file(format, if linear { "positions='linear'" } else { "" }, ""));
            for i in 0..4 {
                for t in [0.1, 0.5, 0.85] {
                    let m = pose(&scene, i as f64 + t);
                    let want = if linear { poses[i].1.lerp(poses[i + 1].1, t) } else { curve(i, t) };
                    assert!((m.w_axis.truncate() - want).length() < 1e-9, "{format} {i} {t}");
                    let (a, b) = (poses[i].0, poses[i + 1].0);
                    // The rotation from a to b turns at constant speed.
                    let between = b * a.inverse();
                    let (axis, angle) = between.to_axis_angle();
                    let want = DMat3::from_quat(DQuat::from_axis_angle(axis, angle * t) * a);
                    let got = DMat3::from_mat4(m);
                    let worst = (got - want).to_cols_array().into_iter().fold(0.0_f64, |a, b| a.max(b.abs()));
                    assert!(worst < 1e-9, "{format} {i} {t}: {worst:e}");
                }
            }
        }
    }
}

#[test]
fn the_lens_is_that_of_the_file() {
    for format in FORMATS {
        let scene = loaded(&scene_file(format, "", ""));
        if format == "tum" {
            assert_eq!((scene.image.width, scene.camera.shift.length()), (1024, 0.0));
            continue;
        }
        assert_eq!([scene.image.width, scene.image.height], [320, 240], "{format}");
        let fovy = 2.0 * (120.0_f64 / 300.0).atan();
        assert!((scene.camera.fovy - fovy).abs() < 1e-12, "{format}");
        let shift = scene.camera.shift;
        let want = if format == "3dgs" { [0.0; 2] } else { [-10.0 / 320.0, 10.0 / 240.0] };
        assert!((shift.x - want[0]).abs() < 1e-12 && (shift.y - want[1]).abs() < 1e-12, "{format}: {shift}");
        // What the scene says wins.
        let scene = loaded(&scene_file(format, "", "<image width='640' height='480'/>"));
        assert_eq!([scene.image.width, scene.image.height], [640, 480], "{format}");
        assert!((scene.camera.shift - shift).length() < 1e-12, "{format}");
    }
    let dir = scene_file("nerfstudio", "", "<image width='320' height='320'/>");
    let notes = load(&dir.path().join("s.xml"), &SceneLoadOptions::default()).unwrap().notes;
    let note = "camera: the track's images have 320 x 240 pixels, this one has 320 x 320: the height is kept";
    assert!(notes.iter().any(|found| found == note), "{notes:?}");
}

#[test]
fn tracks_survive_writing() {
    for format in FORMATS {
        let dir = scene_file(format, "start='3' positions='linear' distortion='ignore'", "");
        let scene = loaded(&dir);
        fs::write(dir.path().join("s.xml"), to_xml(&scene, dir.path())).unwrap();
        let again = loaded(&dir);
        assert_eq!(pose(&again, 4.3), pose(&scene, 4.3), "{format}");
        assert_eq!(again.camera.shift, scene.camera.shift, "{format}");
    }
}

/// Changes the file of a track, and says what is wrong with it then.
fn spoilt(format: &str, from: &str, to: &str) -> String {
    let dir = scene_file(format, "", "");
    for (name, bytes) in written(format) {
        let text = String::from_utf8_lossy(&bytes).replacen(from, to, 1);
        fs::write(dir.path().join(name), text).unwrap();
    }
    error(&dir)
}

#[test]
fn what_is_wrong_with_a_track_is_said() {
    for (format, from, to, want) in [
        (
            "nerfstudio",
            "\"k1\":0.0",
            "\"k1\":0.1",
            "a lens with distortion (k1 0.1), expected none, or `distortion=\"ignore\"`",
        ),
        ("nerfstudio", "\"fl_y\":300", "\"fl_y\":310", "a lens with distortion (fl_x 300 beside fl_y 310)"),
        ("nerfstudio", "\"w\":320", "\"w\":0", "an image of 0 x 240 pixels, expected whole numbers up to 65535"),
        ("nerfstudio", "\"w\":320", "\"w\":1e300", "pixels, expected whole numbers up to 65535"),
        ("nerfstudio", "\"fl_x\":300", "\"fl_x\":-1", "the focal lengths -1 and 300, expected pixels, above 0"),
        ("nerfstudio", "[0,0,0,1]]", "]", "expected"),
        ("nerfstudio", "\"transform_matrix\":[[", "\"transform_matrix\":[[9,0,0,0],[", "expected"),
        ("nerfstudio", "\"frames\":[", "\"frames\":[],\"x\":[", "found no pose, expected at least one"),
        ("nerfstudio", "{", "", "expected a transforms.json"),
        ("3dgs", "\"rotation\":[[", "\"rotation\":[[7,0,0],[", "expected a cameras.json"),
        ("3dgs", "\"position\":[", "\"position\":[1e31,", "expected a cameras.json"),
        ("tum", " ", "x ", "line 1: found `"),
        ("colmap text", "PINHOLE", "OPENCV", "line 2: found 8 words, expected at least 9"),
        (
            "colmap text",
            "PINHOLE 320 240 300 300 150 130",
            "SIMPLE_RADIAL 320 240 300 150 130 0.02",
            "distortion (k1 0.02)",
        ),
        (
            "colmap text",
            "PINHOLE 320 240 300 300 150 130",
            "FOV 320 240 300 300 150 130 0",
            "a lens with distortion (fisheye 1)",
        ),
        ("colmap text", "PINHOLE", "MAGIC", "the camera model `MAGIC`, expected one of SIMPLE_PINHOLE"),
        ("colmap text", "7 PINHOLE", "8 PINHOLE", "found camera 7, expected a camera of the file of cameras"),
    ] {
        // The first blank of a TUM file is in its comment.
        let e = if format == "tum" {
            spoilt(format, "timestamp tx", "timestamp tx ty\nx 1 2 3 4 5 6 7\n#")
        } else {
            spoilt(format, from, to)
        };
        let want = if format == "tum" { "line 2: found `x`, expected a finite number" } else { want };
        assert!(e.contains(want), "{format} {to}: {e}");
    }
    // Distortion may be ignored, and is said to be.
    let dir = scene_file("nerfstudio", "distortion='ignore'", "");
    let text = String::from_utf8(written("nerfstudio")[0].1.clone()).unwrap().replace("\"k1\":0.0", "\"k1\":0.1");
    fs::write(dir.path().join("t.json"), text).unwrap();
    let notes = load(&dir.path().join("s.xml"), &SceneLoadOptions::default()).unwrap().notes;
    assert!(notes.iter().any(|note| note.ends_with("distortion ignored: k1 0.1")), "{notes:?}");
    // No pose twice at one time, and no track beside an animation.
    let dir = scene_file("tum", "", "");
    fs::write(dir.path().join("t.txt"), "5 0 0 0 0 0 0 1\n5 0 0 1 0 0 0 1\n").unwrap();
    assert!(error(&dir).contains("line 2: found the time 5, expected more than 5"), "{}", error(&dir));
    fs::write(dir.path().join("t.txt"), "5 0 0 0 0 0 0 0\n").unwrap();
    assert!(error(&dir).contains("line 1: found a quaternion of length 0, expected a rotation"), "{}", error(&dir));
    let text = fs::read_to_string(dir.path().join("s.xml")).unwrap();
    fs::write(dir.path().join("s.xml"), text.replace("<camera>", "<camera><animation>a.anim</animation>")).unwrap();
    assert!(error(&dir).contains("<track> is beside <animation>, expected one of the two"), "{}", error(&dir));
    // The cameras of COLMAP lie beside the images.
    let dir = scene_file("colmap binary", "", "");
    fs::remove_file(dir.path().join("cameras.bin")).unwrap();
    assert!(error(&dir).contains("cannot read animation cameras.bin"), "{}", error(&dir));
}

/// Every cut and many changed bytes of every file: read or refused at once, and never a panic.
#[test]
fn cut_and_changed_tracks_are_read_or_refused() {
    for format in FORMATS {
        for (name, bytes) in written(format) {
            let step = (bytes.len() / 60).max(1);
            let spoilt = |at: usize| {
                let changed = [0, 0x7f, 0xff].map(|value| {
                    let mut changed = bytes.clone();
                    changed[at] = value;
                    changed
                });
                std::iter::once(bytes[..at].to_vec()).chain(changed)
            };
            let with = |bytes: Vec<u8>| {
                let dir = scene_file(format, "", "");
                fs::write(dir.path().join(name), bytes).unwrap();
                dir
            };
            // All are written before one is read: a file is opened when it has been at rest for a while.
            let dirs: Vec<TempDir> = (0..bytes.len()).step_by(step).flat_map(spoilt).map(with).collect();
            for dir in &dirs {
                let _ = error(dir);
            }
        }
        assert_eq!(error(&scene_file(format, "", "")), "loaded");
    }
}
