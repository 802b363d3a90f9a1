//! What goes in: model files, animations, scene files, and what ships beside the code.

#[path = "../support/mod.rs"]
mod support;

mod anim;
mod camera_paths;
mod cameras;
mod captures;
mod coincident;
mod files;
mod fuzz_corpus;
mod gltf_motion;
mod mesh_properties;
mod mesh_scenes;
mod meshes;
mod model_formats;
mod moving_bounds;
mod read_files;
mod sampling;
mod shipped;
mod tracks;
mod volumes;
