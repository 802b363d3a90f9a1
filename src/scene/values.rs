//! A scene, resolved into plain values: what the renderer sees.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use crate::anim::{Interpolation, NodeAnimation};
use crate::math::{Bounds, Trs};
use crate::model::{ColourSpace, Material, Surfels};
use crate::time::Shutter;

/// A scene with everything loaded and every default filled in.
#[derive(Clone, Debug)]
pub struct Scene {
    /// File stem of the scene file; names the output.
    pub name: String,
    /// Image size and background.
    pub image: ImageSettings,
    /// Frames that a plain `render` makes, and their rate.
    pub frames: FrameRange,
    /// Exposure.
    pub shutter: Shutter,
    /// Camera.
    pub camera: Camera,
    /// Lights, in document order.
    pub lights: Vec<Light>,
    /// Objects, in document order.
    pub objects: Vec<Object>,
}

/// `<image>`.
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

/// `<frames>`: an inclusive range and the frame rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRange {
    /// First frame.
    pub first: i64,
    /// Last frame, >= `first`.
    pub last: i64,
    /// Frames per second, > 0.
    pub rate: f64,
}

/// `<camera>`: a pinhole.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Eye point, world space.
    pub eye: DVec3,
    /// Point looked at; not the eye.
    pub at: DVec3,
    /// Up direction, not parallel to the view direction.
    pub up: DVec3,
    /// Vertical field of view, radians, in (0, pi).
    pub fovy: f64,
    /// Nearest visible depth, > 0.
    pub near: f64,
    /// Replaces eye, at and up: the camera sits at the node and looks along its -z.
    pub animation: Option<AnimationBinding>,
    /// True where the scene names no camera and this one was derived from the objects.
    pub automatic: bool,
}

/// `<light>`. Colours are linear Rec.709, already multiplied by the intensity.
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

/// `<animation>`: one node of an animation file.
#[derive(Clone, Debug)]
pub struct AnimationBinding {
    /// File the node came from.
    pub path: PathBuf,
    /// The node's curves.
    pub node: Arc<NodeAnimation>,
    /// How values between keys are found.
    pub interpolation: Interpolation,
}

/// `<motion>`: motion without a file, from frame 0 on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Thesis: `LinearAnimation`.
    Linear {
        /// Scene units a frame.
        velocity: DVec3,
    },
    /// Thesis: `RotationalAnimation`.
    Rotation {
        /// Axis, unit length.
        axis: DVec3,
        /// Radians a frame, right-handed.
        per_frame: f64,
        /// A point on the axis.
        centre: DVec3,
    },
}

/// `<object>`. A point goes through `transform`, the animation, the motions in document order and `place`:
/// `world_from_model` = place * motions, the last on the left * animation * transform.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name, unique in the scene (default: `object1`, `object2`, ...).
    pub name: String,
    /// Model file.
    pub model_path: PathBuf,
    /// Surfels, in an order that keeps neighbours together; shared by objects with the same model and options.
    pub model: Arc<Surfels>,
    /// Factor on the model's radii, > 0 (already applied to `model`).
    pub radius_scale: f64,
    /// Colour space forced by the scene (already applied to `model`).
    pub colour_space: Option<ColourSpace>,
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
    /// Depth tolerance of the visibility rule, world units; `None`: the median cut-off radius times the object's scale.
    pub epsilon: Option<f64>,
    /// False: object and camera are posed at the frame number.
    pub blur: bool,
    /// True: back faces show, with their normals turned to the viewer.
    pub two_sided: bool,
    /// Median cut-off radius of `model`.
    pub median_radius: f32,
    /// Box around the model's surfel centres, model space.
    pub bounds: Bounds,
    /// An ideal sphere instead of the model, which is empty then: for the reference alone; no splatter can show it.
    pub sphere: Option<Sphere>,
}

/// `<sphere>`: the thesis's ideal sphere (B.2.4), about the model's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Radius, model space, > 0.
    pub radius: f64,
    /// Colour, linear Rec.709.
    pub colour: Vec3,
}
