//! Whatever of a scene names a path: none waits for the other end of a pipe.

#![cfg(unix)]

use std::path::Path;
use std::sync::mpsc;
use std::time::Duration;

use super::schema::{ELEMENTS, ValueKind};
use super::{SceneLoadOptions, load};
use crate::anim::TrackFormat;

/// Attributes that are text and name no path.
const NO_PATHS: [(&str, &str); 7] = [
    ("camera", "atObject"),
    ("object", "name"),
    ("pointModel", "node"),
    ("pointModel", "classes"),
    ("pointModel", "colourBy"),
    ("pointModel", "range"),
    ("animation", "node"),
];

/// Scenes whose element, or attribute, names `pipe`, or `pipe.1` and `pipe.2` of a sequence.
fn scenes(element: &str, attribute: Option<&str>) -> Vec<String> {
    let in_scene = |text: &str| format!("<scene>{text}<object><sphere/></object></scene>");
    let in_object = |text: &str| format!("<scene><object>{text}</object></scene>");
    match (element, attribute) {
        ("track", None) => TrackFormat::WORDS
            .iter()
            .map(|format| in_scene(&format!("<camera><track format=\"{format}\">pipe</track></camera>")))
            .collect(),
        ("environment", None) => vec![in_scene("<environment>pipe</environment>")],
        ("pointModel", None) => vec![in_object("<pointModel>pipe</pointModel>")],
        ("pointModel", Some("sequence")) => {
            vec![in_object("<pointModel sequence=\"pipe.%d\" first=\"1\" last=\"2\"/>")]
        }
        ("pointModel", Some("colourMap")) => {
            vec![in_object("<pointModel colourBy=\"z\" colourMap=\"pipe\">m.ply</pointModel>")]
        }
        ("animation", None) => vec![
            in_object("<sphere/><animation>pipe</animation>"),
            in_scene("<camera><animation>pipe</animation></camera>"),
        ],
        other => panic!("tell a scene of {other:?}, or that it names no path"),
    }
}

#[test]
fn nothing_of_a_scene_waits_for_a_pipe() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["pipe", "pipe.1", "pipe.2"] {
        assert!(std::process::Command::new("mkfifo").arg(dir.path().join(name)).status().unwrap().success());
    }
    let mut tried = 0;
    for schema in ELEMENTS {
        let attributes = schema.attributes.iter().filter(|attribute| matches!(attribute.kind, ValueKind::Text));
        let paths = attributes.map(|attribute| attribute.name).filter(|name| !NO_PATHS.contains(&(schema.name, name)));
        for attribute in paths.map(Some).chain(schema.text.map(|_| None)) {
            for scene in scenes(schema.name, attribute) {
                let path = dir.path().join("scene.xml");
                std::fs::write(&path, &scene).unwrap();
                let why = refusal(&path).unwrap_or_else(|| panic!("{scene} waits"));
                assert!(why.contains("pipe") && !why.contains('\n'), "{scene}: {why}");
                tried += 1;
            }
        }
    }
    assert!(tried >= 5 + TrackFormat::WORDS.len(), "{tried}");
}

/// Why a scene is refused; none if that is not known soon.
fn refusal(path: &Path) -> Option<String> {
    let (tell, told) = mpsc::channel();
    let path = path.to_owned();
    std::thread::spawn(move || {
        let why = load(&path, &SceneLoadOptions::default()).map(|_| ()).unwrap_err();
        // Nobody listens any more where it took too long.
        let _ = tell.send(why.to_string());
    });
    told.recv_timeout(Duration::from_secs(10)).ok()
}
