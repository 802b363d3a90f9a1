//! The reference: the same scene by quasi-Monte-Carlo ray tracing (Wolf 2008, 3.6.4 and 4.5), with a standard error for
//! each pixel.
//!
//! Every sample has a place in the pixel's square and a time of its own. The scene is posed at just that time, and a
//! ray is cast through a hierarchy over each model's surfels, or over the triangles of its mesh. The visibility rule
//! (docs/math.md, eq. 5) and the kernel (eq. 4) are evaluated in `f64`. The reference shares one thing with the passes
//! that it judges, the shading equation (`shading`); closed forms judge that. It has no screen-space prefilter, as rays
//! have no footprint: it is what a splatter without prefilter converges to. See docs/reference.md.
//!
//! Data flow: `sampler` and `warp` (where and when a sample lies) → `cull` (objects that it may hit) → `trace`
//! (what it sees), through `moving`, `bvh`, `boxes` and `traverse`, with `shadows` (the light that reaches it), `haze`
//! (what captures let through of that) and `sky` (the environment as a light) → `layers` (see-through surfels before
//! that) → `gaussians` (captures among them) with `volumes` → `composite` → `sums` (means and standard errors).
//! `integrator` does this for the pixels of an image, `render` for a frame, `probe` for one pixel. `flow` follows what
//! pixels show from one instant to another.

mod boxes;
mod bvh;
mod composite;
mod cull;
mod error;
mod flow;
mod gaussians;
mod haze;
mod integrator;
mod layers;
mod moving;
mod options;
mod posed;
mod probe;
mod render;
mod sampler;
mod shadows;
mod sky;
mod store;
mod sums;
mod trace;
mod traverse;
mod volumes;
mod warp;

pub use self::error::ReferenceError;
pub use self::flow::{Flow, flows};
pub use self::integrator::{RoundListener, RoundProgress};
pub use self::options::{Meshes, ROUND, ReferenceOptions};
pub use self::probe::{Probe, ProbedGaussian, ProbedHit, Sample, probe};
pub use self::render::{Reference, ReferenceStats, picture, picture_until, render, render_until};
pub use self::sampler::{MOST_SAMPLES, SCRAMBLINGS, Sampler};
pub use self::sums::Sums;
