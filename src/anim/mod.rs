//! Keyframe animation: curves, their evaluation, Maya's `.anim` files, and the animations of glTF files.
//!
//! Times are in seconds at this interface where nothing else is said; a file's own time unit is `Animation::rate` units
//! a second. Lengths are in cm (one cm is one scene unit), angles in radians.
//!
//! Data flow: `load` (file to text) → `maya` (text to raw keys) → `tangent` (types to vectors) → `curve` and
//! `segment` (value at a time), `breaks` (jumps) → `node` (curves to a transform) → `animation` (all nodes of a
//! file). A glTF file goes through `gltf` (its nodes and clips) and `track` (value at a time) to a `chain` (a node and
//! those above it); `poses` makes such a chain of matrices at times. `camera_track` reads poses of other programs,
//! and `camera_path` flies through views that a person chose. `motion` is a node of either, a track or a path.

mod animation;
mod breaks;
mod camera_path;
mod camera_track;
mod chain;
mod curve;
mod error;
mod gltf;
mod load;
mod maya;
mod motion;
mod node;
mod poses;
mod segment;
mod tangent;
mod track;

pub use animation::Animation;
pub(crate) use camera_path::PathFault;
pub use camera_path::{CameraPath, PathKey, PathTarget, PathTiming, PathView};
pub use camera_track::{CameraTrack, Intrinsics, TrackFormat, TrackOptions};
pub use chain::Chain;
pub use curve::Interpolation;
pub use error::{AnimError, AnimLocation};
pub use gltf::GltfAnimation;
pub use load::{AnimationFile, load, open};
pub use maya::parse;
pub use motion::{NodeMotion, NodePose};
pub use node::{Drift, NodeAnimation, NodeState};
