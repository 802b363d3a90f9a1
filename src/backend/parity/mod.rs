//! Both backends held against each other, pass by pass and picture by picture.
//!
//! Each pass of the GPU backend is fed the CPU's results of the passes before it, and compared with the CPU's own
//! (`paint`, `sweeps`). The CPU's passes run through the constructors that rendering uses (`posed`,
//! `paint_twins`, `sweep_twins`). Splats and lists are compared slot by slot (`slots`), floats with
//! tolerances (`compare`). See-through surfels, captures and volumes are compared as whole frames, and Gaussians by the
//! pass that projects them (`transparents`). What the groups of a position share is compared as whole frames, too
//! (`shared_rest`), and so are shadows (`shadows`). The comparison must reject broken programs (`mutants`). Buffers
//! that are too small must not show (`small_buffers`, `pictures`).
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stderr, reason = "tests may stop and report")]

pub(super) mod captures;
pub(super) mod cases;
mod compare;
mod functions;
mod harness;
mod mutants;
mod paint;
mod paint_twins;
mod pictures;
mod posed;
mod rounds;
mod shadows;
mod shared_rest;
mod slots;
mod small_buffers;
mod sorts;
mod sweep_twins;
mod sweeps;
mod tiles_of_edge;
mod transparents;
mod waste;

use super::gpu::tests::gpu_or_skip;
