//! The surfels of each model that are fine enough for a frame.
//!
//! One cut serves a whole exposure. It depends on scene, frame and tolerance alone, never on the frame before, so that
//! any part of a sequence can be rendered by itself.

mod blocks;
mod shadows;
mod volumes;

pub(crate) use blocks::BlockErrors;

use std::borrow::Cow;

use glam::{DMat3, DMat4, DVec2, DVec3, Vec3};

use self::shadows::{Lamps, ShadowView};
use super::pose::{camera_from_world, object_pose};
use super::shape::{Shape, Surface};
use super::values::{Object, Scene};
use crate::math::{focal_length, norm};
use crate::model::levels::{Levels, Node};
use crate::model::paths::elapsed;
use crate::options::{Detail, Quality};

/// Tolerances at an error of 1. At `good`, which is .025, they are .005 of white and .05 pixels.
const REST: f64 = 0.2;
const DEVIATION: f64 = 2.0;
/// What a mirror shows turns twice as far as its front, by surroundings from black to white.
const MIRRORED: f64 = 2.0;
/// Parts of an exposure, of equal weight. Nodes are looked at where they begin and end.
const PARTS: usize = 8;
/// Length of the waves that cells leave out, in edges of a cell over pi: two edges.
const WAVE: f64 = 2.0 / std::f64::consts::PI;
/// Share of change along stripes that pairs of surfels show all the same, because some lie aslant: a sixth.
const ALONG: f64 = 1.0 / 6.0;
/// The factor with which half of all change, that of detail that is the same in all directions, counts as a half.
const ACROSS: f64 = 1.5;
/// Cosine between mean front and ray below which an outline may run through a node.
const OUTLINE: f64 = 0.5;
/// Difference of display values across an outline.
const CONTRAST: f64 = 0.3;
/// Least cosine between a surface and a ray at which motion on the image is traced on the surface.
const GRAZING: f64 = 0.2;

/// What a cut may leave out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CutTolerance {
    /// Root mean square of what is missing of colours in the finished picture, as a share of white as it is displayed.
    pub(crate) rest: f64,
    /// How far surfels may lie from those that they replace, pixels.
    pub(crate) deviation: f64,
}

impl CutTolerance {
    /// The tolerance for the error of a picture ([`ErrorTarget::error`](crate::options::ErrorTarget::error)).
    pub(crate) fn of(error: f64) -> Self {
        Self { rest: REST * error, deviation: DEVIATION * error }
    }
}

/// A scene with the surfels that a frame needs.
#[derive(Debug)]
pub(crate) struct Cut<'a> {
    /// The same as before where none is left out.
    pub(crate) scene: Cow<'a, Scene>,
    /// Estimated error by colours and outlines that it leaves out. What hides what is not looked at, so it may be
    /// larger than what shows.
    pub(crate) errors: BlockErrors,
}

impl<'a> Cut<'a> {
    /// All surfels.
    pub(crate) fn whole(scene: &'a Scene) -> Self {
        Self { scene: Cow::Borrowed(scene), errors: BlockErrors::default() }
    }

    /// The same, with a scene of its own.
    pub(crate) fn into_owned(self) -> Cut<'static> {
        Cut { scene: Cow::Owned(self.scene.into_owned()), errors: self.errors }
    }
}

