//! A person at the viewer, in headless Chromium.

use std::fs;

use serde_json::json;

use crate::devtools::{Browser, browser_or_skip};
use crate::support::{Program, SCENE, scene};

const RESTS: &str = "viewer.rests === viewer.serial && viewer.serial > 0";

impl Browser {
    /// Waits until what is asked for is there.
    fn rests(&mut self) {
        // One picture of the screen, in which a change is sent.
        self.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))");
        self.wait(RESTS);
    }

    /// Waits until the page shows a message with this word.
    fn alarmed(&mut self, word: &str) {
        let alert = "document.getElementById('alert')";
        self.wait(&format!("!{alert}.hidden && {alert}.textContent.includes('{word}')"));
    }

    /// A sum over the picture on the canvas: another one where the picture is another.
    fn picture(&mut self) -> u64 {
        let sum = self.number(
            "(() => { const c = viewer.view.canvas; let s = 0; \
             const d = viewer.view.context.getImageData(0, 0, c.width, c.height).data; \
             for (let i = 0; i < d.length; i += 1) s = (s * 31 + d[i]) % 4294967291; return s; })()",
        );
        sum as u64
    }
}

#[allow(clippy::too_many_lines, reason = "a session in its order")]
#[test]
#[ignore = "deep: a browser"]
fn a_session() {
    let Some(mut browser) = browser_or_skip("a_session") else { return };
    let dir = tempfile::tempdir().unwrap();
    let path = scene(dir.path());
    let (out, token) = (dir.path().join("saved"), dir.path().join("token"));
    let more = ["--out", out.to_str().unwrap(), "--token-file", token.to_str().unwrap()];
    let program = Program::start(&path, &more);
    browser.size(1280, 720, 1.0);
    browser.open(&program.link);
    browser.rests();
    assert_eq!(browser.text("document.title"), "flight - splatblur view");
    assert_eq!(browser.text("viewer.last.mode"), "auto:0.025");
    let at_rest = browser.picture();

    // Orbit, and back.
    let at = |x: f64| [400.0 + x, 300.0];
    browser.mouse("mousePressed", at(0.0));
    for step in 1..=10 {
        browser.mouse("mouseMoved", at(10.0 * f64::from(step)));
    }
    browser.mouse("mouseReleased", at(100.0));
    browser.rests();
    let turned = browser.text("viewer.last.line");
    assert!(!turned.contains("eye=\"0 0 8\"") && turned.contains("at=\"0 0 0\""), "{turned}");
    assert_eq!(browser.text("document.getElementById('line').value"), turned);
    assert_ne!(browser.picture(), at_rest);
    browser.key("0");
    browser.rests();
    assert_eq!(browser.picture(), at_rest);

    // The keys of the camera.
    for key in ["ArrowLeft", "+"] {
        browser.key(key);
        browser.rests();
        assert_ne!(browser.picture(), at_rest, "{key}");
        browser.key("0");
        browser.rests();
    }

    // Lights are turned by drags and arrows, the camera stays; and back.
    let line = browser.text("viewer.last.line");
    browser.key("l");
    browser.key("ArrowLeft");
    browser.rests();
    let lit = browser.picture();
    browser.mouse("mousePressed", at(0.0));
    browser.mouse("mouseMoved", at(40.0));
    browser.mouse("mouseReleased", at(40.0));
    browser.rests();
    assert!(lit != at_rest && ![at_rest, lit].contains(&browser.picture()));
    assert_eq!(browser.text("viewer.last.line"), line);
    browser.key("l");
    browser.key("L");
    browser.rests();
    assert_eq!(browser.picture(), at_rest);

    // Ten frames, one after the other, then played.
    for frame in 1..=10 {
        browser.key(".");
        browser.rests();
        assert_eq!(browser.number("viewer.state.frame"), f64::from(frame));
    }
    let before = browser.number("viewer.log.length");
    browser.key(" ");
    browser.wait(&format!("new Set(viewer.log.slice({before}).map((entry) => entry.frame)).size >= 10"));
    browser.key(" ");
    browser.key("Home");
    browser.rests();
    assert_eq!(browser.picture(), at_rest);

    // Modes and buffers, with the words of the command line.
    for mode in ["still:4", "supersample:4+interleave=2", "bucket:2x2", "volumetric:2+published", "auto:draft"] {
        browser.write("mode", mode);
        browser.rests();
        let shown = browser.text("document.getElementById('first').textContent");
        assert!(shown.starts_with(mode.split('+').next().unwrap().split("draft").next().unwrap()), "{shown}");
    }
    for buffer in ["alpha", "depth", "normal", "velocity", "samples", "error", "colour"] {
        browser.key("b");
        browser.rests();
        assert_eq!(browser.text("viewer.last.buffer"), buffer);
    }
    browser.write("mode", "supersmaple:4");
    browser.alarmed("supersmaple");
    browser.write("mode", "supersample:8");
    browser.rests();
    assert_eq!(browser.value("document.getElementById('alert').hidden"), true);

    // A rolling shutter, and a mode that has none.
    let at_once = browser.picture();
    browser.write("readout", "1.5");
    browser.rests();
    let down = browser.picture();
    browser.key("n");
    browser.rests();
    assert_eq!(browser.text("viewer.state.shutter.readout"), "1.5,up,middle");
    assert!(down != at_once && browser.picture() != down);
    browser.write("mode", "volumetric:2");
    browser.alarmed("--readout 0");
    browser.key("o");
    browser.write("mode", "supersample:8");
    browser.rests();
    assert_eq!(browser.value("document.getElementById('alert').hidden"), true);
    assert_eq!(browser.picture(), at_once);

    // The reference under the slider.
    browser.key("s");
    browser.wait("viewer.compared && viewer.compared.samples >= 64");
    browser.key("[");
    assert!(browser.text("document.getElementById('compared').textContent").contains("FLIP 0."));
    assert!(browser.text("document.getElementById('second').textContent").starts_with("reference:"));
    browser.key("s");
    browser.rests();

    // Files.
    for (key, name) in [("p", "flight.0000.view-1.png"), ("e", "flight.0000.view-1.exr"), ("x", "flight.view-1.xml")] {
        browser.key(key);
        browser.wait(&format!("document.getElementById('saved').textContent.endsWith('{name}')"));
        assert!(out.join(name).is_file(), "{name}");
    }

    // Help, by the keyboard.
    browser.key("?");
    browser.wait("document.getElementById('help').open");
    assert!(browser.text("document.getElementById('grammar').textContent").contains("NAME[:COUNTS]"));
    browser.value("document.getElementById('help').close()");

    // An edit, a mistake, and its end.
    let before = browser.picture();
    fs::write(&path, SCENE.replace("fovy=\"40\"", "fovy=\"60\"")).unwrap();
    browser.wait("viewer.last.line.includes('fovy=\"60\"')");
    browser.rests();
    assert_ne!(browser.picture(), before);
    fs::write(&path, SCENE.replace("fovy", "fovvy")).unwrap();
    browser.alarmed("fovvy");
    fs::write(&path, SCENE).unwrap();
    browser.wait("document.getElementById('alert').hidden && viewer.last.line.includes('fovy=\"40\"')");
    browser.rests();
    assert_eq!(browser.picture(), before);

    // The program goes and comes again: the page goes on where it was.
    let port = program.parts().0.split(':').nth(1).unwrap().to_owned();
    browser.key(".");
    browser.rests();
    let before = browser.picture();
    drop(program);
    browser.wait("document.getElementById('state').textContent.startsWith('not connected')");
    let count = browser.number("viewer.log.length");
    let _again = Program::start(&path, &[&more[..], &["--port", &port]].concat());
    browser.wait(&format!("viewer.log.length > {count}"));
    browser.rests();
    assert_eq!((browser.number("viewer.state.frame"), browser.picture()), (1.0, before));
    assert_eq!(browser.complaints, [""; 0]);
}

