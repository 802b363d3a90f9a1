//! Turns a document into a scene: reads each file once, and fills in the defaults that depend on files.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::document::{
    AnimationSpec, CameraSpec, Document, EnvironmentSpec, GaussiansSpec, MaterialSpec, ObjectSpec, ShapeSpec,
};
use super::dom::{FileRef, Source};
use super::error::{EnvironmentError, SceneError, quoted};
use super::paths::Finder;
use super::{SceneLoadOptions, write};
use crate::anim::{self, CameraTrack, Interpolation, Intrinsics, NodeMotion, TrackOptions};
use crate::environment::{Environment, LatLong};
use crate::files::Seen;
use crate::image;
use crate::model::mesh::Fineness;
use crate::model::{self, ColourMap, LoadedShape, MeshOptions, MeshSource, ReadFile, Spacing};
use crate::options::Detail;
use crate::scene::{
    self, AnimationBinding, Camera, Capture, FrameRange, GivenCamera, Object, Opened, PointMotion, Scene, Sequence,
    SequenceSpec, Shape, Surface,
};

/// Reads all files of a document and fills in what it leaves out; the scene, and notes on it.
pub(super) fn resolve(
    source: &Source,
    document: Document,
    options: &SceneLoadOptions<'_>,
    notes: Vec<String>,
    flown: Option<&Flown>,
) -> Result<(Scene, Vec<String>), SceneError> {
    let finder = Finder::new(source, options.restrict)?;
    // A camera of a file of its own takes the place of the scene's.
    let (camera_source, spec) = match flown {
        Some(Flown { source, spec }) => (source, Some(spec)),
        None => (source, document.camera.as_ref()),
    };
    let mut files = Files {
        source,
        finder,
        options,
        notes,
        found: HashMap::new(),
        shapes: HashMap::new(),
        variants: HashMap::new(),
        meshes: Vec::new(),
        sampled: 0,
        animations: HashMap::new(),
        automatic: spec.is_none_or(|camera| camera.completed().eye.is_none()),
        rate: None,
    };
    let sides_given: Vec<bool> = document.objects.iter().map(|object| object.two_sided.is_some()).collect();
    let objects = document.objects.into_iter().map(|o| files.object(o)).collect::<Result<Vec<_>, _>>()?;
    let camera_binding = match spec.and_then(|c| c.animation.as_ref()) {
        Some(spec) => Some(files.bind(spec)?),
        None => None,
    };
    let track = match spec.and_then(|camera| camera.track.as_ref()) {
        Some((file, given)) => Some(files.track(file, *given, document.frames.rate)?),
        None => None,
    };
    let intrinsics = track.as_ref().and_then(|(_, intrinsics)| *intrinsics);
    let camera_binding = camera_binding.or(track.map(|(binding, _)| binding));
    let mut environment = document.environment.as_ref().map(|spec| files.environment(spec)).transpose()?;
    if let (Some(environment), Some(spec)) = (&mut environment, &document.environment) {
        environment.light = spec.light.unwrap_or(document.lights.is_empty());
    }
    let is_lit = environment.as_ref().is_some_and(|environment| environment.light);
    if environment.is_none()
        && objects.iter().any(|object| object.shape.surface().is_some_and(|surface| surface.reflection > 0.0))
    {
        files.notes.push("`reflection` of <material> mirrors the <environment>, and means nothing without".to_owned());
    }
    let camera_moves = spec.is_some_and(|c| !c.motions.is_empty());
    let file_rate = files.rate.map(|(_, rate)| rate);
    let flight = spec.and_then(|camera| camera.flight.as_ref());
    let rate = document.frames.rate.or(file_rate).unwrap_or(scene::RATE);
    let keys = flight.and_then(|flight| flight.range(rate)).or(camera_binding.as_ref().map(|b| b.node.range()));
    let mut frames = scene::frames(&document.frames, &objects, keys, camera_moves, file_rate);
    if let Some(keys) = keys.filter(|_| flown.is_some()) {
        frames = scene::frames_of_keys(keys, frames.rate);
    }
    let name = source.path().file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let lights = if document.lights.is_empty() && !is_lit { scene::lights() } else { document.lights };
    let mut scene = Scene {
        name,
        image: document.image,
        frames,
        shutter: document.shutter,
        camera: Camera::new(DVec3::ZERO, DVec3::NEG_Z),
        lights,
        environment,
        objects,
        files: Seen::new(),
    };
    scene.unlight_coloured_by().map_err(|ambient| SceneError::BadValue {
        at: source.locate(0),
        what: "the ambient light".to_owned(),
        found: format!("{} {} {}", ambient.x, ambient.y, ambient.z),
        expected: "three equal numbers, as `colourBy` shows colours that no light changes".to_owned(),
    })?;
    scene.camera = camera(camera_source, &scene, spec, camera_binding)?;
    let says_fovy = spec.is_some_and(|camera| camera.says_fovy);
    if let Some(intrinsics) = intrinsics {
        files.notes.extend(look_through(&mut scene, &intrinsics, document.size_given, says_fovy));
    }
    let mut notes = files.notes;
    files.meshes.retain(|mesh| mesh.is_coarse);
    for mesh in &files.meshes {
        refine(&mut scene, mesh, files.meshes.len(), &mut notes);
    }
    drop_answered(&scene, &mut notes);
    show_insides(&mut scene, &sides_given, &mut notes);
    drop_rooms(&scene, &mut notes);
    if scene.camera.automatic {
        let FrameRange { first, last, .. } = scene.frames;
        notes.push(format!(
            "{}: no camera, took one that sees frames {first}..{last}: {}",
            source.path().display(),
            write::camera_line(&scene.camera)
        ));
    }
    Ok((scene, notes))
}

