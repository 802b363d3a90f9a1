//! One run: a seed is damaged, read, and rendered where it can be read.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use splatblur::backend::cpu::Cpu;
use splatblur::film::Aov;
use splatblur::options::{Look, Quality, RenderOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::Scene;
use splatblur::{image, scene_file};

use super::mutate::{self, Dice};
use super::seeds::{Seed, Way, seeds};

/// Modes of the small picture, most of them the cheapest.
const MODES: [&str; 6] = ["supersample:2", "supersample:2", "supersample:2", "still:1", "bucket:2x2", "volumetric:2"];

/// Width and height of the picture.
const SIZE: (u32, u32) = (24, 16);

/// How a run ended well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outcome {
    Refused,
    Rendered,
}

/// Plants a fault in a run, to see that it is found.
pub(crate) fn plant(kind: &str) -> Result<Outcome, String> {
    match kind {
        "panic" => panic!("planted"),
        "overflow" => {
            let big = std::hint::black_box(u32::MAX);
            Err(format!("{} is no sum", big + 1))
        }
        "hang" => loop {
            std::thread::sleep(Duration::from_secs(1));
        },
        "abort" => std::process::abort(),
        "memory" => {
            let many = vec![1_u8; std::hint::black_box(1 << 40)];
            Err(format!("{} bytes were there", many.len()))
        }
        "nan" => check(&[[0.0, 1.0, f32::NAN, 1.0]], "picture").map(|()| Outcome::Rendered),
        other => Err(format!("nothing to plant: {other}")),
    }
}

/// All seeds, read once.
pub(crate) struct Runs {
    groups: Vec<Vec<Seed>>,
}

impl Runs {
    pub(crate) fn new() -> Self {
        Self { groups: seeds() }
    }

    /// All seeds as they are.
    pub(crate) fn all(&self) -> impl Iterator<Item = &Seed> {
        self.groups.iter().flatten()
    }

    /// The damaged input of a run.
    pub(crate) fn input(&self, seed: u64, number: u64) -> Seed {
        let mut dice = Dice::new(seed, number);
        let group = dice.pick(&self.groups);
        let mut input = dice.pick(group);
        // What is refused as it is seldom becomes more.
        while input.name.contains("bad-") && !dice.once_in(6) {
            input = dice.pick(group);
        }
        let mut input = input.clone();
        let others: Vec<&[u8]> = group.iter().map(|other| other.files[other.target].1.as_slice()).collect();
        let target = &mut input.files[input.target].1;
        *target = mutate::damage(std::mem::take(target), &others, &mut dice);
        input
    }

    /// Reads and renders it in a folder.
    pub(crate) fn run(input: &Seed, seed: u64, number: u64, folder: &Path) -> Result<Outcome, String> {
        for (name, bytes) in &input.files {
            fs::write(folder.join(name), bytes).map_err(|error| error.to_string())?;
        }
        let path = folder.join(&input.files[0].0);
        // Not those that the damage came from.
        let mut dice = Dice::new(seed ^ 0x5eed, number);
        let options = scene_file::SceneLoadOptions {
            lenient: dice.once_in(2),
            size: Some(SIZE),
            ..scene_file::SceneLoadOptions::default()
        };
        match input.way {
            Way::Model => match scene_file::load_model(&path, &options) {
                Ok(loaded) => render(&loaded.scene, &mut dice),
                Err(error) => refused(&anyhow::Error::from(error)),
            },
            Way::Scene => match scene_file::load(&path, &options) {
                Ok(loaded) => render(&loaded.scene, &mut dice),
                Err(error) => refused(&anyhow::Error::from(error)),
            },
            Way::Picture => {
                let _ = image::read_settings(&path);
                let _ = image::is_whole(&path);
                match image::read(&path) {
                    // A file may hold what is not finite; it has as many pixels as it says.
                    Ok(picture) if picture.rgba.len() == (picture.width * picture.height) as usize => {
                        Ok(Outcome::Rendered)
                    }
                    Ok(picture) => {
                        Err(format!("{} pixels of {} x {}", picture.rgba.len(), picture.width, picture.height))
                    }
                    Err(error) => refused(&anyhow::Error::from(error)),
                }
            }
            Way::Replay => replay(folder),
        }
    }
}

/// An error is one line.
fn refused(error: &anyhow::Error) -> Result<Outcome, String> {
    let line = format!("{error:#}");
    if line.lines().count() == 1 { Ok(Outcome::Refused) } else { Err(format!("the message is not one line: {line:?}")) }
}

fn render(scene: &Scene, dice: &mut Dice) -> Result<Outcome, String> {
    let quality: Quality = dice.pick(&MODES).parse().map_err(|error| format!("{error:?}"))?;
    let aovs = if dice.once_in(4) { vec![Aov::Alpha, Aov::Depth, Aov::Normal, Aov::Velocity] } else { Vec::new() };
    let options = RenderOptions { quality, look: Look { aovs, ..Look::default() }, ..RenderOptions::default() };
    let frame = scene.frames.first + dice.below(2) as i64;
    let rendered = match render_frame(&mut Cpu::default(), scene, frame, &options) {
        Ok(rendered) => rendered,
        Err(error) => return refused(&anyhow::Error::from(error)),
    };
    check(&rendered.picture.rgba, "picture")?;
    for layer in &rendered.picture.layers {
        // Depth is infinite where nothing is seen.
        if layer.planes.iter().flatten().any(|x| x.is_nan()) {
            return Err(format!("the layer {} has a value that is no number", layer.aov.name()));
        }
    }
    Ok(Outcome::Rendered)
}

fn check(pixels: &[[f32; 4]], what: &str) -> Result<(), String> {
    match pixels.iter().position(|pixel| !pixel.iter().all(|x| x.is_finite())) {
        Some(at) => Err(format!("the {what} is not finite: pixel {at} is {:?}", pixels[at])),
        None => Ok(()),
    }
}

/// The command runs in a process of its own, which may not take longer than a run may.
fn replay(folder: &Path) -> Result<Outcome, String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_splatblur"));
    command.current_dir(folder).args(["dataset", "--replay", "transforms.json", "--out", "made", "--quiet"]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().map_err(|error| error.to_string())?;
    let start = Instant::now();
    while start.elapsed() < 2 * super::patience() {
        if child.try_wait().map_err(|error| error.to_string())?.is_some() {
            let output = child.wait_with_output().map_err(|error| error.to_string())?;
            let said = String::from_utf8_lossy(&output.stderr);
            return match output.status.code() {
                Some(0) => Ok(Outcome::Rendered),
                Some(2) if said.lines().count() == 1 => Ok(Outcome::Refused),
                code => Err(format!("exit {code:?}: {said:?}")),
            };
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let _ = child.kill();
    let _ = child.wait();
    Err("the replay takes too long".to_owned())
}
