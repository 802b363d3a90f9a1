//! Models that are saved in place under the eyes of a viewer: it shows whole ones, and goes on.
//!
//! `SPLATBLUR_SAVES=200` is the long run, `SPLATBLUR_SAVED=sfl,glb` looks at these formats alone.

#![allow(clippy::print_stdout, reason = "figures of the long run")]

use std::path::Path;

use serde_json::json;

use crate::saved::{Case, Saver, cases, saves, scene_of};
use crate::support::{Heard, PATIENCE, Page, Program};

/// Pictures of one version, by the views that are asked for in turn: a view that is shown already is not sent again.
type Pictures = [Vec<u8>; 2];

/// Asks for the other view.
fn ask(page: &mut Page, round: usize) -> u64 {
    page.see(json!({ "width": 96 + round % 2 }))
}

/// Waits until the page shows the last version.
fn shows(page: &mut Page, wanted: &Pictures) {
    let begin = std::time::Instant::now();
    // In a view of its own first: a picture of the last round is no answer.
    let serial = page.see(json!({ "width": 98 }));
    page.finished(serial);
    for round in 0.. {
        let serial = ask(page, round);
        if page.finished(serial).1 == wanted[round % 2] {
            return;
        }
        assert!(begin.elapsed() < PATIENCE, "the last version never comes");
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
}

/// The pictures of a version that stands still.
fn still(case: &Case, version: usize) -> Pictures {
    let dir = tempfile::tempdir().unwrap();
    case.put(version, dir.path());
    let program = start(dir.path(), case);
    let mut page = program.page();
    page.text("scene");
    [0, 1].map(|round| {
        let serial = ask(&mut page, round);
        page.finished(serial).1
    })
}

fn start(dir: &Path, case: &Case) -> Program {
    let scene = dir.join("scene.xml");
    std::fs::write(&scene, scene_of(&case.name)).unwrap();
    Program::start(&scene, &[])
}

// Not deep: it waits for saves, and takes little of the processor.
#[test]
fn a_viewer_shows_whole_files_and_goes_on() {
    let work = tempfile::tempdir().unwrap();
    let count = saves(6);
    let all = cases(work.path());
    // The short run looks at three formats: of columns, of text, and of two files.
    let short = |case: &&Case| count > 6 || ["m.bin", "m.xyz", "m.gltf"].contains(&case.name.as_str());
    let formats = std::env::var("SPLATBLUR_SAVED").ok();
    let asked = |case: &&Case| match &formats {
        Some(formats) => formats.split(',').any(|format| case.name == format!("m.{format}")),
        None => short(case),
    };
    let asked: Vec<&Case> = all.iter().filter(asked).collect();
    assert!(!asked.is_empty(), "SPLATBLUR_SAVED names no format");
    // All versions first: a case that cannot show what it is for ends the run at once.
    let pictures: Vec<[Pictures; 2]> = asked.iter().map(|case| [0, 1].map(|version| still(case, version))).collect();
    for (case, [a, b]) in asked.iter().zip(&pictures) {
        assert!(a != b, "{}: both versions look the same", case.name);
    }
    for (case, wanted) in asked.iter().zip(&pictures) {
        for truncating in [false, true] {
            let dir = tempfile::tempdir().unwrap();
            case.put(0, dir.path());
            let mut program = start(dir.path(), case);
            let mut page = program.page();
            page.text("scene");
            let (mut shown, mut broken) = ([0; 2], 0);
            let saver = Saver::start(dir.path(), case, truncating, count, 3);
            for round in 0.. {
                if saver.is_done() {
                    break;
                }
                let serial = ask(&mut page, round);
                let png = loop {
                    match page.hear() {
                        Heard::Picture(header, png) if header["serial"] == serial && header["finished"] == true => {
                            break png;
                        }
                        Heard::Text(text) if text["type"] == "broken" => broken += 1,
                        Heard::End(why) => panic!("{}: the connection ended: {why}", case.name),
                        _ => {}
                    }
                };
                let which = wanted.iter().position(|wanted| wanted[round % 2] == png);
                shown[which.unwrap_or_else(|| panic!("{}: a picture of neither version", case.name))] += 1;
                std::thread::sleep(std::time::Duration::from_millis(30));
            }
            drop(saver);
            shows(&mut page, &wanted[count % 2]);
            assert!(program.child.try_wait().unwrap().is_none(), "{}: the viewer ended", case.name);
            let manner = if truncating { "truncating" } else { "over" };
            println!("{} {manner}: {} of A, {} of B, told {broken} times", case.name, shown[0], shown[1]);
        }
    }
}
