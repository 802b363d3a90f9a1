//! What `sheet` and `report` share: a scene, options that hold for all modes, and renderings in one mode, timed.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context as _;
use clap::Args;
use glam::DVec3;
use splatblur::film::{Aov, Picture};
use splatblur::image::Format;
use splatblur::options;
use splatblur::options::{BlurMode, Quality, RenderOptions};
use splatblur::reference::{self, ReferenceOptions};
use splatblur::renderer::render_frame;
use splatblur::scene::Scene;
use splatblur::scene_file::Loaded;
use splatblur::study::report::STRATA;
use splatblur::time::{Shutter, Weight};

use super::backend::{self, Wanted};
use super::common::{Filter, Prefilter, Shading, load_scene};
use super::grammar;
use super::modes::{Machine, Method};
use super::output::say;
use super::settings::Settings;

/// Added to the seed for references that are judged: with the seed of the judge their errors would be those of the judge.
const OTHER_SEED: u64 = 0x5eed;

/// Told the finished share of a rendering.
pub(super) type Share<'a> = &'a (dyn Fn(f32) + Sync);

/// Options that hold for all modes.
#[derive(Debug, Args)]
pub(super) struct Common {
    /// Image size in pixels [default: the scene's, else 1024x768].
    #[arg(long, value_name = "WxH", allow_hyphen_values = true, value_parser = grammar::size, help_heading = "All modes")]
    size: Option<(u32, u32)>,
    /// Background in linear light [default: the scene's].
    #[arg(long, value_name = "R,G,B", allow_hyphen_values = true, value_parser = grammar::colour, help_heading = "All modes")]
    background: Option<DVec3>,
    /// Shutter opening and closing, frames around the frame number [default: the scene's, else -0.25,0.25].
    #[arg(long, value_name = "OPEN,CLOSE", allow_hyphen_values = true, value_parser = grammar::shutter, help_heading = "All modes")]
    shutter: Option<(f64, f64)>,
    /// Time weight over the shutter, as in `render` [default: the scene's, else box].
    #[arg(long, value_name = "WEIGHT", value_parser = grammar::weight, help_heading = "All modes")]
    weight: Option<Weight>,
    /// Where samples lie: over the pixel's square, or at its centre.
    #[arg(long, value_enum, default_value_t, help_heading = "All modes")]
    filter: Filter,
    /// Screen-space prefilter of splatting; the reference has none.
    #[arg(long, value_enum, default_value_t, help_heading = "All modes")]
    prefilter: Prefilter,
    /// Shading per pixel (phong) or per surfel (gouraud).
    #[arg(long, value_enum, default_value_t, help_heading = "All modes")]
    shading: Shading,
    /// Show back faces, with their normals turned to the viewer.
    #[arg(long, help_heading = "All modes")]
    two_sided: bool,
    /// Depth tolerance of visibility, scene units, for all objects; not for the reference, which keeps the scene's
    /// [default: the scene's, else the median splat radius].
    #[arg(long, value_name = "E", allow_hyphen_values = true, value_parser = grammar::epsilon, help_heading = "All modes")]
    epsilon: Option<f64>,
    /// Seed of positions and times.
    #[arg(long, value_name = "S", default_value_t = 1, allow_hyphen_values = true, help_heading = "All modes")]
    seed: u64,

    /// Threads [default: all cores]. The images do not depend on it.
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = "Running")]
    threads: Option<u16>,
    /// Memory that a frame may take beside the models, as in 64M, 1G.
    #[arg(long, value_name = "SIZE", default_value = "1G", allow_hyphen_values = true, value_parser = grammar::memory, help_heading = "Running")]
    memory: u64,
    /// Report unknown words of the scene instead of refusing them.
    #[arg(long, help_heading = "Running")]
    lenient: bool,
    /// Refuse scenes that name files outside DIR.
    #[arg(long, value_name = "DIR", help_heading = "Running")]
    restrict: Option<PathBuf>,
    /// Say nothing but errors.
    #[arg(long, help_heading = "Running")]
    pub(super) quiet: bool,
}

