//! Error of the blur modes against the reference: makes the tables of docs/modes.md. Takes minutes, so it is ignored by default:
//!
//! `cargo test --release --test modes_study -- --ignored --nocapture`; references are kept in the build folder and used again.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

mod support;

use std::path::Path;

use splatblur::backend::cpu::Cpu;
use splatblur::compare::{flip, gamma_rmse};
use splatblur::film::Picture;
use splatblur::image::{self, Format};
use splatblur::plan::{BlurMode, Interleave, PixelFilter, Prefilter, RenderOptions, Shading};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::render::render_frame;
use splatblur::scene::{LoadOptions, Scene, load};
use support::study::{cross, lin, rot};

const SAMPLES: u64 = 1024;

/// The scene's reference, from an earlier run where there is one.
fn reference(scene: &Scene, frame: i64) -> Picture {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("study");
    std::fs::create_dir_all(&directory).unwrap();
    let path = directory.join(format!("{}_{frame}_{SAMPLES}.exr", scene.name));
    if let Ok(picture) = image::read(&path) {
        return picture;
    }
    let options = ReferenceOptions {
        samples: SAMPLES,
        filter: PixelFilter::Point,
        shading: Shading::Gouraud,
        ..ReferenceOptions::default()
    };
    let made = reference::render(scene, frame, &options, None, &|_| ()).unwrap();
    println!("{}: reference, mean standard error {:.1e}", scene.name, made.stats.mean_error);
    image::write(&path, &made.picture, Format::Exr, "").unwrap();
    made.picture
}

/// FLIP, gamma-space RMSE and CPU seconds of a mode.
fn row(scene: &Scene, frame: i64, truth: &Picture, mode: BlurMode) {
    let options = RenderOptions {
        mode,
        filter: PixelFilter::Point,
        prefilter: Prefilter::None,
        shading: Shading::Gouraud,
        ..RenderOptions::default()
    };
    let rendered = render_frame(&mut Cpu::default(), scene, frame, &options).unwrap();
    let s = rendered.stats;
    println!(
        "| {} | {mode} | {:.4} | {:.4} | {:.3} |",
        scene.name,
        flip::mean(&rendered.picture, truth).unwrap(),
        gamma_rmse(&rendered.picture, truth).unwrap(),
        (s.project + s.visibility + s.attribute + s.resolve).as_secs_f64(),
    );
}

fn table(scene: &Scene, frame: i64) {
    let truth = reference(scene, frame);
    for n in [1, 2, 3, 5, 8, 10, 16, 20, 32, 50, 100] {
        row(scene, frame, &truth, BlurMode::supersample(n));
    }
    for (n, interleave) in [2, 3, 4, 8, 16].iter().flat_map(|&n| [(n, Interleave::Two), (n, Interleave::Four)]) {
        row(scene, frame, &truth, BlurMode::Supersample { samples: n, interleave });
    }
    for (buckets, samples) in [(1, 32), (2, 8), (4, 4), (8, 2), (8, 4), (16, 2)] {
        for interleave in [Interleave::None, Interleave::Two] {
            row(scene, frame, &truth, BlurMode::Bucket { buckets, samples, pixel_samples: 1, interleave });
        }
    }
}

#[test]
#[ignore = "takes minutes; makes a table of docs/modes.md"]
fn generated_scenes() {
    println!("| scene | mode | FLIP | RMSE | CPU s |");
    for scene in [lin(), rot(), cross()] {
        table(&scene, 0);
    }
}

#[test]
#[ignore = "takes minutes; makes a table of docs/modes.md"]
fn shipped_scenes() {
    println!("| scene | mode | FLIP | RMSE | CPU s |");
    for (name, frame) in [
        ("diagonal", 12),
        ("crossing", 12),
        ("checkerboard", 5),
        ("blinker", 5),
        ("blinker_fence", 5),
        ("spin", 5),
        ("three_objects", 5),
        ("toward_camera_and_sideways", 5),
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("xml");
        let mut scene = load(&path, &LoadOptions::default()).unwrap().scene;
        (scene.image.width, scene.image.height) = (480, 270);
        table(&scene, frame);
    }
}
