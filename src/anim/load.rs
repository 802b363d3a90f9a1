//! Reading an animation file from disk, with a limit on its size.

use std::io;
use std::path::Path;

use super::animation::Animation;
use super::error::AnimError;
use super::gltf::GltfAnimation;
use super::maya::parse;
use crate::files::{self, InputError};
use crate::gltf::is_text;

/// Largest file that is read, bytes. A hundred curves of 60,000 keys fit.
const MAX_BYTES: u64 = 256 << 20;

/// An animation file of either kind.
#[derive(Clone, Debug)]
pub enum AnimationFile {
    /// Maya's.
    Maya(Animation),
    /// glTF.
    Gltf(GltfAnimation),
}

/// Reads an animation file. The content shows its kind.
///
/// # Errors
/// As [`load`], or the file is not a valid glTF file.
pub fn open(path: &Path) -> Result<AnimationFile, AnimError> {
    files::steady(|| {
        let bytes = bytes(path)?;
        if bytes.starts_with(b"glTF") || is_text(&bytes) {
            return GltfAnimation::parse(&bytes, path).map(AnimationFile::Gltf);
        }
        parse(&bytes, path).map(AnimationFile::Maya)
    })
}

/// Reads a `.anim` file.
///
/// # Errors
/// The file cannot be read, is not a regular file, is larger than 256 MiB, or is not a valid `.anim` file.
pub fn load(path: &Path) -> Result<Animation, AnimError> {
    files::steady(|| parse(&bytes(path)?, path))
}

/// The bytes of a file.
pub(super) fn bytes(path: &Path) -> Result<Vec<u8>, AnimError> {
    files::read(path, MAX_BYTES).map_err(|why| match why {
        InputError::NotAFile { .. } => AnimError::NotAFile { path: path.to_owned() },
        InputError::TooLarge { bytes, most } => AnimError::TooLarge { path: path.to_owned(), bytes, limit: most },
        InputError::Changed(changed) => changed.into(),
        other => AnimError::Read { path: path.to_owned(), source: io::Error::from(other) },
    })
}
