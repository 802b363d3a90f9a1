//! Does mode auto look right? What eyes see and a mean misses, on shipped and on random scenes.
//!
//! `cargo run --release --example auto_look [-- shipped] [random] [scene=NAME] [seed=N] [scenes=N] [error=E]
//! [mode=MODE] [out=FOLDER]`
//!
//! For each picture: FLIP in the worst twentieth of blocks of 32 x 32 pixels; mean steps across the borders of blocks
//! over those two pixels beside them, of the picture and of the truth; seconds. The truth is supersampling with 768
//! samples and another seed; it is kept in `target/tables`. `mode=MODE` looks at another mode instead. `out=FOLDER`
//! writes each picture above its truth.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a generator may stop, and prints its tables")]

mod support;

use std::path::Path;
use std::time::Instant;

use splatblur::backend::cpu::Cpu;
use splatblur::compare::{encode, flip, gamma_rmse};
use splatblur::film::Picture;
use splatblur::options::{ErrorTarget, Quality, RenderOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::Scene;
use support::Arguments;
use support::blocks::{EDGE, means, worst_twentieth};
use support::random_scenes::{Models, random};
use support::scenes::{converged, names_of_shipped, shipped, two_frames};

/// Frames of shipped scenes that are looked at beside two of each: motion that turns, and stripes.
const MORE: [(&str, i64); 5] =
    [("blinker_fence", 0), ("crossing", 9), ("three_objects", 20), ("three_objects", 25), ("three_objects", 31)];

fn main() {
    let asked = Arguments::read(&["shipped", "random"], &["scene", "seed", "scenes", "error", "mode", "out"]);
    let number = |key: &str, default: u64| asked.value(key).map_or(default, |text| text.parse().unwrap());
    let error = asked.value("error").map_or(ErrorTarget::GOOD, |text| text.parse().unwrap());
    let quality = Quality::Error(ErrorTarget { error, ..ErrorTarget::default() });
    let quality = asked.value("mode").map_or(quality, |text| text.parse().unwrap());
    println!(
        "| scene | FLIP | FLIP, worst twentieth | RMSE | stated | steps at borders | of the truth | s | samples |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let out = asked.value("out").map(Path::new);
    if asked.table("shipped") {
        let names = names_of_shipped().into_iter().chain(["four_meshes".to_owned()]);
        for name in names.filter(|name| asked.scene(name)) {
            let scene = shipped(&name);
            let more = MORE.into_iter().filter(|(of, _)| *of == name).map(|(_, frame)| frame);
            for frame in two_frames(&scene).into_iter().chain(more) {
                row(&scene, frame, quality, out);
            }
        }
    }
    if asked.table("random") {
        let models = Models::load();
        let seed = number("seed", 4);
        for index in 0..number("scenes", 20) {
            let mut scene = random(&models, seed, index);
            if asked.scene(&scene.name) {
                (scene.image.width, scene.image.height) = (480, 270);
                row(&scene, 0, quality, out);
            }
        }
    }
}

fn row(scene: &Scene, frame: i64, quality: Quality, out: Option<&Path>) {
    let mut cpu = Cpu::default();
    let truth =
        converged(scene, frame, &RenderOptions::default(), &format!("look_{}", RenderOptions::default().prefilter));
    let options = RenderOptions { quality, ..RenderOptions::default() };
    let start = Instant::now();
    let rendered = render_frame(&mut cpu, scene, frame, &options).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let picture = &rendered.picture;
    let map = flip::map(picture, &truth).unwrap();
    let mean = map.iter().map(|&value| f64::from(value)).sum::<f64>() / map.len() as f64;
    let achieved = rendered.stats.achieved;
    let by = achieved.map_or_else(
        || quality.to_string(),
        |a| format!("{}..{} S {}, {} of {}", a.samples, a.most_samples, a.interleave, a.refined, a.blocks),
    );
    println!(
        "| {} {frame} | {mean:.4} | {:.4} | {:.4} | {:.4} | {:.2} | {:.2} | {seconds:.2} | {by} |",
        scene.name,
        worst_twentieth(means(&map, picture.width as usize)),
        gamma_rmse(picture, &truth).unwrap(),
        achieved.map_or(0.0, |achieved| achieved.error),
        steps_at_borders(picture),
        steps_at_borders(&truth),
    );
    if let Some(folder) = out {
        std::fs::create_dir_all(folder).unwrap();
        let both = Picture {
            height: 2 * picture.height,
            rgba: picture.rgba.iter().chain(&truth.rgba).copied().collect(),
            layers: Vec::new(),
            ..*picture
        };
        both.write(folder.join(format!("{}_{frame}.png", scene.name))).unwrap();
    }
}

/// Mean step of display values from a pixel to the next across borders of blocks, over that two pixels beside them.
fn steps_at_borders(picture: &Picture) -> f64 {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let planes = encode(picture);
    let step =
        |from: usize, to: usize| planes.iter().map(|plane| f64::from((plane[from] - plane[to]).abs())).sum::<f64>();
    let column = |x: usize| (0..height).map(|y| step(y * width + x - 1, y * width + x)).sum::<f64>();
    let row = |y: usize| (0..width).map(|x| step((y - 1) * width + x, y * width + x)).sum::<f64>();
    let sums = |of: &dyn Fn(usize) -> f64, size: usize| {
        let borders = (EDGE..size - 2).step_by(EDGE);
        borders.fold([0.0, 0.0], |[at, beside], i| [at + of(i), beside + 0.5 * (of(i - 2) + of(i + 2))])
    };
    let ([x_at, x_beside], [y_at, y_beside]) = (sums(&column, width), sums(&row, height));
    if x_beside + y_beside > 0.0 { (x_at + y_at) / (x_beside + y_beside) } else { 1.0 }
}
