//! What ships beside the code: models and scenes.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use splatblur::environment;
use splatblur::frame::Frame;
use splatblur::image;
use splatblur::model::generate_volume::{self, FieldShape, Storage};
use splatblur::model::{Cloud, ModelFormat, generate, mesh};
use splatblur::options::{BlurMode, Prefilter, RenderOptions};
use splatblur::scene::Scene;
use splatblur::scene_file;

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

/// Names of the files directly in a directory.
fn names(directory: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(directory).unwrap().map(Result::unwrap);
    entries.filter(|e| e.path().is_file()).map(|e| e.file_name().into_string().unwrap()).collect()
}

fn assert_shipped(name: &str, cloud: &Cloud) {
    let mut bytes = Vec::new();
    generate::write(cloud, &mut bytes).unwrap();
    let shipped = fs::read(scenes().join("models").join(name)).unwrap();
    let differs = shipped.iter().zip(&bytes).position(|(a, b)| a != b);
    assert!(
        shipped.len() == bytes.len() && differs.is_none(),
        "{name}: {} bytes ship, {} are generated, first difference at {differs:?}",
        shipped.len(),
        bytes.len()
    );
}

/// The floor has 14 x 14 squares, each of the other grey than its neighbours, and all look up.
#[test]
fn the_floor_is_a_board() {
    let path = scenes().join("models/floor.obj");
    let mesh = mesh::read(&fs::read(&path).unwrap(), ModelFormat::Obj, &path, None).unwrap().unwrap();
    assert_eq!(mesh.triangles.len(), 2 * 14 * 14);
    let greys = [[120.0_f32, 116.0, 110.0], [70.0, 72.0, 78.0]];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.corners.map(|v| mesh.position[v as usize]);
        let (middle, across) = ((a + b + c) / 3.0, (b - a).cross(c - a));
        assert!((across - DVec3::Y).length() < 1e-12 && middle.abs().max_element() < 7.0, "{a} {b} {c}");
        let odd = (middle.x.floor() + middle.z.floor()).rem_euclid(2.0) as usize;
        let colour = mesh.materials[triangle.material as usize].colour;
        for (linear, grey) in colour.to_array().into_iter().zip(greys[odd]) {
            let encoded = 255.0 * (1.055 * linear.powf(1.0 / 2.4) - 0.055);
            assert!((encoded - grey).abs() < 0.01, "{encoded} {grey}");
        }
    }
}

#[test]
fn generated_models_are_what_the_generator_writes() {
    assert_shipped("ball.ply", &generate::ball());
    assert_shipped("checker_plane.ply", &generate::checker_plane());
    assert_shipped("fence.ply", &generate::fence());
    assert_shipped("splash.ply", &generate::splash());
    assert_shipped("propeller.ply", &generate::propeller());
    for number in generate::SWARM[0]..=generate::SWARM[1] {
        assert_shipped(&format!("swarm.{number}.ply"), &generate::swarm(number));
    }
    let mut smoke = Vec::new();
    generate_volume::write(FieldShape::Torus, 64, Storage::Uint8, &mut smoke).unwrap();
    assert!(fs::read(scenes().join("models/smoke.nrrd")).unwrap() == smoke, "smoke.nrrd is not what is generated");
    // Half floats, with their rounding.
    let studio = image::read(&scenes().join("models/studio.exr")).unwrap();
    let close = |(&[r, g, b, _], want): (&[f32; 4], &[f32; 3])| {
        [r, g, b].iter().zip(want).all(|(a, b)| (a - b).abs() <= 5e-4 * b.abs())
    };
    let want = environment::studio();
    assert_eq!([studio.width as usize, studio.height as usize], [want.width(), want.height()]);
    assert!(studio.rgba.iter().zip(want.pixels()).all(close), "studio.exr is not what is generated");
}

#[test]
fn everything_stays_within_15_megabytes() {
    let size = |directory: &Path| -> u64 {
        names(directory).iter().map(|name| fs::metadata(directory.join(name)).unwrap().len()).sum()
    };
    let total = size(&scenes()) + size(&scenes().join("models"));
    assert!(total > 1_000_000 && total <= 15_000_000, "{total} bytes");
}

