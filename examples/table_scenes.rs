//! Price and error of a picture of each shipped scene, as tables.
//!
//! `cargo run --release --example table_scenes [-- TABLE... [scene=NAME] [mode=MODE] [prefilter=none|approx|ewa]
//! [truth=SAMPLES] [random=SEED,COUNT]]`
//!
//! Table `prices`: two frames of each scene at 480 x 270, by default in mode auto as `render` makes them. All seconds
//! are of one processor: of passes as the CPU backend counts them, and of the whole frame. FLIP is at 67 pixels a
//! degree, over the blocks of 32 x 32 pixels that something covers; *worst* is the mean of the worst twentieth of
//! them. *RMSE* is that of the display values in the worst block. *Uniform* is the cheapest number of plain time
//! samples (8, 12, .. 128, with the prefilter `none` or `ewa`) with no more of *worst* and *RMSE*, and the frame's
//! seconds over its seconds. *Noise* are *FLIP* and *worst* for two references of other seeds: errors below twice that
//! are not judged, and stand in brackets. The last two columns are the cheapest reference (16, 32, .. samples) that is
//! as near to the truth, in the mean and in the worst blocks, and its seconds without its tree.
//!
//! Table `plain`: the price of these frames beside plain time samples alone. The truth is 768 plain samples of another
//! seed without a filter, which takes seconds, and shares kernels and tolerance with the pictures. `random=SEED,COUNT`:
//! of random scenes instead. *Uniform* has up to 64 samples.
//!
//! Table `modes`: FLIP, *worst* and seconds of the first of these frames in each blur mode. Below it, for each mode,
//! the geometric means of their ratios to those of `supersample:32` (docs/modes.md), over the scenes that it takes.
//!
//! The truth has 1024 samples (`truth=`), from an earlier run where there is one (`target/tables`). The first run
//! takes long, because it traces two references of each frame.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a generator may stop, and prints its tables")]

mod support;

use std::sync::LazyLock;
use std::time::Instant;

use splatblur::backend::cpu::Cpu;
use splatblur::backend::{Backend, BackendError, Rendered, Stats};
use splatblur::compare::flip;
use splatblur::film::{Aov, Picture};
use splatblur::options::{BlurMode, ErrorTarget, Look, Prefilter, Quality, RenderOptions};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::Scene;

use support::Arguments;
use support::blocks::{EDGE, means, worst_block, worst_twentieth};
use support::random_scenes::{Models, random_hard};
use support::scenes::{converged, kept, names_of_shipped, shipped, two_frames};

/// For FLIP.
const PIXELS_PER_DEGREE: f64 = 67.0;
/// Numbers of plain time samples.
const UNIFORM: [u32; 9] = [8, 12, 16, 24, 32, 48, 64, 96, 128];
/// Most of them in table `plain`.
const MOST_PLAIN: u32 = 64;
/// The mode beside which table `modes` puts the others.
const USUAL: &str = "supersample:32";
/// Most samples of a reference that is as near to the truth as a picture.
const MOST: u64 = 256;

