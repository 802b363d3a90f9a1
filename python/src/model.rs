//! Objects: a shape with its place, motion and look.

use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;

use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use splatblur::fields::Kind;
use splatblur::glam::{DMat4, DQuat, DVec3, EulerRot, Quat, Vec3};
use splatblur::model::{LoadOptions, load, write_bin, write_ply};
use splatblur::scene::pose::object_pose;
use splatblur::{
    AnimationBinding, Gaussians, Invalid, Material, ModelError, Motion, Optics, Scene, Shape, Source, Surfels,
    SurfelsBuilder, Transform, VelocityUnit,
};

use crate::arrays;
use crate::errors::{OrRaise as _, guard, invalid, patient};

/// Poses at frames, which become a motion once the rate of the scene is known.
#[derive(Clone)]
pub(crate) struct Poses {
    pub(crate) frames: Vec<f64>,
    pub(crate) matrices: Vec<DMat4>,
}

/// Frames (T,) and matrices (T, 4, 4).
pub(crate) type PoseArrays<'py> = (Bound<'py, PyArrayDyn<f64>>, Bound<'py, PyArrayDyn<f64>>);

impl Poses {
    /// Reads and checks them.
    pub(crate) fn new(frames: &Bound<'_, PyAny>, matrices: &Bound<'_, PyAny>) -> PyResult<Self> {
        let poses = Self { frames: arrays::doubles(frames)?, matrices: arrays::matrices(matrices)? };
        poses.at_rate(1.0).or_raise(frames.py())?;
        Ok(poses)
    }

    /// The motion in a scene of `rate` frames per second.
    pub(crate) fn at_rate(&self, rate: f64) -> Result<AnimationBinding, Invalid> {
        AnimationBinding::from_poses(rate, &self.frames, &self.matrices)
    }

    /// The arrays that it was made of.
    pub(crate) fn arrays<'py>(&self, py: Python<'py>) -> PyResult<PoseArrays<'py>> {
        let frames = arrays::array(py, self.frames.clone(), &[self.frames.len()])?;
        let rows: Vec<f64> = self.matrices.iter().flat_map(|m| m.transpose().to_cols_array()).collect();
        Ok((frames, arrays::array(py, rows, &[self.matrices.len(), 4, 4])?))
    }
}

/// An object. It never changes: the methods `with_...` make another one, which shares its shape.
#[pyclass(frozen, module = "splatblur._native")]
pub(crate) struct Object {
    pub(crate) object: splatblur::Object,
    pub(crate) poses: Option<Arc<Poses>>,
    /// What a user should know about how it was made.
    #[pyo3(get)]
    notes: Vec<String>,
}

impl Object {
    pub(crate) fn plain(object: splatblur::Object) -> Self {
        Self { object, poses: None, notes: Vec::new() }
    }

    /// The object, moving as it says, for a scene of `rate` frames per second.
    pub(crate) fn at_rate(&self, rate: f64) -> Result<splatblur::Object, Invalid> {
        let mut object = self.object.clone();
        if let Some(poses) = &self.poses {
            object.animation = Some(poses.at_rate(rate)?);
        }
        Ok(object)
    }

    fn with(&self, change: impl FnOnce(&mut splatblur::Object)) -> Self {
        let mut object = self.object.clone();
        change(&mut object);
        Self { object, poses: self.poses.clone(), notes: Vec::new() }
    }
}

/// Names of columns in the library, and their arguments here.
type Words = &'static [(&'static str, &'static str)];
const POINTS: Words = &[
    ("position", "positions"),
    ("colour", "colours"),
    ("velocity", "velocities"),
    ("acceleration", "accelerations"),
    ("opacity", "opacities"),
    ("normal", "normals"),
];
const GAUSSIANS: Words =
    &[("position", "means"), ("sigma", "scales"), ("opacity", "opacities"), ("base", "sh"), ("harmonics", "sh")];
