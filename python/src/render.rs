//! The renderer: frames, references and paired truth of scenes, as arrays.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::{ThreadPool, ThreadPoolBuilder};
use splatblur::backend::Achieved;
use splatblur::fields::OptionError;
use splatblur::options::in_order;
use splatblur::reference::{self, Reference, ReferenceOptions};
use splatblur::{Aov, BackendError, Device, Look, RenderOptions, Stats, Stop};

use crate::cli::memory::budget;
use crate::cli::words::with_flags;
use crate::dataset;
use crate::errors::{OrRaise as _, Raise as _, guard, interruptible, invalid, refused};
use crate::picture::{How, Origin, to_arrays};
use crate::scene::Scene;

/// A device that renders. It may be used by several threads, one after the other.
#[pyclass(frozen, module = "splatblur._native")]
pub(crate) struct Renderer {
    renderer: Mutex<splatblur::Renderer>,
    pool: Option<ThreadPool>,
    memory: u64,
    backend: &'static str,
    description: String,
}

/// Choices of a picture, as the Python layer hands them over.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Choices {
    mode: String,
    aovs: Vec<String>,
    seed: u64,
    filter: String,
    prefilter: String,
    shading: String,
    detail: String,
    two_sided: bool,
    epsilon: Option<f64>,
    shadows: bool,
    smooth: bool,
}

/// A value by its text; else an error that names the field.
fn word<T: std::str::FromStr<Err = OptionError>>(py: Python<'_>, field: &str, text: &str) -> PyResult<T> {
    text.parse().map_err(|why: OptionError| refused(py, field, text, &why))
}

impl Choices {
    fn look(&self, py: Python<'_>) -> PyResult<Look> {
        let aovs = self.aovs.iter().map(|name| word(py, "aovs", name)).collect::<PyResult<Vec<Aov>>>()?;
        let aovs = in_order(&aovs).map_err(|why| refused(py, "aovs", &self.aovs.join(","), &why))?;
        Ok(Look {
            filter: word(py, "filter", &self.filter)?,
            shading: word(py, "shading", &self.shading)?,
            two_sided: self.two_sided,
            epsilon: self.epsilon,
            shadows: self.shadows,
            seed: self.seed,
            aovs,
        })
    }

    pub(crate) fn options(&self, py: Python<'_>, memory: u64) -> PyResult<RenderOptions> {
        Ok(RenderOptions {
            quality: word(py, "mode", &self.mode)?,
            prefilter: word(py, "prefilter", &self.prefilter)?,
            detail: word(py, "detail", &self.detail)?,
            look: self.look(py)?,
            memory,
            reconstruct: self.smooth,
        })
    }
}

/// Refuses choices that no renderer takes.
#[pyfunction]
pub(crate) fn check_choices(py: Python<'_>, choices: Choices) -> PyResult<()> {
    choices.options(py, 0).map(drop)
}

impl Renderer {
    /// The renderer, once no other thread has it; `None` where `stop` is set before.
    fn wait(&self, stop: &Stop) -> Option<MutexGuard<'_, splatblur::Renderer>> {
        while !stop.is_set() {
            match self.renderer.try_lock() {
                Ok(renderer) => return Some(renderer),
                // A panic within a frame leaves a renderer that begins the next one anew.
                Err(TryLockError::Poisoned(renderer)) => return Some(renderer.into_inner()),
                Err(TryLockError::WouldBlock) => thread::sleep(Duration::from_millis(2)),
            }
        }
        None
    }

    /// In the threads of the renderer.
    fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }

    /// Does `work` with the device, until Ctrl-C.
    fn with_device<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut splatblur::Renderer) -> Result<T, BackendError> + Send,
    ) -> PyResult<Result<T, BackendError>> {
        let stop = Arc::new(Stop::default());
        interruptible(
            py,
            &stop,
            |_| Ok(()),
            || {
                let mut renderer = self.wait(&stop).ok_or(BackendError::Stopped)?;
                renderer.heed(Arc::clone(&stop));
                let renderer: &mut splatblur::Renderer = &mut renderer;
                self.install(|| work(renderer))
            },
        )
    }
}

