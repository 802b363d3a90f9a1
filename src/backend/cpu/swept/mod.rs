//! Step `Sweep`: kernels in motion, the passes of an interval of time (Wolf 2008, 4.1.2; docs/math.md, section 7).

pub(in crate::backend) mod attribute;
mod filter;
pub(in crate::backend) mod hull;
mod posed;
pub(in crate::backend) mod project;
pub(in crate::backend::cpu) mod ray;
pub(in crate::backend) mod resolve;
pub(in crate::backend) mod slices;
mod sweep_group;
#[cfg(test)]
mod tests;
mod waste;

pub(in crate::backend) use self::hull::Hull;
pub(in crate::backend) use self::resolve::finish;
pub(in crate::backend::cpu) use self::resolve::{IntervalExposure, add_to_film};
pub(in crate::backend) use self::sweep_group::SweepGroup;
pub(in crate::backend::cpu) use self::waste::{count, covered};
