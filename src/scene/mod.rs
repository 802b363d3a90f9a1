//! Scenes as plain values, and where things are at a time. `scene_file` reads and writes them.

mod automatic;
mod model;
pub mod pose;
mod values;

pub(crate) use self::automatic::{GivenCamera, GivenFrames, camera, frames, lights};
pub use self::model::Model;
pub use self::values::{AnimationBinding, Camera, FrameRange, ImageSettings, Light, Motion, Object, Scene, Sphere};
