//! Scenes, cameras and environments.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use numpy::{PyArrayDyn, PyReadonlyArrayDyn, PyUntypedArrayMethods as _};
use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use splatblur::fields::{LoadedScene, OptionError};
use splatblur::glam::{DMat3, DMat4, DVec2, DVec3};
use splatblur::scene::pose::camera_from_world;
use splatblur::scene_file::{SceneLoadOptions, load_model, to_xml};
use splatblur::{Anchor, Direction, FrameRange, Invalid, LatLong, Light, Picture, Readout, Shutter, Weight, files};

use crate::arrays;
use crate::errors::{OrRaise as _, guard, invalid, patient, refused};
use crate::model::{Object, PoseArrays, Poses};

/// A camera. It never changes.
#[pyclass(frozen, module = "splatblur._native")]
pub(crate) struct Camera {
    camera: splatblur::Camera,
    poses: Option<Arc<Poses>>,
}

/// The lens: vertical field of view (radians), nearest visible depth, shift of the axis in shares of the image.
type Lens = (f64, f64, (f64, f64));

fn with_lens(mut camera: splatblur::Camera, (fovy, near, (right, down)): Lens) -> splatblur::Camera {
    (camera.fovy, camera.near, camera.shift) = (fovy, near, DVec2::new(right, down));
    camera
}

#[pymethods]
impl Camera {
    /// At a point, looking at another.
    #[staticmethod]
    fn look(eye: [f64; 3], at: [f64; 3], up: [f64; 3], lens: Lens) -> Self {
        let camera = splatblur::Camera { up: up.into(), ..splatblur::Camera::new(eye.into(), at.into()) };
        Self { camera: with_lens(camera, lens), poses: None }
    }

    /// Going through poses, camera to world, the camera looking along its -z.
    #[staticmethod]
    fn moving(frames: &Bound<'_, PyAny>, matrices: &Bound<'_, PyAny>, lens: Lens) -> PyResult<Self> {
        let poses = Poses::new(frames, matrices)?;
        let camera = splatblur::Camera::new(DVec3::ZERO, DVec3::NEG_Z);
        Ok(Self { camera: with_lens(camera, lens), poses: Some(Arc::new(poses)) })
    }

    /// Eye, point that it looks at, up.
    #[getter]
    fn look_at(&self) -> ([f64; 3], [f64; 3], [f64; 3]) {
        let splatblur::Camera { eye, at, up, .. } = &self.camera;
        (eye.to_array(), at.to_array(), up.to_array())
    }

    #[getter]
    fn lens(&self) -> Lens {
        let splatblur::Camera { fovy, near, shift, .. } = &self.camera;
        (*fovy, *near, (shift.x, shift.y))
    }

    /// Does something of a file move it?
    #[getter]
    fn of_file(&self) -> bool {
        !self.camera.rests()
    }

    /// The poses that it was given, as (frames, matrices).
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Option<PoseArrays<'py>>> {
        self.poses.as_ref().map(|poses| poses.arrays(py)).transpose()
    }

    fn with_lens(&self, lens: Lens) -> Self {
        Self { camera: with_lens(self.camera.clone(), lens), poses: self.poses.clone() }
    }
}

/// What surrounds a scene. It never changes.
#[pyclass(frozen, module = "splatblur._native")]
pub(crate) struct Environment {
    environment: splatblur::Environment,
    /// Is it a light? `None`: where the scene has no lights of its own.
    light: Option<bool>,
}

/// How a picture surrounds a scene.
struct Around {
    /// Degrees.
    rotation: f64,
    intensity: f64,
    background: bool,
    shadows: bool,
    light: Option<bool>,
}

#[pymethods]
impl Environment {
    /// The picture of a file: PNG, EXR or Radiance HDR.
    #[staticmethod]
    fn load(
        py: Python<'_>,
        path: PathBuf,
        rotation: f64,
        intensity: f64,
        background: bool,
        shadows: bool,
        light: Option<bool>,
    ) -> PyResult<Self> {
        guard(py)?;
        let picture = py.detach(|| Picture::read(&path)).or_raise(py)?;
        let pixels = picture.rgba.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
        let around = Around { rotation, intensity, background, shadows, light };
        Self::of(py, picture.width as usize, pixels, path, &around)
    }

    /// A picture (H, 2 H, 3), linear.
    #[staticmethod]
    fn of_pixels(
        pixels: PyReadonlyArrayDyn<'_, f32>,
        rotation: f64,
        intensity: f64,
        background: bool,
        shadows: bool,
        light: Option<bool>,
    ) -> PyResult<Self> {
        let py = pixels.py();
        let &[_, width, 3] = pixels.shape() else {
            return Err(invalid(py, "environment", &format!("of shape {:?}", pixels.shape()), "(H, 2 H, 3)"));
        };
        let rows = pixels.as_slice().map_or_else(|_| Vec::new(), |values| values.as_chunks::<3>().0.to_vec());
        Self::of(py, width, rows, PathBuf::new(), &Around { rotation, intensity, background, shadows, light })
    }

