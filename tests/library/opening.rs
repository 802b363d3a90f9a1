//! The size of the image before loading.

use std::fs;

use splatblur::{BlurMode, Device, Picture, RenderOptions, Renderer, Scene};
use tempfile::TempDir;

/// A scene without a camera: the one that is found must see all points of a wide row.
fn without_camera() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let row: Vec<String> =
        (0..40).map(|i| format!("{} {} 0", f64::from(i % 20) * 0.1, f64::from(i / 20) * 0.1)).collect();
    fs::write(folder.path().join("row.xyz"), row.join("\n")).unwrap();
    let text = "<scene><object><pointModel>row.xyz</pointModel></object></scene>";
    fs::write(folder.path().join("scene.xml"), text).unwrap();
    folder
}

fn render(scene: &Scene) -> Picture {
    let options = RenderOptions { quality: BlurMode::Still { pixel_samples: 1 }.into(), ..RenderOptions::default() };
    Renderer::open(Device::Cpu).unwrap().render(scene, 0, &options).unwrap().picture
}

/// What the program gives.
#[cfg(feature = "cli")]
fn by_the_program(folder: &std::path::Path, size: &str) -> Picture {
    let mut program = std::process::Command::new(env!("CARGO_BIN_EXE_splatblur"));
    program.args(["render", "scene.xml", "--size", size, "--mode", "still:1", "--backend", "cpu", "--out", "out"]);
    let output = program.current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut files = fs::read_dir(folder.join("out")).unwrap();
    Picture::read(files.next().unwrap().unwrap().path()).unwrap()
}

#[test]
fn is_the_size_of_the_program() {
    let folder = without_camera();
    let path = folder.path().join("scene.xml");
    let scene = Scene::open(&path).size(96, 24).load().unwrap();
    #[cfg(feature = "cli")]
    {
        let expected = by_the_program(folder.path(), "96x24");
        assert_eq!(render(&scene).to_srgb8().unwrap(), expected.to_srgb8().unwrap());
    }
    // Set afterwards, it is another picture: the camera was found for 1024 x 768.
    let mut cropped = Scene::load(&path).unwrap();
    (cropped.image.width, cropped.image.height) = (96, 24);
    assert!(cropped.camera.eye.z > 1.5 * scene.camera.eye.z, "{} {}", cropped.camera.eye, scene.camera.eye);
    assert_ne!(render(&cropped), render(&scene));
}

#[test]
fn notes_are_handed_out_and_sizes_checked() {
    let folder = without_camera();
    let path = folder.path().join("scene.xml");
    let loaded = Scene::open(&path).load_with_notes().unwrap();
    assert!(loaded.notes.iter().any(|note| note.contains("normals of all 40 points estimated")), "{:?}", loaded.notes);
    for (width, height, field) in [(0, 10, "size.width"), (10, 65_536, "size.height")] {
        let refused = Scene::open(&path).size(width, height).load().unwrap_err().to_string();
        assert!(refused.starts_with(&format!("`{field}` is ")), "{refused}");
    }
    fs::write(&path, "<scene colour='red'><object><pointModel>row.xyz</pointModel></object></scene>").unwrap();
    assert!(Scene::open(&path).load().is_err());
    assert!(Scene::open(&path).lenient().load().is_ok());
}
