//! A scene as plain values: what the renderer sees.

use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};

use super::model::{Piece, SurfelModel};
use super::shape::Shape;
use crate::anim::{Interpolation, NodeMotion};
use crate::environment::Environment;
use crate::files::Seen;
use crate::math::{Bounds, Trs};
use crate::model::paths::elapsed;
use crate::model::{self, Cloud, LoadOptions, ModelError, VelocityUnit};
use crate::options::Detail;
use crate::time::Shutter;

/// Objects, lights and a camera, with the image, the frames and the shutter: all that is rendered.
///
/// `Scene::load` reads a scene file; [`Scene::new`] takes objects made in code and fills in the same defaults as a
/// file. All fields may be changed afterwards.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Name of the scene: the file stem of its scene file. The command line names output files after it.
    pub name: String,
    /// Image size and background.
    pub image: ImageSettings,
    /// The frames of the sequence, and their rate. A renderer takes any frame number.
    pub frames: FrameRange,
    /// Exposure.
    pub shutter: Shutter,
    /// Camera.
    pub camera: Camera,
    /// Lights.
    pub lights: Vec<Light>,
    /// What surrounds the scene.
    pub environment: Option<Environment>,
    /// Objects. Their order is that of all sums of floats: a scene with its objects in another order gives the same
    /// picture up to rounding.
    pub objects: Vec<Object>,
    /// The files that it was read from: its own, those that it names, and those that these name; of a sequence, the
    /// first. Each with what it was then; files that were looked for and not found are among them. None of a scene that
    /// was made in code.
    pub files: Seen,
}

impl Scene {
    /// The environment, where it is the background.
    pub(crate) fn panorama(&self) -> Option<&Environment> {
        self.environment.as_ref().filter(|environment| environment.background && !self.image.transparent)
    }

    /// The environment, where light comes from it.
    pub(crate) fn sky(&self) -> Option<&Environment> {
        self.environment.as_ref().filter(|environment| environment.shines())
    }

    /// Are there shadows in any light?
    pub(crate) fn has_shadows(&self) -> bool {
        self.lights.iter().any(Light::has_shadows) || self.sky().is_some_and(|sky| sky.shadows)
    }

    /// A capture that is composited in coded values, before an environment as background. It needs what is behind it at
    /// each instant; nothing has that.
    pub(crate) fn capture_before_panorama(&self) -> Option<&Object> {
        self.panorama()?;
        self.objects.iter().find(|object| object.shape.gaussians().is_some_and(|model| !model.gaussians().linear))
    }
}

/// Size and background of the image.
///
/// A size that is set after loading leaves the camera and the surfels of meshes as they are. The picture then shows the
/// same height, with the same field of view, and more or less at the sides; meshes may be too coarse for it.
/// [`Scene::open`](Scene::open) takes the size before, as `--size` does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageSettings {
    /// Width in pixels, >= 1.
    pub width: u32,
    /// Height in pixels, >= 1.
    pub height: u32,
    /// Background, linear Rec.709.
    pub background: DVec3,
    /// Leave the background out and keep alpha.
    pub transparent: bool,
}

impl Default for ImageSettings {
    fn default() -> Self {
        Self { width: 1024, height: 768, background: DVec3::ZERO, transparent: false }
    }
}

/// The frames of a sequence: an inclusive range, and the frame rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRange {
    /// First frame.
    pub first: i64,
    /// Last frame, >= `first`.
    pub last: i64,
    /// Frames per second, > 0.
    pub rate: f64,
}

/// A pinhole camera.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Eye point, world space.
    pub eye: DVec3,
    /// Point that the camera looks at; not the eye.
    pub at: DVec3,
    /// Up direction, not parallel to the view direction.
    pub up: DVec3,
    /// Vertical field of view, radians, in (0, pi).
    pub fovy: f64,
    /// Nearest visible depth, > 0.
    pub near: f64,
    /// Where the camera's axis meets the image, from its middle: shares of the width (right) and of the height (down).
    pub shift: DVec2,
    /// Replaces eye, at and up: the camera sits at the node and looks along its -z.
    pub animation: Option<AnimationBinding>,
    /// Motion of the camera by formula, after eye, at and up or the animation.
    pub motions: Vec<Motion>,
    /// True where this camera was derived from the objects ([`Camera::automatic`]).
    pub automatic: bool,
}