    /// The file; empty where it was made of pixels.
    #[getter]
    fn path(&self) -> OsString {
        self.environment.path.clone().into_os_string()
    }

    /// Rotation in degrees, intensity, and whether it is the background, has shadows and is a light.
    #[getter]
    fn settings(&self) -> (f64, f64, bool, bool, Option<bool>) {
        let own = &self.environment;
        (own.rotation.to_degrees(), own.intensity, own.background, own.shadows, self.light)
    }

    /// Writes its picture as EXR, and gives the same environment as one of that file.
    fn saved(&self, py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let map = self.environment.map();
        let rgba = map.pixels().iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
        let picture = Picture { width: map.width() as u32, height: map.height() as u32, rgba, layers: Vec::new() };
        py.detach(|| picture.write(&path)).or_raise(py)?;
        let mut environment = self.environment.clone();
        environment.path = path;
        Ok(Self { environment, ..*self })
    }

    /// Its pixels (H, 2 H, 3).
    fn pixels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let map = self.environment.map();
        let values = map.pixels().to_vec().into_flattened();
        arrays::array(py, values, &[map.height(), map.width(), 3])
    }
}

impl Environment {
    fn of(
        py: Python<'_>,
        width: usize,
        pixels: Vec<[f32; 3]>,
        path: PathBuf,
        &Around { rotation, intensity, background, shadows, light }: &Around,
    ) -> PyResult<Self> {
        let map = LatLong::new(width, pixels)
            .map_err(|why| invalid(py, "environment", &why.to_string(), "a picture of all directions"))?;
        let mut environment = splatblur::Environment::new(map);
        (environment.path, environment.rotation) = (path, rotation.to_radians());
        (environment.intensity, environment.background, environment.shadows) = (intensity, background, shadows);
        Ok(Self { environment, light })
    }
}

/// A scene as it is rendered. It never changes; `changed` makes another one.
#[pyclass(frozen, module = "splatblur._native")]
pub(crate) struct Scene {
    pub(crate) scene: Arc<splatblur::Scene>,
    /// The scene file, or model, that it was loaded from.
    pub(crate) path: Option<PathBuf>,
    /// Is everything in it from files, so that files of pictures can say what made them?
    pub(crate) of_files: bool,
    /// What a user should know about how it was loaded.
    #[pyo3(get)]
    notes: Vec<String>,
}

/// Open, close, weight, read-out (frames), its direction, its anchor.
type ShutterValues = (f64, f64, String, f64, String, String);

/// Name, size, background, whether it is left out, first and last frame, rate, shutter, lights.
type SceneValues = (String, (u32, u32), [f64; 3], bool, (i64, i64), f64, ShutterValues, Vec<LightValues>);

/// Kind (directional, point, ambient), direction or position, colour.
type LightValues = (String, [f64; 3], [f64; 3], f64, bool);

fn shutter(py: Python<'_>, (open, close, weight, duration, direction, anchor): ShutterValues) -> PyResult<Shutter> {
    let refused = |why: OptionError| refused(py, "weight", &weight, &why);
    let weight: Weight = weight.parse().map_err(refused)?;
    let direction = Direction::ALL
        .into_iter()
        .find(|known| known.name() == direction)
        .ok_or_else(|| invalid(py, "direction", &format!("`{direction}`"), "down, up, right or left"))?;
    let anchor = Anchor::ALL.into_iter().find(|known| known.name() == anchor);
    let anchor = anchor.ok_or_else(|| invalid(py, "anchor", "unknown", "middle or first"))?;
    Ok(Shutter { open, close, weight, readout: Readout { duration, direction, anchor } })
}

fn light(py: Python<'_>, (kind, place, colour, size, shadows): LightValues) -> PyResult<Light> {
    let (place, colour) = (DVec3::from(place), DVec3::from(colour));
    match kind.as_str() {
        "directional" => Ok(Light::Directional { direction: place, colour, angle: size.to_radians(), shadows }),
        "point" => Ok(Light::Point { position: place, colour, radius: size, shadows }),
        "ambient" => Ok(Light::Ambient { colour }),
        other => Err(invalid(py, "light", &format!("`{other}`"), "directional, point or ambient")),
    }
}

