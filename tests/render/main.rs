//! What comes out: pictures of both backends in all modes, and the files that hold them.

#[path = "../support/mod.rs"]
mod support;

mod auto;
mod captures;
mod closed_forms;
mod coloured;
mod contact;
mod dataset;
mod detail;
mod environment;
mod ewa;
mod ewa_in_motion;
mod exposure;
mod flights;
mod gpu;
mod hostile_values;
mod image_files;
mod kernels_in_motion;
mod levels;
mod mesh_truth;
mod minified;
mod modes;
mod objects;
mod oracle;
mod pictures;
mod principal;
mod rendering;
mod rolling_shutter;
mod see_through;
mod see_through_shadows;
mod sequences;
mod shadow_receivers;
mod shadows;
mod sky;
mod spheres;
mod static_objects;
mod symmetries;
mod tolerances;
mod transparent_receivers;
mod velocities;
mod volumes;
mod waste;
mod wheels;