/// Drops the notes that a mesh's animations are ignored where the scene plays them.
fn drop_answered(scene: &Scene, notes: &mut Vec<String>) {
    let bindings = scene.objects.iter().filter_map(|object| object.animation.as_ref());
    let played: HashSet<String> = bindings.map(|binding| format!("{}: ", binding.path.display())).collect();
    notes.retain(|note| !(note.contains(model::mesh::NOT_PLAYED) && played.iter().any(|path| note.starts_with(path))));
}

/// Drops the notes that normals point inward where both sides show, or where the camera stands inside.
fn drop_rooms(scene: &Scene, notes: &mut Vec<String>) {
    for object in &scene.objects {
        let begin = format!("{}: {}", object.source.path.display(), model::INWARD);
        let told = notes.iter().any(|note| note.starts_with(&begin));
        if told && (shows_both(object) || scene::camera_enters(scene, object)) {
            notes.retain(|note| !note.starts_with(&begin));
        }
    }
}

/// Gives the scene's camera the lens of its track, and the image its size where the scene does not say one.
fn look_through(scene: &mut Scene, lens: &Intrinsics, size_given: bool, says_fovy: bool) -> Option<String> {
    let [width, height] = lens.size;
    if !size_given {
        (scene.image.width, scene.image.height) = (width, height);
    }
    if !says_fovy {
        scene.camera.fovy = 2.0 * libm::atan(0.5 * f64::from(height) / lens.focal);
    }
    let share = |i: usize| lens.principal[i] / f64::from(lens.size[i]) - 0.5;
    scene.camera.shift = DVec2::new(share(0), share(1));
    let aspect = f64::from(scene.image.width) / f64::from(scene.image.height);
    let of_lens = f64::from(width) / f64::from(height);
    let alike = (aspect / of_lens - 1.0).abs() < 0.01;
    (!alike).then(|| {
        format!(
            "camera: the track's images have {width} x {height} pixels, this one has {} x {}: the height is kept",
            scene.image.width, scene.image.height
        )
    })
}

/// A mesh that was sampled, and the first file that it came from.
pub(super) struct SampledMesh {
    pub(super) path: PathBuf,
    pub(super) source: MeshSource,
    pub(super) shape: Shape,
    /// The scene decides its spacing. Until then it has few surfels, which show its size.
    pub(super) is_coarse: bool,
}