impl Camera {
    /// Field of view by default, degrees.
    pub(crate) const FOVY_DEGREES: f64 = 40.0;
    /// Nearest visible depth by default, scene units.
    pub(crate) const NEAR: f64 = 0.01;

    /// A camera at `eye` that looks at the point `at`, in scene units; +y is up, the vertical field of view is 40
    /// degrees, and the nearest visible depth 0.01.
    ///
    /// `at` must not be `eye` itself, nor straight above or below it (else set another `up`).
    pub fn new(eye: DVec3, at: DVec3) -> Self {
        Self {
            eye,
            at,
            up: DVec3::Y,
            fovy: Self::FOVY_DEGREES.to_radians(),
            near: Self::NEAR,
            shift: DVec2::ZERO,
            animation: None,
            motions: Vec::new(),
            automatic: false,
        }
    }

    /// True if no animation and no motion moves the camera.
    pub fn rests(&self) -> bool {
        self.animation.is_none() && self.motions.is_empty()
    }
}

/// A light. Colours are linear Rec.709, already multiplied by the intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Light that travels along `direction` (unit), from infinitely far.
    Directional {
        /// Direction of travel, world space, unit length.
        direction: DVec3,
        /// Radiance.
        colour: DVec3,
        /// Angle under which the light is seen, radians in [0, pi]: its diameter. It softens shadows; without them it
        /// does nothing.
        angle: f64,
        /// Are there shadows in it?
        shadows: bool,
    },
    /// A point, or a ball; falls off with 1/distance^2.
    Point {
        /// World-space position.
        position: DVec3,
        /// Radiance at distance 1.
        colour: DVec3,
        /// Radius of the ball, >= 0: seen from everywhere it is an even disc. It softens shadows; without them it does
        /// nothing.
        radius: f64,
        /// Are there shadows in it?
        shadows: bool,
    },
    /// From everywhere.
    Ambient {
        /// Radiance.
        colour: DVec3,
    },
}

impl Light {
    /// Angle under which a directional light is seen by default, degrees: about that of the sun.
    pub(crate) const ANGLE_DEGREES: f64 = 0.5;

    /// Light that travels along the unit vector `direction`, half a degree wide, with shadows.
    pub const fn directional(direction: DVec3, colour: DVec3) -> Self {
        Self::Directional { direction, colour, angle: Self::ANGLE_DEGREES.to_radians(), shadows: true }
    }

    /// A point at `position`, of light `colour` at distance 1, with shadows.
    pub const fn point(position: DVec3, colour: DVec3) -> Self {
        Self::Point { position, colour, radius: 0.0, shadows: true }
    }

    /// The same light, from which nothing is hidden.
    #[must_use]
    pub const fn without_shadows(mut self) -> Self {
        if let Self::Directional { shadows, .. } | Self::Point { shadows, .. } = &mut self {
            *shadows = false;
        }
        self
    }

    /// Are there shadows in it?
    pub const fn has_shadows(&self) -> bool {
        matches!(self, Self::Directional { shadows: true, .. } | Self::Point { shadows: true, .. })
    }
}

/// One node of an animation file, bound to an object or to the camera.
#[derive(Clone, Debug)]
pub struct AnimationBinding {
    /// File the node came from.
    pub path: PathBuf,
    /// The node's motion.
    pub node: NodeMotion,
    /// How values between the keys of a Maya file are found.
    pub interpolation: Interpolation,
}

/// Motion by formula, without an animation file. At frame 0 it changes nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Along a straight line, at constant speed.
    Linear {
        /// Scene units per frame.
        velocity: DVec3,
    },
    /// About an axis, at constant speed.
    Rotation {
        /// Axis, unit length.
        axis: DVec3,
        /// Radians per frame, right-handed.
        per_frame: f64,
        /// A point on the axis.
        centre: DVec3,
    },
}

/// Where a model came from and how it was read: what is needed to write the object back into a scene file. Renderers do
/// not look at it.
#[derive(Clone, Debug, Default)]
pub struct Source {
    /// Model file; empty for a model made in code.
    pub path: PathBuf,
    /// How the file was read (already applied to the shape).
    pub options: LoadOptions,
}