/// A scene on the machines that render it.
pub(super) struct Trial<'a> {
    pub(super) scene: Scene,
    pub(super) notes: Vec<String>,
    common: &'a Common,
    path: PathBuf,
    pool: rayon::ThreadPool,
    /// Those that were needed so far.
    machines: Vec<(Machine, backend::Machine)>,
}

/// One rendering.
pub(super) struct Shot {
    pub(super) picture: Picture,
    /// Wall time.
    pub(super) seconds: f64,
}

impl Common {
    /// Reads the scene, and puts the options into it.
    pub(super) fn load(&self, path: &Path) -> anyhow::Result<Trial<'_>> {
        // 0: as many as there are cores.
        let threads = self.threads.map_or(0, usize::from);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().context("cannot start the threads")?;
        let Loaded { mut scene, notes } = load_scene(path, self.lenient, self.restrict.as_deref(), self.quiet, &pool)?;
        if !self.quiet {
            for note in &notes {
                say(&format!("note: {note}"));
            }
        }
        if let Some((width, height)) = self.size {
            (scene.image.width, scene.image.height) = (width, height);
        }
        if let Some(colour) = self.background {
            (scene.image.background, scene.image.transparent) = (colour, false);
        }
        if let Some((open, close)) = self.shutter {
            (scene.shutter.open, scene.shutter.close) = (open, close);
        }
        if let Some(weight) = &self.weight {
            scene.shutter.weight = weight.clone();
        }
        Ok(Trial { scene, notes, common: self, path: path.to_owned(), pool, machines: Vec::new() })
    }

    /// The depth tolerance of the modes, where it is not the scene's.
    pub(super) fn epsilon(&self) -> Option<f64> {
        self.epsilon
    }

    /// Options of splatting in one mode.
    pub(super) fn render_options(&self, quality: Quality, aovs: Vec<Aov>) -> RenderOptions {
        RenderOptions {
            quality,
            filter: self.filter.into(),
            prefilter: self.prefilter.into(),
            shading: self.shading.into(),
            two_sided: self.two_sided,
            epsilon: self.epsilon,
            seed: self.seed,
            memory: self.memory,
            reconstruct: false,
            aovs,
        }
    }
}

/// Samples of a pixel of a picture that was made in one way: their mean where it says them itself.
pub(super) fn samples_of(method: Method, picture: &Picture) -> u64 {
    let Some(layer) = picture.layers.iter().find(|layer| layer.aov == Aov::Samples) else { return method.samples() };
    let plane = layer.planes.iter().flatten();
    (plane.map(|&samples| f64::from(samples)).sum::<f64>() / picture.rgba.len() as f64).round() as u64
}

