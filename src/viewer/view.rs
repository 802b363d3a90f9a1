//! What a page wants to see: the text that it sends, and the values that come of it.

use serde::Deserialize;

use super::camera::CameraAt;
use super::lights::LightsAt;
use super::path::PathAt;
use super::shared::Known;
use crate::film::Aov;
use crate::frame::all_rests;
use crate::options::{self, BlurMode, ErrorTarget, Interleave, Prefilter, Quality, RenderOptions, Shading};
use crate::renderer::Device;
use crate::scene::{Camera, FrameRange, Scene};
use crate::time::{FrameNumber, Readout, Shutter, Weight};

/// Longest side of a picture, pixels.
const LONGEST: u32 = 8192;
/// Most pixels of a picture: an 8K screen.
const MOST_PIXELS: u64 = 7680 * 4320;
/// Frames and shutters end here, as on the command line.
const LAST_FRAME: f64 = 1e6;

/// A page's view in the words of the command line.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Asked {
    /// The page's number of this view; pictures carry it.
    serial: u64,
    width: u32,
    height: u32,
    frame: f64,
    /// Does it change all the time, as in a drag?
    moving: bool,
    /// `None`: the scene's.
    camera: Option<CameraAt>,
    /// What the camera flies along where it is `None`.
    #[serde(default)]
    path: Option<PathAt>,
    /// `None`: the scene's.
    lights: Option<LightsAt>,
    /// `None`: the scene's.
    shutter: Option<AskedShutter>,
    mode: String,
    /// The other side of the slider: a mode, or `reference`.
    split: Option<String>,
    /// `colour`, or the name of a layer.
    buffer: String,
    backend: String,
    /// `None`: the one that suits the mode.
    prefilter: Option<String>,
    shading: String,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct AskedShutter {
    open: f64,
    close: f64,
    /// `None`: the scene's, which may be a drawn curve.
    weight: Option<String>,
    /// `None`: the scene's.
    readout: Option<String>,
}

/// All that both sides of a picture share. Equal looks have equal pictures.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PageLook {
    pub(super) size: [u32; 2],
    pub(super) frame: FrameNumber,
    camera: Option<CameraAt>,
    path: Option<PathAt>,
    lights: Option<LightsAt>,
    shutter: Option<ShutterAt>,
    pub(super) device: Device,
    prefilter: Option<Prefilter>,
    pub(super) shading: Shading,
    /// `None`: colour.
    pub(super) buffer: Option<Aov>,
}

#[derive(Clone, Debug, PartialEq)]
struct ShutterAt {
    open: f64,
    close: f64,
    weight: Option<Weight>,
    readout: Option<Readout>,
}

/// The other side of the slider.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Other {
    Mode(Quality),
    Reference,
}

/// A view that was checked.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PageView {
    pub(super) serial: u64,
    pub(super) moving: bool,
    pub(super) look: PageLook,
    pub(super) quality: Quality,
    pub(super) other: Option<Other>,
}

impl PageView {
    /// Does it ask for the same pictures?
    pub(super) fn shows_as(&self, other: &Self) -> bool {
        self.look == other.look && self.quality == other.quality && self.other == other.other
    }
}

impl Asked {
    /// The view, or what is wrong with it in one line.
    pub(super) fn check(self) -> Result<PageView, String> {
        let Self { width, height, frame, .. } = self;
        let pixels = u64::from(width) * u64::from(height);
        if width == 0 || height == 0 || width.max(height) > LONGEST || pixels > MOST_PIXELS {
            return Err(format!("a picture of {width} x {height} pixels cannot be shown"));
        }
        if !(-LAST_FRAME..=LAST_FRAME).contains(&frame) {
            return Err(format!("there is no frame {frame}; frames end at {LAST_FRAME}"));
        }
        let fault = self.camera.as_ref().and_then(CameraAt::fault);
        let fault = fault.or_else(|| self.path.as_ref().and_then(PathAt::fault));
        if let Some(fault) = fault.or_else(|| self.lights.as_ref().and_then(LightsAt::fault)) {
            return Err(fault);
        }
        let look = PageLook {
            size: [width, height],
            frame: FrameNumber::from(frame),
            camera: self.camera,
            path: self.path,
            lights: self.lights,
            shutter: self.shutter.map(AskedShutter::check).transpose()?,
            device: device(&self.backend)?,
            prefilter: self.prefilter.map(|word| word.parse()).transpose().map_err(in_words("prefilter"))?,
            shading: self.shading.parse().map_err(in_words("shading"))?,
            buffer: buffer(&self.buffer)?,
        };
        let other = match self.split.as_deref() {
            None => None,
            Some("reference") => Some(Other::Reference),
            Some(mode) => Some(Other::Mode(mode.parse().map_err(in_words("split"))?)),
        };
        let quality = self.mode.parse().map_err(in_words("mode"))?;
        Ok(PageView { serial: self.serial, moving: self.moving, look, quality, other })
    }
}

fn in_words<E: std::fmt::Display>(what: &str) -> impl Fn(E) -> String {
    move |why| format!("{what}: {why}")
}

