//! What levels of detail leave out of a picture, and what they save.
//!
//! `cargo run --release --example table_detail [-- TABLE...] [models=FOLDER] [scene=NAME]`. Tables:
//!
//! - `distances`: detail `good` beside all surfels: FLIP where something is seen, the share of surfels, and the stated
//!   error over the true one; models of five sizes, at rest and with paths of 4, 16 and 64 pixels;
//! - `volumes`: the same for clouds made of a seed, at details `draft`, `good` and `final`;
//! - `figures`: seconds of a frame after loading, for a figure 60 pixels tall of 10^4 to 10^7 surfels.
//!
//! `models`: a folder with two scans that do not ship, `guanyin.ply` and `pond_mvs.ply`. `scene`: one model alone, by
//! the name of its file. `seed`: another one for the clouds. The results stand in docs/measurements/levels.md.

#![allow(clippy::expect_used, clippy::print_stdout, reason = "a generator may stop, and prints its tables")]

mod support;

use std::path::{Path, PathBuf};
use std::time::Instant;

use splatblur::Surfels;
use splatblur::backend::cpu::Cpu;
use splatblur::compare::{encode, flip};
use splatblur::film::Picture;
use splatblur::glam::{DVec3, Vec3};
use splatblur::options::{BlurMode, Detail, RenderOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::{Camera, Object, Scene};
use splatblur::scene_file::{SceneLoadOptions, load};
use support::volumes::cloud;
use support::{Arguments, Random};

const SIZE: [u32; 2] = [480, 270];
const FOVY: f64 = 40.0;
/// Pixels that the longest side of a model has where its box is nearest; where it is farther away it has fewer.
const SIZES: [f64; 5] = [240.0, 120.0, 60.0, 30.0, 15.0];
/// Lengths of paths in the exposure, pixels.
const PATHS: [f64; 4] = [0.0, 4.0, 16.0, 64.0];
const SAMPLES: u32 = 64;

fn main() {
    let asked = Arguments::read(&["distances", "volumes", "figures"], &["models", "scene", "seed"]);
    if asked.table("distances") {
        distances(&asked);
    }
    if asked.table("volumes") {
        volumes(asked.value("seed").map_or(1, |seed| seed.parse().expect("a seed")));
    }
    if asked.table("figures") {
        figures();
    }
}

fn models(asked: &Arguments) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let own = ["scenes/models/CesiumMilkTruck.glb", "scenes/models/fuze.obj", "tests/data/models/BoxTextured.glb"];
    let mut models: Vec<PathBuf> = own.iter().map(|path| root.join(path)).collect();
    if let Some(folder) = asked.value("models") {
        models.extend(["guanyin.ply", "pond_mvs.ply"].map(|name| Path::new(folder).join(name)));
    }
    models
}

/// A model that is so long on the image, and gets on by `path` pixels while the shutter is open.
fn scene(model: &Path, long: f64, path: f64) -> Scene {
    let of = |eye: DVec3, at: DVec3, step: f64| {
        let text = format!(
            "<scene><image width=\"{}\" height=\"{}\" background=\"0.3 0.35 0.4\"/>\
             <shutter open=\"-0.5\" close=\"0.5\"/>\
             <camera eye=\"{} {} {}\" at=\"{} {} {}\" fovy=\"{FOVY}\" near=\"1e-4\"/>\
             <light type=\"directional\" direction=\"-0.5 -1 -0.7\" intensity=\"0.8\"/>\
             <light type=\"ambient\" intensity=\"0.3\"/>\
             <object><pointModel>{}</pointModel><motion type=\"linear\" velocity=\"{step} 0 0\"/></object></scene>",
            SIZE[0],
            SIZE[1],
            eye.x,
            eye.y,
            eye.z,
            at.x,
            at.y,
            at.z,
            model.display()
        );
        let file = std::env::temp_dir().join("splatblur_table_detail.xml");
        std::fs::write(&file, text).expect("room for a scene");
        load(&file, &SceneLoadOptions::default()).expect("a scene").scene
    };
    let bounds = of(DVec3::new(0.0, 0.0, 1e3), DVec3::ZERO, 0.0).objects[0].shape.bounds();
    let (middle, size) = (0.5 * (bounds.min + bounds.max), bounds.max - bounds.min);
    // Pixels of a length of 1 at a distance of 1.
    let focal = 0.5 * f64::from(SIZE[1]) / (0.5 * FOVY.to_radians()).tan();
    let away = size.max_element() * focal / long + 0.5 * size.length();
    let eye = middle + DVec3::new(0.25, 0.3, 1.0).normalize() * away;
    of(eye, middle, path * away / focal)
}

fn render(scene: &Scene, detail: Detail) -> (Picture, u64, f64) {
    let options = RenderOptions { quality: BlurMode::supersample(SAMPLES).into(), detail, ..RenderOptions::default() };
    let rendered = render_frame(&mut Cpu::default(), scene, 0, &options).expect("a picture");
    (rendered.picture, rendered.stats.surfels, rendered.stats.detail)
}

fn distances(asked: &Arguments) {
    println!("| model, pixels | {} |", PATHS.map(|path| format!("path of {path}")).join(" | "));
    println!("|---|{}", "---|".repeat(PATHS.len()));
    let mut worst: f64 = 0.0;
    for model in models(asked) {
        let name = model.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if !asked.scene(&name) {
            continue;
        }
        for long in SIZES {
            let cells = PATHS.map(|path| {
                let scene = scene(&model, long, path);
                let [(full, all, _), (good, some, stated)] = [Detail::Full, Detail::Good].map(|of| render(&scene, of));
                let (error, rms) = differences(&good, &full);
                worst = worst.max(error);
                format!("{error:.4}, {:.3}, {:.1}", some as f64 / all as f64, stated / rms)
            });
            println!("| *{name}* {long} | {} |", cells.join(" | "));
        }
    }
    println!("\nworst: {worst:.4}");
}