fn of_achieved<'py>(py: Python<'py>, achieved: &Achieved) -> PyResult<Bound<'py, PyDict>> {
    let values = PyDict::new(py);
    values.set_item("error", achieved.error)?;
    values.set_item("path_length", achieved.path_length)?;
    values.set_item("turn", achieved.turn)?;
    values.set_item("samples", achieved.samples)?;
    values.set_item("most_samples", achieved.most_samples)?;
    values.set_item("interleave", achieved.interleave)?;
    values.set_item("blocks", achieved.blocks)?;
    values.set_item("refined", achieved.refined)?;
    values.set_item("capped", achieved.capped)?;
    Ok(values)
}

fn of_stats<'py>(py: Python<'py>, stats: &Stats, seconds: f64, backend: &str) -> PyResult<Bound<'py, PyDict>> {
    let values = PyDict::new(py);
    values.set_item("seconds", seconds)?;
    values.set_item("backend", backend)?;
    values.set_item("samples", stats.samples)?;
    values.set_item("surfels", stats.surfels)?;
    values.set_item("splats", stats.splats)?;
    values.set_item("left_out", stats.left_out)?;
    values.set_item("detail_error", stats.detail)?;
    values.set_item("stated_error", stats.achieved.map(|achieved| achieved.error))?;
    values.set_item("auto", stats.achieved.map(|achieved| of_achieved(py, &achieved)).transpose()?)?;
    let times = [
        ("project", stats.project),
        ("sort", stats.sort),
        ("bin", stats.bin),
        ("visibility", stats.visibility),
        ("attribute", stats.attribute),
        ("composite", stats.composite),
        ("resolve", stats.resolve),
    ];
    let passes = PyDict::new(py);
    for (name, time) in times {
        passes.set_item(name, time.as_secs_f64())?;
    }
    values.set_item("pass_seconds", passes)?;
    Ok(values)
}

/// Arrays of a picture, with what else is known of it.
fn finish<'py>(arrays: Bound<'py, PyDict>, stats: Bound<'py, PyDict>, origin: Origin) -> PyResult<Bound<'py, PyDict>> {
    arrays.set_item("stats", stats)?;
    arrays.set_item("transparent", origin.scene.image.transparent)?;
    arrays.set_item("origin", Bound::new(arrays.py(), origin)?)?;
    Ok(arrays)
}

/// The file that headers of pictures name, where one can say all of the scene.
fn path_of(scene: &Scene) -> Option<std::path::PathBuf> {
    scene.path.clone().filter(|_| scene.of_files)
}

#[pymethods]
impl Renderer {
    /// Opens `auto`, `cpu`, `gpu`, or a GPU by a part of its name.
    #[new]
    #[pyo3(signature = (device, threads, memory))]
    fn new(py: Python<'_>, device: &str, threads: Option<usize>, memory: Option<u64>) -> PyResult<Self> {
        guard(py)?;
        let device = match device {
            "auto" => Device::Auto,
            "cpu" => Device::Cpu,
            "gpu" => Device::Gpu { adapter: None },
            name => Device::Gpu { adapter: Some(name.to_owned()) },
        };
        let pool = match threads {
            None => None,
            Some(count @ 1..=1024) => {
                let pool = ThreadPoolBuilder::new().num_threads(count).build();
                Some(pool.map_err(|error| pyo3::exceptions::PyRuntimeError::new_err(error.to_string()))?)
            }
            Some(count) => return Err(invalid(py, "threads", &count.to_string(), "a number from 1 to 1024, or None")),
        };
        let renderer = py.detach(|| splatblur::Renderer::open(device)).or_raise(py)?;
        let threads = pool.as_ref().map_or_else(rayon::current_num_threads, ThreadPool::current_num_threads);
        let memory = budget(memory, renderer.backend_name() == "gpu", true);
        let (backend, description) = (renderer.backend_name(), renderer.describe_with(threads));
        Ok(Self { renderer: Mutex::new(renderer), pool, memory, backend, description })
    }

