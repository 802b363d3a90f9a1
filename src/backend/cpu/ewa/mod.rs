//! Full EWA: each kernel convolved with the low-pass filter of the sample grid, and coverage by groups of splats
//! (Zwicker et al. 2001, section 4; 2002, section 6; docs/math.md, section 3).

mod attribute;
mod buffers;
mod group;
mod project;
mod resolve;
#[cfg(test)]
mod tests;
mod visibility;

pub(in crate::backend) use self::buffers::EwaBuffers;
pub(in crate::backend) use self::group::EwaGroup;
