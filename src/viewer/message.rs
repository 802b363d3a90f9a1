//! What pages and the program say to each other: JSON, and pictures with a header of JSON.

use serde::{Deserialize, Serialize};

use super::camera::CameraAt;
use super::view::Asked;

/// From the page.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub(super) enum Message {
    /// This is to be seen.
    View(Box<Asked>),
    /// A picture is on the screen.
    Shown {
        /// Its number.
        picture: u64,
    },
    /// Write a file.
    Save {
        /// The kind of file.
        what: SavedKind,
    },
    /// Make a movie of the scene's frames as they are seen now, or stop the one under way.
    Movie {
        /// Extension of its file; `None`: stop.
        format: Option<String>,
    },
}

/// What a page can save.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum SavedKind {
    Png,
    Exr,
    Scene,
    /// The keys that the page collected, for `--camera-path`.
    Path,
}

/// To the page, as text.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub(super) enum Told {
    /// The scene, when it was read.
    Scene(Box<AboutScene>),
    /// The scene is being read.
    Loading,
    /// The scene cannot be read; what was seen before stays.
    Broken { message: String },
    /// Something that the page asked for is wrong or cannot be done.
    Refused { message: String },
    /// A file was written.
    Saved { path: String },
    /// A movie is under way.
    Filming { done: u64, frames: u64 },
    /// It is not any more: it was saved, or stopped, or it failed, which is told before.
    Filmed,
    /// Errors of the first side against the second, and the samples of the reference.
    Compared { serial: u64, flip: f64, rmse: f64, samples: Option<u64> },
    /// All that was asked for is there.
    Rests { serial: u64 },
}

/// What a page has to know of a scene.
#[derive(Clone, Debug, Serialize)]
pub(super) struct AboutScene {
    pub(super) name: String,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) first: i64,
    pub(super) last: i64,
    pub(super) rate: f64,
    pub(super) open: f64,
    pub(super) close: f64,
    /// The weight's text, which need not read back: a drawn curve has none.
    pub(super) weight: String,
    pub(super) readout: String,
    /// Surfels, Gaussians and kernels of volumes.
    pub(super) surfels: u64,
    pub(super) objects: usize,
    pub(super) notes: Vec<String>,
    /// The grammar of modes.
    pub(super) modes: &'static str,
    pub(super) program: &'static str,
}

/// Before a picture.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Header {
    pub(super) picture: u64,
    pub(super) serial: u64,
    /// `both` sides of the slider, the `first` or the `second`.
    pub(super) side: &'static str,
    /// As good as was asked for; a reference may still get samples.
    pub(super) finished: bool,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) mode: String,
    pub(super) backend: String,
    /// Time of rendering.
    pub(super) seconds: f64,
    /// Stated error: of mode auto its estimate, of a reference its mean standard error.
    pub(super) error: Option<f64>,
    /// A sentence on the picture.
    pub(super) note: Option<String>,
    pub(super) buffer: &'static str,
    /// Least and greatest value of the layer.
    pub(super) range: Option<[f32; 2]>,
    /// Where the camera is, in numbers and as a line of a scene file.
    pub(super) camera: CameraAt,
    pub(super) line: String,
    /// Time weight in equal parts of the shutter, mean 1.
    pub(super) curve: Vec<f64>,
}

/// A message to a page.
#[derive(Clone, Debug)]
pub(super) enum Sent {
    Text(String),
    /// Length of the header (u32, big endian), the header, a PNG file.
    Picture(Vec<u8>),
}

impl Told {
    pub(super) fn sent(&self) -> Sent {
        // Plain structures of text and numbers always have JSON.
        Sent::Text(serde_json::to_string(self).unwrap_or_default())
    }
}

impl Header {
    pub(super) fn sent(&self, png: &[u8]) -> Sent {
        let header = serde_json::to_vec(self).unwrap_or_default();
        let mut bytes = Vec::with_capacity(4 + header.len() + png.len());
        bytes.extend((header.len() as u32).to_be_bytes());
        bytes.extend(header);
        bytes.extend(png);
        Sent::Picture(bytes)
    }
}
