//! Stated and true errors of mode auto, and its cost beside that of supersampling: makes tables of docs/modes.md. Takes minutes, so it
//! is ignored by default. `BOX=1`: samples over the pixel's square, not at its centre. `SCENE=spin`: one shipped scene.
//!
//! `cargo test --release --test auto_study -- --ignored --nocapture`; references are kept in the build folder and used again.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

mod support;

use std::time::Instant;

use glam::{Vec2, Vec3};
use splatblur::backend::Backend;
use splatblur::backend::cpu::Cpu;
#[cfg(feature = "gpu")]
use splatblur::backend::gpu::{Choice, Gpu};
use splatblur::compare::{flip, gamma_rmse};
use splatblur::film::{Aov, Picture};
use splatblur::frame::STILL_PATH;
use splatblur::options::{BlurMode, ErrorTarget, Interleave, PixelFilter, Prefilter, Quality, RenderOptions, Shading};
use splatblur::renderer::{Rendered, render_frame};
use splatblur::scene::Scene;
use support::posed;
use support::study::{cross, lin, reference, rot, shipped};

/// The rendering, and the least wall time of five.
fn rendered(scene: &Scene, frame: i64, filter: PixelFilter, mode: impl Into<Quality>) -> (Rendered, f64) {
    let (prefilter, shading) = (Prefilter::None, Shading::Gouraud);
    let options = RenderOptions { quality: mode.into(), filter, prefilter, shading, ..RenderOptions::default() };
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
        let mode = Quality::Error(ErrorTarget { error, ..ErrorTarget::default() });
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

/// The cheapest setting of mode auto, of plain supersampling and of supersampling with a lattice that has at most this FLIP, and what they
/// cost: time in turns, the least of nine, splats and samples of a pixel. `GPU=1`: seconds of one frame each on the GPU, too.
#[test]
#[ignore = "takes minutes; makes a table of docs/modes.md"]
fn at_equal_flip() {
    println!("| scene | FLIP at most | mode | FLIP | ms | M splats | samples of a pixel | s on the GPU |");
    let mut gpu: Option<Box<dyn Backend>> = None;
    #[cfg(feature = "gpu")]
    if std::env::var_os("GPU").is_some() {
        gpu = Some(Box::new(Gpu::open(&Choice::default()).unwrap()));
    }
    let generated = [(lin(), 0), (rot(), 0), (cross(), 0)];
    for (scene, frame) in generated.into_iter().chain([(shipped("three_objects"), 20)]) {
        if std::env::var("SCENE").is_ok_and(|wanted| wanted != scene.name) {
            continue;
        }
        let truth = reference(&scene, frame, filter());
        let options = |quality: Quality| {
            let (prefilter, shading) = (Prefilter::None, Shading::Gouraud);
            RenderOptions { quality, filter: filter(), prefilter, shading, ..RenderOptions::default() }
        };
        let mut cpu = Cpu::default();
        let mut render = |mode: Quality| render_frame(&mut cpu, &scene, frame, &options(mode)).unwrap();
        let autos = (0..18).map(|k| 0.2 * 0.5_f64.powf(f64::from(k) / 3.0));
        let autos = autos.map(|error| Quality::Error(ErrorTarget { error, ..ErrorTarget::default() }));
        let plain = (2..=80).map(|samples| BlurMode::supersample(samples).into());
        let lattice = (2..=40).map(|samples| BlurMode::interleaved(samples, Interleave::Two).into());
        let kinds: [Vec<Quality>; 3] = [autos.collect(), plain.collect(), lattice.collect()];
        for most in [0.01, 0.005] {
            let mut found: Vec<&Quality> = Vec::new();
            for modes in &kinds {
                let good = |mode: &&Quality| flip::mean(&render(**mode).picture, &truth).unwrap() <= most;
                found.extend(modes.iter().find(good));
            }
            let mut least = vec![f64::INFINITY; found.len()];
            for _ in 0..9 {
                for (mode, least) in found.iter().zip(&mut least) {
                    let start = Instant::now();
                    render(**mode);
                    *least = least.min(start.elapsed().as_secs_f64());
                }
            }
            for (mode, seconds) in found.into_iter().zip(least) {
                let Rendered { picture, stats } = render(*mode);
                let with_samples = RenderOptions { aovs: vec![Aov::Samples], ..options(*mode) };
                let layer =
                    render_frame(&mut Cpu::default(), &scene, frame, &with_samples).unwrap().picture.layers.remove(0);
                let samples = layer.planes[0].iter().sum::<f32>() / layer.planes[0].len() as f32;
                let on_gpu = gpu.as_mut().map_or(f64::NAN, |gpu| {
                    let start = Instant::now();
                    render_frame(gpu.as_mut(), &scene, frame, &options(*mode)).unwrap();
                    start.elapsed().as_secs_f64()
                });
                println!(
                    "| {} | {most} | {mode} | {:.4} | {:.1} | {:.2} | {samples:.1} | {on_gpu:.1} |",
                    scene.name,
                    flip::mean(&picture, &truth).unwrap(),
                    1e3 * seconds,
                    stats.splats as f64 / 1e6,
                );
            }
        }
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
        let options = RenderOptions { quality: BlurMode::supersample(9).into(), ..RenderOptions::default() };
        for number in frames {
            let frame = posed(&scene, number, &options);
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
