//! A document to a scene: files read, each once, and defaults that need them filled in.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

use super::document::{AnimationSpec, CameraSpec, Document, FileRef, ObjectSpec, ShapeSpec, unit};
use super::dom::Source;
use super::error::SceneError;
use super::paths::Finder;
use super::{LoadOptions, Loaded, defaults, write};
use crate::anim::{self, Animation};
use crate::math::Bounds;
use crate::model::{self, Surfels};
use crate::scene::{AnimationBinding, Camera, FrameRange, Light, Object, Scene};

/// Reads all files of a document and fills in what it leaves out.
pub(super) fn resolve(
    source: &Source,
    document: Document,
    options: &LoadOptions<'_>,
    notes: Vec<String>,
) -> Result<Loaded, SceneError> {
    let finder = Finder::new(source, options.restrict)?;
    let mut files = Files {
        source,
        finder,
        options,
        notes,
        found: HashMap::new(),
        models: HashMap::new(),
        variants: HashMap::new(),
        animations: HashMap::new(),
        rate: None,
    };
    let objects = document.objects.into_iter().map(|o| files.object(o)).collect::<Result<Vec<_>, _>>()?;
    let camera_binding = match document.camera.as_ref().and_then(|c| c.animation.as_ref()) {
        Some(spec) => Some(files.bind(spec)?),
        None => None,
    };
    let bindings = objects.iter().filter_map(|o| o.animation.as_ref()).chain(&camera_binding);
    let moving = objects.iter().any(|o| !o.motions.is_empty());
    let file_rate = files.rate.map(|(_, rate)| rate);
    let frames = defaults::frames(&document.frames, bindings.map(|b| b.node.range()), file_rate, moving);
    let name = source.path().file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let lights = if document.lights.is_empty() { default_lights() } else { document.lights };
    let mut scene = Scene {
        name,
        image: document.image,
        frames,
        shutter: document.shutter,
        camera: placeholder(),
        lights,
        objects,
    };
    scene.camera = camera(source, &scene, document.camera.as_ref(), camera_binding)?;
    let mut notes = files.notes;
    if scene.camera.automatic {
        let FrameRange { first, last, .. } = scene.frames;
        notes.push(format!(
            "{}: no camera, took one that sees frames {first}..{last}: {}",
            source.path().display(),
            write::camera_line(&scene.camera)
        ));
    }
    Ok(Loaded { scene, notes })
}

/// A key light from the upper right front and a little ambient light.
fn default_lights() -> Vec<Light> {
    vec![
        Light::Directional { direction: unit(DVec3::new(-0.5, -1.0, -0.8)), colour: DVec3::splat(0.9) },
        Light::Ambient { colour: DVec3::splat(0.3) },
    ]
}

fn placeholder() -> Camera {
    Camera {
        eye: DVec3::ZERO,
        at: DVec3::NEG_Z,
        up: DVec3::Y,
        fovy: defaults::FOVY_DEGREES.to_radians(),
        near: defaults::NEAR,
        animation: None,
        automatic: false,
    }
}

fn camera(
    source: &Source,
    scene: &Scene,
    spec: Option<&CameraSpec>,
    animation: Option<AnimationBinding>,
) -> Result<Camera, SceneError> {
    let camera = match (spec, animation) {
        (Some(spec), Some(animation)) => Camera {
            eye: spec.eye.unwrap_or(DVec3::ZERO),
            at: spec.target.unwrap_or_else(|| spec.eye.unwrap_or(DVec3::ZERO) + DVec3::NEG_Z),
            up: spec.up,
            fovy: spec.fovy,
            near: spec.near.unwrap_or(defaults::NEAR),
            animation: Some(animation),
            automatic: false,
        },
        _ => defaults::camera(scene, spec),
    };
    if camera.animation.is_some() {
        return Ok(camera);
    }
    let bad = |found: &str, expected: &str| SceneError::BadValue {
        at: source.locate(spec.map_or(0, |s| s.at)),
        what: "the view from `eye` to `at` of <camera>".to_owned(),
        found: found.to_owned(),
        expected: expected.to_owned(),
    };
    let view = camera.at - camera.eye;
    if !(1e-12..=1e100).contains(&view.length()) {
        return Err(bad("0 long", "two different points"));
    }
    if view.normalize().cross(camera.up.normalize()).length() < 1e-9 {
        return Err(bad("along `up`", "another direction than `up`"));
    }
    Ok(camera)
}

/// Most copies of one model file that differ in radius scale or colour space: a small scene must not fill the memory.
const MOST_VARIANTS: usize = 32;

/// What two objects share if they name it alike: file, radius scale (its bits) and colour space.
type ModelKey = (PathBuf, u64, Option<bool>);

/// A model and what is derived from it once.
#[derive(Clone)]
struct Model {
    surfels: Arc<Surfels>,
    median_radius: f32,
    bounds: Bounds,
}