fn device(word: &str) -> Result<Device, String> {
    match word {
        "auto" => Ok(Device::Auto),
        "cpu" => Ok(Device::Cpu),
        "gpu" => Ok(Device::Gpu { adapter: None }),
        _ => Err(format!("backend: expected auto, cpu or gpu, found `{word}`")),
    }
}

fn buffer(word: &str) -> Result<Option<Aov>, String> {
    if word == "colour" {
        return Ok(None);
    }
    match word.parse().map_err(in_words("buffer"))? {
        // It would take a rendering for each object.
        Aov::Object => Err("buffer: the layer `object` is for `splatblur render`".to_owned()),
        aov => Ok(Some(aov)),
    }
}

impl AskedShutter {
    fn check(self) -> Result<ShutterAt, String> {
        let Self { open, close, weight, readout } = self;
        let known = -LAST_FRAME..=LAST_FRAME;
        if !known.contains(&open) || !known.contains(&close) {
            return Err("the shutter must stay within a million frames".to_owned());
        }
        if open >= close {
            return Err(format!("the shutter closes at {close}, not after it opens at {open}"));
        }
        let weight = weight.map(|text| text.parse()).transpose().map_err(in_words("weight"))?;
        let readout = readout.map(|text| text.parse()).transpose().map_err(in_words("readout"))?;
        Ok(ShutterAt { open, close, weight, readout })
    }
}

impl PageLook {
    /// The scene as it is looked at, at `size` pixels. The camera of a model file is chosen for the size of the image.
    pub(super) fn scene(&self, known: &Known, [width, height]: [u32; 2]) -> Scene {
        let mut scene = self.changed(known.scene());
        (scene.image.width, scene.image.height) = (width, height);
        if known.of_model && known.rests_alone() && self.camera.is_none() && self.path.is_none() {
            let in_studio = known.loaded.studio.is_some();
            scene.camera = if in_studio { scene.studio_camera() } else { Camera::automatic(&scene) };
        }
        scene
    }

    /// The scene with the changes of the page, for a file.
    pub(super) fn changed(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        match (&self.camera, &self.path) {
            (Some(camera), _) => camera.place(&mut scene.camera),
            (None, Some(path)) => path.place(&mut scene),
            (None, None) => {}
        }
        if let Some(lights) = &self.lights {
            lights.turn(&mut scene);
        }
        if let Some(ShutterAt { open, close, weight, readout }) = self.shutter.clone() {
            let weight = weight.unwrap_or_else(|| scene.shutter.weight.clone());
            let readout = readout.unwrap_or(scene.shutter.readout);
            scene.shutter = Shutter { open, close, weight, readout };
        }
        scene
    }

    /// The frames that are seen: those of the scene, or of the path that the page collected.
    pub(super) fn frames(&self, scene: &Scene) -> FrameRange {
        let rate = scene.frames.rate;
        self.path.as_ref().map_or(scene.frames, |path| path.frames(rate))
    }

    /// The camera of the scene on the path that the page collected; `None`: there is none.
    pub(super) fn flown(&self, scene: &Scene) -> Option<Camera> {
        let mut scene = scene.clone();
        self.path.as_ref()?.place(&mut scene);
        Some(scene.camera)
    }

    /// The options of a finished picture, as `splatblur render` has them.
    pub(super) fn options(&self, quality: Quality, memory: u64) -> RenderOptions {
        RenderOptions {
            quality,
            prefilter: self.prefilter.unwrap_or_default(),
            memory,
            look: options::Look {
                shading: self.shading,
                // Only mode auto estimates an error.
                aovs: self.buffer.into_iter().filter(|&aov| aov != Aov::Error || is_auto(quality)).collect(),
                ..options::Look::default()
            },
            ..RenderOptions::default()
        }
    }

    /// The options of a quick picture of `scene` with `samples` times the work of the least. It has no filter, which
    /// takes half the time of full EWA, so that outlines stay where they are when the picture is refined. `approx`
    /// stays where it is asked for.
    ///
    /// What moves shows its blur: the least picture has four instants, one in each pixel of a square, which take 1.3 to
    /// 1.7 times as long as one in all pixels. Two time samples take as long as that, and four twice as long.
    pub(super) fn quick(&self, scene: &Scene, quality: Quality, samples: u32, memory: u64) -> RenderOptions {
        let mode = match quality {
            Quality::Mode(BlurMode::Still { .. }) => BlurMode::Still { pixel_samples: samples },
            _ if all_rests(scene) => BlurMode::supersample(samples),
            _ if samples == 1 => BlurMode::interleaved(1, Interleave::Two),
            _ => BlurMode::supersample(2 * samples),
        };
        let prefilter = match self.prefilter {
            Some(Prefilter::Approx) => Prefilter::Approx,
            _ => Prefilter::None,
        };
        RenderOptions { prefilter, ..self.options(mode.into(), memory) }
    }
}

fn is_auto(quality: Quality) -> bool {
    matches!(quality, Quality::Error(ErrorTarget { .. }))
}