#[test]
#[ignore = "deep: a browser"]
fn a_movie_is_saved_and_stopped() {
    let Some(mut browser) = browser_or_skip("a_movie_is_saved_and_stopped") else { return };
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("saved");
    let program = Program::start(&scene(dir.path()), &["--out", out.to_str().unwrap()]);
    browser.size(800, 600, 1.0);
    browser.open(&program.link);
    browser.write("mode", "supersample:2");
    browser.write("size", "scene");
    browser.rests();
    browser.value("document.getElementById('movie-format').value = 'y4m'");
    browser.key("V");
    let (saved, button) = ("document.getElementById('saved')", "document.getElementById('save-movie')");
    browser.key("v");
    browser.wait(&format!("{saved}.textContent.endsWith('flight.view-1.gif')"));
    assert!(out.join("flight.view-1.gif").is_file());
    assert_eq!(browser.text(&format!("{button}.textContent")), "movie");
    // Again, and stopped.
    browser.key("v");
    browser.wait(&format!("{button}.textContent === 'stop' && {saved}.textContent.includes('of 13 frames')"));
    browser.key("v");
    browser.wait(&format!("{button}.textContent === 'movie'"));
    assert_eq!(browser.text(&format!("{saved}.textContent")), "there is no movie");
    assert_eq!(browser.complaints, [""; 0]);
}

