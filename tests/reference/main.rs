//! The ray-traced reference: against closed forms, against brute force, and what it promises beside the right values.

#[path = "../support/mod.rs"]
mod support;

mod closed_forms;
mod flow;
mod gaussians;
mod meshes;
mod parts;
mod promises;
mod samples;
mod see_through;
mod shadows;
mod sky;
mod volumes;