/// A shape in the scene, with its place, motion and look.
///
/// A point of the model moves by itself ([`PointMotion`](super::PointMotion)). Then it goes through `transform`, the
/// animation, the motions in their order, and `place`: `world_from_model` = place * motions (the last one leftmost) *
/// animation * transform.
#[derive(Clone, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "each is a property by itself")]
pub struct Object {
    /// Name, unique in the scene.
    pub name: String,
    /// What it is made of. Objects of the same model and options share it.
    pub shape: Shape,
    /// Where the shape came from.
    pub source: Source,
    /// Before motion.
    pub transform: Trs,
    /// Keyframed motion.
    pub animation: Option<AnimationBinding>,
    /// Motion by formula.
    pub motions: Vec<Motion>,
    /// After motion.
    pub place: Trs,
    /// Factor on the opacities of all surfels, Gaussians or kernels, in [0, 1].
    pub opacity: f64,
    /// Depth tolerance of the visibility rule, world units; `None`: [`Shape::tolerance`] times the object's scale.
    pub epsilon: Option<f64>,
    /// How fine its surfels are; [`Detail::Auto`]: as the picture asks. Where the picture asks for [`Detail::Full`],
    /// all of them show.
    pub detail: Detail,
    /// False: object and camera are posed at the frame number.
    pub blur: bool,
    /// Do shadows fall on it? On surfels, on volumes that have normals, and on captures: their colours are multiplied
    /// by the ratio of the light that reaches them to all light.
    pub receive_shadows: bool,
    /// It is not seen itself: its opaque surfels show the light that shadows take away, as black with the alpha
    /// 1 - lit / unlit, and hide what is behind them.
    pub shadow_catcher: bool,
    /// False: it keeps no light from anything, in lights with shadows. Captures keep none from captures anyway.
    pub cast_shadows: bool,
}

impl Object {
    /// An object of this shape: surfels, Gaussians, an ideal sphere, or the [`Shape`] of another object.
    ///
    /// It has no name ([`Scene::new`] gives it one), stands where its model does, does not move, and has its model's
    /// material ([`Shape::surface_mut`] changes that). Rendering is faster where neighbours in the model are
    /// neighbours in space ([`Surfels::spatially_ordered`]).
    ///
    /// [`Surfels::spatially_ordered`]: crate::model::Surfels::spatially_ordered
    pub fn new(shape: impl Into<Shape>) -> Self {
        Self {
            name: String::new(),
            source: Source::default(),
            transform: Trs::default(),
            animation: None,
            motions: Vec::new(),
            place: Trs::default(),
            opacity: 1.0,
            epsilon: None,
            detail: Detail::Auto,
            blur: true,
            receive_shadows: true,
            shadow_catcher: false,
            cast_shadows: true,
            shape: shape.into(),
        }
    }

