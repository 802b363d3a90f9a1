//! What a page gets: pictures in their order, files, and the scene as it changes.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::json;

use crate::support::{PATIENCE, Program, SCENE, scene};

/// Runs the program with the words of a line, then a path.
fn run(line: &str, paths: &[&Path]) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_splatblur"));
    let status = program.args(line.split(' ')).args(paths).stdin(Stdio::null()).stdout(Stdio::null()).status().unwrap();
    assert!(status.success(), "{line}");
}

#[test]
fn a_view_that_rests_is_refined_to_what_was_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let program = Program::start(&scene(dir.path()), &[]);
    let mut page = program.page();
    let about = page.text("scene");
    assert_eq!((&about["name"], &about["first"], &about["last"]), (&json!("flight"), &json!(0), &json!(12)));
    let serial = page.see(json!({ "mode": "auto:good" }));
    let (quick, png) = page.picture();
    assert_eq!((&quick["finished"], &quick["side"]), (&json!(false), &json!("both")));
    assert!(png.starts_with(b"\x89PNG"));
    let (refined, _) = page.finished(serial);
    assert_eq!(
        (&refined["mode"], &refined["width"], &refined["height"]),
        (&json!("auto:0.025"), &json!(96), &json!(72))
    );
    assert!((0.0..0.1).contains(&refined["error"].as_f64().unwrap()), "{refined}");
    assert_eq!(page.text("rests")["serial"], serial);
    // The line of the camera is that of the scene, and the curve has mean 1.
    assert_eq!(refined["line"], r#"<camera eye="0 0 8" at="0 0 0" up="0 1 0" fovy="40" near="0.01"/>"#);
    let curve: Vec<f64> = refined["curve"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    assert!((curve.iter().sum::<f64>() / curve.len() as f64 - 1.0).abs() < 1e-9);
}

#[test]
fn what_moves_is_not_refined() {
    let dir = tempfile::tempdir().unwrap();
    let program = Program::start(&scene(dir.path()), &[]);
    let mut page = program.page();
    page.text("scene");
    let moving = page.see(json!({ "moving": true, "mode": "supersample:16" }));
    let (header, _) = page.picture();
    assert_eq!((&header["serial"], &header["finished"]), (&json!(moving), &json!(false)));
    let rests = page.see(json!({ "mode": "supersample:16" }));
    // The quick picture is there already.
    let (header, _) = page.picture();
    assert_eq!((&header["serial"], &header["finished"]), (&json!(rests), &json!(true)));
}

#[test]
fn a_newer_view_stops_the_refinement_of_an_older_one() {
    let dir = tempfile::tempdir().unwrap();
    let program = Program::start(&scene(dir.path()), &[]);
    let mut page = program.page();
    page.text("scene");
    for split in [json!(null), json!("reference")] {
        // Half a minute's work on any machine.
        let mode = if split.is_null() { "supersample:8192" } else { "still:1" };
        page.see(json!({ "mode": mode, "split": split, "width": 640, "height": 480 }));
        page.picture();
        std::thread::sleep(Duration::from_millis(300));
        let begin = Instant::now();
        let serial = page.see(json!({ "frame": 3, "mode": "still:1" }));
        page.finished(serial);
        // Measured: 0.05 s.
        assert!(begin.elapsed() < Duration::from_secs(5), "{mode}: {:?}", begin.elapsed());
    }
}

#[test]
fn saved_pictures_have_the_bytes_of_render() {
    let dir = tempfile::tempdir().unwrap();
    let path = scene(dir.path());
    let out = dir.path().join("saved");
    let program = Program::start(&path, &["--out", out.to_str().unwrap()]);
    let mut page = program.page();
    page.text("scene");
    let shutter = json!({ "open": -0.25, "close": 0.5, "weight": "tent" });
    let views = [
        (json!({}), "--mode supersample:4 --size 96x72"),
        (json!({ "mode": "auto:good", "width": 120, "height": 90 }), "--size 120x90"),
        (
            json!({ "mode": "bucket:3x2", "shading": "gouraud", "prefilter": "approx", "shutter": shutter }),
            "--mode bucket:3x2 --size 96x72 --shading gouraud --prefilter approx --shutter -0.25,0.5 --weight tent",
        ),
        (json!({ "mode": "volumetric:3+published" }), "--mode volumetric:3+published --size 96x72"),
    ];
    for (number, (view, line)) in (1..).zip(views) {
        let serial = page.see(view);
        page.finished(serial);
        for format in ["png", "exr"] {
            page.say(&json!({ "type": "save", "what": format }));
            let saved = page.text("saved")["path"].as_str().unwrap().to_owned();
            assert_eq!(Path::new(&saved), out.join(format!("flight.0001.view-{number}.{format}")));
            let rendered = dir.path().join("rendered");
            run(
                &format!("render --quiet --backend cpu --frames 1 --format {format} {line} --out"),
                &[&rendered, &path],
            );
            let rendered = fs::read(rendered.join(format!("flight.0001.{format}"))).unwrap();
            assert!(fs::read(saved).unwrap() == rendered, "{format} of {line}");
        }
    }
    // A layer is for EXR.
    let serial = page.see(json!({ "buffer": "depth" }));
    page.finished(serial);
    page.say(&json!({ "type": "save", "what": "png" }));
    assert!(page.text("refused")["message"].as_str().unwrap().contains("EXR"));
    page.say(&json!({ "type": "save", "what": "exr" }));
    let saved = page.text("saved")["path"].as_str().unwrap().to_owned();
    let rendered = dir.path().join("depth");
    run(
        "render --quiet --backend cpu --frames 1 --format exr --aov depth --mode supersample:4 --out",
        &[&rendered, &path],
    );
    assert!(fs::read(saved).unwrap() == fs::read(rendered.join("flight.0001.exr")).unwrap());
}

#[test]
fn a_saved_scene_shows_what_was_seen_and_leaves_the_original() {
    let dir = tempfile::tempdir().unwrap();
    let path = scene(dir.path());
    let out = dir.path().join("saved");
    let program = Program::start(&path, &["--out", out.to_str().unwrap()]);
    let mut page = program.page();
    page.text("scene");
    let camera = json!({ "eye": [3.0, 2.0, 6.5], "at": [0.25, 0.0, 0.0], "up": [0.0, 1.0, 0.0], "fovy": 35.0 });
    let shutter = json!({ "open": 0.0, "close": 1.0, "weight": "ramp" });
    let serial = page.see(json!({ "camera": camera, "shutter": shutter }));
    page.finished(serial);
    let mut saved = Vec::new();
    for what in ["png", "scene", "scene"] {
        page.say(&json!({ "type": "save", "what": what }));
        saved.push(page.text("saved")["path"].as_str().unwrap().to_owned());
    }
    assert_ne!(saved[1], saved[2]);
    assert_eq!(fs::read_to_string(&path).unwrap(), SCENE);
    let text = fs::read_to_string(&saved[1]).unwrap();
    assert!(text.contains(r#"<camera eye="3 2 6.5" at="0.25 0 0" up="0 1 0" fovy="35""#), "{text}");
    assert!(text.contains(r#"<shutter open="0" close="1" weight="ramp""#), "{text}");
    // Its picture has the pixels that were saved; its settings name another scene.
    let rendered = dir.path().join("rendered");
    run("render --quiet --backend cpu --frames 1 --mode supersample:4 --out", &[&rendered, Path::new(&saved[1])]);
    let [a, b] = [Path::new(&saved[0]).to_owned(), rendered.join("flight.view-1.0001.png")]
        .map(|path| splatblur::Picture::read(path).unwrap());
    assert!(a == b);
}

#[test]
fn every_mode_and_every_buffer_is_shown() {
    let dir = tempfile::tempdir().unwrap();
    let program = Program::start(&scene(dir.path()), &[]);
    let mut page = program.page();
    page.text("scene");
    for mode in ["auto:draft", "still:4", "supersample:4+interleave=2", "bucket:2x2", "volumetric:2"] {
        for buffer in ["colour", "alpha", "depth", "normal", "velocity", "samples", "error"] {
            let serial = page.see(json!({ "mode": mode, "buffer": buffer }));
            let (header, png) = page.finished(serial);
            assert_eq!(header["buffer"], buffer);
            assert!(png.len() > 100);
            let has_note = header["note"].as_str().is_some_and(|note| note.contains("mode auto"));
            assert_eq!(has_note, buffer == "error" && mode != "auto:draft", "{mode} {header}");
        }
    }
}

#[test]
fn both_sides_of_the_slider_are_compared() {
    let dir = tempfile::tempdir().unwrap();
    let program = Program::start(&scene(dir.path()), &[]);
    let mut page = program.page();
    page.text("scene");
    let serial = page.see(json!({ "mode": "still:16", "split": "supersample:16" }));
    assert_eq!(page.finished(serial).0["side"], "first");
    assert_eq!(page.finished(serial).0["side"], "second");
    let still = page.text("compared");
    assert!(still["flip"].as_f64().unwrap() > 0.005 && still["samples"].is_null(), "{still}");
    // The reference gets nearer with its samples: 16, 32, ... 1024. Rounds that are quickly over may go uncompared.
    let serial = page.see(json!({ "mode": "supersample:64", "split": "reference" }));
    let mut rounds: Vec<(u64, f64)> = Vec::new();
    while rounds.last().is_none_or(|(samples, _)| *samples < 1024) {
        let round = page.text("compared");
        rounds.push((round["samples"].as_u64().unwrap(), round["flip"].as_f64().unwrap()));
    }
    assert!(rounds.is_sorted_by(|a, b| a.0 < b.0) && rounds[0].0 < 1024, "{rounds:?}");
    assert!(rounds[rounds.len() - 1].1 < 0.2 * still["flip"].as_f64().unwrap(), "{rounds:?}, {still}");
    assert_eq!(page.text("rests")["serial"], serial);
}

#[test]
fn a_changed_scene_is_read_again_and_a_broken_one_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let path = scene(dir.path());
    let program = Program::start(&path, &[]);
    let mut page = program.page();
    page.text("scene");
    let serial = page.see(json!({}));
    let (_, before) = page.finished(serial);
    // An edit.
    fs::write(&path, SCENE.replace("fovy=\"40\"", "fovy=\"60\"")).unwrap();
    page.text("scene");
    let (header, after) = page.finished(serial);
    assert!(header["line"].as_str().unwrap().contains("fovy=\"60\"") && after != before);
    // A mistake: told with its place, and the old picture stays.
    fs::write(&path, SCENE.replace("fovy", "fovvy")).unwrap();
    let message = page.text("broken")["message"].as_str().unwrap().to_owned();
    assert!(message.contains("flight.xml") && message.contains("fovvy"), "{message}");
    let serial = page.see(json!({ "frame": 2 }));
    page.finished(serial);
    // Mended.
    fs::write(&path, SCENE).unwrap();
    page.text("scene");
    assert!(page.finished(serial).0["line"].as_str().unwrap().contains("fovy=\"40\""));
    // A model changes.
    let ball = dir.path().join("ball.xyz");
    let points = fs::read_to_string(&ball).unwrap();
    fs::write(&ball, points.lines().take(400).map(|line| line.to_owned() + "\n").collect::<String>()).unwrap();
    page.text("scene");
    page.finished(serial);
}

#[test]
fn a_scene_that_is_broken_from_the_start_comes_when_it_is_mended() {
    let dir = tempfile::tempdir().unwrap();
    let path = scene(dir.path());
    let ball = dir.path().join("ball.xyz");
    let model = fs::read(&ball).unwrap();
    fs::remove_file(&ball).unwrap();
    let program = Program::start(&path, &[]);
    let mut page = program.page();
    assert!(page.text("broken")["message"].as_str().unwrap().contains("ball.xyz"));
    page.see(json!({}));
    // The scene file stays the same: only the model was missing.
    fs::write(&ball, model).unwrap();
    page.text("scene");
    let serial = page.see(json!({}));
    page.finished(serial);
}

#[test]
fn two_pages_do_not_disturb_each_other() {
    let dir = tempfile::tempdir().unwrap();
    let program = Program::start(&scene(dir.path()), &[]);
    let (mut a, mut b) = (program.page(), program.page());
    a.text("scene");
    b.text("scene");
    let of_a = a.see(json!({ "mode": "still:4", "width": 64, "height": 48 }));
    let of_b = b.see(json!({ "mode": "bucket:2x2", "frame": 5, "buffer": "normal" }));
    let (a, b) = (a.finished(of_a).0, b.finished(of_b).0);
    assert_eq!((&a["mode"], &a["width"], &a["buffer"]), (&json!("still:4"), &json!(64), &json!("colour")));
    assert_eq!((&b["mode"], &b["width"], &b["buffer"]), (&json!("bucket:2x2"), &json!(96), &json!("normal")));
}

#[test]
fn a_token_file_keeps_the_link() {
    let dir = tempfile::tempdir().unwrap();
    let path = scene(dir.path());
    let file = dir.path().join("token");
    let with = ["--token-file", file.to_str().unwrap()];
    let tokens = [0, 1].map(|_| Program::start(&path, &with).parts().1);
    assert_eq!(tokens[0], tokens[1]);
    assert_ne!(Program::start(&path, &[]).parts().1, Program::start(&path, &[]).parts().1);
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_it() {
    let dir = tempfile::tempdir().unwrap();
    let mut program = Program::start(&scene(dir.path()), &[]);
    let mut page = program.page();
    page.text("scene");
    page.see(json!({ "mode": "supersample:65536", "width": 640, "height": 480 }));
    page.picture();
    let begin = Instant::now();
    let killed = Command::new("sh").args(["-c", &format!("kill -INT {}", program.child.id())]).status().unwrap();
    assert!(killed.success());
    let status = program.child.wait().unwrap();
    assert_eq!(status.code(), Some(130));
    assert!(begin.elapsed() < PATIENCE);
}