fn main() {
    let asked = Arguments::read(&["prices", "plain", "modes"], &["scene", "mode", "prefilter", "truth", "random"]);
    let mut options = RenderOptions::default();
    if let Some(mode) = asked.value("mode") {
        options.quality = mode.parse::<BlurMode>().unwrap().into();
    }
    if let Some(prefilter) = asked.value("prefilter") {
        options.prefilter = prefilter.parse().unwrap();
    }
    let samples = asked.value("truth").map_or(1024, |samples| samples.parse().unwrap());
    let mut names = names_of_shipped();
    names.push("four_meshes".to_owned());
    names.retain(|name| asked.scene(name));
    // Then the clock is that of the processor.
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    if asked.table("prices") {
        println!(concat!(
            "| scene | project | visibility | attribute | composite | resolve | frame, s | splats, M | ns a splat | ",
            "ns a covered pixel | waste | samples | FLIP | worst | RMSE | uniform | noise | reference | its s |"
        ));
        println!("|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|---:|---:|---:|---|---|---:|---:|");
        for scene in names.iter().map(|name| shipped(name)) {
            for frame in two_frames(&scene) {
                let truths = [77, 78].map(|seed| truth(&scene, frame, &options, samples, seed));
                one.install(|| row(&scene, frame, &options, &truths));
            }
        }
    }
    if asked.table("plain") {
        let scenes: Vec<Scene> = match asked.value("random").and_then(|value| value.split_once(',')) {
            Some((seed, count)) => {
                let (models, seed) = (Models::load(), seed.parse().unwrap());
                (0..count.parse().unwrap()).map(|index| random_hard(&models, seed, index)).collect()
            }
            None => names.iter().map(|name| shipped(name)).collect(),
        };
        println!("| scene | s | samples | refined | FLIP | worst | RMSE | uniform |");
        println!("|---|---:|---|---:|---:|---:|---:|---|");
        for scene in scenes {
            let frames = if asked.value("random").is_some() { vec![0] } else { two_frames(&scene) };
            for frame in frames {
                let unfiltered = RenderOptions { prefilter: Prefilter::None, ..options.clone() };
                let truth = converged(&scene, frame, &unfiltered, "plain");
                one.install(|| plain_row(&scene, frame, &options, &truth));
            }
        }
    }
    if asked.table("modes") {
        let modes = modes();
        println!("| scene | {} |", modes.each_ref().map(|(name, _)| *name).join(" | "));
        println!("|---|{}", "---|".repeat(modes.len()));
        let mut all = Vec::new();
        for scene in names.iter().map(|name| shipped(name)) {
            let frame = two_frames(&scene)[0];
            let truth = truth(&scene, frame, &options, samples, 77);
            let covered = covered_blocks(&truth);
            let measured = modes.each_ref().map(|(_, quality)| {
                let options = RenderOptions { quality: *quality, ..options.clone() };
                let (rendered, seconds) = one.install(|| timed(&scene, frame, &options)).ok()?;
                let map = flip::map_at(&rendered.picture, &truth, PIXELS_PER_DEGREE).unwrap();
                let [mean, worst] = judged(&map, truth.width as usize, &covered);
                Some([mean, worst, seconds])
            });
            let cell = |of: &Option<[f64; 3]>| {
                of.map_or_else(|| "-".into(), |[mean, worst, seconds]| format!("{mean:.4} {worst:.3} {seconds:.2}"))
            };
            println!("| *{}* {frame} | {} |", scene.name, measured.each_ref().map(cell).join(" | "));
            all.push(measured);
        }
        println!("\n| mode | FLIP | worst | seconds | scenes |\n|---|---:|---:|---:|---:|");
        let usual = modes.iter().position(|(name, _)| *name == USUAL).unwrap();
        for (mode, (name, _)) in modes.iter().enumerate() {
            let ratios: Vec<[f64; 3]> = all
                .iter()
                .filter_map(|of| of[mode].zip(of[usual]))
                .map(|(of, usual)| [0, 1, 2].map(|what| of[what] / usual[what]))
                .collect();
            let mean = |what: usize| {
                let sum: f64 = ratios.iter().map(|of| of[what].ln()).sum();
                format!("{:.2}", (sum / ratios.len() as f64).exp())
            };
            println!("| `{name}` | {} | {} |", [0, 1, 2].map(mean).join(" | "), ratios.len());
        }
    }
}

