//! A camera path that a page collects: flown, filmed and saved for `--camera-path`.

use std::process::{Command, Stdio};

use serde_json::{Value, json};
use splatblur::Picture;

use crate::support::Visit;

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
    let camera = json!({ "eye": [0.0, 0.0, 8.0], "at": [0.0, 0.0, 0.0], "up": [0.0, 1.0, 0.0], "fovy": 40.0 });
    let own = visit.shown(json!({ "path": path, "camera": camera })).1;
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