const COLOURED: Words = &[("position", "means"), ("sigma", "scales"), ("opacity", "opacities"), ("base", "colours")];

/// The flaw of a column by the name of the argument that it came from.
fn in_words(flaw: Invalid, words: Words) -> Invalid {
    let field = flaw.field.trim_start_matches("objects[0].shape.model.");
    let (name, row) = field.split_at(field.find('[').unwrap_or(field.len()));
    let argument = words.iter().find(|(column, _)| *column == name).map(|(_, argument)| *argument);
    Invalid { field: argument.map_or_else(|| field.to_owned(), |argument| format!("{argument}{row}")), ..flaw }
}

/// The same of an error of a model.
fn in_words_of(error: ModelError, words: Words) -> ModelError {
    match error {
        ModelError::Column(flaw) => ModelError::Column(in_words(flaw, words)),
        other => other,
    }
}

/// An optional column of a dict.
fn column<T>(
    columns: &Bound<'_, PyDict>,
    name: &str,
    read: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<Vec<T>>,
) -> PyResult<Option<Vec<T>>> {
    columns.get_item(name)?.filter(|value| !value.is_none()).map(|value| read(&value)).transpose()
}

/// Copies columns as `Object::points` does, and makes nothing of them; gives the number of points. For measurements.
#[pyfunction]
pub(crate) fn copied(columns: &Bound<'_, PyDict>) -> PyResult<usize> {
    Ok(builder(columns, "second", false)?.1)
}

/// Surfels on the way, and their number.
fn builder(columns: &Bound<'_, PyDict>, velocity_unit: &str, two_sided: bool) -> PyResult<(SurfelsBuilder, usize)> {
    let positions = column(columns, "positions", arrays::places)?.unwrap_or_default();
    let count = positions.len();
    let mut builder = Surfels::builder(positions);
    if let Some(normals) = column(columns, "normals", arrays::vectors)? {
        builder = builder.normals(normals);
    }
    if let Some(radii) = column(columns, "radii", arrays::numbers)? {
        builder = builder.radii(radii);
    }
    if let Some(colours) = column(columns, "colours", arrays::vectors)? {
        builder = builder.colours(colours);
    }
    if let Some(opacities) = column(columns, "opacities", arrays::numbers)? {
        builder = builder.opacities(opacities);
    }
    if let Some(velocities) = column(columns, "velocities", arrays::vectors)? {
        builder = builder.velocities(velocities, unit(velocity_unit));
    }
    if let Some(accelerations) = column(columns, "accelerations", arrays::vectors)? {
        builder = builder.accelerations(accelerations);
    }
    if let Some(ids) = column(columns, "ids", arrays::identities)? {
        builder = builder.identities(ids);
    }
    Ok((if two_sided { builder.two_sided() } else { builder }, count))
}

fn unit(word: &str) -> VelocityUnit {
    if word == "frame" { VelocityUnit::Frame } else { VelocityUnit::Second }
}

#[pymethods]
impl Object {
    /// Surfels of points, by columns of one length. Normals and radii that are missing are estimated.
    #[staticmethod]
    fn points(py: Python<'_>, columns: &Bound<'_, PyDict>, velocity_unit: &str, two_sided: bool) -> PyResult<Self> {
        guard(py)?;
        let (builder, _) = builder(columns, velocity_unit, two_sided)?;
        let made =
            patient(py, move || builder.build().map(|(surfels, notes)| (splatblur::Object::new(surfels), notes)));
        let (object, notes) = made?.or_raise(py)?;
        let mut alone = Scene::new([]);
        alone.objects.push(object);
        py.detach(|| alone.check()).map_err(|flaw| in_words(flaw, POINTS)).or_raise(py)?;
        Ok(Self { object: alone.objects.remove(0), poses: None, notes })
    }