/// Everything that a mouse can do has a key, and the help names it.
#[test]
#[ignore = "deep: a browser"]
fn every_control_has_a_key() {
    let Some(mut browser) = browser_or_skip("every_control_has_a_key") else { return };
    let dir = tempfile::tempdir().unwrap();
    let program = Program::start(&scene(dir.path()), &[]);
    browser.size(1280, 720, 1.0);
    browser.open(&program.link);
    browser.rests();
    let mut reached = Vec::new();
    let fields =
        ["m mode", "S split", "i frame", "r rate", "t open", "T close", "w weight", "d readout", "h apart", "H ease"];
    for (key, id) in fields.map(|field| field.split_once(' ').unwrap()) {
        browser.key(key);
        assert_eq!(browser.text("document.activeElement.id"), id, "{key}");
        browser.key("Escape");
        assert_eq!(browser.text("document.activeElement.tagName"), "BODY", "{key}");
        reached.push(id);
    }
    let lists = [
        "V movie-format",
        "k backend",
        "f prefilter",
        "g shading",
        "z size",
        "n direction",
        "a anchor",
        "b buffer",
        "q speed",
    ];
    for (key, id) in lists.map(|list| list.split_once(' ').unwrap()) {
        let choices = browser.number(&format!("document.getElementById('{id}').options.length")) as usize;
        let mut seen = std::collections::BTreeSet::new();
        for _ in 0..choices {
            browser.key(key);
            browser.rests();
            seen.insert(browser.text(&format!("document.getElementById('{id}').value")));
            assert_eq!(browser.value("document.getElementById('alert').hidden"), true, "{id}");
        }
        assert_eq!(seen.len(), choices, "{id}: {seen:?}");
        reached.push(id);
    }
    // Those that `a_session` presses, or that say their own key.
    reached.extend(["shutter-reset", "copy", "reset", "save-png", "save-exr", "save-scene", "save-movie", "help-open"]);
    reached.extend(["lights-drag", "lights-reset", "to-first", "back", "play", "forward", "to-last", "time"]);
    reached.extend(["key-add", "key-drop", "path-play", "save-path"]);
    reached.sort_unstable();
    let controls = browser.text(
        "[...document.querySelectorAll('header button, aside :is(input, select, button), footer :is(input, button)')]\
         .map((control) => control.id).sort().join(' ')",
    );
    assert_eq!(controls, reached.join(" "));
    let unnamed = browser.text(
        "(() => { const names = [...document.querySelectorAll('#keys dt')].flatMap((name) => \
         name.textContent.split(/, (?!and)| and | /)); \
         return Object.keys(viewer.keys).filter((key) => !names.includes(key === ' ' ? 'Space' : key)).join(' '); })()",
    );
    // It is the key of `+` without Shift.
    assert_eq!(unnamed, "=");
    browser.key("c");
    browser.wait("document.getElementById('state').textContent.includes('camera')");
    assert_eq!(browser.complaints, [""; 0]);
}

/// The page fits its window, on screens with any number of pixels to a point. `VIEW_SCREENSHOTS` keeps what it looks
/// like.
#[test]
#[ignore = "deep: a browser"]
fn the_page_fits_its_window() {
    let Some(mut browser) = browser_or_skip("the_page_fits_its_window") else { return };
    let scene = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/three_objects.xml");
    let program = Program::start(&scene, &[]);
    browser.size(1280, 720, 1.0);
    browser.open(&program.link);
    browser.write("mode", "supersample:8");
    browser.write("frame", "20");
    for (width, height, ratio) in [(1280, 720, 1.0), (800, 600, 1.0), (800, 600, 2.0)] {
        for scheme in ["light", "dark"] {
            browser.size(width, height, ratio);
            browser.scheme(scheme);
            browser.rests();
            let overflow = browser.number("document.documentElement.scrollWidth - innerWidth");
            assert!(overflow <= 0.0, "{width} x {height}: {overflow} pixels too wide");
            let lowest = browser.number("document.querySelector('footer').getBoundingClientRect().bottom");
            assert!(lowest <= f64::from(height), "{width} x {height}: the footer ends at {lowest}");
            // The picture has the pixels of the screen, in the shape of the scene.
            let shown = browser.number("viewer.last.width / viewer.view.canvas.getBoundingClientRect().width");
            assert!((shown - ratio).abs() < 0.01, "{shown} pixels a point, of {ratio}");
            let shape = browser.number("viewer.last.width / viewer.last.height");
            assert!((shape - 960.0 / 540.0).abs() < 0.01, "{shape}");
            if ratio == 1.0 {
                browser.screenshot(&format!("{scheme}-{width}"));
            }
        }
    }
    browser.size(1280, 720, 1.0);
    browser.write("split", "reference");
    // Through the middle of the objects.
    browser.key("[");
    browser.key("[");
    browser.wait("viewer.compared && viewer.compared.samples >= 16");
    browser.screenshot("split");
    browser.key("?");
    browser.wait("document.getElementById('help').open");
    browser.screenshot("help");
    assert_eq!(browser.value("innerWidth"), json!(1280));
    assert_eq!(browser.complaints, [""; 0]);
}
