//! The motion of a node, whichever file it came from.

use std::sync::Arc;

use glam::{DMat4, DVec3};

use super::camera_path::CameraPath;
use super::camera_track::CameraTrack;
use super::chain::Chain;
use super::curve::Interpolation;
use super::node::NodeAnimation;

/// The motion of one node of an animation file.
#[derive(Clone, Debug)]
pub enum NodeMotion {
    /// The curves of a Maya file.
    Curves(Arc<NodeAnimation>),
    /// A node of a glTF file, with those that it hangs below.
    Chain(Arc<Chain>),
    /// Poses of a camera.
    Track(Arc<CameraTrack>),
    /// Keys of a camera. The object that it looks at counts in a scene alone.
    Path(Arc<CameraPath>),
}

/// Where a node is at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodePose {
    /// From the node's space to the space of its file.
    pub matrix: DMat4,
    /// False where the animation hides the node.
    pub visible: bool,
}

impl NodeMotion {
    /// The node at `seconds`. glTF files say by themselves how values between keys are found.
    pub fn at(&self, seconds: f64, interpolation: Interpolation) -> NodePose {
        match self {
            Self::Curves(node) => {
                let state = node.at(seconds, interpolation);
                NodePose { matrix: state.transform.matrix(), visible: state.visible }
            }
            Self::Chain(chain) => NodePose { matrix: chain.at(seconds), visible: true },
            Self::Track(track) => NodePose { matrix: track.at(seconds), visible: true },
            Self::Path(path) => NodePose { matrix: path.at(seconds, None), visible: true },
        }
    }

    /// Rotation and translation of the node at `seconds`, without its scale.
    pub fn rigid_at(&self, seconds: f64, interpolation: Interpolation) -> DMat4 {
        match self {
            Self::Curves(node) => {
                let mut rigid = node.at(seconds, interpolation).transform;
                rigid.scale = DVec3::ONE;
                rigid.matrix()
            }
            Self::Chain(chain) => chain.rigid_at(seconds),
            Self::Track(track) => track.at(seconds),
            Self::Path(path) => path.at(seconds, None),
        }
    }

    /// First and last key, seconds.
    pub fn range(&self) -> (f64, f64) {
        match self {
            Self::Curves(node) => node.range(),
            Self::Chain(chain) => chain.range(),
            Self::Track(track) => track.range(),
            Self::Path(path) => path.range(),
        }
    }

    /// True if a scale has keys.
    pub fn has_scale(&self) -> bool {
        match self {
            Self::Curves(node) => node.has_scale(),
            Self::Chain(chain) => chain.has_scale(),
            Self::Track(_) | Self::Path(_) => false,
        }
    }

    /// Times in (from, to), seconds, rising, at which the node jumps, appears or vanishes; see
    /// [`NodeAnimation::breaks`].
    pub fn breaks(&self, from: f64, to: f64, interpolation: Interpolation) -> Vec<f64> {
        match self {
            Self::Curves(node) => node.breaks(from, to, interpolation),
            Self::Chain(chain) => chain.breaks(from, to),
            Self::Track(_) | Self::Path(_) => Vec::new(),
        }
    }

    /// Where the sphere about `x` is at mid-time of `times` (from, middle, to; seconds), its largest radius at any of
    /// them, and the most that its centre is away from there; `None` where no bound is known, as at a jump.
    pub fn sweep(
        &self,
        x: DVec3,
        radius: f64,
        times: [f64; 3],
        interpolation: Interpolation,
    ) -> Option<(DVec3, f64, f64)> {
        let [from, middle, to] = times;
        match self {
            Self::Curves(node) => {
                let by = node.drift(from, to, interpolation)?;
                let transform = node.at(middle, interpolation).transform;
                let scale = transform.scale.abs().max_element() + by.scale;
                let drift = by.translate + (by.rotate * scale + by.scale) * x.length();
                Some((transform.matrix().transform_point3(x), radius * scale, drift))
            }
            Self::Chain(chain) => chain.sweep(x, radius, from, to),
            Self::Track(_) | Self::Path(_) => None,
        }
    }
}

impl From<Arc<NodeAnimation>> for NodeMotion {
    fn from(node: Arc<NodeAnimation>) -> Self {
        Self::Curves(node)
    }
}

impl From<CameraTrack> for NodeMotion {
    fn from(track: CameraTrack) -> Self {
        Self::Track(Arc::new(track))
    }
}

impl From<CameraPath> for NodeMotion {
    fn from(path: CameraPath) -> Self {
        Self::Path(Arc::new(path))
    }
}

impl From<Chain> for NodeMotion {
    fn from(chain: Chain) -> Self {
        Self::Chain(Arc::new(chain))
    }
}