/// Refuses a shutter that no scene takes.
#[pyfunction]
pub(crate) fn check_shutter(py: Python<'_>, values: ShutterValues) -> PyResult<()> {
    // Any scene that is valid.
    let mut scene = splatblur::Scene::new([splatblur::Object::new(splatblur::Sphere {
        radius: 1.0,
        colour: splatblur::glam::Vec3::ONE,
    })]);
    scene.shutter = shutter(py, values)?;
    scene
        .check()
        .map_err(|flaw| Invalid { field: flaw.field.trim_start_matches("shutter.").to_owned(), ..flaw })
        .or_raise(py)
}

/// What a Python scene says beside its objects.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Settings<'py> {
    name: String,
    size: (u32, u32),
    background: [f64; 3],
    transparent: bool,
    frames: Option<(i64, i64)>,
    rate: f64,
    shutter: Option<ShutterValues>,
    lights: Option<Vec<LightValues>>,
    camera: Option<Bound<'py, Camera>>,
    environment: Option<Bound<'py, Environment>>,
}

#[pymethods]
impl Scene {
    /// Reads a scene file, or a model file, which becomes a scene of its own.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf, size: Option<(u32, u32)>, lenient: bool) -> PyResult<Self> {
        guard(py)?;
        let mut start = [0; 4096];
        let count = files::open(&path)
            .ok()
            .map_or(0, |mut file| std::io::Read::read(&mut file, &mut start).unwrap_or_default());
        let from = path.clone();
        let LoadedScene { scene, notes, .. } = if is_xml(&start[..count], &path) {
            let opening = splatblur::Scene::open(&from);
            let opening = if lenient { opening.lenient() } else { opening };
            let opening = size.map_or(opening.clone(), |(width, height)| opening.size(width, height));
            patient(py, move || opening.load_with_notes())?.or_raise(py)?
        } else {
            let options = SceneLoadOptions { lenient, size, ..SceneLoadOptions::default() };
            patient(py, move || load_model(&from, &options))?.or_raise(py)?
        };
        Ok(Self { scene: Arc::new(scene), path: Some(path), of_files: true, notes })
    }

    /// The scene with these objects and settings. `base` is the scene that they came from; without one, what is not
    /// given is chosen as for a scene in code.
    #[staticmethod]
    fn make(
        py: Python<'_>,
        base: Option<&Bound<'_, Self>>,
        objects: Vec<Bound<'_, Object>>,
        settings: Settings<'_>,
    ) -> PyResult<Self> {
        guard(py)?;
        let rate = settings.rate;
        // A rate of 0 would make times infinite: the rate itself is what is wrong.
        if !(rate > 0.0 && rate.is_finite()) {
            return Err(invalid(py, "rate", &rate.to_string(), "frames per second, above 0"));
        }
        let own: Result<Vec<_>, _> = objects.iter().map(|object| object.get().at_rate(rate)).collect();
        let own = own.or_raise(py)?;
        let in_code = objects.iter().any(|object| {
            let Object { object, poses, .. } = object.get();
            let has_no_file = object.source.path.as_os_str().is_empty() && object.shape.sequence().is_none();
            poses.is_some() || has_no_file
        });
        let mut scene = match base {
            Some(base) => splatblur::Scene { objects: own, ..(*base.get().scene).clone() },
            None => py.detach(|| splatblur::Scene::new(own)),
        };
        scene.name = settings.name;
        scene.frames.rate = rate;
        if let Some((first, last)) = settings.frames {
            scene.frames = FrameRange { first, last, rate };
        }
        (scene.image.width, scene.image.height) = settings.size;
        (scene.image.background, scene.image.transparent) = (settings.background.into(), settings.transparent);
        if let Some(values) = settings.shutter {
            scene.shutter = shutter(py, values)?;
        }
        let has_no_lights = settings.lights.is_none();
        if let Some(lights) = settings.lights {
            scene.lights = lights.into_iter().map(|values| light(py, values)).collect::<PyResult<_>>()?;
        }
        scene.environment = settings.environment.as_ref().map(|environment| environment.get().environment.clone());
        if let (Some(environment), Some(given)) = (&mut scene.environment, &settings.environment) {
            environment.light = given.get().light.unwrap_or(has_no_lights);
            // It takes the place of the lights that a scene has where none are given.
            if environment.light && has_no_lights {
                scene.lights.clear();
            }
        }
        // The environment that shone in the scene's file may be gone.
        let shines = scene.environment.as_ref().is_some_and(|environment| environment.light);
        if has_no_lights && !shines && scene.lights.is_empty() {
            scene.lights = splatblur::Scene::new([]).lights;
        }
        let mut camera_in_code = false;
        match settings.camera {
            Some(camera) => {
                scene.camera = camera.get().camera.clone();
                if let Some(poses) = &camera.get().poses {
                    camera_in_code = true;
                    scene.camera.animation = Some(poses.at_rate(rate).or_raise(py)?);
                }
            }
            None if base.is_none() => scene.camera = py.detach(|| splatblur::Camera::automatic(&scene)),
            None => {}
        }
        if base.is_none() && settings.frames.is_none() {
            scene.frames = frames(&scene);
        }
        scene.check().or_raise(py)?;
        let base = base.map(|base| base.get());
        let of_files = base.is_some_and(|base| base.of_files) && !in_code && !camera_in_code;
        let notes = Vec::new();
        Ok(Self { scene: Arc::new(scene), path: base.and_then(|base| base.path.clone()), of_files, notes })
    }

    /// The values of the scene, as `make` takes them.
    #[getter]
    fn values(&self) -> SceneValues {
        let scene = &self.scene;
        let (image, shutter) = (&scene.image, &scene.shutter);
        let (direction, anchor) = (shutter.readout.direction.name(), shutter.readout.anchor.name());
        let shutter = (
            shutter.open,
            shutter.close,
            shutter.weight.to_string(),
            shutter.readout.duration,
            direction.to_owned(),
            anchor.to_owned(),
        );
        let lights = scene.lights.iter().map(|light| match *light {
            Light::Directional { direction, colour, angle, shadows } => {
                ("directional", direction, colour, angle.to_degrees(), shadows)
            }
            Light::Point { position, colour, radius, shadows } => ("point", position, colour, radius, shadows),
            Light::Ambient { colour } => ("ambient", DVec3::ZERO, colour, 0.0, false),
        });
        let lights = lights.map(|(kind, place, colour, size, shadows)| {
            (kind.to_owned(), place.to_array(), colour.to_array(), size, shadows)
        });
        (
            scene.name.clone(),
            (image.width, image.height),
            image.background.to_array(),
            image.transparent,
            (scene.frames.first, scene.frames.last),
            scene.frames.rate,
            shutter,
            lights.collect(),
        )
    }

    #[getter]
    fn camera(&self) -> Camera {
        Camera { camera: self.scene.camera.clone(), poses: None }
    }

    #[getter]
    fn environment(&self) -> Option<Environment> {
        let environment = self.scene.environment.clone()?;
        Some(Environment { light: Some(environment.light), environment })
    }

    #[getter]
    fn objects(&self) -> Vec<Object> {
        self.scene.objects.iter().cloned().map(Object::plain).collect()
    }

    /// The same with other objects, and with this environment.
    fn of_saved(&self, objects: Vec<Bound<'_, Object>>, environment: Option<&Bound<'_, Environment>>) -> Self {
        let mut scene = (*self.scene).clone();
        scene.objects = objects.iter().map(|object| object.get().object.clone()).collect();
        if let (Some(scene), Some(environment)) = (&mut scene.environment, environment) {
            scene.path.clone_from(&environment.get().environment.path);
        }
        Self { scene: Arc::new(scene), path: self.path.clone(), of_files: self.of_files, notes: Vec::new() }
    }

    /// Camera to world at a time (frames), of a camera that looks along its -z.
    fn camera_to_world<'py>(&self, py: Python<'py>, frame: f64) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        arrays::of_matrix(py, &camera_to_world(&self.scene, frame))
    }

    /// Writes the scene as XML. Its models are files already.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let directory = path.parent().unwrap_or(Path::new(""));
        let text = to_xml(&self.scene, directory);
        let written = py.detach(|| files::replace(&path, text.as_bytes()));
        written.map_err(|error| PyOSError::new_err(format!("cannot write {}: {error}", path.display())))
    }
}

