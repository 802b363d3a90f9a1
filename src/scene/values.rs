//! A scene as plain values: what the renderer sees.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};

use super::model::Model;
use super::sequence::Sequence;
use crate::anim::{Interpolation, NodeMotion};
use crate::environment::Environment;
use crate::files::Seen;
use crate::math::{Bounds, Trs};
use crate::model::paths::elapsed;
use crate::model::{self, Cloud, ColourSpace, Kind, Material, MeshOptions, ModelError, VelocityUnit, VolumeOptions};
use crate::time::Shutter;

/// What is rendered: objects, lights and a camera, with the image, the frames and the shutter.
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

    /// A capture that is composited in coded values, before an environment as background. It needs what is behind it at
    /// each instant; nothing has that.
    pub(crate) fn capture_before_panorama(&self) -> Option<&Object> {
        self.panorama()?;
        self.objects.iter().find(|object| object.model.gaussians().is_some_and(|gaussians| !gaussians.linear))
    }
}

/// Size and background of the image.
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
    },
    /// A point; falls off with 1/distance^2.
    Point {
        /// World-space position.
        position: DVec3,
        /// Radiance at distance 1.
        colour: DVec3,
    },
    /// From everywhere.
    Ambient {
        /// Radiance.
        colour: DVec3,
    },
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

/// How the points of a model move by themselves: p(t) = p + v t + a t^2/2, with the model's velocities v and
/// accelerations a.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointMotion {
    /// Unit of time of velocities and accelerations; `None`: that of the model.
    pub unit: Option<VelocityUnit>,
    /// Frame at which the points are where the model has them. `None`: each frame is, so t is 0 at the frame's number.
    pub at: Option<f64>,
}

/// A model in the scene, with its place and motion.
///
/// A point of the model moves by itself (`points`). Then it goes through `transform`, the animation, the motions in
/// their order, and `place`: `world_from_model` = place * motions (the last one leftmost) * animation * transform.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name, unique in the scene.
    pub name: String,
    /// Model file; empty for a model made in code.
    pub model_path: PathBuf,
    /// The surfels; shared by objects with the same model and options.
    pub model: Model,
    /// What the model is drawn as, forced by the scene (already applied to `model`).
    pub kind: Option<Kind>,
    /// How a capture is drawn; of it, `opacity` and `crop` hold for volumes too. It means nothing for surfels.
    pub capture: Capture,
    /// How a volume became kernels (already applied to `model`); it means nothing for other models.
    pub volume: VolumeOptions,
    /// The node of a glTF file that `model` is; `None`: its whole scene.
    pub node: Option<String>,
    /// How a mesh became surfels (already applied to `model`); it means nothing for other models.
    pub mesh: MeshOptions,
    /// Factor on the model's radii, > 0 (already applied to `model`).
    pub radius_scale: f64,
    /// Colour space forced by the scene (already applied to `model`).
    pub colour_space: Option<ColourSpace>,
    /// How its points move by themselves.
    pub points: PointMotion,
    /// Point files of many frames, in place of `model`.
    pub sequence: Option<Arc<Sequence>>,
    /// Frames from the first of which on, and before the second of which, it is there; `None`: always.
    pub(crate) window: Option<[f64; 2]>,
    /// It shows another part of the object before it.
    pub(crate) is_part: bool,
    /// Before motion.
    pub transform: Trs,
    /// Keyframed motion.
    pub animation: Option<AnimationBinding>,
    /// Motion by formula.
    pub motions: Vec<Motion>,
    /// After motion.
    pub place: Trs,
    /// The whole object's material; `None`: the model's own, else the default.
    pub material: Option<Material>,
    /// Factor on the opacities of surfels, in [0, 1].
    pub opacity: f64,
    /// Share of the environment's radiance that its surfels mirror, in [0, 1].
    pub reflection: f64,
    /// Depth tolerance of the visibility rule, world units; `None`: the median cut-off radius times the object's scale.
    pub epsilon: Option<f64>,
    /// False: object and camera are posed at the frame number.
    pub blur: bool,
    /// True: back faces show, with their normals turned to the viewer.
    pub two_sided: bool,
    /// An ideal sphere instead of the model. Only the reference shows it; the renderer refuses it.
    pub sphere: Option<Sphere>,
}

