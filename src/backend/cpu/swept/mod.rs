//! Kernels in motion: the passes of an interval of time (Wolf 2008, 4.1.2 and 4.2.2; docs/math.md, section 7).

pub(in crate::backend) mod attribute;
mod filter;
pub(in crate::backend) mod filtered;
mod hull;
pub(in crate::backend) mod map;
mod map_group;
mod posed;
pub(in crate::backend) mod project;
mod ray;
mod resolve;
pub(in crate::backend) mod slices;
mod sweep_group;
#[cfg(test)]
mod tests;
mod waste;

pub(in crate::backend) use self::hull::Hull;
pub(in crate::backend) use self::map::Map;
pub(in crate::backend) use self::map_group::MapGroup;
pub(in crate::backend) use self::resolve::finish;
pub(in crate::backend) use self::sweep_group::SweepGroup;
