//! Files that a page saves, and files of the scene that change.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::json;

use crate::support::{Program, SCENE, Visit, scene};

/// Runs the program with the words of a line, then paths.
fn run(line: &str, paths: &[&Path]) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_splatblur"));
    let status = program.args(line.split(' ')).args(paths).stdin(Stdio::null()).stdout(Stdio::null()).status().unwrap();
    assert!(status.success(), "{line}");
}

#[test]
fn saved_pictures_have_the_bytes_of_render() {
    let mut visit = Visit::new();
    let shutter = json!({ "open": -0.25, "close": 0.5, "weight": "tent" });
    let rolling = json!({ "open": -0.25, "close": 0.25, "weight": null, "readout": "1.5,up,first" });
    let views = [
        (json!({}), "--mode supersample:4 --size 96x72"),
        (json!({ "mode": "auto:good", "width": 120, "height": 90 }), "--size 120x90"),
        (
            json!({ "mode": "bucket:3x2", "shading": "gouraud", "prefilter": "approx", "shutter": shutter }),
            "--mode bucket:3x2 --size 96x72 --shading gouraud --prefilter approx --shutter -0.25,0.5 --weight tent",
        ),
        (json!({ "mode": "volumetric:3+published" }), "--mode volumetric:3+published --size 96x72"),
        (
            json!({ "shutter": rolling }),
            "--mode supersample:4 --size 96x72 --shutter -0.25,0.25 --readout 1.5,up,first",
        ),
    ];
    for (number, (view, line)) in (1..).zip(views) {
        visit.shown(view);
        for format in ["png", "exr"] {
            let saved = visit.save(format);
            assert_eq!(saved, visit.out.join(format!("flight.0001.view-{number}.{format}")));
            let rendered = visit.dir.path().join("rendered");
            run(
                &format!("render --quiet --backend cpu --frames 1 --format {format} {line} --out"),
                &[&rendered, &visit.scene],
            );
            let rendered = fs::read(rendered.join(format!("flight.0001.{format}"))).unwrap();
            assert!(fs::read(saved).unwrap() == rendered, "{format} of {line}");
        }
    }
    // A layer is for EXR.
    visit.shown(json!({ "buffer": "depth" }));
    visit.page.say(&json!({ "type": "save", "what": "png" }));
    assert!(visit.page.text("refused")["message"].as_str().unwrap().contains("save layers as EXR"));
    let saved = visit.save("exr");
    let rendered = visit.dir.path().join("depth");
    run(
        "render --quiet --backend cpu --frames 1 --format exr --aov depth --mode supersample:4 --out",
        &[&rendered, &visit.scene],
    );
    assert!(fs::read(saved).unwrap() == fs::read(rendered.join("flight.0001.exr")).unwrap());
}