impl Object {
    /// An object that shows `model`: surfels, shared surfels, or the [`Model`] of another object.
    ///
    /// It has no name ([`Scene::new`] gives it one), stands where its model does, does not move, and has its model's
    /// material. Renderers are faster where neighbours in the model are neighbours in space
    /// ([`Surfels::spatially_ordered`]).
    ///
    /// [`Surfels::spatially_ordered`]: crate::model::Surfels::spatially_ordered
    pub fn new(model: impl Into<Model>) -> Self {
        let model = model.into();
        Self {
            name: String::new(),
            model_path: PathBuf::new(),
            kind: None,
            capture: Capture::default(),
            volume: VolumeOptions::default(),
            node: None,
            mesh: MeshOptions::default(),
            radius_scale: 1.0,
            colour_space: None,
            points: PointMotion::default(),
            sequence: None,
            window: None,
            is_part: false,
            transform: Trs::default(),
            animation: None,
            motions: Vec::new(),
            place: Trs::default(),
            material: None,
            opacity: 1.0,
            reflection: 0.0,
            epsilon: None,
            blur: true,
            two_sided: model.two_sided,
            sphere: None,
            model,
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
        let loaded = model::load(path, &model::LoadOptions::default(), &|_, _| {})?;
        Ok(Self { model_path: path.to_owned(), ..Self::new(Model::from(loaded)) })
    }

    /// An object of points: missing normals and radii are estimated, and the points sorted along a curve through space.
    ///
    /// # Errors
    /// The cloud has no point that can be drawn, or a column that is neither empty nor as long as `position`.
    pub fn from_cloud(cloud: Cloud) -> Result<Self, ModelError> {
        cloud.check()?;
        let (surfels, _) = model::complete(cloud, &model::LoadOptions::default(), &|_, _| {})?;
        Ok(Self::new(surfels.spatially_ordered()))
    }

    /// Box around the centres of surfels, Gaussians or kernels, or around the ideal sphere, in model space;
    /// empty for a model without any.
    pub fn bounds(&self) -> Bounds {
        match self.sphere {
            Some(Sphere { radius, .. }) => [DVec3::splat(-radius), DVec3::splat(radius)].into_iter().collect(),
            None if let Some(sequence) = &self.sequence => sequence.bounds(),
            None => self.cropped(self.model.bounds()),
        }
    }

    /// Box around what a viewer looks at, in model space: that of [`Self::bounds`] without the strays of a capture.
    pub fn core(&self) -> Bounds {
        if self.sphere.is_some() || self.sequence.is_some() { self.bounds() } else { self.cropped(self.model.core()) }
    }

    /// [`Self::bounds`] after its points moved by themselves to their places at scene time `time` (frames).
    pub(crate) fn bounds_at(&self, rate: f64, time: f64) -> Bounds {
        if self.points.at.is_none() || self.model.paths().is_empty() {
            // They are near the model's places in each frame.
            return self.bounds();
        }
        self.model.bounds_after(elapsed(self.travelled(rate, time, time)))
    }

    /// [`Self::core`] after its points moved, as [`Self::bounds_at`] has them.
    pub(crate) fn core_at(&self, rate: f64, time: f64) -> Bounds {
        let moved = self.points.at.is_some() && !self.model.paths().is_empty();
        if moved { self.bounds_at(rate, time) } else { self.core() }
    }

    fn cropped(&self, bounds: Bounds) -> Bounds {
        match self.capture.crop {
            Some([min, max]) if self.model.gaussians().is_some() => {
                Bounds { min: bounds.min.max(min), max: bounds.max.min(max) }
            }
            _ => bounds,
        }
    }

    /// The time that its points travelled at scene time `time` of frame `number` (both in frames), in the unit of their
    /// velocities.
    pub(crate) fn travelled(&self, rate: f64, number: f64, time: f64) -> f64 {
        let frames = if self.blur { time } else { number } - self.points.at.unwrap_or(number);
        frames * self.time_units(rate)
    }

    /// Units of time of its velocities in a frame, at `rate` frames per second.
    pub(crate) fn time_units(&self, rate: f64) -> f64 {
        match self.points.unit.unwrap_or(self.model.velocity_unit) {
            VelocityUnit::Second => 1.0 / rate,
            VelocityUnit::Frame => 1.0,
        }
    }

    /// True if light passes through the object's surfels. Surfaces that are as good as opaque count as opaque: they
    /// need no order.
    pub fn is_see_through(&self) -> bool {
        /// Less would be seen in 8 bits.
        const OPAQUE: f64 = 254.0 / 255.0;
        !self.model.is_empty() && self.opacity * f64::from(self.model.least_opacity()) < OPAQUE
    }

    /// Is it there at scene time `time` (frames)?
    pub(crate) fn exists(&self, time: f64) -> bool {
        self.window.is_none_or(|[from, to]| from <= time && time < to)
    }

    /// True if no animation and no motion moves the object, and its points do not travel from frame to frame.
    pub fn is_fixed(&self) -> bool {
        let travels = self.points.at.is_some() && !self.model.paths().is_empty() || self.sequence.is_some();
        let travels = travels || self.window.is_some();
        self.animation.is_none() && self.motions.is_empty() && !travels
    }
}

/// How the Gaussians of a capture are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capture {
    /// Factor on all opacities, in [0, 1].
    pub opacity: f64,
    /// Highest degree of harmonics that colours have, as far as the capture has them.
    pub harmonics: u8,
    /// Gaussians with centres outside this box are left out, model space; both corners belong to it.
    pub crop: Option<[DVec3; 2]>,
    /// Whether a Gaussian that is widened by the filter loses opacity; `None`: as the file says.
    pub antialias: Option<bool>,
    /// The colour of all, in place of their own.
    #[doc(hidden)]
    pub flat: Option<Vec3>,
}

