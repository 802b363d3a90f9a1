//! Renders moving point-sampled surfaces with motion blur by splatting.
//!
//! The method is that of J. Wolf, *Motion Blur with Point-Based Rendering* (2008), on top of EWA surface splatting
//! (Zwicker et al. 2002) with deferred shading (Botsch et al. 2005).
//!
//! # Flow
//! ```text
//! scene file ─► scene (XML) ─► model files, .anim files ─► resolved Scene
//!   per frame: shutter + mode ─► plan: groups of time samples
//!              pose: object and camera transforms at each time sample
//!              passes on a backend: project ─► bin ─► visibility ─► attribute ─► resolve ─► film
//!   film ─► picture ─► PNG / EXR
//! ```
//!
//! # Words
//! *surfel*: one sample of a surface. *model*: an array of surfels. *splat*: a surfel's kernel, posed and projected for one
//! time sample. *pass*: one stage of rendering a time sample. *shutter*: the exposure interval and its time weight.
//! *time sample*: a time, its weight and a sub-pixel offset. *group*: time samples that share one visibility test.
//! *film*: the accumulators that become the image.
//!
//! # Conventions
//! Right-handed, +y up; the camera looks along -z. Image row 0 is at the top; pixel (i, j) covers [i, i+1) x [j, j+1).
//! Depth is -z in camera space. Files and the command line use degrees, frames and scene units; inside: radians, frames as
//! `f64`, scene units. Names of transforms read right to left: `camera_from_world`. Colours are linear Rec.709.

pub mod anim;
pub mod auto;
pub mod backend;
pub mod compare;
pub mod files;
pub mod film;
pub mod frame;
pub mod image;
pub mod layout;
pub mod math;
pub mod model;
pub mod options;
pub mod plan;

pub mod reconstruct;
pub mod reference;
pub mod renderer;
pub mod sampling;
pub mod scene;
pub mod scene_file;
pub mod shading;
pub mod study;
pub mod time;
