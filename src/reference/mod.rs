//! The reference: the same scene by quasi-Monte-Carlo ray tracing (thesis 3.6.4, 4.5), with a standard error for each pixel.
//!
//! Every sample has a place in the pixel's square and a time of its own; the scene is posed at just that time, a ray is cast
//! through a hierarchy over each model's surfels, and the visibility rule and the kernel of design section 2 are evaluated in
//! `f64`. Nothing is shared with the passes that this is to judge. There is no screen-space prefilter: rays have no footprint, so
//! the reference is what a splatter without prefilter converges to. See docs/reference.md.

mod boxes;
mod bvh;
mod cull;
mod error;
mod integrator;
mod options;
mod posed;
mod probe;
mod render;
mod sampler;
mod store;
mod sums;
mod trace;
mod traverse;
mod warp;

pub use self::error::ReferenceError;
pub use self::integrator::{Progress, Step};
pub use self::options::{ROUND, ReferenceOptions};
pub use self::probe::{Probe, ProbedHit, Sample, probe};
pub use self::render::{Reference, Stats, render};
pub use self::sampler::{MOST_SAMPLES, SCRAMBLINGS, Sampler};
pub use self::sums::Sums;