/// Samples one of `meshes` meshes again, as finely as the objects that show it need. Many meshes share what a scene may
/// hold.
pub(super) fn refine(scene: &mut Scene, coarse: &SampledMesh, meshes: usize, notes: &mut Vec<String>) {
    let shows = |object: &Object| {
        let shown = object.shape.surfels().zip(coarse.shape.surfels());
        shown.is_some_and(|(a, b)| Arc::ptr_eq(a.surfels(), b.surfels()))
    };
    let wanted = scene.objects.iter().filter(|object| shows(object));
    let mut fineness = Fineness::default();
    wanted.for_each(|object| fineness.join(scene::wanted_fineness(scene, object)));
    let surfels = scene::SURFELS.map(|count| count.min(SHARED_SURFELS / meshes as f64));
    let Some(loaded) = coarse.source.resampled(&fineness, surfels) else { return };
    notes.extend(loaded.notes.iter().map(|note| format!("{}: {note}", coarse.path.display())));
    let fine = Shape::from(loaded);
    let Some(fine) = fine.surfels() else { return };
    for object in scene.objects.iter_mut().filter(|object| shows(object)) {
        if let Shape::Surfels { model, .. } = &mut object.shape {
            model.clone_from(fine);
        }
    }
}

/// Shows both sides of objects that the camera stands within, where their fronts were estimated to be outside and the
/// scene does not say what shows.
fn show_insides(scene: &mut Scene, sides_given: &[bool], notes: &mut Vec<String>) {
    let estimated = |object: &Object| {
        object.shape.surfels().is_some_and(|model| model.surfels().signs_estimated) && !shows_both(object)
    };
    let entered: Vec<usize> = (0..scene.objects.len())
        .filter(|&i| !sides_given[i] && estimated(&scene.objects[i]) && scene::camera_enters(scene, &scene.objects[i]))
        .collect();
    for i in entered {
        let object = &mut scene.objects[i];
        if let Some(surface) = object.shape.surface_mut() {
            surface.two_sided = true;
        }
        notes.push(format!("object {}: the camera stands within its box, so both sides show", quoted(&object.name)));
    }
}

/// A camera of a file of its own.
pub(super) struct Flown {
    pub(super) source: Source,
    pub(super) spec: CameraSpec,
}

impl Flown {
    /// Puts it into the scene of a model alone, whose camera says how near things show.
    pub(super) fn enter(mut self, scene: &mut Scene) -> Result<(), SceneError> {
        self.spec.given.near = self.spec.given.near.or(Some(scene.camera.near));
        if let Some(keys) = self.spec.flight.as_ref().and_then(|flight| flight.range(scene.frames.rate)) {
            scene.frames = scene::frames_of_keys(keys, scene.frames.rate);
        }
        scene.camera = camera(&self.source, scene, Some(&self.spec), None)?;
        Ok(())
    }
}

fn camera(
    source: &Source,
    scene: &Scene,
    spec: Option<&CameraSpec>,
    animation: Option<AnimationBinding>,
) -> Result<Camera, SceneError> {
    let camera = match (spec, animation) {
        (Some(CameraSpec { given, .. }), Some(animation)) => {
            let eye = given.eye.unwrap_or(DVec3::ZERO);
            Camera {
                up: given.up.unwrap_or(DVec3::Y),
                fovy: given.fovy,
                near: given.near.unwrap_or(Camera::NEAR),
                animation: Some(animation),
                ..Camera::new(eye, given.at.unwrap_or(eye + DVec3::NEG_Z))
            }
        }
        _ => scene::camera(scene, &spec.map_or_else(GivenCamera::default, CameraSpec::completed)),
    };
    let camera = Camera { motions: spec.map_or_else(Vec::new, |spec| spec.motions.clone()), ..camera };
    if let Some((spec, flight)) = spec.and_then(|spec| spec.flight.as_ref().map(|flight| (spec, flight))) {
        return flight.fly(source, scene, camera, &spec.given);
    }
    if camera.animation.is_some() {
        return Ok(camera);
    }
    match camera.bad_view() {
        None => Ok(camera),
        Some([found, expected]) => Err(SceneError::BadValue {
            at: source.locate(spec.map_or(0, |s| s.at)),
            what: "the view from `eye` to `at` of <camera>".to_owned(),
            found: found.to_owned(),
            expected: expected.to_owned(),
        }),
    }
}