/// The blur modes that are held side by side.
fn modes() -> [(&'static str, Quality); 11] {
    let error = |error: f64| Quality::from(ErrorTarget { error, ..ErrorTarget::default() });
    let mode = |name: &'static str| (name, name.parse::<BlurMode>().unwrap().into());
    [
        ("draft", error(2.0 * ErrorTarget::GOOD)),
        ("good", error(ErrorTarget::GOOD)),
        ("final", error(0.5 * ErrorTarget::GOOD)),
        mode("supersample:8"),
        mode("supersample:16"),
        mode("supersample:32"),
        mode("supersample:8+interleave=2"),
        mode("bucket:8x4"),
        mode("volumetric:1"),
        mode("volumetric:3"),
        mode("volumetric:10"),
    ]
}

/// A reference with its alpha.
fn truth(scene: &Scene, frame: i64, options: &RenderOptions, samples: u64, seed: u64) -> Picture {
    kept(&format!("{}_{frame}_scenes_{seed}_{samples}", scene.name), || {
        let asked = ReferenceOptions::like(options, samples);
        let look = Look { seed, aovs: vec![Aov::Alpha], ..asked.look };
        reference::picture(scene, frame, &ReferenceOptions { look, ..asked }).unwrap()
    })
}

fn row(scene: &Scene, frame: i64, options: &RenderOptions, truths: &[Picture; 2]) {
    let (rendered, seconds) = timed(scene, frame, options).unwrap();
    let stats = rendered.stats;
    let counted = counted(scene, frame, options);
    let [truth, other] = truths;
    let covered = covered_blocks(truth);
    let error = |picture: &Picture, truth: &Picture| {
        judged(&flip::map_at(picture, truth, PIXELS_PER_DEGREE).unwrap(), picture.width as usize, &covered)
    };
    let (found, noise) = (error(&rendered.picture, truth), error(other, truth));
    let shown =
        |i: usize| if found[i] < 2.0 * noise[i] { format!("({:.4})", found[i]) } else { format!("{:.4}", found[i]) };
    let (reference, its) = as_near(scene, frame, options, &|picture| {
        let reached = error(picture, truth);
        reached[0] <= found[0] && reached[1] <= found[1]
    });
    let rmse = worst_block(&rendered.picture, truth, EDGE);
    let is_as_good =
        |picture: &Picture| error(picture, truth)[1] <= found[1] && worst_block(picture, truth, EDGE) <= rmse;
    let uniform = cheapest_uniform(scene, frame, options, UNIFORM[UNIFORM.len() - 1], &is_as_good, seconds);
    let by =
        stats.achieved.map_or_else(|| stats.samples.to_string(), |a| format!("{} to {}", a.samples, a.most_samples));
    let each = |count: u64| if count == 0 { "-".to_owned() } else { format!("{:.0}", 1e9 * seconds / count as f64) };
    let times =
        [stats.project + stats.sort + stats.bin, stats.visibility, stats.attribute, stats.composite, stats.resolve];
    let mut cells = vec![format!("*{}* {frame}", scene.name)];
    cells.extend(times.map(|time| format!("{:.3}", time.as_secs_f64())));
    cells.extend([format!("{seconds:.3}"), format!("{:.2}", stats.splats as f64 * 1e-6)]);
    cells.push(each(stats.splats));
    cells.push(each(counted.waste.attribute.covered + counted.waste.composite.covered));
    cells.push(counted.waste.attribute.waste().map_or_else(|| "-".to_owned(), |waste| format!("{waste:.1}")));
    cells.extend([
        by,
        shown(0),
        shown(1),
        format!("{rmse:.4}"),
        uniform,
        format!("{:.4} / {:.4}", noise[0], noise[1]),
        reference,
        its,
    ]);
    println!("| {} |", cells.join(" | "));
}

/// A row of table `plain`.
fn plain_row(scene: &Scene, frame: i64, options: &RenderOptions, truth: &Picture) {
    let (rendered, seconds) = timed(scene, frame, options).unwrap();
    // Covered is what differs from the picture's corner.
    let differs: Vec<f32> = truth.rgba.iter().map(|pixel| if *pixel == truth.rgba[0] { 0.0 } else { 1.0 }).collect();
    let covered: Vec<bool> = means(&differs, truth.width as usize).iter().map(|&mean| mean > 0.0).collect();
    let error = |picture: &Picture| {
        let map = flip::map_at(picture, truth, PIXELS_PER_DEGREE).unwrap();
        let [mean, worst] = judged(&map, truth.width as usize, &covered);
        [mean, worst, worst_block(picture, truth, EDGE)]
    };
    let found = error(&rendered.picture);
    let is_as_good = |picture: &Picture| {
        let reached = error(picture);
        reached[1] <= found[1] && reached[2] <= found[2]
    };
    let uniform = cheapest_uniform(scene, frame, options, MOST_PLAIN, &is_as_good, seconds);
    let by = rendered
        .stats
        .achieved
        .map_or_else(String::new, |a| format!("{} to {} | {} of {}", a.samples, a.most_samples, a.refined, a.blocks));
    println!(
        "| *{}* {frame} | {seconds:.3} | {by} | {:.4} | {:.4} | {:.4} | {uniform} |",
        scene.name, found[0], found[1], found[2]
    );
}

/// The cheapest plain time samples that are as good, and how many times their seconds `seconds` are.
fn cheapest_uniform(
    scene: &Scene,
    frame: i64,
    options: &RenderOptions,
    most: u32,
    is_as_good: &dyn Fn(&Picture) -> bool,
    seconds: f64,
) -> String {
    let first = |prefilter: Prefilter| {
        UNIFORM.into_iter().filter(|&samples| samples <= most).find_map(|samples| {
            let options =
                RenderOptions { quality: BlurMode::supersample(samples).into(), prefilter, ..options.clone() };
            let (rendered, its) = timed(scene, frame, &options).unwrap();
            is_as_good(&rendered.picture).then(|| (its, format!("{samples} {prefilter}")))
        })
    };
    let cheapest = [Prefilter::None, Prefilter::Ewa].into_iter().filter_map(first).min_by(|a, b| a.0.total_cmp(&b.0));
    cheapest.map_or_else(|| format!("above {most}"), |(its, by)| format!("{by}: {:.2}", seconds / its))
}

/// A frame, and the seconds that it takes after another one of the same scene: the smaller of two.
fn timed(scene: &Scene, frame: i64, options: &RenderOptions) -> Result<(Rendered, f64), BackendError> {
    let mut cpu = Cpu::default();
    let mut render = || {
        let start = processor_seconds();
        let rendered = render_frame(&mut cpu, scene, frame, options)?;
        Ok::<_, BackendError>((rendered, processor_seconds() - start))
    };
    render()?;
    let (first, second) = (render()?, render()?);
    Ok(if first.1 < second.1 { first } else { second })
}

/// Seconds that this thread has had a processor. Where the system does not tell, those of the clock.
fn processor_seconds() -> f64 {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| START.elapsed().as_secs_f64(), |nanoseconds| 1e-9 * nanoseconds)
}