impl Capture {
    /// The highest degree of harmonics.
    pub const MOST_HARMONICS: u8 = 3;
}

impl Default for Capture {
    fn default() -> Self {
        Self { opacity: 1.0, harmonics: Self::MOST_HARMONICS, crop: None, antialias: None, flat: None }
    }
}

/// The thesis's ideal sphere (B.2.4), about the model's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Radius, model space, > 0.
    pub radius: f64,
    /// Colour, linear Rec.709.
    pub colour: Vec3,
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::model::generate;

    #[test]
    fn a_cloud_and_its_file_make_the_same_object() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("fence.ply");
        let mut bytes = Vec::new();
        generate::write(&generate::fence(), &mut bytes).unwrap();
        std::fs::write(&path, bytes).unwrap();
        let loaded = Object::load(&path).unwrap();
        let made = Object::from_cloud(generate::fence()).unwrap();
        assert_eq!(loaded.model_path, path);
        assert_eq!(loaded.model.position, made.model.position);
        assert_eq!(loaded.model.median_radius(), made.model.surfels().median_radius());
        assert_eq!(loaded.bounds(), made.model.surfels().bounds());
        assert!(Object::from_cloud(Cloud::default()).is_err());
        assert!(Object::load(directory.path().join("none.ply")).is_err());
    }

    #[test]
    fn a_model_is_shared_by_objects() {
        let first = Object::from_cloud(generate::fence()).unwrap();
        let second = Object::new(first.model.clone());
        assert!(Arc::ptr_eq(first.model.surfels(), second.model.surfels()));
    }

    #[test]
    fn the_box_of_an_ideal_sphere_is_its_own() {
        let mut object = Object::new(Model::default());
        assert!(object.bounds().is_empty());
        object.sphere = Some(Sphere { radius: 2.0, colour: Vec3::ONE });
        assert_eq!(object.bounds().size(), DVec3::splat(4.0));
    }
}