/// Most copies of one model file that differ in how they are loaded: a small scene must not fill the
/// memory.
const MOST_VARIANTS: usize = 32;

/// Surfels that all meshes of a scene share where their spacing follows from the scene.
const SHARED_SURFELS: f64 = (1_u64 << 25) as f64;

/// Most surfels of all meshes of one scene, as for one mesh.
const MOST_SAMPLED: u64 = 1 << 26;

/// What two objects share if they name it alike: the file, and the options as text, which tells all numbers apart.
type ModelKey = (PathBuf, String);

/// The files of one scene, each read once.
struct Files<'a> {
    source: &'a Source,
    finder: Finder<'a>,
    options: &'a SceneLoadOptions<'a>,
    notes: Vec<String>,
    /// By the text that names them: the path, and the one name of the file.
    found: HashMap<String, (PathBuf, PathBuf)>,
    /// With the values of the first and of the last colour.
    shapes: HashMap<ModelKey, (Shape, Option<[f64; 2]>)>,
    /// How often each file, or a node of it, was read as a model.
    variants: HashMap<(PathBuf, Option<String>), usize>,
    /// All that were sampled. Files with the same mesh share one.
    meshes: Vec<SampledMesh>,
    /// Surfels of all meshes so far.
    sampled: u64,
    animations: HashMap<PathBuf, Arc<anim::AnimationFile>>,
    /// The camera is to be found: boxes around all objects are needed.
    automatic: bool,
    /// Where the first animation is named, and its file's rate.
    rate: Option<(usize, f64)>,
}

/// Keeps the range of values that colours stand for.
pub(super) fn take_range(options: &mut model::LoadOptions, range: Option<[f64; 2]>) {
    if let Some(by) = &mut options.points.colour_by {
        by.range = by.range.or(range);
    }
}

/// Do both sides of its surface show?
fn shows_both(object: &Object) -> bool {
    object.shape.surface().is_some_and(|surface| surface.two_sided)
}

/// A shape as an object draws it.
fn as_said(mut shape: Shape, spec: &ObjectSpec) -> Shape {
    let GaussiansSpec { opacity: _, capture: said, crop } = spec.gaussians;
    match &mut shape {
        Shape::Surfels { points, .. } => *points = spec.points,
        Shape::Gaussians { model, capture } => (model.crop, *capture) = (crop, said),
        Shape::Volume { model, material } => (model.crop, *material) = (crop, spec.material.coefficients),
        Shape::Sequence { .. } | Shape::Sphere { .. } => {}
    }
    if let Some(surface) = shape.surface_mut() {
        let two_sided = spec.two_sided.unwrap_or(surface.two_sided);
        *surface = Surface { material: spec.material.coefficients, reflection: spec.material.reflection, two_sided };
    }
    shape
}