    /// A capture, by columns of one length: means, quaternions (w first), scales, opacities, and colours or `sh`, which
    /// has the coefficients of all degrees (N, K, 3).
    #[staticmethod]
    fn gaussians(
        py: Python<'_>,
        columns: &Bound<'_, PyDict>,
        degree: u8,
        linear: bool,
        antialiased: bool,
    ) -> PyResult<Self> {
        guard(py)?;
        let position = column(columns, "means", arrays::vectors)?.unwrap_or_default();
        let quats = column(columns, "quats", arrays::fours)?.unwrap_or_default();
        let rotation = quats.into_iter().map(|[w, x, y, z]| {
            // In f64: squares of tiny or of huge numbers do not fit into 32 bits.
            DQuat::from_xyzw(x.into(), y.into(), z.into(), w.into()).normalize().as_quat()
        });
        let rotation: Vec<Quat> = rotation.collect();
        if let Some(row) = rotation.iter().position(|quat| !quat.is_finite()) {
            let field = format!("quats[{row}]");
            return Err(invalid(py, &field, "without a direction", "finite numbers that are not all 0"));
        }
        let (base, harmonics) = match column(columns, "colours", arrays::vectors)? {
            Some(colours) => (colours.into_iter().map(Gaussians::base_of).collect(), Vec::new()),
            None => split(&column(columns, "sh", arrays::vectors)?.unwrap_or_default(), degree),
        };
        let gaussians = Gaussians {
            position,
            sigma: column(columns, "scales", arrays::vectors)?.unwrap_or_default(),
            rotation,
            opacity: column(columns, "opacities", arrays::numbers)?.unwrap_or_default(),
            base,
            harmonics,
            degree,
            linear,
            antialiased,
            ..Gaussians::default()
        };
        let words = if columns.contains("colours")? { COLOURED } else { GAUSSIANS };
        let made = patient(py, move || splatblur::Object::from_gaussians(gaussians))?;
        Ok(Self::plain(made.map_err(|error| in_words_of(error, words)).or_raise(py)?))
    }

    /// An object of a model file. `kind`: `surfels`, `spheres`, `gaussians`, or nothing for what the file is.
    #[staticmethod]
    #[pyo3(signature = (path, kind = None))]
    fn load(py: Python<'_>, path: PathBuf, kind: Option<&str>) -> PyResult<Self> {
        guard(py)?;
        let kind = match kind {
            None => None,
            Some("surfels") => Some(Kind::Surfels),
            Some("spheres") => Some(Kind::Spheres),
            Some("gaussians") => Some(Kind::Gaussians),
            Some(other) => {
                return Err(invalid(py, "kind", &format!("`{other}`"), "surfels, spheres, gaussians or None"));
            }
        };
        let options = LoadOptions { kind, ..LoadOptions::default() };
        let (from, with) = (path.clone(), options.clone());
        let loaded = patient(py, move || {
            load(&from, &with, &|_, _| {}).map(|mut loaded| {
                let notes = std::mem::take(&mut loaded.notes);
                (splatblur::Object::new(loaded), notes)
            })
        });
        let (mut object, notes) = loaded?.or_raise(py)?;
        let notes = notes.iter().map(|note| format!("{}: {note}", path.display())).collect();
        object.source = Source { path, options };
        Ok(Self { object, poses: None, notes })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.object.name
    }

    #[getter]
    fn blur(&self) -> bool {
        self.object.blur
    }

    #[getter]
    fn receive_shadows(&self) -> bool {
        self.object.receive_shadows
    }

    #[getter]
    fn shadow_catcher(&self) -> bool {
        self.object.shadow_catcher
    }

    #[getter]
    fn cast_shadows(&self) -> bool {
        self.object.cast_shadows
    }

    #[getter]
    fn opacity(&self) -> f64 {
        self.object.opacity
    }

    /// Surfels, Gaussians or kernels; 0 for a sequence.
    #[getter]
    fn elements(&self) -> usize {
        self.object.shape.elements()
    }