/// The files of one scene, each read once.
struct Files<'a> {
    source: &'a Source,
    finder: Finder<'a>,
    options: &'a LoadOptions<'a>,
    notes: Vec<String>,
    /// By the text that names them.
    found: HashMap<String, PathBuf>,
    models: HashMap<ModelKey, Model>,
    /// How often each file was read as a model.
    variants: HashMap<PathBuf, usize>,
    animations: HashMap<PathBuf, Arc<Animation>>,
    /// Where the first animation is named, and its file's rate.
    rate: Option<(usize, f64)>,
}

impl Files<'_> {
    fn object(&mut self, spec: ObjectSpec) -> Result<Object, SceneError> {
        let animation = spec.animation.as_ref().map(|a| self.bind(a)).transpose()?;
        let (model_path, model, sphere) = match &spec.shape {
            ShapeSpec::Model(file) => {
                let path = self.find(file)?;
                let model = self.model(file, &spec.options, &path)?;
                (path, model, None)
            }
            ShapeSpec::Sphere(sphere) => {
                let corner = DVec3::splat(sphere.radius);
                let bounds = [-corner, corner].into_iter().collect();
                (PathBuf::new(), Model { surfels: Arc::default(), median_radius: 0.0, bounds }, Some(*sphere))
            }
        };
        let Model { surfels, median_radius, bounds } = model;
        Ok(Object {
            name: spec.name,
            model_path,
            two_sided: spec.two_sided.unwrap_or(surfels.two_sided),
            model: surfels,
            radius_scale: spec.options.radius_scale,
            colour_space: spec.options.colour_space,
            transform: spec.transform,
            animation,
            motions: spec.motions,
            place: spec.place,
            material: spec.material,
            epsilon: spec.epsilon,
            blur: spec.blur,
            median_radius,
            bounds,
            sphere,
        })
    }

    fn find(&mut self, file: &FileRef) -> Result<PathBuf, SceneError> {
        if let Some(path) = self.found.get(&file.text) {
            return Ok(path.clone());
        }
        let (path, note) = self.finder.find(file)?;
        self.notes.extend(note);
        self.found.insert(file.text.clone(), path.clone());
        Ok(path)
    }

    fn model(&mut self, file: &FileRef, options: &model::LoadOptions, path: &Path) -> Result<Model, SceneError> {
        let linear = options.colour_space.map(|c| c == model::ColourSpace::Linear);
        let key = (canonical(path), options.radius_scale.to_bits(), linear);
        if let Some(model) = self.models.get(&key) {
            return Ok(model.clone());
        }
        let variants = self.variants.entry(key.0.clone()).or_default();
        *variants += 1;
        if *variants > MOST_VARIANTS {
            return Err(SceneError::BadValue {
                at: self.source.locate(file.at),
                what: "<pointModel>".to_owned(),
                found: format!("variant {variants} of the file {}", path.display()),
                expected: format!("at most {MOST_VARIANTS} pairs of `radiusScale` and `colourSpace` for one file"),
            });
        }
        let silent = |_: &str, _: f32| {};
        let progress = self.options.progress.unwrap_or(&silent);
        let loaded = model::load(path, options, progress)
            .map_err(|e| SceneError::Model { at: self.source.locate(file.at), source: Box::new(e) })?;
        self.notes.extend(loaded.notes.iter().map(|note| format!("{}: {note}", path.display())));
        let (median_radius, bounds) = (loaded.surfels.median_radius(), loaded.surfels.bounds());
        let model = Model { surfels: Arc::new(loaded.surfels.spatially_ordered()), median_radius, bounds };
        self.models.insert(key, model.clone());
        Ok(model)
    }

    fn bind(&mut self, spec: &AnimationSpec) -> Result<AnimationBinding, SceneError> {
        let path = self.find(&spec.file)?;
        let source = self.source;
        let refuse = |e| SceneError::Animation { at: source.locate(spec.file.at), source: Box::new(e) };
        let key = canonical(&path);
        let animation = if let Some(animation) = self.animations.get(&key) {
            Arc::clone(animation)
        } else {
            let animation = match anim::load(&path) {
                Ok(animation) => Arc::new(animation),
                Err(e) => return Err(refuse(e)),
            };
            self.notes.extend(animation.notes.iter().map(|note| format!("{}: {note}", path.display())));
            self.animations.insert(key, Arc::clone(&animation));
            animation
        };
        if self.rate.is_none_or(|(first, _)| spec.file.at < first) {
            self.rate = Some((spec.file.at, animation.rate));
        }
        let node = Arc::clone(animation.node(spec.node.as_deref()).map_err(refuse)?);
        Ok(AnimationBinding { path, node, interpolation: spec.interpolation })
    }
}

/// One name for one file, however the scene writes it.
fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}