impl Scene {
    /// The scene with those surfels of its models that frame `number` needs within `tolerance`. `shadows`: those of its
    /// lights show, so what casts them may have to be finer than it looks.
    ///
    /// Models keep all their surfels where they are few, or loose, or files of a sequence.
    pub(crate) fn cut(&self, number: f64, tolerance: CutTolerance, shadows: bool) -> Cut<'_> {
        let lamps = shadows.then(|| Lamps::of(self, number));
        let image = ImagePlane::of(self);
        let mut errors = BlockErrors::of_size(image.size);
        let cut = |object: &Object| {
            let tolerance = match object.detail {
                Detail::Auto => tolerance,
                own => CutTolerance::of(own.error(Quality::default())?),
            };
            let (model, surface, points) = match &object.shape {
                Shape::Surfels { model, surface, points } => (model, surface, points),
                Shape::Volume { model, material } => {
                    let model = volumes::cut(
                        model,
                        object.opacity,
                        &views(self, object, number, None),
                        tolerance,
                        image,
                        &mut errors,
                    )?;
                    return Some(Shape::Volume { model, material: *material });
                }
                Shape::Gaussians { .. } | Shape::Sequence { .. } | Shape::Sphere { .. } => return None,
            };
            let mirrors = if self.environment.is_some() { surface.reflection } else { 0.0 };
            let model = model.cut(surface.material, |levels| {
                let views = views(self, object, number, lamps.as_ref());
                let origin = model.surfels().origin;
                let mut nodes = Vec::new();
                if !views.is_empty() {
                    let (rolls, parts) = (self.shutter.readout.rolls(), Vec::new());
                    let errors = &mut errors;
                    let mut chooser =
                        Chooser { levels, views, tolerance, origin, mirrors, rolls, parts, image, errors };
                    chooser.choose(0, &mut nodes);
                }
                nodes
            })?;
            // Materials of its own are those of the object, but for its highlights.
            let material = surface.material.filter(|_| model.surfels().material.is_empty());
            Some(Shape::Surfels { model, surface: Surface { material, ..*surface }, points: *points })
        };
        let shapes: Vec<Option<Shape>> = self.objects.iter().map(cut).collect();
        if shapes.iter().all(Option::is_none) {
            return Cut::whole(self);
        }
        let objects = self.objects.iter().zip(shapes);
        let objects = objects.map(|(object, shape)| match shape {
            Some(shape) => Object { shape, ..object.clone() },
            None => object.clone(),
        });
        let scene = Cow::Owned(Self { objects: objects.collect(), ..self.clone() });
        Cut { scene, errors }
    }
}

/// Where an object and the camera are at an instant.
struct View {
    camera_from_model: DMat4,
    model_from_camera: DMat3,
    /// In the model.
    eye: DVec3,
    /// Pixels of a length of 1 of the model at a distance of 1 from the eye.
    pixels: f64,
    focal: f64,
    near: f64,
    /// Factors on velocities and accelerations of its points.
    elapsed: [f64; 2],
    shadows: ShadowView,
}

impl View {
    /// The box around what is below `node`, after its points moved by themselves; relative to the model's origin.
    fn corners(&self, node: &Node) -> [DVec3; 2] {
        node.rates.iter().zip(self.elapsed).fold(node.corners.map(Vec3::as_dvec3), |[low, high], (rates, factor)| {
            let [a, b] = rates.corners.map(|corner| corner.as_dvec3() * factor);
            [low + a.min(b), high + a.max(b)]
        })
    }

    /// How far what is below `node` has moved by itself, in the mean.
    fn travelled(&self, node: &Node) -> DVec3 {
        node.rates.iter().zip(self.elapsed).map(|(rates, factor)| rates.mean.as_dvec3() * factor).sum()
    }

    /// How far surfels below `node` are from its own after they moved by themselves, model units (root mean square).
    fn deviation(&self, node: &Node) -> f64 {
        let strays = node.rates.iter().zip(self.elapsed).map(|(rates, factor)| f64::from(rates.stray) * factor);
        strays.fold(f64::from(node.deviation), f64::hypot)
    }

    /// Pixels of a length of 1 of the model where `node` is nearest.
    fn density(&self, node: &Node, origin: DVec3) -> f64 {
        self.density_in(self.corners(node).map(|corner| corner + origin))
    }

    /// Pixels of a length of 1 of the model in the shadows of `node`; 0 where none shows.
    fn density_of_shadows(&self, node: &Node, origin: DVec3) -> f64 {
        let [low, high] = self.corners(node).map(|corner| corner + origin);
        let centre = self.camera_from_model.transform_point3(0.5 * (low + high));
        let radius = 0.5 * (high - low).length() * self.pixels / self.focal;
        self.pixels * self.shadows.magnification(centre, radius)
    }

    /// Pixels of a length of 1 of the model where a box is nearest.
    fn density_in(&self, [low, high]: [DVec3; 2]) -> f64 {
        let nearest = self.camera_from_model.transform_point3(self.eye.clamp(low, high)).length();
        self.pixels / nearest.max(self.near)
    }
}