impl Trial<'_> {
    /// Renders a frame in one way. `share`: told how far it is, where that is known.
    pub(super) fn shoot(
        &mut self,
        method: Method,
        machine: Machine,
        frame: i64,
        share: Share<'_>,
    ) -> anyhow::Result<Shot> {
        match method {
            Method::Splat(mode) => {
                let aovs = if matches!(mode, Quality::Error(_)) { vec![Aov::Samples] } else { Vec::new() };
                let options = self.common.render_options(mode, aovs);
                // Opening a device is no part of rendering.
                self.open(machine)?;
                let start = Instant::now();
                let picture = self.splat(None, machine, frame, &options)?;
                Ok(Shot { picture, seconds: start.elapsed().as_secs_f64() })
            }
            Method::Reference(samples) => self.reference(samples, self.seed_of_others(), frame, share),
        }
    }

    /// The reference that judges the others; its last layer is its standard error.
    pub(super) fn judge(&self, samples: u64, frame: i64, share: Share<'_>) -> anyhow::Result<Shot> {
        self.reference(samples, self.common.seed, frame, share)
    }

    /// Pixel centres at the middle of each of [`STRATA`] parts of the shutter, without blur, with depth and velocity.
    pub(super) fn moments(&mut self, frame: i64) -> anyhow::Result<Vec<Picture>> {
        let mode = BlurMode::supersample(1);
        let options = RenderOptions {
            filter: options::PixelFilter::Point,
            prefilter: options::Prefilter::None,
            ..self.common.render_options(mode.into(), vec![Aov::Depth, Aov::Velocity])
        };
        let Shutter { open, close, .. } = self.scene.shutter;
        let part = (close - open) / f64::from(STRATA);
        let mut scene = self.scene.clone();
        (0..STRATA)
            .map(|k| {
                let open = open + part * f64::from(k);
                scene.shutter = Shutter { open, close: open + part, weight: Weight::Box };
                self.splat(Some(&scene), Machine::Cpu, frame, &options)
            })
            .collect()
    }

    /// What decides the pixels of a rendering, as a file carries it.
    pub(super) fn settings(&self, method: Method, machine: Machine, frame: i64, judge: bool) -> anyhow::Result<String> {
        let mode = match method {
            Method::Splat(mode) => mode,
            Method::Reference(_) => BlurMode::Still { pixel_samples: 1 }.into(),
        };
        let options = self.common.render_options(mode, Vec::new());
        let text = Settings::new(&self.scene, &self.path, &options, Format::Exr, machine.name())?.of_frame(frame)?;
        let Method::Reference(_) = method else { return Ok(text) };
        let mut fields: serde_json::Map<String, serde_json::Value> = serde_json::from_str(&text)?;
        fields.insert("mode".to_owned(), method.to_string().into());
        fields.insert("seed".to_owned(), if judge { self.common.seed } else { self.seed_of_others() }.into());
        Ok(serde_json::to_string(&fields)?)
    }

    /// The machine in words, with all that times depend on.
    pub(super) fn describe(&mut self, machine: Machine) -> anyhow::Result<String> {
        Ok(self.open(machine)?.in_full())
    }

    /// The machine, opened where it was not yet.
    fn open(&mut self, machine: Machine) -> anyhow::Result<&mut backend::Machine> {
        let at = if let Some(at) = self.machines.iter().position(|(open, _)| *open == machine) {
            at
        } else {
            let wanted = match machine {
                Machine::Cpu => Wanted::Cpu,
                Machine::Gpu => Wanted::Gpu,
            };
            let opened = backend::Machine::open(wanted, None, self.pool.current_num_threads())?;
            self.machines.push((machine, opened));
            self.machines.len() - 1
        };
        Ok(&mut self.machines[at].1)
    }

    /// The seed of references that are judged.
    pub(super) fn seed_of_others(&self) -> u64 {
        self.common.seed.wrapping_add(OTHER_SEED)
    }

    /// Of the trial's scene, or of another.
    fn splat(
        &mut self,
        scene: Option<&Scene>,
        machine: Machine,
        frame: i64,
        options: &RenderOptions,
    ) -> anyhow::Result<Picture> {
        self.open(machine)?;
        let Self { scene: own, pool, machines, .. } = self;
        let opened = machines.iter_mut().find(|(open, _)| *open == machine).context("the machine is open")?;
        let backend = opened.1.backend();
        let scene = scene.unwrap_or(own);
        // The GPU's own threads need none of the pool's.
        let rendered = match machine {
            Machine::Cpu => pool.install(|| render_frame(backend, scene, frame, options)),
            Machine::Gpu => render_frame(backend, scene, frame, options),
        };
        Ok(rendered?.picture)
    }

    fn reference(&self, samples: u64, seed: u64, frame: i64, share: Share<'_>) -> anyhow::Result<Shot> {
        let options = ReferenceOptions {
            samples,
            seed,
            filter: self.common.filter.into(),
            shading: self.common.shading.into(),
            two_sided: self.common.two_sided,
            ..ReferenceOptions::default()
        };
        let start = Instant::now();
        let step = |step: reference::Step| share(step.share as f32);
        let scene = &self.scene;
        let made = self.pool.install(|| reference::render(scene, frame, &options, None, &step))?;
        Ok(Shot { picture: made.picture, seconds: start.elapsed().as_secs_f64() })
    }
}
