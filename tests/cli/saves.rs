//! Files that are saved in place while they are read: what comes out is that of one whole file, or nothing.
//!
//! `SPLATBLUR_SAVES=200` is the long run; `-- --nocapture` prints its figures.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests may stop; figures of the long run")]

use std::collections::BTreeMap;
use std::path::Path;

use splatblur::Picture;

use crate::saved::{Case, Saver, cases, program, saves, scene_of};

/// What a command makes of the folder: its exit status, and all that it printed and wrote.
fn made(dir: &Path, line: &str) -> (i32, Vec<u8>) {
    let out = dir.join("out");
    let _ = std::fs::remove_dir_all(&out);
    std::fs::create_dir(&out).unwrap();
    let output = program().current_dir(dir).args(line.split(' ')).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    let code = output.status.code().unwrap_or_else(|| panic!("{line}: {}", output.status));
    if code != 0 {
        assert!(code == 2 && said.starts_with("error: ") && said.matches('\n').count() == 1, "{line}: {code}: {said}");
        return (code, Vec::new());
    }
    let mut all = output.stdout;
    add(&out, &mut all);
    (code, all)
}

/// All files below a folder, in the order of their names.
fn add(folder: &Path, all: &mut Vec<u8>) {
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    for path in paths {
        all.extend(path.file_name().unwrap().as_encoded_bytes());
        if path.is_dir() {
            add(&path, all);
        } else {
            all.extend(std::fs::read(path).unwrap());
        }
    }
}

fn lines(model: &str) -> [String; 4] {
    [
        format!("info {model} --json"),
        format!("convert {model} out/m.ply --quiet"),
        "render scene.xml --out out --backend cpu --mode still --format png --quiet".to_owned(),
        "dataset scene.xml --out out --backend cpu --mode supersample:1 --sharp 1 --no-flow --quiet".to_owned(),
    ]
}

/// How often each command gave version A, version B, or a refusal.
type Figures = BTreeMap<String, [usize; 3]>;

/// Tries the lines while the model is saved, in both manners.
fn try_case(case: &Case, lines: &[String], figures: &mut Figures) {
    let dirs = [(); 2].map(|()| tempfile::tempdir().unwrap());
    for (version, dir) in dirs.iter().enumerate() {
        case.put(version, dir.path());
        std::fs::write(dir.path().join("scene.xml"), scene_of(&case.name)).unwrap();
    }
    let wanted: Vec<_> = lines.iter().map(|line| [0, 1].map(|version| made(dirs[version].path(), line))).collect();
    // A grid has no surfels to be converted, and what two versions have in common tells nothing.
    let tells = |wanted: &[(i32, Vec<u8>); 2]| wanted.iter().all(|(code, _)| *code == 0) && wanted[0] != wanted[1];
    let told: Vec<_> = lines.iter().zip(&wanted).filter(|(_, wanted)| tells(wanted)).collect();
    assert!(!told.is_empty(), "{}: no command tells the versions apart", case.name);
    for truncating in [false, true] {
        // The folder holds the first version.
        case.put(0, dirs[0].path());
        let saver = Saver::start(dirs[0].path(), case, truncating, saves(2), usize::MAX);
        for round in 0.. {
            let (line, wanted) = told[round % told.len()];
            let found = made(dirs[0].path(), line);
            let what = if found.0 == 0 { wanted.iter().position(|w| *w == found) } else { Some(2) };
            let what = what.unwrap_or_else(|| panic!("{line}: neither version, {} bytes", found.1.len()));
            figures.entry(format!("{} {}", case.name, line.split(' ').next().unwrap())).or_default()[what] += 1;
            if round + 1 >= told.len() && saver.is_done() {
                break;
            }
        }
    }
}

// Not deep: it waits for saves, and takes little of the processor.
#[test]
fn what_is_read_is_one_whole_file() {
    let work = tempfile::tempdir().unwrap();
    let mut figures = Figures::new();
    let is_long = saves(2) > 2;
    for (number, case) in cases(work.path()).iter().enumerate() {
        let all = lines(&case.name);
        // The short run tries two commands a format, in turn.
        let lines = if is_long { &all[..] } else { &all[number % 2 * 2..][..2] };
        try_case(case, lines, &mut figures);
    }
    for (what, [a, b, refused]) in &figures {
        println!("{what}: {a} of A, {b} of B, {refused} refused");
    }
    let [a, b] = [0, 1].map(|version| figures.values().map(|counts| counts[version]).sum::<usize>());
    assert!(a > 0 && b > 0, "{a} of A and {b} of B: the files were never saved or never read");
}

/// Files of a sequence are read ahead on another thread.
#[test]
fn each_file_of_a_sequence_is_read_whole() {
    const SCENE: &str = r#"<scene><image width="32" height="24"/><frames first="1" last="3"/>
<camera eye="1 2 5" at="0 0 0"/><object><pointModel sequence="m.%d.ply" first="1" last="3"/></object></scene>"#;
    const LINE: &str = "render scene.xml --out out --backend cpu --mode still --shutter 0,0.001 --quiet";
    let work = tempfile::tempdir().unwrap();
    let ply = cases(work.path()).swap_remove(0);
    let files = |version: usize| -> Vec<(String, Vec<u8>)> {
        (1..=3).map(|number| (format!("m.{number}.ply"), ply.versions[version][0].1.clone())).collect()
    };
    let sequence = Case { name: String::new(), versions: [files(0), files(1)] };
    let pictures = |dir: &Path| [1, 2, 3].map(|n| Picture::read(dir.join(format!("out/scene.000{n}.png"))).unwrap());
    // A picture shows one file or two.
    let mut wanted: [Vec<Picture>; 3] = Default::default();
    for mix in 0..8 {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("scene.xml"), SCENE).unwrap();
        for (number, name) in ["m.1.ply", "m.2.ply", "m.3.ply"].iter().enumerate() {
            std::fs::write(dir.path().join(name), &ply.versions[mix >> number & 1][0].1).unwrap();
        }
        if made(dir.path(), LINE).0 == 0 {
            for (wanted, picture) in wanted.iter_mut().zip(pictures(dir.path())) {
                wanted.push(picture);
            }
        }
    }
    assert!(wanted[0].len() >= 2, "the two versions alone can be shown");
    let mut figures = [0; 2];
    for truncating in [false, true] {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("scene.xml"), SCENE).unwrap();
        sequence.put(0, dir.path());
        let saver = Saver::start(dir.path(), &sequence, truncating, saves(3), usize::MAX);
        loop {
            let (code, _) = made(dir.path(), LINE);
            figures[usize::from(code != 0)] += 1;
            if code == 0 {
                for (n, picture) in pictures(dir.path()).iter().enumerate() {
                    assert!(wanted[n].contains(picture), "frame {}: no picture of whole files", n + 1);
                }
            }
            if saver.is_done() {
                break;
            }
        }
    }
    println!("sequence: {} rendered, {} refused", figures[0], figures[1]);
}