/// The object at the ends of the parts of its exposure; those at which it is hidden are left out. One where nothing
/// moves.
fn views(scene: &Scene, object: &Object, number: f64, lamps: Option<&Lamps>) -> Vec<View> {
    let [early, late] = scene.shutter.readout.delays();
    let focal = focal_length(f64::from(scene.image.height), scene.camera.fovy);
    let at = |part: usize| {
        let share = part as f64 / PARTS as f64;
        let open = scene.shutter.frame_time(number, scene.shutter.weight.time_of(share));
        let time = if object.blur { open + early + (late - early) * share } else { number };
        let pose = object_pose(scene, object, time);
        let camera_from_model = camera_from_world(scene, time) * pose.world_from_model;
        let linear = DMat3::from_mat4(camera_from_model);
        let (scale, model_from_camera) = (norm(&linear), linear.inverse());
        let eye = model_from_camera * -camera_from_model.w_axis.truncate();
        let (pixels, near) = (focal * scale, scene.camera.near);
        let moves = !object.shape.paths().is_empty();
        let travelled = if moves { object.travelled(scene.frames.rate, number, time) } else { 0.0 };
        let [velocity, acceleration, _] = elapsed(travelled);
        let elapsed = [velocity, acceleration];
        let sound = pose.visible && scale > 0.0 && eye.is_finite();
        let shadows = lamps.map(|lamps| ShadowView::of(lamps, scene, ImagePlane::of(scene), focal, time));
        let shadows = shadows.unwrap_or_default();
        sound.then_some(View { camera_from_model, model_from_camera, eye, pixels, focal, near, elapsed, shadows })
    };
    let mut views: Vec<View> = (0..=PARTS).filter_map(at).collect();
    // Lights do not move, so an object that rests before the camera has the same shadows only where the camera rests.
    let same_shadows = lamps.is_none() || scene.camera.rests();
    views.dedup_by(|a, b| same_shadows && a.camera_from_model == b.camera_from_model && a.elapsed == b.elapsed);
    views
}

/// Where the image lies about the camera's axis, pixels.
#[derive(Clone, Copy)]
struct ImagePlane {
    size: DVec2,
    /// The point of the axis, from the upper left corner, y down.
    axis: DVec2,
}

impl ImagePlane {
    fn of(scene: &Scene) -> Self {
        let size = DVec2::new(scene.image.width.into(), scene.image.height.into());
        Self { size, axis: (0.5 + scene.camera.shift) * size }
    }
}

struct Chooser<'a> {
    levels: &'a Levels,
    views: Vec<View>,
    tolerance: CutTolerance,
    origin: DVec3,
    /// Share of the surroundings that it mirrors.
    mirrors: f64,
    /// Is the image read out row by row? A row sees a part of the time of the views, so no detail counts as blurred.
    rolls: bool,
    /// Lengths of the paths of a node in the parts of the exposure, pixels.
    parts: Vec<f64>,
    image: ImagePlane,
    /// What the chosen nodes leave out.
    errors: &'a mut BlockErrors,
}

