//! Errors of the blur modes against the reference.
//!
//! `cargo run --release --example table_modes [-- TABLE... [scene=NAME] [mode=PREFIX]]`. Tables:
//!
//! - `generated`, `shipped`: FLIP, RMSE and CPU seconds of all modes with many numbers of samples;
//! - `alpha`: temporal alpha on shipped scenes, pixel by pixel.
//!
//! `mode=bucket` takes only the modes whose names begin so. Takes minutes, the first run longer: it traces references
//! and keeps them in `target/tables`. The results stand in docs/measurements/.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a generator may stop, and prints its tables")]

mod support;

use splatblur::backend::cpu::Cpu;
use splatblur::compare::{flip, gamma_rmse};
use splatblur::film::{Aov, Picture};
use splatblur::options::{
    BlurMode, Interleave, KernelShape, Look, Normalise, PixelFilter, Prefilter, RenderOptions, Shading, SweptKernel,
    Times,
};
use splatblur::reference::ReferenceOptions;
use splatblur::renderer::render_frame;
use splatblur::scene::Scene;
use support::Arguments;
use support::scenes::{cross, lin, reference, rot, shipped};

fn main() {
    let asked = Arguments::read(&["generated", "shipped", "alpha"], &["scene", "mode"]);
    if asked.table("generated") {
        println!("| scene | mode | FLIP | RMSE | CPU s |");
        for scene in [lin(), rot(), cross()] {
            table(&asked, &scene, 0);
        }
    }
    if asked.table("shipped") {
        println!("| scene | mode | FLIP | RMSE | CPU s |");
        for (name, frame) in SHIPPED {
            table(&asked, &shipped(name), frame);
        }
    }
    if asked.table("alpha") {
        alpha_of_shipped_scenes(&asked);
    }
}

/// FLIP, gamma-space RMSE and CPU seconds of a mode.
fn row(asked: &Arguments, scene: &Scene, frame: i64, truth: &Picture, mode: BlurMode) {
    if asked.value("mode").is_some_and(|prefix| !mode.to_string().starts_with(prefix)) {
        return;
    }
    let options = RenderOptions {
        quality: mode.into(),
        prefilter: Prefilter::None,
        look: Look { filter: PixelFilter::Point, shading: Shading::Gouraud, ..Look::default() },
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

fn table(asked: &Arguments, scene: &Scene, frame: i64) {
    if !asked.scene(&scene.name) {
        return;
    }
    let truth = reference(scene, frame, PixelFilter::Point);
    let numbers = [1, 2, 3, 5, 10, 20, 50, 100];
    for n in [1, 2, 3, 5, 8, 10, 16, 20, 32, 50, 100] {
        row(asked, scene, frame, &truth, BlurMode::supersample(n));
    }
    for n in [1, 2, 3, 5, 8, 10, 16, 20, 50, 100] {
        row(asked, scene, frame, &truth, BlurMode::interleaved(n, Interleave::Two));
    }
    for (buckets, samples) in numbers.map(|n| (n, 4)).into_iter().chain([(1, 32), (8, 2)]) {
        row(
            asked,
            scene,
            frame,
            &truth,
            BlurMode::Bucket {
                buckets,
                samples,
                pixel_samples: None,
                interleave: Interleave::None,
                times: Times::Even,
            },
        );
    }
    let swept = |intervals, swept| BlurMode::Volumetric { intervals, pixel_samples: None, swept };
    for n in numbers {
        row(asked, scene, frame, &truth, swept(n, SweptKernel::default()));
    }
    let ellipsoid = SweptKernel { shape: KernelShape::Ellipsoid, ..SweptKernel::default() };
    let once = SweptKernel { normalise: Normalise::Once, ..SweptKernel::default() };
    for n in [1, 3, 10, 20] {
        for kernel in [ellipsoid, once, SweptKernel::PUBLISHED] {
            row(asked, scene, frame, &truth, swept(n, kernel));
        }
    }
}

/// Shipped scenes that move, each with a frame in the middle of things.
const SHIPPED: [(&str, i64); 8] = [
    ("diagonal", 12),
    ("crossing", 12),
    ("blinker", 5),
    ("blinker_fence", 5),
    ("spin", 5),
    ("three_objects", 5),
    ("toward_camera_and_sideways", 5),
    ("checkerboard", 5),
];

/// Temporal alpha on the shipped scenes: which pixels lie further from the reference than three of its standard errors
/// + 2/255.
fn alpha_of_shipped_scenes(asked: &Arguments) {
    println!("| scene | mode | partly covered pixels | beyond | worst, /255 | mean error there, /255 |");
    for (name, frame) in SHIPPED.into_iter().filter(|(name, _)| asked.scene(name)) {
        let mut scene = shipped(name);
        scene.image.transparent = true;
        let traced = ReferenceOptions {
            samples: 4096,
            look: Look { filter: PixelFilter::Point, ..Look::default() },
            ..ReferenceOptions::default()
        };
        let truth = splatblur::reference::render(&scene, frame, &traced, None, &|_| ()).unwrap().picture;
        let errors = &truth.layers.last().unwrap().planes[3];
        for mode in [
            BlurMode::supersample(256),
            BlurMode::Bucket {
                buckets: 64,
                samples: 4,
                pixel_samples: None,
                interleave: Interleave::None,
                times: Times::Even,
            },
            BlurMode::Volumetric { intervals: 16, pixel_samples: None, swept: SweptKernel::default() },
        ] {
            let options = RenderOptions {
                quality: mode.into(),
                prefilter: Prefilter::None,
                look: Look {
                    filter: PixelFilter::Point,
                    shading: Shading::Gouraud,
                    aovs: vec![Aov::Alpha],
                    ..Look::default()
                },
                ..RenderOptions::default()
            };
            let picture = render_frame(&mut Cpu::default(), &scene, frame, &options).unwrap().picture;
            let (mut partly, mut beyond, mut worst, mut sum) = (0_u32, Vec::new(), 0.0_f32, 0.0);
            for (i, (got, want)) in picture.layers[0].planes[0].iter().zip(&truth.rgba).enumerate() {
                let difference = 255.0 * (got - want[3]);
                if difference.abs() > 765.0 * errors[i] + 2.0 {
                    beyond.push((i % 480, i / 480, difference));
                    worst = worst.max(difference.abs());
                }
                if (1e-3..0.999).contains(&want[3]) {
                    partly += 1;
                    sum += f64::from(difference);
                }
            }
            println!("| {name} | {mode} | {partly} | {} | {worst:.1} | {:.3} |", beyond.len(), sum / f64::from(partly));
            beyond.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
            println!("{:.1?}", &beyond[..beyond.len().min(12)]);
        }
    }
}
