//! Paired truth of a frame, as arrays.

use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use splatblur::backend::Backend;
use splatblur::dataset::{By, DatasetError, File, FileContents, FolderLayout, Made, Noise, Recipe, Role, frame};
use splatblur::fields::Format;
use splatblur::image::Response;
use splatblur::reference::ReferenceOptions;
use splatblur::{FrameNumber, Look, Picture, RenderOptions, Scene};

use crate::arrays;
use crate::errors::{Raise, invalid};
use crate::picture::of_planes;
use crate::scene::camera_to_world;

/// Choices of what is made of each frame, as the Python layer hands it over.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Choices {
    sharp: u32,
    noise: String,
    flow: bool,
    /// Samples of a reference; 0: the mode makes the pictures.
    pub(crate) reference: u64,
}

impl Choices {
    pub(crate) fn recipe(&self, py: Python<'_>, by: By) -> PyResult<Recipe> {
        let noise: Noise = self.noise.parse().map_err(|why: splatblur::dataset::NoiseError| {
            invalid(py, "noise", &format!("`{}`", self.noise), &why.to_string())
        })?;
        Ok(Recipe {
            layout: FolderLayout::Nerfstudio,
            sharp: self.sharp,
            by,
            format: Format::EXR,
            // The Python layer gives pictures their response: files have 8 or 16 bits, arrays need not.
            response: Response::Linear,
            noise,
            flow: self.flow,
            shake: None,
            exact: false,
            held_out: None,
        })
    }
}

/// Refuses a recipe that no data set takes.
#[pyfunction]
pub(crate) fn check_recipe(py: Python<'_>, recipe: Choices) -> PyResult<()> {
    let by = if recipe.reference > 0 {
        traced(recipe.reference, Look::default())
    } else {
        splatted(RenderOptions::default())
    };
    recipe.recipe(py, by).map(drop)
}

/// By ray tracing.
pub(crate) fn traced(samples: u64, look: Look) -> By {
    By::Tracing(ReferenceOptions { samples, look, ..ReferenceOptions::default() })
}

/// By the renderer.
pub(crate) fn splatted(options: RenderOptions) -> By {
    By::Splatting(options)
}

impl Raise for DatasetError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Invalid(error) => error.raise(py),
            Self::Render(error) => error.raise(py),
            Self::Reference(error) => error.raise(py),
            other => pyo3::exceptions::PyRuntimeError::new_err(other.to_string()),
        }
    }
}

/// The parts of a frame.
pub(crate) struct Parts {
    parts: Vec<(Role, FileContents)>,
    made: Made,
}

/// Makes a frame. The number is that of the scene's frames; `seed` is that of the noise.
pub(crate) fn make(
    backend: &mut dyn Backend,
    scene: &Scene,
    number: FrameNumber,
    recipe: &Recipe,
    seed: u64,
) -> Result<Parts, DatasetError> {
    let mut parts = Vec::new();
    let keep = |file: &File, content: FileContents| {
        parts.push((file.role, content));
        Ok::<_, DatasetError>(())
    };
    let made = frame(backend, scene, number, recipe, seed, keep)?;
    Ok(Parts { parts, made })
}

/// Colours of a picture: (H, W, 4).
fn colours<'py>(py: Python<'py>, picture: Picture) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let shape = [picture.height as usize, picture.width as usize, 4];
    arrays::array(py, picture.rgba.into_flattened(), &shape)
}

/// A frame as a dict of arrays. `sharp` is a list of pictures, by time.
pub(crate) fn to_arrays<'py>(
    py: Python<'py>,
    scene: &Scene,
    number: f64,
    recipe: &Recipe,
    Parts { parts, made }: Parts,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let mut sharp = Vec::new();
    for (role, content) in parts {
        let content = match (role, content) {
            (Role::Sharp(number), FileContents::Picture(picture, ..)) => {
                sharp.push((number, colours(py, picture)?));
                continue;
            }
            (Role::Middle | Role::Held | Role::Test, _) => continue,
            (_, FileContents::Picture(picture, ..)) => {
                dict.set_item("blurred", colours(py, picture)?)?;
                continue;
            }
            (_, FileContents::Planes(width, planes, _)) => (width as usize, planes),
        };
        let name = match role {
            Role::OpenClose => "flow_open_close",
            Role::MiddleClose => "flow_middle_close",
            Role::Depth => "depth",
            Role::Alpha => "alpha",
            _ => "error",
        };
        let (width, planes) = content;
        let planes: Vec<Vec<f32>> = planes.into_iter().map(|(_, plane)| plane).collect();
        let height = planes.first().map_or(0, |plane| plane.len() / width.max(1));
        dict.set_item(name, of_planes(py, planes, width, height)?)?;
    }
    sharp.sort_by_key(|(number, _)| *number);
    let sharp: Vec<_> = sharp.into_iter().map(|(_, picture)| picture).collect();
    dict.set_item("sharp", sharp)?;
    let instants = recipe.instants();
    let times: Vec<f64> = instants.iter().map(|&share| scene.shutter.frame_time(number, share)).collect();
    dict.set_item("sharp_weights", arrays::array(py, recipe.weights(&scene.shutter.weight), &[instants.len()])?)?;
    dict.set_item("sharp_times", arrays::array(py, times, &[instants.len()])?)?;
    for (name, share) in [("c2w_open", 0.0), ("c2w_middle", 0.5), ("c2w_close", 1.0)] {
        let time = scene.shutter.frame_time(number, share);
        dict.set_item(name, arrays::of_matrix(py, &camera_to_world(scene, time))?)?;
    }
    dict.set_item("stated_error", made.achieved.map(|achieved| achieved.error).or(made.mean_error))?;
    Ok(dict)
}
