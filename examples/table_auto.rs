//! Stated and true errors of mode auto, and its cost beside that of supersampling.
//!
//! `cargo run --release --example table_auto [-- TABLE... [scene=NAME] [filter=box] [gpu=yes]]`. Tables:
//!
//! - `generated`, `shipped`: for each scene, FLIP, RMSE, seconds and splats of supersampling and of mode auto, with the
//!   error that auto states;
//! - `equal-flip`: the cheapest setting of each mode that stays below a FLIP; `gpu=yes` also times one frame on the
//!   GPU;
//! - `static-clusters`: how many surfels of moving objects are static.
//!
//! `filter=box` takes samples over the square of the pixel, instead of at its centre. Takes minutes, the first run
//! longer: it traces references and keeps them in `target/tables`. The results stand in docs/measurements/.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a generator may stop, and prints its tables")]

mod support;

use std::time::Instant;

use glam::{Vec2, Vec3};
use splatblur::backend::Backend;
use splatblur::backend::cpu::Cpu;
#[cfg(feature = "gpu")]
use splatblur::backend::gpu::{Choice, Gpu};
use splatblur::compare::{flip, gamma_rmse};
use splatblur::film::{Aov, Picture};
use splatblur::frame::STATIC_PATH;
use splatblur::options::{
    BlurMode, ErrorTarget, Interleave, Look, PixelFilter, Prefilter, Quality, RenderOptions, Shading,
};
use splatblur::renderer::{Rendered, render_frame};
use splatblur::scene::Scene;
use support::scenes::{cross, lin, reference, rot, shipped};
use support::{Arguments, posed};

fn main() {
    let asked =
        Arguments::read(&["generated", "shipped", "equal-flip", "static-clusters"], &["scene", "filter", "gpu"]);
    let filter = if asked.value("filter") == Some("box") { PixelFilter::Box } else { PixelFilter::Point };
    if asked.table("generated") {
        generated_scenes(filter);
    }
    if asked.table("shipped") {
        shipped_scenes(&asked, filter);
    }
    if asked.table("equal-flip") {
        at_equal_flip(&asked, filter);
    }
    if asked.table("static-clusters") {
        static_clusters();
    }
}

/// The rendering, and the least wall time of five.
fn rendered(scene: &Scene, frame: i64, filter: PixelFilter, mode: impl Into<Quality>) -> (Rendered, f64) {
    let (prefilter, shading) = (Prefilter::None, Shading::Gouraud);
    let options = RenderOptions {
        quality: mode.into(),
        prefilter,
        look: Look { filter, shading, ..Look::default() },
        ..RenderOptions::default()
    };
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
            a.path_length,
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

fn generated_scenes(filter: PixelFilter) {
    println!("| scene | mode | FLIP | RMSE | s | M splats | stated | stated / true | by |");
    for scene in [lin(), rot(), cross()] {
        table(&scene, 0, filter);
    }
}

fn shipped_scenes(asked: &Arguments, filter: PixelFilter) {
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
        if !asked.scene(name) {
            continue;
        }
        table(&shipped(name), frame, filter);
    }
}

/// The cheapest settings that have at most this FLIP: of mode auto, of plain supersampling and of interleaved
/// supersampling. Their cost: the least time of nine rounds in turns, splats, and samples of a pixel.
fn at_equal_flip(asked: &Arguments, filter: PixelFilter) {
    println!("| scene | FLIP at most | mode | FLIP | ms | M splats | samples of a pixel | s on the GPU |");
    let mut gpu: Option<Box<dyn Backend>> = None;
    #[cfg(feature = "gpu")]
    if asked.value("gpu").is_some() {
        gpu = Some(Box::new(Gpu::open(&Choice::default()).unwrap()));
    }
    let generated = [(lin(), 0), (rot(), 0), (cross(), 0)];
    for (scene, frame) in generated.into_iter().chain([(shipped("three_objects"), 20)]) {
        if !asked.scene(&scene.name) {
            continue;
        }
        let truth = reference(&scene, frame, filter);
        let options = |quality: Quality| {
            let (prefilter, shading) = (Prefilter::None, Shading::Gouraud);
            RenderOptions {
                quality,
                prefilter,
                look: Look { filter, shading, ..Look::default() },
                ..RenderOptions::default()
            }
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
                let with_samples =
                    RenderOptions { look: Look { aovs: vec![Aov::Samples], ..options(*mode).look }, ..options(*mode) };
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

/// Counts the surfels of moving objects that are static themselves, and those in a cluster of 256 of which
/// all are static. This is what a static layer by clusters would gain.
fn static_clusters() {
    println!("| scene | frame | surfels of objects that move | of them static | in static clusters |");
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
            for (index, object) in frame.objects.iter().enumerate().filter(|(_, object)| !object.is_static) {
                let Some(model) = object.shape.surfels() else { continue };
                let on_screen = |p: Vec3| {
                    let posed = frame.groups().map(|group| &group.samples[0].objects[index]);
                    let points = posed.map(|pose| pose.screen_from_model * p + pose.screen_origin);
                    let points: Vec<Vec2> = points.map(|p| p.truncate() / p.z).collect();
                    points.windows(2).map(|pair| pair[0].distance(pair[1])).sum::<f32>() < STATIC_PATH
                };
                let still: Vec<bool> = model.surfels().position.iter().map(|&p| on_screen(p)).collect();
                let whole = still.chunks(256).filter(|cluster| cluster.iter().all(|&still| still)).map(<[bool]>::len);
                counts[0] += still.len();
                counts[1] += still.iter().filter(|&&still| still).count();
                counts[2] += whole.sum::<usize>();
            }
            println!("| {name} | {number} | {} | {} | {} |", counts[0], counts[1], counts[2]);
        }
    }
}