/// Clouds of the table of volumes.
const CLOUDS: u64 = 40;

fn volumes(seed: u64) {
    let details = [Detail::Draft, Detail::Good, Detail::Final];
    println!("| cells, pixels | kernels | {} |", details.map(Detail::word).join(" | "));
    println!("|---|---:|{}", "---|".repeat(details.len()));
    let mut ratios = Vec::new();
    for i in 0..CLOUDS {
        let mut random = Random(seed.wrapping_mul(1_000_003).wrapping_add(i));
        let cells = random.within(24.0, 80.0) as u32;
        let model = cloud(&mut random, cells);
        let (kernels, pixels) = (model.len(), f64::from(cells) * random.within(0.15, 1.0));
        let mut scene = Scene::new([Object::from_gaussians(model).expect("a cloud")]);
        (scene.image.width, scene.image.height) = (128, 128);
        scene.image.background = DVec3::splat(random.next());
        let focal = 64.0 / (0.5 * scene.camera.fovy).tan();
        // The larger it is, the less light gets through.
        let scale = 3_f64.powf(random.within(-1.0, 1.0));
        scene.objects[0].transform.scale = DVec3::splat(scale);
        scene.camera = Camera::new(random.direction() * (scale * (2.0 * focal / pixels + 1.0)), DVec3::ZERO);
        let (full, all, _) = render(&scene, Detail::Full);
        let cells_of = details.map(|detail| {
            let (made, some, stated) = render(&scene, detail);
            if some == all {
                return "all".to_owned();
            }
            let (error, rms) = differences(&made, &full);
            ratios.push(stated / rms);
            format!("{error:.4}, {:.3}, {:.1}", some as f64 / all as f64, stated / rms)
        });
        println!("| {cells}, {pixels:.0} | {kernels} | {} |", cells_of.join(" | "));
    }
    ratios.sort_by(f64::total_cmp);
    let covered = ratios.iter().filter(|&&ratio| ratio >= 1.0).count();
    let [tenth, median, last] = [1, 5, 9].map(|tenth| ratios[ratios.len() * tenth / 10]);
    println!("\nstated over true: covered {covered} of {}, {tenth:.2}, {median:.2}, {last:.2}", ratios.len());
}

/// The mean of FLIP over the pixels that are seen in either picture, and the root mean square of all display values.
fn differences(a: &Picture, b: &Picture) -> (f64, f64) {
    let map = flip::map(a, b).expect("pictures of one size");
    // The corner shows the background.
    let seen = |i: usize| a.rgba[i] != a.rgba[0] || b.rgba[i] != b.rgba[0];
    let of_seen: Vec<f64> = map.iter().enumerate().filter(|(i, _)| seen(*i)).map(|(_, x)| f64::from(*x)).collect();
    let [a, b] = [a, b].map(encode);
    let squares: f64 = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    let values = a.iter().map(Vec::len).sum::<usize>();
    (of_seen.iter().sum::<f64>() / of_seen.len().max(1) as f64, (squares / values as f64).sqrt())
}

/// Points of a knobbly ball.
fn figure(count: u32) -> Surfels {
    let turn = std::f64::consts::PI * (3.0 - 5_f64.sqrt());
    let place = |i: u32| {
        let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
        let (sin, cos) = (turn * f64::from(i)).sin_cos();
        let on_ball = DVec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z);
        on_ball * (1.0 + 0.1 * (5.0 * on_ball.x).sin() * (4.0 * on_ball.y).cos())
    };
    let colour = |i: u32| {
        let p = place(i);
        Vec3::splat(if (6.0 * p.x).sin() * (6.0 * p.y).sin() * (6.0 * p.z).sin() > 0.0 { 0.7 } else { 0.2 })
    };
    let normals = (0..count).map(|i| place(i).normalize().as_vec3());
    Surfels::builder((0..count).map(place))
        .normals(normals)
        .colours((0..count).map(colour))
        .build()
        .expect("a figure")
        .0
}

fn figures() {
    println!("| surfels | full, s | good, s | first frame, s | FLIP where seen |\n|---:|---:|---:|---:|---:|");
    for count in [10_000, 100_000, 1_000_000, 10_000_000] {
        let mut scene = Scene::new([Object::new(figure(count))]);
        (scene.image.width, scene.image.height) = (SIZE[0], SIZE[1]);
        let focal = 0.5 * f64::from(SIZE[1]) / (0.5 * scene.camera.fovy).tan();
        scene.camera = Camera::new(DVec3::new(0.0, 0.0, 2.2 * focal / 60.0), DVec3::ZERO);
        let timed = |detail| {
            let begin = Instant::now();
            let made = render(&scene, detail).0;
            (made, begin.elapsed().as_secs_f64())
        };
        let first = timed(Detail::Good).1;
        let [full, good] = [Detail::Full, Detail::Good]
            .map(|detail| (0..3).map(|_| timed(detail)).min_by(|a, b| a.1.total_cmp(&b.1)).expect("three"));
        let error = differences(&good.0, &full.0).0;
        println!("| {count} | {:.3} | {:.3} | {first:.2} | {error:.4} |", full.1, good.1);
    }
}
