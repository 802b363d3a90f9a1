//! The camera path that a page collects: views at frames.

use serde::Deserialize;

use super::camera::CameraAt;
use crate::anim::{CameraPath, Interpolation, NodeMotion, PathTiming};
use crate::scene::{AnimationBinding, FrameRange, Scene};

/// Most keys of a page.
const MOST_KEYS: usize = 10_000;

/// Views at frames, and how they are flown through.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PathAt {
    keys: Vec<KeyAt>,
    constant: bool,
    /// Frames over which the speed rises at the begin and falls at the end; at most half of the path counts.
    ease: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct KeyAt {
    frame: i32,
    camera: CameraAt,
}

impl PathAt {
    /// The fault of this path; `None`: it can be flown.
    pub(super) fn fault(&self) -> Option<String> {
        if self.keys.is_empty() || self.keys.len() > MOST_KEYS {
            return Some(format!("a camera path has {} keys, must have 1 to {MOST_KEYS}", self.keys.len()));
        }
        if !(0.0..=1e6).contains(&self.ease) {
            return Some(format!("ease is {}, must be from 0 to a million frames", self.ease));
        }
        if let Some(fault) = self.keys.iter().find_map(|key| key.camera.fault()) {
            return Some(fault);
        }
        self.path(1.0).err()
    }

    fn path(&self, rate: f64) -> Result<CameraPath, String> {
        let keys: Vec<_> = self.keys.iter().map(|key| key.camera.key(key.frame.into())).collect();
        let [first, last] = self.ends();
        let ease = self.ease.min(0.5 * (last - first) as f64).max(0.0);
        let timing = PathTiming { constant_speed: self.constant, ease_in: ease, ease_out: ease };
        CameraPath::new(rate, keys, timing, None).map_err(|why| match why.key {
            Some(key) => {
                format!("key {} of the path: {} is {}, must be {}", key + 1, why.attribute, why.found, why.expected)
            }
            None => format!("the path: {} is {}, must be {}", why.attribute, why.found, why.expected),
        })
    }

    /// Frames of the first and the last key.
    fn ends(&self) -> [i64; 2] {
        [self.keys.first(), self.keys.last()].map(|key| key.map_or(0, |key| i64::from(key.frame)))
    }

    /// The frames from the first key to the last.
    pub(super) fn frames(&self, rate: f64) -> FrameRange {
        let [first, last] = self.ends();
        FrameRange { first, last, rate }
    }

    /// Puts the scene's camera on the path, and its frames from the first key to the last.
    pub(super) fn place(&self, scene: &mut Scene) {
        let rate = scene.frames.rate;
        let (Ok(path), Some(first)) = (self.path(rate), self.keys.first()) else { return };
        first.camera.place(&mut scene.camera);
        let node = NodeMotion::from(path);
        let binding = AnimationBinding { path: std::path::PathBuf::new(), node, interpolation: Interpolation::Spline };
        scene.camera.animation = Some(binding);
        scene.frames = self.frames(rate);
    }
}