    /// What it is made of.
    #[getter]
    fn kind(&self) -> &'static str {
        match self.object.shape {
            Shape::Surfels { .. } => "surfels",
            Shape::Gaussians { .. } => "gaussians",
            Shape::Volume { .. } => "volume",
            Shape::Sequence { .. } => "sequence",
            Shape::Sphere { .. } => "sphere",
        }
    }

    /// The model file; empty for a model that was made in code.
    #[getter]
    fn path(&self) -> OsString {
        self.object.source.path.clone().into_os_string()
    }

    /// Box around the centres in model space: two corners.
    #[getter]
    fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        let bounds = self.object.shape.bounds();
        (bounds.min.to_array(), bounds.max.to_array())
    }

    /// The poses that it was given, as (frames, matrices).
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Option<PoseArrays<'py>>> {
        self.poses.as_ref().map(|poses| poses.arrays(py)).transpose()
    }

    /// From the model to the object's place before its motion.
    fn transform<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        arrays::of_matrix(py, &self.object.transform.matrix())
    }

    /// From the model to the world at a time of a scene of `rate` frames per second.
    fn pose_at<'py>(&self, py: Python<'py>, rate: f64, frame: f64) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let mut scene = Scene::new([]);
        scene.frames.rate = rate;
        let object = self.at_rate(rate).or_raise(py)?;
        arrays::of_matrix(py, &object_pose(&scene, &object, frame).world_from_model)
    }

    fn with_name(&self, name: String) -> Self {
        self.with(|object| object.name = name)
    }

    fn with_blur(&self, blur: bool) -> Self {
        self.with(|object| object.blur = blur)
    }

    fn with_receive_shadows(&self, receive_shadows: bool) -> Self {
        self.with(|object| object.receive_shadows = receive_shadows)
    }

    fn with_shadow_catcher(&self, shadow_catcher: bool) -> Self {
        self.with(|object| object.shadow_catcher = shadow_catcher)
    }

    fn with_cast_shadows(&self, cast_shadows: bool) -> Self {
        self.with(|object| object.cast_shadows = cast_shadows)
    }

    fn with_opacity(&self, opacity: f64) -> Self {
        self.with(|object| object.opacity = opacity)
    }

    /// Stands at `matrix` before its motion: translation, rotation and scales.
    fn with_transform(&self, py: Python<'_>, matrix: &Bound<'_, PyAny>) -> PyResult<Self> {
        let Some(&matrix) = arrays::matrices(matrix)?.first() else {
            return Err(invalid(py, "transform", "empty", "a matrix"));
        };
        // It is refused as poses are: where it is singular, sheared or not finite.
        let chain = AnimationBinding::from_poses(1.0, &[0.0], &[matrix]);
        chain.map_err(|error| Invalid { field: "transform".to_owned(), ..error }).or_raise(py)?;
        let (scale, rotation, translate) = matrix.to_scale_rotation_translation();
        // Our order Xyz turns about x first: Z Y X as a product of matrices.
        let (z, y, x) = rotation.to_euler(EulerRot::ZYX);
        let transform = Transform { translate, rotate: DVec3::new(x, y, z), scale, ..Transform::default() };
        Ok(self.with(|object| object.transform = transform))
    }

    /// Goes through poses, in place of any other motion.
    fn with_poses(&self, frames: &Bound<'_, PyAny>, matrices: &Bound<'_, PyAny>) -> PyResult<Self> {
        let poses = Poses::new(frames, matrices)?;
        let mut changed = self.with(|object| (object.animation, object.motions) = (None, Vec::new()));
        changed.poses = Some(Arc::new(poses));
        Ok(changed)
    }

    /// Moves at constant speed, scene units a frame, beside any other motion.
    fn with_velocity(&self, velocity: [f64; 3]) -> Self {
        self.with(|object| object.motions = vec![Motion::Linear { velocity: velocity.into() }])
    }

    /// Material of the whole object: ambient, diffuse, specular, shininess.
    fn with_material(&self, coefficients: [f32; 4]) -> Self {
        let [ambient, diffuse, specular, shininess] = coefficients;
        self.with(|object| {
            if let Some(surface) = object.shape.surface_mut() {
                surface.material = Some(Material { ambient, diffuse, specular, shininess });
            }
        })
    }

    /// The same, of a model file that holds it.
    fn with_path(&self, path: PathBuf) -> Self {
        self.with(|object| object.source.path = path)
    }

    /// The same capture, which says itself whether it was trained with an antialiased rasteriser: PLY cannot.
    fn with_antialias(&self) -> Self {
        self.with(|object| {
            if let Shape::Gaussians { model, capture } = &mut object.shape {
                capture.antialias = capture.antialias.or(Some(model.gaussians().antialiased));
            }
        })
    }

    /// Writes the surfels to a file, `.bin` or `.ply`.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        guard(py)?;
        let Some(model) = self.object.shape.surfels() else {
            return Err(invalid(py, "object", self.kind(), "surfels, which alone can be written to a file"));
        };
        let is_ply = path.extension().is_some_and(|extension| extension == "ply");
        let write = if is_ply { write_ply } else { write_bin };
        py.detach(|| write(&path, model.surfels())).or_raise(py)
    }

    /// The columns of a model that was made in code, for `of_columns`; `None` for other models.
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let columns = PyDict::new(py);
        match &self.object.shape {
            Shape::Surfels { model, .. } => surfel_columns(py, model.surfels(), &columns)?,
            Shape::Gaussians { model, .. } => gaussian_columns(py, model.gaussians(), &columns)?,
            _ => return Ok(None),
        }
        Ok(Some(columns))
    }

    /// The object whose columns these are.
    #[staticmethod]
    fn of_columns(py: Python<'_>, columns: &Bound<'_, PyDict>) -> PyResult<Self> {
        guard(py)?;
        if columns.contains("sigma")? {
            return Ok(Self::plain(splatblur::Object::from_gaussians(read_gaussians(columns)?).or_raise(py)?));
        }
        let surfels = read_surfels(columns)?;
        Ok(Self::plain(py.detach(|| splatblur::Object::new(surfels))))
    }
}

