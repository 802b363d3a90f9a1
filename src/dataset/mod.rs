//! Paired truth: of each frame the blurred picture, and beside it sharp ones, flow, depth, alpha, the blur's error, and
//! a `transforms.json` that names them all (docs/dataset.md).
//!
//! A [`Recipe`] says what is made. `files` lists the files of a frame, `frame` makes them, `noise` is that of the
//! camera's sensor, `shake` that of the hand, and `transforms` writes the list of all frames. `common` makes the other
//! files that all frames share: `views` in their order, and `points` for a start, as `colmap` and `llff` write them.
//! `held_out` are views for a test.

mod colmap;
mod common;
mod files;
mod frame;
mod held_out;
mod llff;
mod noise;
mod points;
mod shake;
mod transforms;
mod views;

use std::borrow::Cow;

use crate::image::{Format, Response};
use crate::limits::Invalid;
use crate::options::RenderOptions;
use crate::reference::ReferenceOptions;
use crate::scene::Scene;
use crate::time::{FrameNumber, Shutter, Weight};

pub use self::common::{CommonFile, common_files};
pub use self::files::{File, FolderLayout, Role, files};
pub use self::frame::{DatasetError, FileContents, Made, frame};
pub use self::held_out::HeldOut;
pub use self::noise::{Noise, NoiseError};
pub use self::shake::{Shake, ShakeError};
pub use self::transforms::{Origin, TRANSFORMS, transforms};

/// Most sharp pictures of a frame.
pub const MOST_SHARP: u32 = 1024;

/// The middle of the shutter.
const MIDDLE: f64 = 0.5;

/// The pictures that are made of each frame.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// Where the files lie.
    pub layout: FolderLayout,
    /// Sharp pictures, 1 to [`MOST_SHARP`].
    pub sharp: u32,
    /// How pictures are made.
    pub by: By,
    /// Format of blurred and sharp pictures.
    pub format: Format,
    /// Response of the camera, for PNG files.
    pub response: Response,
    /// Noise of blurred pictures.
    pub noise: Noise,
    /// Shake of the camera.
    pub shake: Option<Shake>,
    /// Whether the flow is written.
    pub flow: bool,
    /// Is the blurred picture the plain mean of the sharp ones, in linear light? Else it is rendered by itself.
    pub exact: bool,
    /// Views for a test. The layout `gopro` knows none.
    pub held_out: Option<HeldOut>,
}

/// What makes pictures.
#[derive(Clone, Debug)]
pub enum By {
    /// The renderer, as these options say.
    Splatting(RenderOptions),
    /// The reference, which gives each pixel a standard error.
    Tracing(ReferenceOptions),
}

impl Recipe {
    /// The instants of the sharp pictures: shares of the shutter, evenly from where it opens to where it closes. One
    /// picture is that of the middle.
    pub fn instants(&self) -> Vec<f64> {
        match self.sharp {
            0 | 1 => vec![MIDDLE],
            n => (0..n).map(|i| f64::from(i) / f64::from(n - 1)).collect(),
        }
    }

    /// Shares of the exposure that the sharp pictures stand for: each takes what lies nearer to it than to its
    /// neighbours. The sum of the pictures with these weights tends to the blurred one. With `exact` all weigh the
    /// same, and the sum is the blurred picture.
    pub fn weights(&self, weight: &Weight) -> Vec<f64> {
        let instants = self.instants();
        if self.exact {
            return vec![1.0 / instants.len() as f64; instants.len()];
        }
        let between = |pair: &[f64]| 0.5 * (pair[0] + pair[1]);
        let edges: Vec<f64> =
            std::iter::once(0.0).chain(instants.windows(2).map(between)).chain(std::iter::once(1.0)).collect();
        edges.windows(2).map(|pair| weight.integral(pair[0], pair[1])).collect()
    }
}

/// The scene as the camera of frame `frame` sees it.
fn shaken<'a>(scene: &'a Scene, frame: FrameNumber, recipe: &Recipe, seed: u64) -> Result<Cow<'a, Scene>, Invalid> {
    let shaken = recipe.shake.map(|shake| shake.shaken(scene, frame, seed)).transpose()?;
    Ok(shaken.map_or(Cow::Borrowed(scene), Cow::Owned))
}

/// The scene with its shutter open for no longer than an instant: a share of its own.
fn at_instant(scene: &Scene, share: f64) -> Scene {
    let mut scene = scene.clone();
    let Shutter { open, close, weight, .. } = &mut scene.shutter;
    let instant = *open + (*close - *open) * share;
    (*open, *close, *weight) = (instant, instant, Weight::Box);
    scene
}

/// The scene of a view for a test: the middle of the shutter alone, in all rows at once.
fn at_middle(scene: &Scene) -> Scene {
    let mut scene = at_instant(scene, MIDDLE);
    scene.shutter.readout.duration = 0.0;
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recipe(sharp: u32) -> Recipe {
        Recipe {
            layout: FolderLayout::Nerfstudio,
            sharp,
            by: By::Splatting(RenderOptions::default()),
            format: Format::EXR,
            response: Response::Srgb,
            noise: Noise::default(),
            shake: None,
            flow: true,
            exact: false,
            held_out: None,
        }
    }

    #[test]
    fn instants_are_even_and_their_weights_are_the_exposure() {
        assert_eq!(recipe(1).instants(), [0.5]);
        assert_eq!(recipe(3).instants(), [0.0, 0.5, 1.0]);
        assert_eq!(recipe(5).instants(), [0.0, 0.25, 0.5, 0.75, 1.0]);
        // The trapezoid rule.
        assert_eq!(recipe(3).weights(&Weight::Box), [0.25, 0.5, 0.25]);
        assert_eq!(recipe(1).weights(&Weight::Tent), [1.0]);
        assert_eq!(Recipe { exact: true, ..recipe(5) }.weights(&Weight::Tent), [0.2; 5]);
        // 2 t: [0, 1/4], [1/4, 3/4], [3/4, 1].
        let ramp = recipe(3).weights(&Weight::Ramp { centre: 1.0 });
        for (seen, wanted) in ramp.iter().zip([0.0625, 0.5, 0.4375]) {
            assert!((seen - wanted).abs() < 1e-15, "{ramp:?}");
        }
    }
}
