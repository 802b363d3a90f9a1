//! Measurements of docs/measurements/viewer.md. They take long and judge nothing; run them by name with `--release`:
//! `cargo test --release --test view measure -- --ignored --nocapture --test-threads 1`.

#![allow(clippy::print_stdout, reason = "it is what they are for")]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::json;

use crate::devtools::browser_or_skip;
use crate::support::Program;

/// The scene that is measured: `VIEW_SCENE`, else `three_objects`.
fn scene() -> PathBuf {
    let standard = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/three_objects.xml");
    std::env::var_os("VIEW_SCENE").map_or(standard, PathBuf::from)
}

/// Median and worst, milliseconds.
fn spread(mut times: Vec<f64>) -> String {
    times.sort_by(f64::total_cmp);
    let [median, most] = [times[times.len() / 2], times[times.len() - 1]].map(|t| 1e3 * t);
    format!("median {median:.0} ms, worst {most:.0} ms of {}", times.len())
}

/// From the start of the program to the first picture, in a page that connects at once.
#[test]
#[ignore = "a measurement"]
fn measure_first_picture() {
    let times = (0..5).map(|_| {
        let program = Program::start(&scene(), &[]);
        let mut page = program.page();
        page.see(json!({ "width": 1280, "height": 720, "frame": 20, "mode": "auto:good" }));
        page.picture();
        let time = program.begin.elapsed().as_secs_f64();
        println!("first picture after {:.0} ms, {:.0} ms of processor", 1e3 * time, 1e3 * program.cpu());
        time
    });
    println!("first picture: {}", spread(times.collect()));
}

/// A drag of 10 s, 60 moves a second, over a picture of 1280 x 720 in the browser: each move to the first picture that
/// shows it or a later one.
#[test]
#[ignore = "a measurement"]
fn measure_drag() {
    let Some(mut browser) = browser_or_skip("measure_drag") else { return };
    let program = Program::start(&scene(), &[]);
    browser.size(1700, 900, 1.0);
    browser.open(&program.link);
    // The shape of the stage does not matter: the canvas has 1280 x 720 pixels.
    browser.value("viewer.view.fit = () => [1280, 720]");
    browser.write("frame", "20");
    browser.wait("viewer.rests === viewer.serial && viewer.last.width === 1280");
    let center = browser.value(
        "(() => { const b = viewer.view.canvas.getBoundingClientRect(); \
         return [b.x + b.width / 2, b.y + b.height / 2]; })()",
    );
    let center = [0, 1].map(|i| center[i].as_f64().unwrap());
    // The time at which the page hears of each move, and the serial of the view that shows it.
    browser.value(
        "(() => { viewer.moves = []; viewer.view.canvas.addEventListener('pointermove', (event) => \
         viewer.moves.push([event.timeStamp, viewer.serial + 1])); viewer.log.length = 0; })()",
    );
    let cpu = program.cpu();
    browser.mouse("mousePressed", center);
    let begin = Instant::now();
    for step in 0..600 {
        let angle = f64::from(step) * 0.05;
        browser.mouse("mouseMoved", [center[0] + 200.0 * angle.sin(), center[1] + 60.0 * (1.7 * angle).sin()]);
        let next = begin + Duration::from_secs_f64(f64::from(step + 1) / 60.0);
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    let seconds = begin.elapsed().as_secs_f64();
    let cpu = program.cpu() - cpu;
    let pictures = browser.number("viewer.log.length");
    let last = browser.text("JSON.stringify([viewer.last.width, viewer.last.mode, viewer.log.at(-1).bytes])");
    let levels = browser.text(
        "(() => { const c = {}; viewer.log.forEach((e) => { const k = `${e.width} ${e.mode}`; \
         c[k] = (c[k] ?? 0) + 1; }); \
         return JSON.stringify(c); })()",
    );
    browser.mouse("mouseReleased", center);
    browser.wait("viewer.rests === viewer.serial");
    let times = browser.value(
        "viewer.moves.map(([moved, serial]) => \
         (viewer.log.find((entry) => entry.serial >= serial)?.shown - moved) / 1000).filter((t) => t > 0)",
    );
    let times: Vec<f64> = times.as_array().unwrap().iter().map(|t| t.as_f64().unwrap()).collect();
    println!("move to picture: {}; {:.1} pictures/s, last {last}", spread(times), pictures / seconds);
    println!("processor: {:.1} ms a picture; {levels}", 1e3 * cpu / pictures);
}

/// Memory of the program over `VIEW_SECONDS` (600) of play.
#[test]
#[ignore = "a measurement"]
fn measure_memory() {
    let seconds = std::env::var("VIEW_SECONDS").ok().and_then(|text| text.parse().ok()).unwrap_or(600.0);
    let program = Program::start(&scene(), &[]);
    let mut page = program.page();
    page.text("scene");
    let (begin, mut next, mut pictures) = (Instant::now(), 0.0, 0);
    while begin.elapsed().as_secs_f64() < seconds {
        let frame = 5 + pictures % 41;
        page.see(json!({ "width": 1280, "height": 720, "frame": frame, "moving": true, "mode": "auto:good" }));
        page.picture();
        pictures += 1;
        if begin.elapsed().as_secs_f64() >= next {
            println!("{next:4.0} s: {:.1} MB, {pictures} pictures", program.memory() as f64 / 1e6);
            next += seconds / 10.0;
        }
    }
    println!("{seconds:4.0} s: {:.1} MB, {pictures} pictures", program.memory() as f64 / 1e6);
}
