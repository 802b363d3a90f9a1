//! Stated and true errors of mode auto, and its cost beside that of supersampling: makes tables of docs/modes.md. Takes minutes, so it
//! is ignored by default. `BOX=1`: samples over the pixel's square, not at its centre. `SCENE=spin`: one shipped scene.
//!
//! `cargo test --release --test auto_study -- --ignored --nocapture`; references are kept in the build folder and used again.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

mod support;

use std::time::Instant;

use glam::{Vec2, Vec3};
use splatblur::backend::cpu::Cpu;
use splatblur::compare::{flip, gamma_rmse};
use splatblur::film::Picture;
use splatblur::frame::{Frame, STILL_PATH};
use splatblur::plan::{BlurMode, Interleave, PixelFilter, Prefilter, RenderOptions, Shading, Target};
use splatblur::render::{Rendered, render_frame};
use splatblur::scene::Scene;
use support::study::{cross, lin, reference, rot, shipped};

/// The rendering, and the least wall time of five.
fn rendered(scene: &Scene, frame: i64, filter: PixelFilter, mode: BlurMode) -> (Rendered, f64) {
    let (prefilter, shading) = (Prefilter::None, Shading::Gouraud);
    let options = RenderOptions { mode, filter, prefilter, shading, ..RenderOptions::default() };
    let mut cpu = Cpu::default();
    let runs = (0..5).map(|_| {
        let start = Instant::now();
        (render_frame(&mut cpu, scene, frame, &options).unwrap(), start.elapsed().as_secs_f64())
    });
    runs.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap()
}

fn table(scene: &Scene, frame: i64, filter: PixelFilter) {
    let truth = reference(scene, frame, filter);
    let interleave = Interleave::None;
    for samples in [8, 16, 24, 32, 48, 64] {
        let mode = BlurMode::interleaved(samples, interleave);
        let (rendered, seconds) = rendered(scene, frame, filter, mode);
        row(scene, &format!("{mode}"), &rendered, &truth, seconds);
    }
    for error in [0.08, 0.05, 0.035, 0.025, 0.0125] {
        let mode = BlurMode::Auto(Target { error, ..Target::default() });
        let (rendered, seconds) = rendered(scene, frame, filter, mode);
        row(scene, &format!("{mode}"), &rendered, &truth, seconds);
    }
}

fn row(scene: &Scene, mode: &str, rendered: &Rendered, truth: &Picture, seconds: f64) {
    let (flip, rmse) = (flip::mean(&rendered.picture, truth).unwrap(), gamma_rmse(&rendered.picture, truth).unwrap());
    let auto = rendered.stats.achieved.map_or_else(String::new, |a| {
        format!(
            " {:.4} | {:.2} | {:.0} px, {}..{}, S {}, {} of {} blocks, {} capped |",
            a.error,
            a.error / rmse,
            a.way,
            a.samples,
            a.most_samples,
            a.interleave,
            a.refined,
            a.blocks,
            a.capped
        )
    });
    let splats = rendered.stats.splats as f64 / 1e6;
    println!("| {} | {mode} | {flip:.4} | {rmse:.4} | {seconds:.3} | {splats:.2} |{auto}", scene.name);
}

fn filter() -> PixelFilter {
    if std::env::var_os("BOX").is_some() { PixelFilter::Box } else { PixelFilter::Point }
}

#[test]
#[ignore = "takes minutes; makes a table of docs/modes.md"]
fn generated_scenes() {
    println!("| scene | mode | FLIP | RMSE | s | M splats | stated | stated / true | by |");
    for scene in [lin(), rot(), cross()] {
        table(&scene, 0, filter());
    }
}

#[test]
#[ignore = "takes minutes; makes a table of docs/modes.md"]
fn shipped_scenes() {
    println!("| scene | mode | FLIP | RMSE | s | M splats | stated | stated / true | by |");
    for (name, frame) in [
        ("diagonal", 12),
        ("crossing", 12),
        ("checkerboard", 5),
        ("blinker", 5),
        ("blinker_fence", 5),
        ("spin", 5),
        ("three_objects", 5),
        ("three_objects", 20),
        ("toward_camera_and_sideways", 5),
    ] {
        if std::env::var("SCENE").is_ok_and(|wanted| wanted != name) {
            continue;
        }
        table(&shipped(name), frame, filter());
    }
}

/// Of the surfels of objects that move, how many lie still themselves, and in pieces of 256 that lie still whole: what a layer by pieces
/// would gain.
#[test]
#[ignore = "makes figures of docs/modes.md"]
fn still_pieces() {
    println!("| scene | frame | surfels of objects that move | of them still | in still pieces |");
    for (name, frames) in [
        ("diagonal", [6, 12, 18]),
        ("crossing", [6, 12, 18]),
        ("checkerboard", [5, 15, 25]),
        ("blinker", [2, 5, 8]),
        ("blinker_fence", [2, 5, 8]),
        ("spin", [2, 5, 8]),
        ("three_objects", [5, 20, 40]),
        ("toward_camera_and_sideways", [5, 20, 36]),
    ] {
        let scene = shipped(name);
        let options = RenderOptions { mode: BlurMode::supersample(9), ..RenderOptions::default() };
        for number in frames {
            let frame = Frame::new(&scene, number, &options);
            let mut counts = [0; 3];
            for (index, object) in frame.objects.iter().enumerate().filter(|(_, object)| !object.still) {
                let on_screen = |p: Vec3| {
                    let posed = frame.groups.iter().map(|group| &group.samples[0].objects[index]);
                    let points = posed.map(|pose| pose.screen_from_model * p + pose.screen_origin);
                    let points: Vec<Vec2> = points.map(|p| p.truncate() / p.z).collect();
                    points.windows(2).map(|pair| pair[0].distance(pair[1])).sum::<f32>() < STILL_PATH
                };
                let still: Vec<bool> = object.surfels.position.iter().map(|&p| on_screen(p)).collect();
                let whole = still.chunks(256).filter(|piece| piece.iter().all(|&still| still)).map(<[bool]>::len);
                counts[0] += still.len();
                counts[1] += still.iter().filter(|&&still| still).count();
                counts[2] += whole.sum::<usize>();
            }
            println!("| {name} | {number} | {} | {} | {} |", counts[0], counts[1], counts[2]);
        }
    }
}