    /// An object of a model file: PLY, `Pointshop3D` `.sfl`, Wavefront `.obj`, points as text (`.xyz`, `.pts`),
    /// splatblur's own `.bin`, a capture, or a volume (`.nrrd`). Missing normals and radii of surfels are
    /// estimated, and the surfels sorted along a curve through space. A file with faces is sampled to about 200 000
    /// surfels.
    ///
    /// # Errors
    /// The file cannot be read, or is not a valid model with at least one point.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, ModelError> {
        let path = path.as_ref();
        let loaded = model::load(path, &LoadOptions::default(), &|_, _| {})?;
        let source = Source { path: path.to_owned(), ..Source::default() };
        Ok(Self { source, ..Self::new(loaded) })
    }

    /// An object of points as a file has them, with colours as `colour_storage` says: missing normals and radii are
    /// estimated, and the points sorted along a curve through space.
    ///
    /// # Errors
    /// The cloud has no point that can be drawn, or a column that is neither empty nor as long as `position`.
    pub(crate) fn from_cloud(cloud: Cloud) -> Result<Self, ModelError> {
        cloud.check()?;
        let (surfels, _) = model::complete(cloud, &LoadOptions::default(), &|_, _| {})?;
        Ok(Self::new(surfels.spatially_ordered()))
    }

    /// [`Shape::bounds`] after its points moved by themselves to their places at scene time `time` (frames).
    pub(crate) fn bounds_at(&self, rate: f64, time: f64) -> Bounds {
        match self.travelling() {
            Some(model) => model.bounds_after(elapsed(self.travelled(rate, time, time))),
            // They are near the model's places in each frame.
            None => self.shape.bounds(),
        }
    }

    /// [`Shape::core`] after its points moved, as [`Self::bounds_at`] has them.
    pub(crate) fn core_at(&self, rate: f64, time: f64) -> Bounds {
        if self.travelling().is_some() { self.bounds_at(rate, time) } else { self.shape.core() }
    }

    /// Surfels that move by themselves from frame to frame.
    fn travelling(&self) -> Option<&SurfelModel> {
        match &self.shape {
            Shape::Surfels { model, points, .. } if points.at.is_some() && !model.paths().is_empty() => Some(model),
            _ => None,
        }
    }

    /// The time that its points travelled at scene time `time` of frame `number` (both in frames), in the unit of their
    /// velocities.
    pub(crate) fn travelled(&self, rate: f64, number: f64, time: f64) -> f64 {
        let Shape::Surfels { points, .. } = &self.shape else { return 0.0 };
        let frames = if self.blur { time } else { number } - points.at.unwrap_or(number);
        frames * self.time_units(rate)
    }

    /// Units of time of the velocities of its points in a frame, at `rate` frames per second.
    pub(crate) fn time_units(&self, rate: f64) -> f64 {
        let Shape::Surfels { model, points, .. } = &self.shape else { return 1.0 / rate };
        match points.unit.unwrap_or(model.surfels().velocity_unit) {
            VelocityUnit::Second => 1.0 / rate,
            VelocityUnit::Frame => 1.0,
        }
    }

    /// True if light passes through the object's surfels. Surfaces that are as good as opaque count as opaque: they
    /// need no order.
    pub fn is_see_through(&self) -> bool {
        /// Less would be seen in 8 bits.
        const OPAQUE: f64 = 254.0 / 255.0;
        let model = self.shape.surfels().filter(|model| !model.surfels().is_empty());
        model.is_some_and(|model| self.opacity * f64::from(model.least_opacity()) < OPAQUE)
    }

    /// Has it surfels through which no light passes?
    pub(crate) fn has_opaque_surfels(&self) -> bool {
        self.shape.surfels().is_some() && !self.is_see_through()
    }

    /// The part of a sequence that it shows in this frame.
    pub(crate) fn piece(&self) -> Option<&Piece> {
        self.shape.surfels()?.piece()
    }

    /// Does it show another part of the object before it?
    pub(crate) fn is_part(&self) -> bool {
        self.piece().is_some_and(|piece| !piece.is_first)
    }

    /// Is it there at scene time `time` (frames)?
    pub(crate) fn exists(&self, time: f64) -> bool {
        self.piece().is_none_or(|Piece { window: [from, to], .. }| *from <= time && time < *to)
    }

    /// True if no animation and no motion moves the object, and its points do not travel from frame to frame.
    pub fn is_fixed(&self) -> bool {
        let is_sequence = self.piece().is_some() || matches!(self.shape, Shape::Sequence { .. });
        self.animation.is_none() && self.motions.is_empty() && self.travelling().is_none() && !is_sequence
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;

    use super::*;
    use crate::model::generate;
    use crate::scene::Sphere;

    #[test]
    fn a_cloud_and_its_file_make_the_same_object() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("fence.ply");
        let mut bytes = Vec::new();
        generate::write(&generate::fence(), &mut bytes).unwrap();
        std::fs::write(&path, bytes).unwrap();
        let loaded = Object::load(&path).unwrap();
        let made = Object::from_cloud(generate::fence()).unwrap();
        assert_eq!(loaded.source.path, path);
        let [from_file, from_code] = [&loaded, &made].map(|object| object.shape.surfels().unwrap());
        assert_eq!(from_file.surfels().position, from_code.surfels().position);
        assert_eq!(from_file.median_radius(), from_code.surfels().median_radius());
        assert_eq!(loaded.shape.bounds(), from_code.surfels().bounds());
        assert!(Object::from_cloud(Cloud::default()).is_err());
        assert!(Object::load(directory.path().join("none.ply")).is_err());
    }

    #[test]
    fn a_model_is_shared_by_objects() {
        let first = Object::from_cloud(generate::fence()).unwrap();
        let second = Object::new(first.shape.clone());
        let [first, second] = [&first, &second].map(|object| object.shape.surfels().unwrap().surfels());
        assert!(Arc::ptr_eq(first, second));
    }

    #[test]
    fn the_box_of_an_ideal_sphere_is_its_own() {
        assert!(Shape::default().bounds().is_empty());
        let sphere = Shape::from(Sphere { radius: 2.0, colour: Vec3::ONE });
        assert_eq!(sphere.bounds().size(), DVec3::splat(4.0));
    }
}
