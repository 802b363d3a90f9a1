//! Keyframe animation: curves, their evaluation, and Maya's `.anim` files.
//!
//! Times are in seconds at this interface where nothing else is said; a file's own time unit is `Animation::rate` units
//! a second. Lengths are in cm (one cm is one scene unit), angles in radians.
//!
//! Data flow: `load` (file to text) → `maya` (text to raw keys) → `tangent` (types to vectors) → `curve` and
//! `segment` (value at a time), `breaks` (jumps) → `node` (curves to a transform) → `animation` (all nodes of a
//! file).

mod animation;
mod breaks;
mod curve;
mod error;
mod load;
mod maya;
mod node;
mod segment;
mod tangent;

pub use animation::Animation;
pub use curve::Interpolation;
pub use error::{AnimError, Location};
pub use load::load;
pub use maya::parse;
pub use node::{Drift, NodeAnimation, NodeState};
