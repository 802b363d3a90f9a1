//! Reading an animation file from disk, with a limit on its size.

use std::fs::{self, File};
use std::io::Read as _;
use std::path::Path;

use super::animation::Animation;
use super::error::AnimError;
use super::gltf::GltfAnimation;
use super::maya::parse;
use crate::files;
use crate::gltf::is_text;

/// Largest file that is read, bytes. A hundred curves of 60,000 keys fit.
const MAX_BYTES: u64 = 256 << 20;

/// An animation file of either kind.
#[derive(Clone, Debug)]
pub enum Loaded {
    /// Maya's.
    Maya(Animation),
    /// glTF.
    Gltf(GltfAnimation),
}

/// Reads an animation file. The content shows its kind.
///
/// # Errors
/// As [`load`], or the file is not a valid glTF file.
pub fn open(path: &Path) -> Result<Loaded, AnimError> {
    let bytes = bytes(path)?;
    if bytes.starts_with(b"glTF") || is_text(&bytes) {
        return GltfAnimation::parse(&bytes, path).map(Loaded::Gltf);
    }
    parse(&bytes, path).map(Loaded::Maya)
}

/// Reads a `.anim` file.
///
/// # Errors
/// The file cannot be read, is not a regular file, is larger than 256 MiB, or is not a valid `.anim` file.
pub fn load(path: &Path) -> Result<Animation, AnimError> {
    parse(&bytes(path)?, path)
}

/// The bytes of a file.
pub(super) fn bytes(path: &Path) -> Result<Vec<u8>, AnimError> {
    files::reads(path);
    // This comes before opening the file: opening a pipe may wait for ever.
    let about = fs::metadata(path).map_err(|e| AnimError::read(path, e))?;
    if !about.is_file() {
        return Err(AnimError::NotAFile { path: path.to_owned() });
    }
    let too_large = |bytes| AnimError::TooLarge { path: path.to_owned(), bytes, limit: MAX_BYTES };
    if about.len() > MAX_BYTES {
        return Err(too_large(about.len()));
    }
    let mut bytes = Vec::with_capacity(about.len() as usize);
    let file = File::open(path).map_err(|e| AnimError::read(path, e))?;
    // The file may have grown since.
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(|e| AnimError::read(path, e))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(too_large(bytes.len() as u64));
    }
    Ok(bytes)
}
