//! Scenes as plain values, and where things are at a time. `scene_file` reads and writes them.

pub mod pose;
mod values;

pub use self::values::{AnimationBinding, Camera, FrameRange, ImageSettings, Light, Motion, Object, Scene, Sphere};
