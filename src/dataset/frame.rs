//! The pictures of one frame.

use std::path::Path;

use super::files::{File, Role, files};
use super::{By, MIDDLE, MOST_SHARP, Recipe, at_instant, at_middle, shaken};
use crate::backend::{Achieved, Backend, BackendError};
use crate::film::{Aov, Picture};
use crate::image::{self, Format, ImageError, Response};
use crate::limits::{self, Invalid};
use crate::model::ModelError;
use crate::options::{BlurMode, Look, Quality, RenderOptions};
use crate::reference::{self, Flow, ReferenceError, ReferenceOptions};
use crate::renderer::render_frame;
use crate::scene::{ImageSettings, Scene};
use crate::time::FrameNumber;

/// Why a frame of a dataset cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// The recipe asks for what is out of its bounds.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// The renderer cannot.
    #[error(transparent)]
    Render(#[from] BackendError),
    /// The reference cannot.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// A file of a sequence cannot be read.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// JSON cannot be made.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

/// What goes into a file.
#[derive(Clone, Debug, PartialEq)]
pub enum FileContents {
    /// A picture.
    Picture(Picture, Format, Response),
    /// Planes of numbers by the names of their channels, of a picture so wide, with their meaning.
    Planes(u32, Vec<(&'static str, Vec<f32>)>, &'static str),
}

impl FileContents {
    fn planes(width: u32, names: &[&'static str], planes: Vec<Vec<f32>>, meaning: &'static str) -> Self {
        Self::Planes(width, names.iter().copied().zip(planes).collect(), meaning)
    }

    /// Writes it to a file, which appears whole or not at all and carries `settings`.
    ///
    /// # Errors
    /// A value is not finite, or the file cannot be written.
    pub fn write(&self, path: &Path, settings: &str) -> Result<(), ImageError> {
        match self {
            Self::Picture(picture, format, response) => {
                image::write_with_response(path, picture, *format, *response, settings)
            }
            Self::Planes(width, planes, meaning) => {
                let planes: Vec<(&str, &[f32])> =
                    planes.iter().map(|(name, plane)| (*name, plane.as_slice())).collect();
                image::write_planes(path, *width, &planes, meaning, settings)
            }
        }
    }
}

/// Facts about a finished frame.
#[derive(Clone, Copy, Debug)]
pub struct Made {
    /// What mode auto reached in the blurred picture.
    pub achieved: Option<Achieved>,
    /// Mean standard error of the blurred picture, where the reference made it.
    pub mean_error: Option<f64>,
}

/// Samples of a sharp picture where the mode has no number of its own.
const SHARP_SAMPLES: u32 = 16;

/// Names by which every reader finds several channels.
const COLOURS: [&str; 4] = ["R", "G", "B", "A"];

const FLOW: &str = "{\"R\": \"motion to the right, pixels, of the surface that the pixel's middle shows at the first \
                    instant\", \"G\": \"motion down, pixels\", \"B\": \"1 where these are valid, else 0\", \
                    \"A\": \"1 where the surface is seen at the second instant too, else 0\"}";
const DEPTH: &str = "{\"Y\": \"distance from the camera along its axis (-z) in the middle of the shutter, scene units, \
                     mean over the pixel; infinite where nothing is seen\"}";
const ALPHA: &str = "{\"Y\": \"share of the pixel that surfaces cover in the middle of the shutter, 0 to 1\"}";
const ERROR: &str = "{\"R\": \"error of the blurred picture before noise: of the reference its standard error, linear \
                     light; of mode auto its estimate for the block around, without that of detail, root mean square \
                     of display values\", \"A\": \"that of coverage\"}";

/// Makes the files of frame `frame` of a scene, and hands each to `write` as soon as it is made, the blurred picture
/// last. `seed`: of noise and shake.
///
/// # Errors
/// The renderer or the reference cannot make one of the pictures, or `write` fails.
pub fn frame<E: From<DatasetError>>(
    backend: &mut dyn Backend,
    scene: &Scene,
    frame: FrameNumber,
    recipe: &Recipe,
    seed: u64,
    mut write: impl FnMut(&File, FileContents) -> Result<(), E>,
) -> Result<Made, E> {
    limits::check_count("sharp", recipe.sharp, &(1..=MOST_SHARP)).map_err(DatasetError::from)?;
    let scene = &*shaken(scene, frame, recipe, seed).map_err(DatasetError::from)?;
    let list = files(&scene.name, frame, recipe);
    let mut put = |role: Role, content: FileContents| match list.iter().find(|file| file.role == role) {
        Some(file) => write(file, content),
        None => Ok(()),
    };
    let width = scene.image.width;
    let coloured = |picture: Picture| {
        FileContents::Picture(Picture { layers: Vec::new(), ..picture }, recipe.format, recipe.response)
    };
    let instants = recipe.instants();
    let has_middle = instants.contains(&MIDDLE);
    let own_middle = (!has_middle).then_some((usize::MAX, MIDDLE));
    let by = recipe.by.at_instant();
    let mut mean = Mean::default();
    for (number, share) in instants.into_iter().enumerate().chain(own_middle) {
        let is_middle = share == MIDDLE;
        let layers: &[Aov] = if is_middle { &[Aov::Alpha, Aov::Depth] } else { &[] };
        let made = picture(backend, &at_instant(scene, share), frame, &by, layers)?.picture;
        if is_middle {
            put(Role::Depth, FileContents::planes(width, &["Y"], planes(&made, Aov::Depth), DEPTH))?;
            put(Role::Alpha, FileContents::planes(width, &["Y"], planes(&made, Aov::Alpha), ALPHA))?;
            put(Role::Middle, coloured(made.clone()))?;
        }
        if recipe.exact && number < recipe.sharp as usize {
            mean.add(&made);
        }
        put(Role::Sharp(number), coloured(made))?;
    }
    if recipe.holds_out(frame) {
        let made = picture(backend, &at_middle(scene), frame, &by, &[])?.picture;
        put(Role::Test, coloured(made.clone()))?;
        put(Role::Held, coloured(made))?;
    }
    if recipe.flow {
        let pairs = [(Role::OpenClose, [0.0, 1.0]), (Role::MiddleClose, [MIDDLE, 1.0])];
        let flows = reference::flows(scene, frame, &pairs.map(|(_, pair)| pair), &recipe.by.of_flow());
        for ((role, _), Flow { x, y, valid, visible }) in pairs.into_iter().zip(flows.map_err(DatasetError::from)?) {
            put(role, FileContents::planes(width, &COLOURS, vec![x, y, valid, visible], FLOW))?;
        }
    }
    let layers: &[Aov] = if recipe.has_error() { &[Aov::Error] } else { &[] };
    let Pictured { mut picture, made } = if recipe.exact {
        let picture = mean.picture(&scene.image);
        Pictured { picture, made: Made { achieved: None, mean_error: None } }
    } else {
        picture(backend, scene, frame, &recipe.by, layers)?
    };
    put(Role::Error, FileContents::planes(width, &COLOURS, planes(&picture, Aov::Error), ERROR))?;
    recipe.noise.add(&mut picture, seed, frame);
    put(Role::Blur, coloured(picture))?;
    Ok(made)
}

/// The mean of pictures in linear light.
#[derive(Default)]
struct Mean {
    sums: Vec<[f64; 4]>,
    pictures: u32,
}

impl Mean {
    fn add(&mut self, picture: &Picture) {
        self.sums.resize(picture.rgba.len(), [0.0; 4]);
        self.pictures += 1;
        for (sum, value) in self.sums.iter_mut().flatten().zip(picture.rgba.iter().flatten()) {
            *sum += f64::from(*value);
        }
    }

    fn picture(&self, image: &ImageSettings) -> Picture {
        let pictures = f64::from(self.pictures.max(1));
        let rgba = self.sums.iter().map(|sums| sums.map(|sum| (sum / pictures) as f32)).collect();
        Picture { width: image.width, height: image.height, rgba, layers: Vec::new() }
    }
}

/// A picture, and what is known of it.
struct Pictured {
    picture: Picture,
    made: Made,
}

fn picture(
    backend: &mut dyn Backend,
    scene: &Scene,
    frame: FrameNumber,
    by: &By,
    layers: &[Aov],
) -> Result<Pictured, DatasetError> {
    match by {
        By::Splatting(options) => {
            let options =
                RenderOptions { look: Look { aovs: layers.to_vec(), ..options.look.clone() }, ..options.clone() };
            let rendered = render_frame(backend, scene, frame, &options)?;
            let made = Made { achieved: rendered.stats.achieved, mean_error: None };
            Ok(Pictured { picture: rendered.picture, made })
        }
        By::Tracing(options) => {
            // It always has its error.
            let aovs = layers.iter().copied().filter(|&aov| aov != Aov::Error).collect();
            let options = ReferenceOptions { look: Look { aovs, ..options.look.clone() }, ..options.clone() };
            let traced = reference::render(scene, frame, &options, None, &|_| ())?;
            let made = Made { achieved: None, mean_error: Some(traced.stats.mean_error) };
            Ok(Pictured { picture: traced.picture, made })
        }
    }
}

/// The planes of a layer.
fn planes(picture: &Picture, aov: Aov) -> Vec<Vec<f32>> {
    picture.layers.iter().find(|layer| layer.aov == aov).map_or_else(Vec::new, |layer| layer.planes.clone())
}

impl By {
    /// The way to make a sharp picture. Modes that want an extent of time become supersampling.
    fn at_instant(&self) -> Self {
        match self {
            Self::Splatting(options) => {
                let quality = match options.quality {
                    Quality::Mode(BlurMode::Still { pixel_samples }) => {
                        Quality::Mode(BlurMode::supersample(pixel_samples))
                    }
                    Quality::Mode(BlurMode::Bucket { .. } | BlurMode::Volumetric { .. }) => {
                        Quality::Mode(BlurMode::supersample(SHARP_SAMPLES))
                    }
                    same => same,
                };
                Self::Splatting(RenderOptions { quality, ..options.clone() })
            }
            same @ Self::Tracing(_) => same.clone(),
        }
    }

    /// What the flow depends on.
    fn of_flow(&self) -> ReferenceOptions {
        match self {
            Self::Splatting(RenderOptions { look, .. }) => {
                let look = Look { two_sided: look.two_sided, epsilon: look.epsilon, ..Look::default() };
                ReferenceOptions { look, ..ReferenceOptions::default() }
            }
            Self::Tracing(options) => options.clone(),
        }
    }
}
