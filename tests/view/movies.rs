//! Movies that a page saves.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use image::AnimationDecoder as _;
use serde_json::{Value, json};

use crate::support::{Heard, Page, SCENE, Visit, scene};

impl Page {
    /// Asks for a movie, or for the end of the one under way.
    fn film(&mut self, format: Option<&str>) {
        self.say(&json!({ "type": "movie", "format": format }));
    }

    /// The messages until the movie is no longer under way.
    fn filmed(&mut self) -> Vec<Value> {
        let mut told = Vec::new();
        loop {
            match self.hear() {
                Heard::Text(text) if text["type"] == "filmed" => return told,
                Heard::Text(text) => told.push(text),
                Heard::Picture(..) => {}
                Heard::End(why) => panic!("the connection ended: {why}"),
            }
        }
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// A movie has the frames of `render` with the same settings; no file is replaced.
#[test]
fn a_movie_has_the_frames_of_render() {
    let mut visit = Visit::new();
    visit.shown(json!({}));
    visit.page.film(Some("y4m"));
    let told = visit.page.filmed();
    let progress: Vec<u64> =
        told.iter().filter(|text| text["type"] == "filming").map(|text| text["done"].as_u64().unwrap()).collect();
    assert_eq!(progress, (0..13).collect::<Vec<_>>());
    let path = visit.out.join("flight.view-1.y4m");
    assert_eq!(told.last().unwrap(), &json!({ "type": "saved", "path": path.to_str().unwrap() }));
    let rendered = visit.dir.path().join("rendered.y4m");
    let line = "render --quiet --backend cpu --mode supersample:4 --no-frames --movie";
    let mut program = Command::new(env!("CARGO_BIN_EXE_splatblur"));
    program.args(line.split(' ')).args([&rendered, &visit.scene]).stdin(Stdio::null());
    assert!(program.status().unwrap().success());
    assert!(fs::read(path).unwrap() == fs::read(rendered).unwrap());
    // Another view meanwhile changes nothing of the movie, and comes first.
    visit.page.film(Some("gif"));
    visit.page.text("filming");
    let serial = visit.page.see(json!({ "frame": 5, "width": 48, "height": 36 }));
    visit.page.finished(serial);
    let told = visit.page.filmed();
    assert_eq!(told.last().unwrap()["type"], "saved");
    let file = std::io::BufReader::new(fs::File::open(visit.out.join("flight.view-1.gif")).unwrap());
    let frames = image::codecs::gif::GifDecoder::new(file).unwrap().into_frames().collect_frames().unwrap();
    assert_eq!((frames.len(), frames[0].buffer().dimensions()), (13, (96, 72)));
    visit.page.film(Some("gif"));
    visit.page.filmed();
    assert_eq!(names(&visit.out), ["flight.view-1.gif", "flight.view-1.y4m", "flight.view-2.gif"]);
}

/// Many frames.
fn long(dir: &Path) -> std::path::PathBuf {
    let path = scene(dir);
    fs::write(&path, SCENE.replace("last=\"12\"", "last=\"99999\"")).unwrap();
    path
}

#[test]
fn a_movie_that_is_stopped_leaves_nothing() {
    let mut visit = Visit::to(long);
    visit.page.film(Some("gif"));
    assert!(visit.page.text("refused")["message"].as_str().unwrap().contains("nothing to film yet"));
    visit.shown(json!({}));
    visit.page.film(Some("gif"));
    visit.page.text("filming");
    visit.page.film(Some("y4m"));
    let refused = visit.page.text("refused");
    assert!(refused["message"].as_str().unwrap().contains("under way already"), "{refused}");
    visit.page.film(None);
    let told = visit.page.filmed();
    assert!(told.iter().all(|text| text["type"] == "filming"), "{told:?}");
    assert_eq!(names(&visit.out), [""; 0]);
    for (format, why) in [("avi", "there are no movies as .avi"), ("../gif", "there are no movies")] {
        visit.page.film(Some(format));
        let refused = visit.page.text("refused");
        assert!(refused["message"].as_str().unwrap().contains(why), "{refused}");
    }
    let serial = visit.page.see(json!({ "buffer": "depth" }));
    visit.page.finished(serial);
    visit.page.film(Some("gif"));
    let refused = visit.page.text("refused");
    assert!(refused["message"].as_str().unwrap().contains("take the buffer colour"), "{refused}");
    // The program ends in the middle of one.
    visit.shown(json!({}));
    visit.page.film(Some("y4m"));
    visit.page.text("filming");
    visit.program.child.kill().unwrap();
    visit.program.child.wait().unwrap();
    assert_eq!(names(&visit.out), [""; 0]);
}