impl Files<'_> {
    fn object(&mut self, mut spec: ObjectSpec) -> Result<Object, SceneError> {
        self.colour_table(&mut spec)?;
        let animation = spec.animation.as_ref().map(|a| self.bind(a)).transpose()?;
        let (path, shape) = match &spec.shape {
            ShapeSpec::Model(file) => {
                let (path, canonical) = self.find(file)?;
                let (shape, colour_range) = self.model(file, &spec.options, &path, canonical)?;
                self.note_idle(&spec, &shape);
                take_range(&mut spec.options, colour_range);
                (path, shape)
            }
            ShapeSpec::Sequence(files, first) => {
                let Opened { sequence: files, two_sided, colour_range, .. } = self.sequence(files, first, &spec)?;
                take_range(&mut spec.options, colour_range);
                let path = PathBuf::from(files.spec().pattern.to_string());
                let surface = Surface { two_sided, ..Surface::default() };
                (path, Shape::Sequence { files, unit: spec.points.unit, surface })
            }
            ShapeSpec::Sphere(sphere) => {
                let shape = Shape::from(*sphere);
                self.note_idle(&spec, &shape);
                (PathBuf::new(), shape)
            }
        };
        let shape = as_said(shape, &spec);
        let opacity = if shape.surface().is_some() { spec.material.opacity } else { spec.gaussians.opacity };
        Ok(Object {
            name: spec.name,
            source: scene::Source { path, options: spec.options },
            transform: spec.transform,
            animation,
            motions: spec.motions,
            place: spec.place,
            epsilon: spec.epsilon,
            detail: spec.detail,
            opacity,
            blur: spec.blur,
            receive_shadows: spec.receive_shadows,
            shadow_catcher: spec.shadow_catcher,
            cast_shadows: spec.cast_shadows,
            ..Object::new(shape)
        })
    }

    /// Reads the table of colours of an object, if it has one.
    fn colour_table(&mut self, spec: &mut ObjectSpec) -> Result<(), SceneError> {
        let (Some(file), Some(by)) = (&spec.colour_table, &mut spec.options.points.colour_by) else { return Ok(()) };
        let (path, _) = self.find(file)?;
        by.map = ColourMap::read(&path)
            .map_err(|e| SceneError::Model { at: self.source.locate(file.at), source: Box::new(e) })?;
        Ok(())
    }

    /// The files of a sequence, of which `first` is the first one.
    fn sequence(&mut self, spec: &SequenceSpec, first: &FileRef, object: &ObjectSpec) -> Result<Opened, SceneError> {
        let at = first.at;
        let (path, _) = self.find(first)?;
        if self.options.restrict.is_some() {
            for number in spec.first..=spec.last {
                let text = spec.pattern.path(number).to_string_lossy().into_owned();
                self.finder.find(&FileRef { text, at })?;
            }
        }
        let pattern = spec.pattern.at(spec.first, &path).unwrap_or_else(|| spec.pattern.clone());
        if object.points.at.is_some() {
            let name = quoted(&object.name);
            self.notes.push(format!("object {name}: `at` means nothing for a sequence: each file has its own frame"));
        }
        let spec = SequenceSpec { pattern, ..spec.clone() };
        let opened = Sequence::open(spec, &object.options, self.automatic)
            .map_err(|e| SceneError::Model { at: self.source.locate(at), source: Box::new(e) })?;
        self.notes.extend(opened.notes.iter().map(|note| format!("{}: {note}", path.display())));
        Ok(opened)
    }

    fn environment(&mut self, spec: &EnvironmentSpec) -> Result<Environment, SceneError> {
        let (path, _) = self.find(&spec.file)?;
        let refuse =
            |source| SceneError::Environment { at: self.source.locate(spec.file.at), source: Box::new(source) };
        let picture = image::read(&path).map_err(|e| refuse(e.into()))?;
        let pixels = picture.rgba.into_iter().map(|[r, g, b, _]| [r, g, b]).collect();
        let map = LatLong::new(picture.width as usize, pixels)
            .map_err(|why| refuse(EnvironmentError::Map { path: path.clone(), why }))?;
        let mut environment = Environment::new(map);
        (environment.path, environment.background) = (path, spec.background);
        (environment.intensity, environment.rotation) = (spec.intensity, spec.rotation);
        environment.shadows = spec.shadows;
        Ok(environment)
    }

    /// Notes what is said about an object and means nothing for its model.
    fn note_idle(&mut self, spec: &ObjectSpec, shape: &Shape) {
        let said = spec.gaussians;
        let is_capture = matches!(shape, Shape::Gaussians { .. });
        let is_volume = matches!(shape, Shape::Volume { .. });
        let mut note = |what: &str| {
            self.notes.push(format!("object {}: {what} nothing here", quoted(&spec.name)));
        };
        if !is_capture && !is_volume && said != GaussiansSpec::default() {
            note(
                "`opacity`, `shDegree`, `cropMin`, `cropMax` and `antialias` are for captures drawn as Gaussians, all \
                 but `shDegree` and `antialias` for volumes too, and mean",
            );
        }
        if is_volume && said.capture != Capture::default() {
            note("`shDegree` and `antialias` are for captures drawn as Gaussians, and mean");
        }
        if spec.points != PointMotion::default() && shape.paths().is_empty() {
            note("`velocityUnit` and `at` are for surfels with velocities, and mean");
        }
        if !is_volume && spec.options.volume != model::VolumeOptions::default() {
            note("`kernel`, `flatten`, `lit` and <transferFunction> are for volumes, and mean");
        }
        if (is_capture || is_volume) && spec.material.is_of_surfels() {
            note(&format!("{} are for surfels, and mean", MaterialSpec::OF_SURFELS));
        }
        if is_capture && spec.material.coefficients.is_some() {
            note("`ambient`, `diffuse`, `specular` and `shininess` of <material> are for what lights shade, and mean");
        }
        if (is_capture || is_volume) && spec.two_sided == Some(true) {
            note("`twoSided` is for surfels, and means");
        }
        if spec.detail != Detail::Auto && !matches!(shape, Shape::Surfels { .. } | Shape::Volume { .. }) {
            note("`detail` is for models of surfels and volumes, and means");
        }
    }

    fn find(&mut self, file: &FileRef) -> Result<(PathBuf, PathBuf), SceneError> {
        if let Some(found) = self.found.get(&file.text) {
            return Ok(found.clone());
        }
        let (path, note) = self.finder.find(file)?;
        self.notes.extend(note);
        let found = (path.clone(), canonical(&path));
        self.found.insert(file.text.clone(), found.clone());
        Ok(found)
    }

    fn model(
        &mut self,
        file: &FileRef,
        options: &model::LoadOptions,
        path: &Path,
        canonical: PathBuf,
    ) -> Result<(Shape, Option<[f64; 2]>), SceneError> {
        let key = (canonical, format!("{options:?}"));
        if let Some(shape) = self.shapes.get(&key) {
            return Ok(shape.clone());
        }
        // Each node of a file is another model, and no larger than its part of the file.
        let variants = self.variants.entry((key.0.clone(), options.node.clone())).or_default();
        *variants += 1;
        if *variants > MOST_VARIANTS {
            return Err(SceneError::BadValue {
                at: self.source.locate(file.at),
                what: "<pointModel>".to_owned(),
                found: format!("variant {variants} of the file {}", path.display()),
                expected: format!(
                    "at most {MOST_VARIANTS} sets of `radiusScale`, `colourSpace`, `kind`, `spacing`, `reduce`, what \
                     clouds of points and what volumes take for one file"
                ),
            });
        }
        let silent = |_: &str, _: f32| {};
        let progress = self.options.progress.unwrap_or(&silent);
        let is_auto = options.mesh.spacing == Spacing::Auto;
        let options = if is_auto { coarse(options.clone()) } else { options.clone() };
        let refuse = |e| SceneError::Model { at: self.source.locate(file.at), source: Box::new(e) };
        let loaded = match model::open(path, &options, progress).map_err(refuse)? {
            ReadFile::Ready(loaded) => *loaded,
            ReadFile::Mesh(mesh) => {
                let same = |known: &&SampledMesh| known.is_coarse == is_auto && known.source.is_of(&mesh, &options);
                if let Some(known) = self.meshes.iter().find(same) {
                    let (path, first) = (path.display(), known.path.display());
                    self.notes.push(format!("{path}: the same mesh as {first}, and sampled once for both"));
                    let shape = known.shape.clone();
                    self.shapes.insert(key, (shape.clone(), None));
                    return Ok((shape, None));
                }
                model::sample_mesh(mesh, &options, path, progress).map_err(refuse)?
            }
        };
        if let LoadedShape::Surfels(surfels, Some(_)) = &loaded.shape {
            self.sampled += surfels.len() as u64;
        }
        if self.sampled > MOST_SAMPLED {
            return Err(SceneError::BadValue {
                at: self.source.locate(file.at),
                what: "<pointModel>".to_owned(),
                found: format!("the mesh with which the scene's meshes have {} surfels", self.sampled),
                expected: format!("at most {MOST_SAMPLED} in all, by wider `spacing` or fewer meshes"),
            });
        }
        let mesh = loaded.mesh().cloned();
        if mesh.is_none() || !is_auto {
            self.notes.extend(loaded.notes.iter().map(|note| format!("{}: {note}", path.display())));
        }
        let colour_range = loaded.colour_range;
        let shape = Shape::from(loaded);
        if let Some(source) = mesh {
            self.meshes.push(SampledMesh { path: path.to_owned(), source, shape: shape.clone(), is_coarse: is_auto });
        }
        self.shapes.insert(key, (shape.clone(), colour_range));
        Ok((shape, colour_range))
    }

    /// The poses of a tracked camera, and its lens. `rate`: the scene's, frames per second, where it says one.
    fn track(
        &mut self,
        file: &FileRef,
        options: TrackOptions,
        rate: Option<f64>,
    ) -> Result<(AnimationBinding, Option<Intrinsics>), SceneError> {
        let (path, _) = self.find(file)?;
        let rate = rate.or(self.rate.map(|(_, rate)| rate)).unwrap_or(scene::RATE);
        let track = CameraTrack::load(&path, options, rate)
            .map_err(|e| SceneError::Animation { at: self.source.locate(file.at), source: Box::new(e) })?;
        self.notes.extend(track.notes.iter().map(|note| format!("{}: {note}", path.display())));
        let intrinsics = track.intrinsics;
        Ok((AnimationBinding { path, node: NodeMotion::from(track), interpolation: Interpolation::Maya }, intrinsics))
    }

    fn bind(&mut self, spec: &AnimationSpec) -> Result<AnimationBinding, SceneError> {
        let (path, key) = self.find(&spec.file)?;
        let source = self.source;
        let refuse = |e| SceneError::Animation { at: source.locate(spec.file.at), source: Box::new(e) };
        let animation = if let Some(animation) = self.animations.get(&key) {
            Arc::clone(animation)
        } else {
            let animation = Arc::new(anim::open(&path).map_err(refuse)?);
            let notes = match &*animation {
                anim::AnimationFile::Maya(animation) => &animation.notes,
                anim::AnimationFile::Gltf(animation) => &animation.notes,
            };
            self.notes.extend(notes.iter().map(|note| format!("{}: {note}", path.display())));
            self.animations.insert(key, Arc::clone(&animation));
            animation
        };
        let mut idle = |what: &str| {
            self.notes.push(format!("{}: {what} nothing here", source.locate(spec.file.at)));
        };
        let (rate, node) = match &*animation {
            anim::AnimationFile::Maya(animation) => {
                if spec.fps.is_some() || spec.looped.is_some() {
                    idle("`fps` and `loop` are for glTF files, and mean");
                }
                let node = animation.node(spec.node.as_deref()).map_err(refuse)?;
                (animation.rate, NodeMotion::from(Arc::clone(node)))
            }
            anim::AnimationFile::Gltf(animation) => {
                if spec.says_between {
                    idle("`interpolation` is for Maya files, and means");
                }
                let fps = spec.fps.unwrap_or(anim::GltfAnimation::FPS);
                let looped = spec.looped.unwrap_or(false);
                let chain = animation.bind(spec.node.as_deref(), fps, looped).map_err(refuse)?;
                if !chain.unused.is_empty() {
                    idle(&format!(
                        "animations beside the first that moves the node ({}) mean",
                        chain.unused.join(", ")
                    ));
                }
                (fps, NodeMotion::from(chain))
            }
        };
        if self.rate.is_none_or(|(first, _)| spec.file.at < first) {
            self.rate = Some((spec.file.at, rate));
        }
        Ok(AnimationBinding { path, node, interpolation: spec.interpolation })
    }
}

/// The options with which a mesh gets its size, before the scene says how fine it is to be.
pub(super) fn coarse(options: model::LoadOptions) -> model::LoadOptions {
    let mesh = MeshOptions { spacing: Spacing::Surfels(scene::SURFELS[0] as u32), ..options.mesh };
    model::LoadOptions { mesh, ..options }
}

/// One name for one file, however the scene writes it.
fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}