#[test]
fn a_saved_scene_shows_what_was_seen_and_leaves_the_original() {
    let mut visit = Visit::new();
    let camera = json!({ "eye": [3.0, 2.0, 6.5], "at": [0.25, 0.0, 0.0], "up": [0.0, 1.0, 0.0], "fovy": 35.0 });
    let shutter = json!({ "open": 0.0, "close": 1.0, "weight": "ramp", "readout": "0.5,left,first" });
    let lights = json!({ "turn": [0.0, 0.6, 0.0, 0.8] });
    visit.shown(json!({ "camera": camera, "shutter": shutter, "lights": lights }));
    let saved = ["png", "scene", "scene"].map(|what| visit.save(what));
    assert_ne!(saved[1], saved[2]);
    assert_eq!(fs::read_to_string(&visit.scene).unwrap(), SCENE);
    let text = fs::read_to_string(&saved[1]).unwrap();
    assert!(text.contains(r#"<camera eye="3 2 6.5" at="0.25 0 0" up="0 1 0" fovy="35""#), "{text}");
    let shutter = r#"<shutter open="0" close="1" readout="0.5" direction="left" anchor="first" weight="ramp""#;
    assert!(text.contains(shutter), "{text}");
    assert!(text.contains("<light") && !text.contains(r#"direction="-0.577350"#), "{text}");
    // Its picture has the pixels that were saved; its settings name another scene.
    let rendered = visit.dir.path().join("rendered");
    run("render --quiet --backend cpu --frames 1 --mode supersample:4 --out", &[&rendered, &saved[1]]);
    let [a, b] =
        [saved[0].clone(), rendered.join("flight.view-1.0001.png")].map(|path| splatblur::Picture::read(path).unwrap());
    assert!(a == b);
}

/// Four programs save into one folder at the same time: each path is told once, and has its own file.
#[test]
fn viewers_that_share_a_folder_replace_nothing() {
    const SAVES: usize = 8;
    let dir = tempfile::tempdir().unwrap();
    let (path, out) = (scene(dir.path()), dir.path().join("saved"));
    fs::create_dir(&out).unwrap();
    // A link that leads nowhere has its name.
    #[cfg(unix)]
    std::os::unix::fs::symlink(dir.path().join("nowhere.png"), out.join("flight.0001.view-1.png")).unwrap();
    let programs: Vec<Program> = (0..4).map(|_| Program::start(&path, &["--out", out.to_str().unwrap()])).collect();
    let told = std::thread::scope(|scope| {
        let pages: Vec<_> = programs
            .iter()
            .map(|program| {
                let mut page = program.page();
                page.text("scene");
                let serial = page.see(json!({}));
                page.finished(serial);
                page
            })
            .collect();
        // All are there before the first saves.
        let savers: Vec<_> = pages
            .into_iter()
            .map(|mut page| {
                scope.spawn(move || {
                    for _ in 0..SAVES {
                        page.say(&json!({ "type": "save", "what": "png" }));
                    }
                    (0..SAVES).map(|_| PathBuf::from(page.text("saved")["path"].as_str().unwrap())).collect::<Vec<_>>()
                })
            })
            .collect();
        savers.into_iter().flat_map(|saver| saver.join().unwrap()).collect::<Vec<_>>()
    });
    let paths: std::collections::BTreeSet<&PathBuf> = told.iter().collect();
    assert_eq!((told.len(), paths.len()), (4 * SAVES, 4 * SAVES));
    let first = fs::read(&told[0]).unwrap();
    assert!(told.iter().all(|path| fs::read(path).unwrap() == first));
    let link = usize::from(cfg!(unix));
    assert_eq!(fs::read_dir(&out).unwrap().count(), 4 * SAVES + link);
    assert!(!dir.path().join("nowhere.png").exists());
}

#[test]
fn a_changed_scene_is_read_again_and_a_broken_one_is_told() {
    let mut visit = Visit::new();
    let (_, before) = visit.shown(json!({}));
    // An edit.
    fs::write(&visit.scene, SCENE.replace("fovy=\"40\"", "fovy=\"60\"")).unwrap();
    visit.page.text("scene");
    let (header, after) = visit.shown(json!({}));
    assert!(header["line"].as_str().unwrap().contains("fovy=\"60\"") && after != before);
    // A mistake: told with its place, and the old picture stays.
    fs::write(&visit.scene, SCENE.replace("fovy", "fovvy")).unwrap();
    let message = visit.page.text("broken")["message"].as_str().unwrap().to_owned();
    assert!(message.contains("flight.xml") && message.contains("fovvy"), "{message}");
    visit.shown(json!({ "frame": 2 }));
    // Mended.
    fs::write(&visit.scene, SCENE).unwrap();
    visit.page.text("scene");
    assert!(visit.shown(json!({})).0["line"].as_str().unwrap().contains("fovy=\"40\""));
    // A model changes.
    let ball = visit.dir.path().join("ball.xyz");
    let points = fs::read_to_string(&ball).unwrap();
    fs::write(&ball, points.lines().take(400).map(|line| line.to_owned() + "\n").collect::<String>()).unwrap();
    visit.page.text("scene");
    assert!(visit.shown(json!({})).1 != before);
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

/// A square with a texture that its material names, which the model names.
fn textured(dir: &Path) -> PathBuf {
    paint(dir, [255, 0, 0]);
    fs::write(dir.join("square.mtl"), "newmtl paint\nmap_Kd paint.png\n").unwrap();
    let square = "mtllib square.mtl\nusemtl paint\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n\
                  vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
    fs::write(dir.join("square.obj"), square).unwrap();
    let path = dir.join("square.xml");
    fs::write(&path, SCENE.replace("ball.xyz", "square.obj")).unwrap();
    path
}

fn paint(dir: &Path, colour: [u8; 3]) {
    image::RgbImage::from_pixel(4, 4, image::Rgb(colour)).save(dir.join("paint.png")).unwrap();
}

#[test]
fn files_that_a_model_names_are_looked_at_too() {
    let mut visit = Visit::to(textured);
    let (_, red) = visit.shown(json!({}));
    paint(visit.dir.path(), [0, 0, 255]);
    visit.page.text("scene");
    let (_, blue) = visit.shown(json!({}));
    assert!(blue != red);
    // An editor puts the old file aside first. Without its texture the square is white.
    let (texture, aside) = (visit.dir.path().join("paint.png"), visit.dir.path().join("aside.png"));
    fs::rename(&texture, &aside).unwrap();
    visit.page.text("scene");
    let (_, white) = visit.shown(json!({}));
    assert!(white != blue);
    fs::rename(&aside, &texture).unwrap();
    visit.page.text("scene");
    assert!(visit.shown(json!({})).1 == blue);
    // The material.
    fs::write(visit.dir.path().join("square.mtl"), "newmtl paint\nKd 0 1 0\n").unwrap();
    visit.page.text("scene");
    assert!(visit.shown(json!({})).1 != blue);
}
