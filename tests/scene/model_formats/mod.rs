//! Model file formats: valid files read to known values, hostile files refused with one clear error and no panic.

#![allow(clippy::unwrap_used, reason = "clippy knows #[test] functions, not their helpers")]

mod bin;
mod bin_levels;
mod compressed_ply;
mod files;
mod glb;
mod hostile;
mod nrrd;
mod obj;
mod ply;
mod ply_crosscheck;
#[cfg(feature = "formats")]
mod scans;
mod sfl;
#[cfg(feature = "formats")]
mod sog;
mod spheres;
mod splat;
#[cfg(feature = "formats")]
mod spz;
mod support;
mod tables;
mod write;
mod xyz;
