//! A camera path that a page collects: flown, filmed and saved for `--camera-path`.

use std::process::{Command, Stdio};

use serde_json::{Value, json};
use splatblur::Picture;

use crate::devtools::browser_or_skip;
use crate::support::{Program, Visit, scene};

fn key(frame: i32, eye: [f64; 3], fovy: f64) -> Value {
    json!({ "frame": frame, "camera": { "eye": eye, "at": [0.5, 0.0, 0.0], "up": [0.0, 1.0, 0.0], "fovy": fovy } })
}

/// What a page shows of its path is what `render` makes of the file that it saves.
#[test]
fn a_saved_path_is_the_one_that_was_seen() {
    let mut visit = Visit::new();
    let keys = [key(-2, [-3.0, 1.0, 8.0], 40.0), key(6, [0.0, 2.0, 7.0], 30.0), key(10, [4.0, 1.0, 6.0], 45.0)];
    let path = json!({ "keys": keys, "constant": true, "ease": 2.0 });
    let plain = visit.shown(json!({})).1;
    let (header, seen) = visit.shown(json!({ "path": path, "frame": 5 }));
    assert!(seen != plain);
    assert!(header["camera"]["fovy"].as_f64().is_some_and(|fovy| fovy > 28.0 && fovy < 40.0), "{header}");
    // A camera of the page's own goes before.
    let own = visit.shown(json!({ "path": path, "camera": key(0, [0.0, 0.0, 8.0], 40.0)["camera"] })).1;
    assert!(own == plain);
    visit.shown(json!({ "path": path, "frame": 5 }));
    let saved = visit.save("path");
    assert_eq!(saved, visit.out.join("flight.path.view-1.xml"));
    let (png, out) = (visit.save("png"), visit.dir.path().join("rendered"));
    let line = "render --quiet --backend cpu --mode supersample:4 --frames 5 --format png --camera-path";
    let mut program = Command::new(env!("CARGO_BIN_EXE_splatblur"));
    program.args(line.split(' ')).arg(&saved).arg("--out").arg(&out).arg(&visit.scene);
    assert!(program.stdin(Stdio::null()).status().unwrap().success());
    let [seen, rendered] = [png, out.join("flight.0005.png")].map(|path| Picture::read(path).unwrap().rgba);
    assert!(seen == rendered, "the pictures differ");
    // The scene that is saved has the keys, too.
    let text = std::fs::read_to_string(visit.save("scene")).unwrap();
    assert_eq!(text.matches("<key ").count(), 3, "{text}");
    assert!(text.contains("<frames first=\"-2\" last=\"10\""), "{text}");
}

#[test]
fn what_is_no_path_is_refused() {
    let mut visit = Visit::new();
    let eye = [0.0, 0.0, 8.0];
    for (keys, constant, ease, wanted) in [
        (json!([]), false, 0.0, "has 0 keys"),
        (json!([key(3, eye, 40.0), key(3, eye, 40.0)]), false, 0.0, "key 2 of the path: frame is 3, must be more than"),
        (json!([key(3, eye, 40.0), key(4, eye, 40.0)]), true, 0.0, "key 2 of the path: eye is"),
        (json!([key(3, [0.5, 0.0, 0.0], 40.0)]), false, 0.0, "looks at its own eye"),
        (json!([key(3, eye, 40.0)]), false, -1.0, "ease is -1"),
    ] {
        visit.page.see(json!({ "path": { "keys": keys, "constant": constant, "ease": ease } }));
        let told = visit.page.text("refused")["message"].as_str().unwrap().to_owned();
        assert!(told.contains(wanted), "{told}");
    }
    visit.shown(json!({}));
    visit.page.say(&json!({ "type": "save", "what": "path" }));
    assert!(visit.page.text("refused")["message"].as_str().unwrap().contains("no keys yet"));
}

/// Three views of a person become keys, are flown through, and saved.
#[test]
#[ignore = "deep: a browser"]
fn views_become_a_path() {
    let Some(mut browser) = browser_or_skip("views_become_a_path") else { return };
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("saved");
    let program = Program::start(&scene(dir.path()), &["--out", out.to_str().unwrap()]);
    browser.size(1280, 720, 1.0);
    browser.open(&program.link);
    browser.write("mode", "supersample:2");
    browser.write("apart", "10");
    browser.rests();
    let keys = |browser: &mut crate::devtools::Browser| {
        browser.text("document.getElementById('path-keys').textContent").trim().to_owned()
    };
    assert_eq!(keys(&mut browser), "no keys");
    for step in 0..3 {
        if step > 0 {
            browser.value(
                "for (let i = 0; i < 8; i++) dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowRight' }))",
            );
        }
        browser.rests();
        browser.key("j");
        browser.rests();
    }
    assert_eq!(keys(&mut browser), "3 keys, frames 0 to 20");
    browser.key("j");
    browser.key("J");
    assert_eq!(keys(&mut browser), "3 keys, frames 0 to 20");
    browser.write("speed", "constant");
    browser.write("ease", "5");
    // It flies: frames pass, and the eye with them.
    browser.key("y");
    browser.wait("viewer.state.camera === null && viewer.state.frame > 5 && viewer.last.camera.eye[0] !== 0");
    browser.key("y");
    browser.rests();
    assert_eq!(browser.number("Number(document.getElementById('time').max)"), 20.0);
    browser.key("Y");
    browser.wait("document.getElementById('saved').textContent.endsWith('flight.path.view-1.xml')");
    let text = std::fs::read_to_string(out.join("flight.path.view-1.xml")).unwrap();
    assert_eq!(text.matches("<key ").count(), 3, "{text}");
    assert!(text.contains("speed=\"constant\" easeIn=\"5\" easeOut=\"5\""), "{text}");
    assert_eq!(browser.complaints, [""; 0]);
}