/// Coefficients of all degrees, each Gaussian's one after the other, as those of degree 0 and all others.
fn split(coefficients: &[Vec3], degree: u8) -> (Vec<Vec3>, Vec<Vec3>) {
    let each = (usize::from(degree) + 1).pow(2);
    let (mut base, mut harmonics) = (Vec::new(), Vec::new());
    for of_one in coefficients.chunks_exact(each) {
        base.push(of_one[0]);
        harmonics.extend_from_slice(&of_one[1..]);
    }
    (base, harmonics)
}

fn surfel_columns<'py>(py: Python<'py>, surfels: &Surfels, columns: &Bound<'py, PyDict>) -> PyResult<()> {
    let vectors = [
        ("position", &surfels.position),
        ("axis_u", &surfels.axis_u),
        ("axis_v", &surfels.axis_v),
        ("normal", &surfels.normal),
        ("colour", &surfels.colour),
        ("velocity", &surfels.velocity),
        ("acceleration", &surfels.acceleration),
    ];
    for (name, values) in vectors {
        columns.set_item(name, arrays::of_vectors(py, values.clone())?)?;
    }
    columns.set_item("opacity", arrays::array(py, surfels.opacity.clone(), &[surfels.opacity.len()])?)?;
    let materials = surfels.material.iter().map(|m| [m.ambient, m.diffuse, m.specular, m.shininess]);
    let materials: Vec<_> = materials.collect();
    let count = materials.len();
    columns.set_item("material", arrays::array(py, materials.into_flattened(), &[count, 4])?)?;
    columns.set_item("id", arrays::array(py, surfels.id.clone(), &[surfels.id.len()])?)?;
    columns.set_item("origin", surfels.origin.to_array())?;
    columns.set_item("per_frame", surfels.velocity_unit == VelocityUnit::Frame)?;
    columns.set_item("two_sided", surfels.two_sided)?;
    columns.set_item("signs_estimated", surfels.signs_estimated)?;
    columns.set_item("spheres", surfels.spheres)
}