impl Chooser<'_> {
    /// Adds the coarsest nodes below `node` that are fine enough, from one end of their curve to the other.
    fn choose(&mut self, node: u32, cut: &mut Vec<u32>) {
        let levels = self.levels;
        let of = &levels.nodes()[node as usize];
        if of.is_leaf() {
            return cut.push(node);
        }
        if let Some(error) = self.error_if_fine(of) {
            self.add_error(of, error);
            return cut.push(node);
        }
        of.children.clone().for_each(|child| self.choose(child, cut));
    }

    /// What the picture misses where `node` takes the place of all below it, as a share of white as it is displayed
    /// (root mean square); `None` where that is more than the tolerance.
    fn error_if_fine(&mut self, node: &Node) -> Option<f64> {
        let density = self.density(node);
        if self.deviation(node) > self.tolerance.deviation {
            return None;
        }
        let spacing = f64::from(node.spacing) * density;
        // The share of detail as fine as a cell that a pixel shows (docs/measurements/levels.md).
        let seen = 1.0 - libm::exp(-0.45 * libm::pow(spacing, 1.3));
        let rest = f64::from(node.rest).hypot(MIRRORED * self.mirrors * f64::from(node.turns)) * seen;
        if self.rolls {
            return (rest <= self.tolerance.rest).then_some(rest);
        }
        // The share that is left is at most 1, so what a still picture may miss is right in motion, too.
        let blurred = rest * self.blur(node, spacing);
        (blurred <= self.tolerance.rest).then_some(blurred)
    }

    /// Adds what the picture misses by a node at mid-exposure: `rest` where its fronts show, and a strip as wide as its
    /// deviation where an outline may run through it.
    fn add_error(&mut self, node: &Node, rest: f64) {
        let view = &self.views[self.views.len() / 2];
        let [low, high] = view.corners(node).map(|corner| corner + self.origin);
        let centre = 0.5 * (low + high);
        let place = view.camera_from_model.transform_point3(centre);
        let density = view.pixels / place.length().max(view.near);
        let radius = 0.5 * (high - low).length() * density;
        if -place.z <= view.near {
            return;
        }
        let on_image = self.image.axis + place.truncate() * DVec2::new(1.0, -1.0) * (view.focal / -place.z);
        // Each surfel stands for a square of the distance to the next.
        let edge = f64::from(node.spacing) * density;
        let area = node.len() as f64 * edge * edge;
        let facing = node.axis.as_dvec3().dot((view.eye - centre).normalize_or_zero());
        let outline = if facing.abs() < OUTLINE { area.sqrt() } else { 0.0 };
        let strip = CONTRAST * view.deviation(node) * density;
        self.errors.add(on_image, radius, rest * rest * area * facing.max(0.0) + strip * strip * outline);
    }

    /// Pixels of a length of 1 of the model at its nearest.
    fn density(&self, node: &Node) -> f64 {
        self.views.iter().map(|view| view.density(node, self.origin)).fold(0.0, f64::max)
    }

    /// How far surfels below `node`, or their shadows, are from its own, pixels: the largest of the exposure.
    fn deviation(&self, node: &Node) -> f64 {
        let density = |view: &View| view.density(node, self.origin).max(view.density_of_shadows(node, self.origin));
        let of = |view: &View| view.deviation(node) * density(view);
        self.views.iter().map(of).fold(0.0, f64::max)
    }

    /// The share of missing detail, `spacing` pixels wide, that is left after the blur of the exposure, 0 to 1.
    ///
    /// Waves are averaged out where the path is longer than they are. What rests for a part of the exposure keeps that
    /// share. Waves along the motion stay: half of all of them cross it where detail is the same in all directions.
    fn blur(&mut self, node: &Node, spacing: f64) -> f64 {
        let [low, high] = node.corners.map(|corner| corner.as_dvec3() + self.origin);
        let (middle, axis) = (0.5 * (low + high), node.axis.as_dvec3());
        let along = node.along.as_dmat3();
        self.parts.clear();
        let (mut across, mut path) = (0.0, 0.0);
        for [from, to] in self.views.array_windows() {
            let places = [from, to].map(|view| view.camera_from_model.transform_point3(middle + view.travelled(node)));
            if places.iter().any(|place| -place.z < from.near) {
                return 1.0;
            }
            let films: [DVec2; 2] = places.map(|place| place.truncate() * (from.focal / -place.z));
            let length = films[0].distance(films[1]);
            let ray = places[0].normalize_or_zero();
            let moved = places[1] - places[0];
            let moved = from.model_from_camera * (moved - ray * moved.dot(ray));
            let ray = (from.model_from_camera * ray).normalize_or_zero();
            let facing = axis.dot(ray);
            let moved = if facing.abs() > GRAZING { moved - ray * (axis.dot(moved) / facing) } else { moved };
            let moved = moved.normalize_or_zero();
            across += length * moved.dot(along * moved);
            path += length;
            self.parts.push(length);
        }
        if path <= 0.0 {
            return 1.0;
        }
        let rests = (PARTS - self.parts.len()) as f64 / PARTS as f64;
        let share = rests + (1.0 - rests) * longest_rest(&self.parts, WAVE * spacing.max(1.0));
        libm::pow(share.min(1.0), ((across / path - ALONG) * ACROSS).clamp(0.0, 1.0))
    }
}

/// The longest share of a time, in parts of equal length, that a path takes to get on by `wave`.
fn longest_rest(parts: &[f64], wave: f64) -> f64 {
    let from = |way: &mut dyn Iterator<Item = &f64>| {
        let (mut left, mut share) = (wave, 0.0);
        for &part in way {
            if part >= left {
                return share + left / part.max(f64::MIN_POSITIVE);
            }
            left -= part;
            share += 1.0;
        }
        share
    };
    // It begins or ends with a part.
    let of = |i: usize| from(&mut parts[i..].iter()).max(from(&mut parts[..=i].iter().rev()));
    (0..parts.len()).map(of).fold(0.0, f64::max) / parts.len() as f64
}

#[cfg(test)]
mod tests;
