//! Does mode auto keep its promises? Stated and true errors on random scenes.
//!
//! `cargo run --release --example auto_coverage [-- seed=N] [scenes=N] [prefilter=approx] [list=yes]
//! [kind=plain|hard|lit|captures] [truth=reference] [detail=full]`
//!
//! For each target: the share of scenes whose stated error is at least the true one, the median of stated / true, the
//! share of scenes without a block beyond 1.1 E, and the samples of a pixel. The truth is supersampling with 768
//! samples and another seed; it is kept in `target/tables`. `list=yes` prints a line a scene. With `truth=reference`
//! two ray-traced references of 256 samples judge, whose noise falls out of the mean of (A - R) (A - S).

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a generator may stop, and prints its tables")]

mod support;

use splatblur::backend::Achieved;
use splatblur::backend::cpu::Cpu;
use splatblur::compare::{encode, gamma_rmse};
use splatblur::film::{Aov, Picture};
use splatblur::options::{Detail, ErrorTarget, Look, Prefilter, Quality, RenderOptions};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::Scene;
use support::Arguments;
use support::blocks::worst_block;
use support::random_scenes::{Models, random, random_hard, random_lit, random_with_captures};
use support::scenes::{converged, kept};

/// Targets: draft, good and final.
const ERRORS: [f64; 3] = [0.05, 0.025, 0.0125];

/// What one scene showed at one target.
struct Seen {
    stated: f64,
    truth: f64,
    /// Largest error of a block, over the target.
    worst: f64,
    /// Mean samples of a pixel.
    samples: f64,
    splats: u64,
}

fn main() {
    let asked = Arguments::read(&[], &["seed", "scenes", "prefilter", "kind", "list", "truth", "detail"]);
    let number = |key: &str, default: u64| asked.value(key).map_or(default, |text| text.parse().unwrap());
    let (seed, scenes) = (number("seed", 1), number("scenes", 200));
    let prefilter: Prefilter = asked.value("prefilter").map_or_else(Prefilter::default, |text| text.parse().unwrap());
    let detail: Detail = asked.value("detail").map_or_else(Detail::default, |text| text.parse().unwrap());
    let of_kind = match asked.value("kind").unwrap_or("hard") {
        "plain" => random,
        "lit" => random_lit,
        "captures" => random_with_captures,
        _ => random_hard,
    };
    let models = Models::load();
    let mut cpu = Cpu::default();
    let mut seen: [Vec<Seen>; 3] = [Vec::new(), Vec::new(), Vec::new()];
    for index in 0..scenes {
        let scene = of_kind(&models, seed, index);
        let options = RenderOptions { prefilter, detail, ..RenderOptions::default() };
        let truths = if asked.value("truth") == Some("reference") {
            [1, 2].map(|seed| traced(&scene, seed)).to_vec()
        } else {
            vec![converged(&scene, 0, &options, &prefilter.to_string())]
        };
        for (error, seen) in ERRORS.into_iter().zip(&mut seen) {
            let (of_scene, achieved) = look(&mut cpu, &scene, &options, error, &truths);
            if asked.value("list").is_some() {
                println!(
                    "{index} E {error}: stated {:.5} true {:.5} ratio {:.2} worst {:.2} samples {:.1} | {:.0} px, \
                     {}..{}, S {}, {} of {} refined, {} capped, {:?}",
                    of_scene.stated,
                    of_scene.truth,
                    of_scene.stated / of_scene.truth,
                    of_scene.worst,
                    of_scene.samples,
                    achieved.path_length,
                    achieved.samples,
                    achieved.most_samples,
                    achieved.interleave,
                    achieved.refined,
                    achieved.blocks,
                    achieved.capped,
                    scene.shutter.weight,
                );
            }
            seen.push(of_scene);
        }
    }
    println!("seed {seed}, {scenes} scenes, prefilter {prefilter}, detail {detail}");
    println!(
        "| E | stated >= true | median of stated/true | no block over 1.1 E | worst block / E | samples | splats |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for (error, seen) in ERRORS.into_iter().zip(&seen) {
        // Where nothing is seen, both are 0.
        let covered = seen.iter().filter(|seen| seen.stated >= seen.truth - 1e-6).count();
        let mut ratios: Vec<f64> =
            seen.iter().filter(|seen| seen.truth > 1e-5).map(|seen| seen.stated / seen.truth).collect();
        ratios.sort_by(f64::total_cmp);
        let kept = seen.iter().filter(|seen| seen.worst <= 1.1).count();
        let worst = seen.iter().map(|seen| seen.worst).fold(0.0, f64::max);
        let samples: f64 = seen.iter().map(|seen| seen.samples).sum::<f64>() / seen.len() as f64;
        let splats: u64 = seen.iter().map(|seen| seen.splats).sum();
        println!(
            "| {error} | {covered} of {} | {:.2} (5 %: {:.2}, 95 %: {:.2}) | {kept} of {} | {worst:.2} | \
             {samples:.1} | {:.1} M |",
            seen.len(),
            ratios[ratios.len() / 2],
            ratios[ratios.len() / 20],
            ratios[ratios.len() * 19 / 20],
            seen.len(),
            splats as f64 / 1e6,
        );
    }
}

/// A reference.
fn traced(scene: &Scene, seed: u64) -> Picture {
    kept(&format!("{}_0_reference_256_{seed}", scene.name), || {
        let look = Look { seed, ..Look::default() };
        let options = ReferenceOptions { samples: 256, look, ..ReferenceOptions::default() };
        reference::picture(scene, 0, &options).unwrap()
    })
}

/// Root mean square of the differences of display values of a picture and the truth. Of two truths each has noise of
/// its own.
fn true_error(picture: &Picture, truths: &[Picture]) -> f64 {
    let [first, second] = truths else { return gamma_rmse(picture, &truths[0]).unwrap() };
    let (picture, first, second) = (encode(picture), encode(first), encode(second));
    let channels = picture.iter().zip(&first).zip(&second);
    let products = channels
        .flat_map(|((p, a), b)| p.iter().zip(a.iter().zip(b)).map(|(p, (a, b))| f64::from(p - a) * f64::from(p - b)));
    let (sum, n) = products.fold((0.0, 0_u32), |(sum, n), product| (sum + product, n + 1));
    (sum.max(0.0) / f64::from(n)).sqrt()
}

fn look(cpu: &mut Cpu, scene: &Scene, options: &RenderOptions, error: f64, truths: &[Picture]) -> (Seen, Achieved) {
    let quality = Quality::Error(ErrorTarget { error, ..ErrorTarget::default() });
    let options =
        RenderOptions { quality, look: Look { aovs: vec![Aov::Samples], ..options.look.clone() }, ..options.clone() };
    let rendered = render_frame(cpu, scene, 0, &options).unwrap();
    let achieved = rendered.stats.achieved.unwrap();
    let samples = &rendered.picture.layers[0].planes[0];
    let seen = Seen {
        stated: achieved.error,
        truth: true_error(&rendered.picture, truths),
        worst: worst_block(&rendered.picture, &truths[0], 32 * achieved.interleave as usize) / error,
        samples: samples.iter().map(|&n| f64::from(n)).sum::<f64>() / samples.len() as f64,
        splats: rendered.stats.splats,
    };
    (seen, achieved)
}