fn gaussian_columns<'py>(py: Python<'py>, gaussians: &Gaussians, columns: &Bound<'py, PyDict>) -> PyResult<()> {
    columns.set_item("position", arrays::of_vectors(py, gaussians.position.clone())?)?;
    columns.set_item("sigma", arrays::of_vectors(py, gaussians.sigma.clone())?)?;
    columns.set_item("base", arrays::of_vectors(py, gaussians.base.clone())?)?;
    columns.set_item("harmonics", arrays::of_vectors(py, gaussians.harmonics.clone())?)?;
    let rotation: Vec<[f32; 4]> = gaussians.rotation.iter().map(|quat| quat.to_array()).collect();
    let count = rotation.len();
    columns.set_item("rotation", arrays::array(py, rotation.into_flattened(), &[count, 4])?)?;
    columns.set_item("opacity", arrays::array(py, gaussians.opacity.clone(), &[count])?)?;
    columns.set_item("degree", gaussians.degree)?;
    columns.set_item("linear", gaussians.linear)?;
    columns.set_item("antialiased", gaussians.antialiased)
}

/// A value of a dict of columns that must be there.
fn value<'py, T>(columns: &Bound<'py, PyDict>, name: &str) -> PyResult<T>
where
    T: for<'a> FromPyObject<'a, 'py, Error = PyErr>,
{
    let found = columns.get_item(name)?;
    let found = found.ok_or_else(|| pyo3::exceptions::PyKeyError::new_err(name.to_owned()))?;
    found.extract::<T>()
}

fn read_surfels(columns: &Bound<'_, PyDict>) -> PyResult<Surfels> {
    let vectors = |name: &str| Ok::<_, PyErr>(column(columns, name, arrays::vectors)?.unwrap_or_default());
    let materials = column(columns, "material", arrays::fours)?.unwrap_or_default().into_iter();
    let material =
        |[ambient, diffuse, specular, shininess]: [f32; 4]| Material { ambient, diffuse, specular, shininess };
    Ok(Surfels {
        origin: DVec3::from_array(value(columns, "origin")?),
        position: vectors("position")?,
        axis_u: vectors("axis_u")?,
        axis_v: vectors("axis_v")?,
        normal: vectors("normal")?,
        colour: vectors("colour")?,
        velocity: vectors("velocity")?,
        acceleration: vectors("acceleration")?,
        opacity: column(columns, "opacity", arrays::numbers)?.unwrap_or_default(),
        material: materials.map(material).collect(),
        id: column(columns, "id", arrays::identities)?.unwrap_or_default(),
        velocity_unit: if value(columns, "per_frame")? { VelocityUnit::Frame } else { VelocityUnit::Second },
        two_sided: value(columns, "two_sided")?,
        signs_estimated: value(columns, "signs_estimated")?,
        spheres: value(columns, "spheres")?,
        ..Surfels::default()
    })
}

fn read_gaussians(columns: &Bound<'_, PyDict>) -> PyResult<Gaussians> {
    let vectors = |name: &str| Ok::<_, PyErr>(column(columns, name, arrays::vectors)?.unwrap_or_default());
    let rotation = column(columns, "rotation", arrays::fours)?.unwrap_or_default();
    Ok(Gaussians {
        position: vectors("position")?,
        sigma: vectors("sigma")?,
        rotation: rotation.into_iter().map(Quat::from_array).collect(),
        opacity: column(columns, "opacity", arrays::numbers)?.unwrap_or_default(),
        optics: Optics::Alpha,
        base: vectors("base")?,
        harmonics: vectors("harmonics")?,
        degree: value(columns, "degree")?,
        linear: value(columns, "linear")?,
        antialiased: value(columns, "antialiased")?,
        ..Gaussians::default()
    })
}