#[test]
fn every_model_has_its_origin_and_licence_listed() {
    let readme = fs::read_to_string(scenes().join("models/README.md")).unwrap();
    let listed: BTreeSet<String> = readme
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split_once('`').map(|(name, _)| name.to_owned()))
        .collect();
    let mut present = names(&scenes().join("models"));
    assert!(present.remove("README.md") && present.remove("LICENSES.txt"));
    assert_eq!(listed, present);
}

#[test]
fn every_scene_loads_without_a_word_of_doubt() {
    let files = names(&scenes());
    assert!(files.len() >= 8, "{files:?}");
    for name in files {
        let path = scenes().join(&name);
        let loaded =
            scene_file::load(&path, &scene_file::SceneLoadOptions::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        let scene = loaded.scene;
        assert_eq!((scene.image.width, scene.image.height), (960, 540), "{name}");
        // A propeller before a rolling shutter is sharp.
        let half = if name == "propeller.xml" { 0.01 } else { 0.5 };
        assert_eq!((scene.shutter.open, scene.shutter.close), (-half, half), "{name}");
        assert!(!scene.camera.automatic, "{name}");
        // Only the captured guitar has something to report: splats that were too faint. And meshes say how they were
        // sampled.
        if name != "static.xml" {
            let doubts = loaded.notes.iter().filter(|note| !note.contains(" triangles sampled with spacing "));
            let doubts = doubts.filter(|note| !note.contains("which an `<animation node>` plays"));
            // The bottle's material says so.
            let doubts: Vec<_> = doubts.filter(|note| !note.contains("Tr 1 without `d` is taken as opaque")).collect();
            assert_eq!(doubts, Vec::<&String>::new(), "{name}");
        }
    }
}

/// The bounds of what modes see in a scene were set on these.
#[test]
fn shipped_scenes_get_the_filter_and_the_positions_that_suit_them() {
    for (name, frame, prefilter, positions) in [
        // Its floor is at rest.
        ("three_objects", 15, Prefilter::None, 8),
        // Little rests, nothing, all.
        ("blinker_fence", 0, Prefilter::None, 24),
        ("crossing", 9, Prefilter::None, 24),
        ("static", 0, Prefilter::None, 24),
        // Cells shrink to a pixel.
        ("checkerboard", 0, Prefilter::Ewa, 24),
    ] {
        let scene = Scene::open(scenes().join(name).with_extension("xml")).size(480, 270).load().unwrap();
        let frame = |samples| Frame::new(&scene, frame, BlurMode::supersample(samples), &RenderOptions::default());
        assert_eq!(frame(8).prefilter, prefilter, "{name}");
        assert_eq!(frame(24).rasters[0].positions.len(), positions, "{name}");
    }
}

/// The documents at the root, all below `docs`, and those of folders with files that ship.
fn documents() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let alone = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", "fuzz/README.md", "scenes/models/README.md"];
    let mut found: Vec<PathBuf> = alone.iter().map(|name| root.join(name)).collect();
    for folder in ["docs", "docs/measurements"].map(|folder| root.join(folder)) {
        let pages = names(&folder).into_iter().filter(|name| Path::new(name).extension().is_some_and(|e| e == "md"));
        found.extend(pages.map(|name| folder.join(name)));
    }
    found
}

#[test]
fn every_file_that_the_documents_link_to_exists() {
    let mut links = 0;
    for document in documents() {
        let text = fs::read_to_string(&document).unwrap();
        for target in text.split("](").skip(1).filter_map(|rest| rest.split_once(')').map(|(target, _)| target)) {
            let file = target.split('#').next().unwrap_or(target);
            // Links within a page have no file. Pictures are made from a release and need not exist while one is
            // prepared.
            if !file.is_empty() && !file.contains("://") && !file.contains("images/") {
                links += 1;
                assert!(document.with_file_name(file).exists(), "{} links to {target}", document.display());
            }
        }
    }
    assert!(links > 60, "found {links} links");
}

#[test]
fn the_readme_lists_every_scene() {
    let readme = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md")).unwrap();
    for name in names(&scenes()) {
        assert!(readme.contains(&format!("`{}`", name.trim_end_matches(".xml"))), "{name}");
    }
}
