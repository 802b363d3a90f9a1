//! Small mathematics shared by all parts: the sRGB transfer curve, bounding boxes, transforms as translate/rotate/scale.

mod bounds;
pub mod fast;
#[cfg(test)]
pub(crate) mod random;
pub(crate) mod simd;
pub mod srgb;
pub mod sweep;
mod trs;

pub use bounds::Bounds;
pub use trs::{RotateOrder, Trs};
pub(crate) use trs::{norm, rotation};
