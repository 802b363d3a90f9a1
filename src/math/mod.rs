//! Mathematics that all parts share.
//!
//! `bounds` has boxes, `projection` the focal length, `trs` transforms as translate, rotate and scale, and `srgb` the
//! transfer curve. `fast` has elementary functions as polynomials, and `sweep` has the weight of a kernel in motion on
//! one ray; both have a twin in `shaders/common/`. `simd` compiles a function for wider vectors.

mod bounds;
pub mod fast;
mod projection;
#[cfg(test)]
pub(crate) mod random;
pub(crate) mod simd;
pub(crate) mod sphere;
pub mod srgb;
pub mod sweep;
mod trs;

pub use bounds::Bounds;
pub(crate) use projection::focal_length;
pub use trs::{RotateOrder, Trs};
pub(crate) use trs::{angle_between, norm, rotation};
