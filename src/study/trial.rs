//! A scene in front of the backends: renderings of its frames in any mode, timed.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::StudyError;
use super::contestant::{BackendKind, Choices, Contestant, Method};
use super::provenance::{Provenance, Settings};
use super::report::STRATA;
use crate::film::{Aov, Picture};
use crate::image::Format;
use crate::options::{BlurMode, Look, PixelFilter, Prefilter, Quality, RenderOptions};
use crate::reference::{self, ReferenceOptions};
use crate::renderer::Renderer;
use crate::scene::Scene;
use crate::time::{FrameNumber, Shutter, Weight};

/// Added to the seed for references that take part: with the seed of the judging one their errors would be the same.
const OTHER_SEED: u64 = 0x5eed;

/// Told the finished share of a rendering, 0 to 1.
pub type Share<'a> = &'a (dyn Fn(f32) + Sync);

/// A renderer that is ready.
pub struct Opened {
    /// The renderer.
    pub renderer: Renderer,
    /// What it is, in words, with all that times depend on.
    pub description: String,
}

/// Opens a backend, when a study first needs it.
pub type Open<'a> = Box<dyn FnMut(BackendKind) -> Result<Opened, Box<dyn Error + Send + Sync>> + Send + 'a>;

/// A scene in front of the backends that render it.
pub struct Trial<'a> {
    scene: Scene,
    path: PathBuf,
    options: RenderOptions,
    /// Prefilter of all modes that ask for none; `None`: the one that suits each.
    prefilter: Option<Prefilter>,
    backends: Backends<'a>,
    /// Once it was needed.
    provenance: Option<Provenance>,
}

/// The backends that were needed so far.
struct Backends<'a> {
    open: Open<'a>,
    opened: Vec<(BackendKind, Opened)>,
}

impl Backends<'_> {
    /// The backend, opened where it was not yet.
    fn get(&mut self, backend: BackendKind) -> Result<&mut Opened, StudyError> {
        let mut at = self.opened.iter().position(|(kind, _)| *kind == backend);
        if at.is_none() {
            self.opened.push((backend, (self.open)(backend).map_err(StudyError::Open)?));
            at = Some(self.opened.len() - 1);
        }
        Ok(&mut self.opened[at.unwrap_or_default()].1)
    }
}

/// One rendering.
#[derive(Clone, Debug)]
pub struct Shot {
    /// The picture.
    pub picture: Picture,
    /// Wall time, without opening the backend.
    pub seconds: f64,
}

impl Shot {
    /// Samples of a pixel of a picture that was made in this way: their mean where the picture says them.
    pub fn samples(&self, method: Method) -> u64 {
        samples_of(method, &self.picture)
    }
}

/// Samples of a pixel of a picture that was made in this way: their mean where the picture says them.
pub(super) fn samples_of(method: Method, picture: &Picture) -> u64 {
    let Some(layer) = picture.layers.iter().find(|layer| layer.aov == Aov::Samples) else { return method.samples() };
    let plane = layer.planes.iter().flatten();
    (plane.map(|&samples| f64::from(samples)).sum::<f64>() / picture.rgba.len() as f64).round() as u64
}

impl<'a> Trial<'a> {
    /// A scene that was loaded from `path`. `options` hold for all modes, apart from quality, prefilter, filter along
    /// the motion and extra channels, which a study sets itself. `prefilter` holds for all modes, too; `None` is the
    /// one that suits each mode. References have no prefilter and keep the scene's depth tolerance.
    ///
    /// Everything runs on the threads of the caller's pool (rayon).
    pub fn new(
        scene: Scene,
        path: &Path,
        options: RenderOptions,
        prefilter: Option<Prefilter>,
        open: Open<'a>,
    ) -> Self {
        let backends = Backends { open, opened: Vec::new() };
        Self { scene, path: path.to_owned(), options, prefilter, backends, provenance: None }
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The file that it was loaded from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Options that hold for all modes.
    pub fn options(&self) -> &RenderOptions {
        &self.options
    }

    /// Renders a frame. `share`: told how far it is, where that is known.
    ///
    /// # Errors
    /// The backend cannot be opened or cannot render the frame, or the reference cannot be made.
    pub fn shoot(&mut self, contestant: Contestant, frame: FrameNumber, share: Share<'_>) -> Result<Shot, StudyError> {
        match contestant.method {
            Method::Splat(quality) => {
                let aovs = if matches!(quality, Quality::Error(_)) { vec![Aov::Samples] } else { Vec::new() };
                let options = self.splatting(quality, contestant.choices, aovs);
                // Opening a device is no part of rendering.
                self.backends.get(contestant.backend)?;
                let start = Instant::now();
                let picture = self.splat(None, contestant.backend, frame, &options)?;
                Ok(Shot { picture, seconds: start.elapsed().as_secs_f64() })
            }
            Method::Reference(samples) => {
                let filter = self.filter_of(contestant.choices);
                self.trace(&self.tracing(samples, filter, self.seed_of_others()), frame, share)
            }
        }
    }

    /// The reference with this pixel filter that judges the others; its last layer is its standard error.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn judge(
        &self,
        samples: u64,
        filter: PixelFilter,
        frame: FrameNumber,
        share: Share<'_>,
    ) -> Result<Shot, StudyError> {
        self.trace(&self.tracing(samples, filter, self.options.look.seed), frame, share)
    }

    /// The prefilter of all modes that ask for none, in words.
    pub(super) fn prefilter(&self) -> String {
        self.prefilter.unwrap_or_default().to_string()
    }

