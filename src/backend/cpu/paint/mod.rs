//! Step `Paint`: opaque surfels at instants. Their kernels may be convolved with the low-pass filter of the sample
//! grid; then coverage is by groups of splats (Ren et al. 2002, section 4; Zwicker et al. 2002, section 6;
//! docs/math.md, section 3).

pub(in crate::backend) mod attribute;
pub(in crate::backend) mod buffers;
mod group;
mod kernel;
mod project;
pub(in crate::backend) mod resolve;
pub(super) mod share;
#[cfg(test)]
mod tests;
pub(in crate::backend) mod visibility;
mod waste;

pub(in crate::backend::cpu) use self::attribute::{Filter, attribute};
pub(in crate::backend) use self::buffers::PaintBuffers;
pub(in crate::backend::cpu) use self::buffers::{APRON_STRIDE, DepthLayer, PEAK, SIDE, with_apron};
pub(in crate::backend) use self::group::{PaintGroup, Painted};
pub(in crate::backend) use self::kernel::{Kernel, RasterRays, Seen};
pub(in crate::backend::cpu) use self::visibility::{find_open, visibility};
pub(in crate::backend) use self::waste::of_splats as waste_of;
