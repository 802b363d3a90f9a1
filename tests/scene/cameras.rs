//! Cameras in scene files: motion by formula, and cameras within a cloud whose normals were estimated.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may stop and report")]

use std::fmt::Write as _;
use std::fs;

use glam::{DMat4, DVec3};
use splatblur::scene::pose::camera_from_world;
use splatblur::scene_file::{LoadedScene, SceneLoadOptions, load, to_xml};

/// A scene of one model, `m.xyz` with these points.
fn loaded(points: &str, camera: &str, object: &str) -> LoadedScene {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("m.xyz"), points).unwrap();
    let text = format!("<scene>{camera}<object {object}><pointModel>m.xyz</pointModel></object></scene>");
    fs::write(dir.path().join("s.xml"), text).unwrap();
    let loaded = load(&dir.path().join("s.xml"), &SceneLoadOptions::default()).unwrap();
    // What is written is the same scene.
    fs::write(dir.path().join("again.xml"), to_xml(&loaded.scene, dir.path())).unwrap();
    let again = load(&dir.path().join("again.xml"), &SceneLoadOptions::default()).unwrap().scene;
    assert_eq!(to_xml(&again, dir.path()), to_xml(&loaded.scene, dir.path()));
    for time in [-0.25, 0.0, 7.5] {
        assert_eq!(camera_from_world(&again, time), camera_from_world(&loaded.scene, time));
    }
    loaded
}

#[test]
fn a_camera_moves_by_formula() {
    let at = |motion: &str, time: f64, p: DVec3| {
        let camera = format!("<camera eye='0 0 5' at='0 0 0'>{motion}</camera>");
        let scene = loaded("0 0 0\n", &camera, "").scene;
        assert_eq!((scene.frames.first, scene.frames.last), (0, 24));
        camera_from_world(&scene, time).transform_point3(p)
    };
    // After two frames the eye is at (1, 0, 5).
    let linear = "<motion type='linear' velocity='0.5 0 0'/>";
    assert_eq!(at(linear, 2.0, DVec3::new(1.0, 0.0, 0.0)), DVec3::new(0.0, 0.0, -5.0));
    // A quarter turn about the y axis through the origin brings the eye to (5, 0, 0), looking along -x.
    let turn = "<motion type='rotation' axis='0 1 0' degreesPerFrame='45'/>";
    let p = at(turn, 2.0, DVec3::new(3.0, 1.0, 0.0));
    assert!((p - DVec3::new(0.0, 1.0, -2.0)).length() < 1e-12, "{p}");
    // In document order: the turn carries the eye from (1, 0, 5) to (5, 0, -1).
    let p = at(&format!("{linear}{turn}"), 2.0, DVec3::new(5.0, 0.0, -1.0));
    assert!(p.length() < 1e-12, "{p}");
}

#[test]
fn a_moving_camera_is_an_object_that_moves_the_other_way() {
    let still = "<camera eye='0 0 5' at='0 0 0'/>";
    let camera = "<camera eye='0 0 5' at='0 0 0'><motion type='linear' velocity='0.5 -1 2'/></camera>";
    let view = |camera: &str, time: f64| camera_from_world(&loaded("0 0 0\n", camera, "").scene, time);
    for time in [-1.0, 0.0, 0.25, 3.0] {
        let moved = view(still, time) * DMat4::from_translation(-time * DVec3::new(0.5, -1.0, 2.0));
        assert!((view(camera, time) - moved).abs_diff_eq(DMat4::ZERO, 1e-12), "{time}");
    }
}

/// The walls of a room from -2 to 2, a point every 0.2.
fn room() -> String {
    let mut text = String::new();
    for axis in 0..3 {
        for side in [-2.0, 2.0] {
            for i in 0..400 {
                let mut p = [side; 3];
                p[(axis + 1) % 3] = f64::from(i % 20) * 0.2 - 1.9;
                p[(axis + 2) % 3] = f64::from(i / 20) * 0.2 - 1.9;
                writeln!(text, "{} {} {}", p[0], p[1], p[2]).unwrap();
            }
        }
    }
    text
}

#[test]
fn a_camera_within_a_closed_cloud_sees_both_sides() {
    let shown = |camera: &str, object: &str| {
        let LoadedScene { scene, notes, .. } = loaded(&room(), camera, object);
        (
            scene.objects[0].shape.surface().unwrap().two_sided,
            notes.iter().any(|note| note.contains("the camera stands within its box")),
        )
    };
    let inside = "<camera eye='0 0 1' at='0 0 0'/>";
    let outside = "<camera eye='0 0 8' at='0 0 0'/>";
    assert_eq!(shown(inside, ""), (true, true));
    assert_eq!(shown(outside, ""), (false, false));
    // What the scene says counts.
    assert_eq!(shown(inside, "twoSided='false'"), (false, false));
    assert_eq!(shown(outside, "twoSided='true'"), (true, false));
    // It comes in at frame 7.
    let entering = "<camera eye='0 0 8' at='0 0 0'><motion type='linear' velocity='0 0 -1'/></camera>";
    assert_eq!(shown(entering, ""), (true, true));
    assert_eq!(shown(&format!("<frames last='4'/>{entering}"), ""), (false, false));
}