/// The same frame once more, with what bounds of splats waste. Counting takes time, so it is not timed.
fn counted(scene: &Scene, frame: i64, options: &RenderOptions) -> Stats {
    let mut cpu = Cpu::default();
    cpu.count_waste();
    render_frame(&mut cpu, scene, frame, options).unwrap().stats
}

/// Samples and seconds of the cheapest reference that is near enough.
fn as_near(scene: &Scene, frame: i64, options: &RenderOptions, near: &dyn Fn(&Picture) -> bool) -> (String, String) {
    let mut samples = 16;
    while samples <= MOST {
        let made = reference::render(scene, frame, &ReferenceOptions::like(options, samples), None, &|_| ()).unwrap();
        if near(&made.picture) {
            return (samples.to_string(), format!("{:.2}", made.stats.trace.as_secs_f64()));
        }
        samples *= 2;
    }
    (format!("above {MOST}"), "-".to_owned())
}

/// The blocks that something covers.
fn covered_blocks(truth: &Picture) -> Vec<bool> {
    let alpha = &truth.layers.iter().find(|layer| layer.aov == Aov::Alpha).unwrap().planes[0];
    means(alpha, truth.width as usize).iter().map(|&mean| mean > 0.0).collect()
}

/// Mean of a map over the covered blocks, and over the worst twentieth of them.
fn judged(map: &[f32], width: usize, covered: &[bool]) -> [f64; 2] {
    let all = means(map, width).into_iter().zip(covered);
    let judged: Vec<f64> = all.filter(|(_, covered)| **covered).map(|(mean, _)| mean).collect();
    [judged.iter().sum::<f64>() / judged.len().max(1) as f64, worst_twentieth(judged)]
}