/// The inverse of the camera's transform, which turns and moves.
pub(crate) fn camera_to_world(scene: &splatblur::Scene, frame: f64) -> DMat4 {
    let camera = camera_from_world(scene, frame);
    let turn = DMat3::from_mat4(camera).transpose();
    DMat4::from_mat3_translation(turn, -(turn * camera.w_axis.truncate()))
}

/// The frames of a scene in code: those of all poses, of objects and camera, else as the library chooses.
fn frames(scene: &splatblur::Scene) -> FrameRange {
    let rate = scene.frames.rate;
    let moving = scene.objects.iter().filter_map(|object| object.animation.as_ref()).chain(&scene.camera.animation);
    let all = moving.map(|binding| binding.node.range()).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let Some((first, last)) = all else { return scene.frames };
    // Poses that stand on a frame may miss it by rounding in the conversion to seconds and back.
    let (first, last) = ((first * rate - 1e-6).ceil() as i64, (last * rate + 1e-6).floor() as i64);
    FrameRange { first: first.min(last), last, rate }
}

/// Is it a scene file, and no model?
fn is_xml(start: &[u8], path: &Path) -> bool {
    let text = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
    let is_utf_16 = start.starts_with(b"\xff\xfe") || start.starts_with(b"\xfe\xff");
    let named = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xml"));
    named || is_utf_16 || text.starts_with(b"<")
}
