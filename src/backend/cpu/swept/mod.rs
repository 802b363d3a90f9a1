//! Kernels in motion: the passes of an interval of time (thesis 4.1.2, 4.2.2; docs/math.md, section 7).

mod attribute;
mod hull;
mod map;
mod project;
mod resolve;
mod still;
#[cfg(test)]
mod tests;
#[cfg(all(test, feature = "gpu"))]
pub(in crate::backend) mod twins;

pub(super) use self::attribute::{Footprint, Swept, attribute};
pub(super) use self::hull::Hull;
pub(super) use self::map::{Map, MapTile, keep};
pub(super) use self::project::{Volume, project};
pub(super) use self::resolve::{Exposure, coverage, finish, pool};
pub(super) use self::still::StillTile;
