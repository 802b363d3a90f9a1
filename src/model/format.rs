//! The file formats of models, and how a file shows which one it has.

use std::path::Path;

use super::error::KNOWN_FORMATS;
use super::{archive, npy, xyz};
use crate::gltf;

/// The first bytes of our own format. They are not text, so a transfer that changes line ends is noticed.
pub(super) const BIN_MAGIC: [u8; 8] = *b"\x89SPLAT\r\n";

/// A file format of models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelFormat {
    /// Polygon file format: point clouds, surfels, meshes whose vertices are taken as points, Gaussian-splat captures.
    Ply,
    /// `Pointshop3D` surfels.
    Sfl,
    /// Wavefront OBJ, whose vertices are taken as points.
    Obj,
    /// Our own format (docs/bin-format.md).
    Bin,
    /// Points as lines of numbers.
    Xyz,
    /// Points as lines of numbers, after a line with their number.
    Pts,
    /// Gaussian-splat captures as `.splat`: records of 32 bytes.
    Splat,
    /// Gaussian-splat captures as SOG: a zip archive of pictures. Needs the Cargo feature `formats`.
    Sog,
    /// Gaussian-splat captures in planes of compressed bytes.
    Spz,
    /// glTF in one file: triangles, or Gaussian splats.
    Glb,
    /// glTF as text, with its data in other files or in the text: triangles.
    Gltf,
    /// Regular grids of a volume's values: NRRD with its data in the same file.
    Nrrd,
    /// Points in an array of `NumPy`.
    Npy,
    /// Points in several arrays of `NumPy`. Needs the Cargo feature `formats`.
    Npz,
    /// Points of laser scanners: LAS, LAZ and COPC. Needs the Cargo feature `formats`.
    Las,
    /// Points of laser scanners: E57, which may hold several scans. Needs the Cargo feature `formats`.
    E57,
}

impl ModelFormat {
    /// The known formats, for messages.
    pub const KNOWN: &'static str = KNOWN_FORMATS;

    /// The format of a file by its first bytes, or by its extension if the bytes show none: OBJ and `.splat` have no
    /// mark, and a text of points is known by lines of numbers.
    pub fn detect(bytes: &[u8], path: &Path) -> Option<Self> {
        if bytes.starts_with(&BIN_MAGIC) {
            Some(Self::Bin)
        } else if bytes.starts_with(b"GFLF") {
            Some(Self::Sfl)
        } else if bytes.starts_with(b"ply") && bytes.get(3).is_none_or(u8::is_ascii_whitespace) {
            Some(Self::Ply)
        } else if bytes.starts_with(npy::MAGIC) {
            Some(Self::Npy)
        } else if bytes.starts_with(b"PK\x03\x04") {
            Some(if archive::begins_with_npy(bytes) { Self::Npz } else { Self::Sog })
        } else if bytes.starts_with(b"NGSP") || bytes.starts_with(b"\x1f\x8b") {
            // Older versions of SPZ are gzip, which no other format is.
            Some(Self::Spz)
        } else if bytes.starts_with(b"glTF") {
            Some(Self::Glb)
        } else if bytes.starts_with(b"NRRD") {
            Some(Self::Nrrd)
        } else if bytes.starts_with(b"LASF") {
            Some(Self::Las)
        } else if bytes.starts_with(b"ASTM-E57") {
            Some(Self::E57)
        } else if gltf::is_text(bytes) {
            Some(Self::Gltf)
        } else {
            let ends_in = |name: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(name));
            match xyz::looks_like(bytes) {
                _ if ends_in("obj") => Some(Self::Obj),
                _ if ends_in("splat") => Some(Self::Splat),
                _ if ends_in("sog") => Some(Self::Sog),
                Some(xyz::TextKind::Xyz) => Some(Self::Xyz),
                Some(xyz::TextKind::Pts) => Some(Self::Pts),
                None if ends_in("xyz") || ends_in("csv") => Some(Self::Xyz),
                None if ends_in("pts") => Some(Self::Pts),
                None => None,
            }
        }
    }
}