    /// The pixel filter of a mode, and of the reference that judges it.
    pub fn filter_of(&self, choices: Choices) -> PixelFilter {
        choices.filter.unwrap_or(self.options.look.filter)
    }

    /// The pixel filters of these modes, each once, in order.
    pub fn filters_of(&self, modes: impl Iterator<Item = Choices>) -> Vec<PixelFilter> {
        let mut filters = Vec::new();
        for filter in modes.map(|mode| self.filter_of(mode)) {
            if !filters.contains(&filter) {
                filters.push(filter);
            }
        }
        filters
    }

    /// `reference` where the reference has the pixel filter of all modes; else with the filter, as modes say it.
    pub fn name_of_judge(&self, filter: PixelFilter) -> String {
        let filter = Some(filter).filter(|f| *f != self.options.look.filter);
        format!("reference{}", Choices { filter, ..Choices::default() })
    }

    /// Pixel centres at the middle of each of [`STRATA`] parts of the shutter, without blur, with depth and velocity.
    ///
    /// # Errors
    /// The CPU cannot be opened or cannot render the frame.
    pub fn moments(&mut self, frame: FrameNumber) -> Result<Vec<Picture>, StudyError> {
        let mode = BlurMode::supersample(1).into();
        let choices = Choices { filter: Some(PixelFilter::Point), prefilter: Some(Prefilter::None), detail: None };
        let options = self.splatting(mode, choices, vec![Aov::Depth, Aov::Velocity]);
        let Shutter { open, close, .. } = self.scene.shutter;
        let part = (close - open) / f64::from(STRATA);
        let mut scene = self.scene.clone();
        (0..STRATA)
            .map(|k| {
                let open = open + part * f64::from(k);
                scene.shutter = Shutter { open, close: open + part, weight: Weight::Box, ..self.scene.shutter.clone() };
                self.splat(Some(&scene), BackendKind::Cpu, frame, &options)
            })
            .collect()
    }

    /// The settings of a rendering, as its file carries them.
    pub(super) fn settings(&mut self, contestant: Contestant, frame: FrameNumber) -> Result<String, StudyError> {
        let settings = match contestant.method {
            Method::Splat(quality) => {
                let options = self.splatting(quality, contestant.choices, Vec::new());
                self.provenance()?.splatted(&options, Format::EXR, contestant.backend.word())?
            }
            Method::Reference(samples) => {
                let filter = self.filter_of(contestant.choices);
                let options = self.tracing(samples, filter, self.seed_of_others());
                self.provenance()?.traced(&options, samples, Format::EXR)?
            }
        };
        Ok(settings.of_frame(frame)?)
    }

    /// The settings of the reference with this pixel filter that judges the others.
    pub(super) fn settings_of_judge(&mut self, samples: u64, filter: PixelFilter) -> Result<Settings, StudyError> {
        let options = self.tracing(samples, filter, self.options.look.seed);
        Ok(self.provenance()?.traced(&options, samples, Format::EXR)?)
    }

    /// The backend in words, with all that times depend on.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn describe(&mut self, backend: BackendKind) -> Result<String, StudyError> {
        Ok(self.backends.get(backend)?.description.clone())
    }

    /// The seed of references that take part.
    pub fn seed_of_others(&self) -> u64 {
        self.options.look.seed.wrapping_add(OTHER_SEED)
    }

    fn provenance(&mut self) -> Result<&Provenance, StudyError> {
        let provenance = match self.provenance.take() {
            Some(provenance) => provenance,
            None => Provenance::of(&self.scene, &self.path)?,
        };
        Ok(self.provenance.insert(provenance))
    }

    /// Options of splatting.
    fn splatting(&self, quality: Quality, choices: Choices, aovs: Vec<Aov>) -> RenderOptions {
        let filter = self.filter_of(choices);
        let prefilter = choices.prefilter.or(self.prefilter).unwrap_or_default();
        RenderOptions {
            quality,
            prefilter,
            detail: choices.detail.unwrap_or(self.options.detail),
            reconstruct: false,
            look: Look { filter, aovs, ..self.options.look.clone() },
            ..self.options.clone()
        }
    }

    /// Options of references. They have the scene's own tolerance, whatever the modes have.
    fn tracing(&self, samples: u64, filter: PixelFilter, seed: u64) -> ReferenceOptions {
        let look = Look { filter, seed, epsilon: None, aovs: Vec::new(), ..self.options.look.clone() };
        ReferenceOptions { samples, look, ..ReferenceOptions::default() }
    }

    /// Splats the trial's scene, or another.
    fn splat(
        &mut self,
        scene: Option<&Scene>,
        backend: BackendKind,
        frame: FrameNumber,
        options: &RenderOptions,
    ) -> Result<Picture, StudyError> {
        let opened = self.backends.get(backend)?;
        let scene = scene.unwrap_or(&self.scene);
        Ok(opened.renderer.render(scene, frame, options)?.picture)
    }

    fn trace(&self, options: &ReferenceOptions, frame: FrameNumber, share: Share<'_>) -> Result<Shot, StudyError> {
        let start = Instant::now();
        let step = |step: reference::RoundProgress| share(if step.is_building() { 0.0 } else { step.share as f32 });
        let made = reference::render(&self.scene, frame, options, None, &step)?;
        Ok(Shot { picture: made.picture, seconds: start.elapsed().as_secs_f64() })
    }
}