    #[getter]
    fn backend(&self) -> &'static str {
        self.backend
    }

    #[getter]
    fn description(&self) -> &str {
        &self.description
    }

    /// Renders a frame; gives its arrays, `stats` and `origin`.
    fn render<'py>(
        &self,
        py: Python<'py>,
        scene: &Bound<'py, Scene>,
        frame: f64,
        choices: Choices,
    ) -> PyResult<Bound<'py, PyDict>> {
        guard(py)?;
        let options = choices.options(py, self.memory)?;
        let of_scene = Arc::clone(&scene.get().scene);
        let start = Instant::now();
        let rendered = self.with_device(py, |renderer| renderer.render(&of_scene, frame, &options))?.or_raise(py)?;
        let stats = of_stats(py, &rendered.stats, start.elapsed().as_secs_f64(), self.backend)?;
        let comment = rendered.stats.achieved.map(|achieved| with_flags(&achieved.to_string()));
        let how = How::Splatted(options, self.backend);
        let origin = Origin { scene: of_scene, path: path_of(scene.get()), how, frame: frame.into(), comment };
        finish(to_arrays(py, rendered.picture)?, stats, origin)
    }

    /// Traces the reference of a frame; gives its arrays, `stats` and `origin`. `told` hears the share that is done.
    #[pyo3(signature = (scene, frame, choices, samples, error = None, told = None))]
    #[allow(clippy::too_many_arguments, reason = "keywords of one call of the Python layer")]
    fn reference<'py>(
        &self,
        py: Python<'py>,
        scene: &Bound<'py, Scene>,
        frame: f64,
        choices: Choices,
        samples: u64,
        error: Option<f64>,
        told: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        guard(py)?;
        let options = ReferenceOptions { samples, error, look: choices.look(py)?, ..ReferenceOptions::default() };
        let of_scene = Arc::clone(&scene.get().scene);
        let start = Instant::now();
        let share = AtomicU64::new(0);
        let stop = Stop::default();
        let tell = |py: Python<'_>| match &told {
            None => Ok(()),
            Some(told) => told.call1(py, (f64::from_bits(share.load(Ordering::Relaxed)),)).map(drop),
        };
        let traced = interruptible(py, &stop, tell, || {
            // What is traced is built in no time beside the tracing.
            let listen = |step: reference::RoundProgress| {
                let done = if step.is_building() { 0.0 } else { step.share };
                share.store(done.to_bits(), Ordering::Relaxed);
            };
            self.install(|| reference::render_until(&of_scene, frame, &options, None, (&listen, Some(&stop))))
        })?;
        let Reference { picture, stats, .. } = traced.or_raise(py)?;
        let values = PyDict::new(py);
        values.set_item("seconds", start.elapsed().as_secs_f64())?;
        values.set_item("backend", "reference")?;
        values.set_item("samples", stats.samples)?;
        values.set_item("stated_error", stats.mean_error)?;
        let how = How::Traced(options, stats.samples);
        let origin = Origin { scene: of_scene, path: path_of(scene.get()), how, frame: frame.into(), comment: None };
        finish(to_arrays(py, picture)?, values, origin)
    }

    /// Makes the paired truth of a frame.
    fn pair<'py>(
        &self,
        py: Python<'py>,
        scene: &Bound<'py, Scene>,
        frame: f64,
        choices: Choices,
        recipe: dataset::Choices,
    ) -> PyResult<Bound<'py, PyDict>> {
        guard(py)?;
        let seed = choices.seed;
        let by = if recipe.reference > 0 {
            dataset::traced(recipe.reference, choices.look(py)?)
        } else {
            dataset::splatted(choices.options(py, self.memory)?)
        };
        let recipe = recipe.recipe(py, by)?;
        let of_scene = Arc::clone(&scene.get().scene);
        let made = self.with_device(py, |renderer| {
            Ok(dataset::make(renderer.backend(), &of_scene, frame.into(), &recipe, seed))
        })?;
        let parts = made.or_raise(py)?.map_err(|error| error.raise(py))?;
        dataset::to_arrays(py, &of_scene, frame, &recipe, parts)
    }
}
