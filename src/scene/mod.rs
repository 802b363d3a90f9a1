//! Scenes as plain values, and where things are at a time. `scene_file` reads and writes them.

mod at_frame;
mod automatic;
mod check;
mod cut;
mod detail;
mod gaussians;
mod model;
pub mod pose;
mod poses;
mod sequence;
mod shape;
mod sight;
mod studio;
mod unlit;
mod unseen;
mod values;

pub(crate) use self::automatic::{GivenCamera, GivenFrames, RATE, camera, frames, frames_of_keys, lights};
pub(crate) use self::cut::{BlockErrors, Cut, CutTolerance};
pub(crate) use self::detail::{SURFELS, wanted_fineness};
pub use self::model::{GaussianModel, SurfelModel};
pub(crate) use self::sequence::Opened;
pub use self::sequence::{Pattern, Sequence, SequenceSpec};
pub use self::shape::{Capture, Drawing, PointMotion, Shape, Sphere, Surface};
pub(crate) use self::sight::camera_enters;
pub use self::studio::{Studio, StudioLight, StudioOptions};
pub use self::unseen::{Unseen, why_unseen};
pub use self::values::{AnimationBinding, Camera, FrameRange, ImageSettings, Light, Motion, Object, Scene, Source};
