//! Renders moving point-sampled surfaces with motion blur by splatting.
//!
//! ```
//! use splatblur::{Device, RenderOptions, Renderer, Scene};
//!
//! # std::fs::create_dir_all("out")?;
//! let scene = Scene::open("scenes/swarm.xml").size(160, 120).load()?;
//! let mut renderer = Renderer::open(Device::Auto)?;
//! let picture = renderer.render(&scene, 3, &RenderOptions::default())?.picture;
//! picture.write("out/swarm.0003.png")?;
//! # assert_eq!(splatblur::Picture::read("out/swarm.0003.png")?.width, 160);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`Scene::new`] makes a scene in code, of points ([`Surfels::builder`]), captures ([`Object::from_gaussians`]) and
//! motions ([`Motion`], [`AnimationBinding::from_poses`]). [`Renderer::render_sequence`] renders many frames, and
//! [`RenderOptions`] says how. The default is mode auto, which takes as many time samples as its error allows;
//! [`BlurMode`] lists the other modes. [`reference::picture`] makes the picture that a frame is judged by, and
//! [`compare::compare`] says how far it is from there. The guide `docs/library.md` has an example of each.
//!
//! The method is that of J. Wolf, *Motion Blur with Point-Based Rendering* (2008), on top of EWA surface splatting
//! (Zwicker et al. 2002) with deferred shading (Botsch et al. 2005). Pages in `docs/` say which mode is for what, and
//! give the formulas.
//!
//! # Flow
//! ```text
//! scene file ─► scene_file (XML) ─► model files, .anim files ─► Scene
//!   per frame:  shutter + mode ─► plan: rasters, sample positions, and the steps at each
//!               frame: transforms of objects and camera at each time sample
//!               backend (CPU or GPU): project ─► bin ─► visibility ─► attribute ─► resolve ─► film
//!   film ─► Picture ─► PNG / EXR
//! ```
//!
//! # Glossary
//! *surfel*: one sample of a surface, a disc or an ellipse with a normal and a colour. *model*: an array of surfels.
//! *splat*: a surfel's kernel, posed and projected for one time sample. *shutter*: the exposure interval and its time
//! weight. *time sample*: a time, its weight and a sub-pixel offset. *group*: time samples that share one visibility
//! test. *raster*: the image, or every n-th pixel of it as a smaller image. *sample position*: a raster at one
//! sub-pixel offset. *step*: what a backend does at a sample position; the plan lists the steps. *pass*: one stage of
//! a step.
//! *twin*: the CPU or the GPU form of a pass. *static*: an object that moves less than a quarter of a pixel during the
//! exposure. *film*: the accumulators that become the picture.
//!
//! # Conventions
//! Right-handed, +y up; the camera looks along -z. Image row 0 is at the top; pixel (i, j) covers [i, i+1) x [j, j+1).
//! Depth is -z in camera space. Angles are radians, times are frames (`f64`), lengths are scene units; scene files and
//! the command line use degrees. The shutter is given in frames around the frame number. Colours are linear Rec.709.
//! Names of transforms read right to left: `camera_from_world` takes world space to camera space.
//!
//! # Features
//! All are on by default. `gpu`: the GPU backend, on wgpu and Vulkan. `formats`: captures as SOG and SPZ, textures of
//! meshes as JPEG and WebP. `movie`: movies of frames. `cli`: the program `splatblur`. `viewer`: its command `view`.
//! Without them, the library alone is built.

// In the order of data flow: a module imports only modules that stand above it. They are public for the program, the
// tests, the benches and the fuzz targets; what a library user needs is re-exported below.
#[doc(hidden)]
pub mod limits;

#[doc(hidden)]
pub mod math;

#[doc(hidden)]
pub mod files;

#[doc(hidden)]
pub mod stop;

#[doc(hidden)]
pub mod time;

#[doc(hidden)]
pub mod sampling;

#[doc(hidden)]
pub mod film;

#[doc(hidden)]
pub mod options;

#[doc(hidden)]
pub mod gltf;

#[doc(hidden)]
pub mod anim;

#[doc(hidden)]
pub mod model;

#[doc(hidden)]
pub mod environment;

#[doc(hidden)]
pub mod scene;

#[doc(hidden)]
pub mod image;

#[cfg(feature = "movie")]
#[doc(hidden)]
pub mod movie;

#[doc(hidden)]
pub mod scene_file;

#[doc(hidden)]
pub mod plan;

#[doc(hidden)]
pub mod shading;

#[doc(hidden)]
pub mod frame;

#[doc(hidden)]
pub mod layout;

#[doc(hidden)]
pub mod backend;

#[doc(hidden)]
pub mod auto;

#[doc(hidden)]
pub mod reconstruct;

#[doc(hidden)]
pub mod objects;

#[doc(hidden)]
pub mod renderer;

pub mod reference;

#[doc(hidden)]
pub mod dataset;

pub mod compare;

pub mod study;

#[cfg(feature = "viewer")]
#[doc(hidden)]
pub mod viewer;

/// Types of public fields, results and errors that few programs name.
pub mod fields {
    pub use crate::anim::{
        AnimError, AnimLocation, CameraPath, CameraTrack, Chain, Drift, Interpolation, Intrinsics, NodeAnimation,
        NodeMotion, NodePose, NodeState, PathKey, PathTarget, PathTiming, PathView, TrackFormat, TrackOptions,
    };
    pub use crate::backend::{Achieved, GpuCalls, Pixels, Waste};
    pub use crate::environment::NotLatLong;
    pub use crate::files::{Changed, Seen, Stamp};
    pub use crate::image::{Bits, Compression, Exr, Format, Precision};
    pub use crate::math::RotateOrder;
    pub use crate::model::{
        ColourBy, ColourMap, ColourSpace, KeptLevels, Kind, LoadOptions, MeshOptions, Normalisation, ParseError, Place,
        PointOptions, Spacing, TransferFunction, TransferFunctionError, TransferStop, VolumeOptions,
    };
    pub use crate::options::{
        KernelShape, KernelWeight, Normalise, OptionError, Overlap, SourceSamples, TemporalAlpha, Times,
    };
    pub use crate::scene::{Pattern, Sequence, SequenceSpec, Studio, StudioLight, StudioOptions};
    pub use crate::scene_file::{EnvironmentError, LoadedScene, Location};
}

/// The vectors and matrices of scenes, in the version that this crate uses.
#[doc(no_inline)]
pub use glam;

// What is rendered.
pub use environment::{Environment, LatLong};
pub use math::{Bounds, Trs as Transform};
pub use model::{Gaussians, Material, Optics, Surfels, SurfelsBuilder, VelocityUnit};
pub use scene::{
    AnimationBinding, Camera, Capture, FrameRange, GaussianModel, ImageSettings, Light, Motion, Object, PointMotion,
    Scene, Shape, Source, Sphere, Surface, SurfelModel,
};
pub use scene_file::Opening;
pub use time::{Anchor, Direction, FrameNumber, Readout, Shutter, Weight};

// How, and on what.
pub use film::Aov;
pub use options::{
    BlurMode, Detail, ErrorTarget, Interleave, Lattice, Look, PixelFilter, Prefilter, Quality, RenderOptions, Shading,
    SweptKernel,
};
pub use renderer::{Device, Renderer};
pub use stop::{Done, Progress, Stop};

// What comes out.
pub use backend::{Rendered, Stats};
pub use film::{Layer, Picture};

// What may go wrong.
pub use backend::BackendError;
pub use image::ImageError;
pub use limits::Invalid;
pub use model::ModelError;
pub use scene_file::SceneError;
