//! Point models: reads files of several formats into a [`Cloud`], and completes a cloud into [`Surfels`].
//!
//! Data flow: `format` (which format a file has) → `ply`, `sfl`, `obj`, `xyz`, `scan`, `bin` (bytes to a cloud) →
//! `several` (clouds of several files) → `tidy` (points and attributes that cannot be drawn), or `builder` (points of a
//! program) → `complete` (normals and radii that are missing; `sides`: do the signs of normals mean something?) →
//! `surfels`. A mesh (`mesh`) is sampled to surfels. Captures (`capture`) and volumes (`volume`) become [`Gaussians`].
//! `load` does all this. `normalisation` is computed when it is asked for.

mod archive;
mod area_normals;
mod arrays;
mod bin;
mod bin_columns;
mod bin_stream;
mod builder;
mod capture;
mod cloud;
mod colour_by;
mod colour_map;
mod columns;
mod complete;
pub(crate) mod disc_tree;
mod error;
mod flaw;
mod format;
pub mod generate;
pub mod generate_volume;
mod inward;
pub(crate) mod levels;
mod load;
pub mod mesh;
mod neighbours;
mod normalisation;
mod normals;
mod npy;
#[cfg(feature = "formats")]
mod npz;
mod obj;
mod options;
mod order;
mod orient;
pub mod paths;
mod ply;
mod ply_body;
mod ply_faces;
mod ply_header;
mod ply_scales;
mod radii;
mod scan;
mod several;
mod sfl;
mod sfl_codes;
mod sfl_container;
mod sides;
mod spacing;
mod spheres;
mod store;
mod strays;
mod surfels;
mod tidy;
mod tolerance;
mod variance;
mod volume;
mod write_ply;
mod xyz;
mod xyz_names;

pub use bin::write_bin;
pub use builder::SurfelsBuilder;
pub use capture::{Gaussians, Optics};
pub use cloud::{Cloud, ColourStorage};
pub use colour_by::ColourBy;
pub use colour_map::ColourMap;
pub use complete::complete;
pub use error::{ModelError, ParseError, Place};
pub use format::ModelFormat;
pub(crate) use inward::INWARD;
pub use load::{LoadedModel, LoadedShape, MeshSource, Parsed, load, parse, parse_capture, parse_mesh, sample_mesh};
pub(crate) use load::{ReadFile, open, value_range};
pub(crate) use neighbours::Tree as PointTree;
pub use options::{ColourSpace, Kind, LoadOptions, LoadProgress, MeshOptions, PointOptions, Spacing};
#[cfg(feature = "formats")]
pub use scan::{Scan, ScanFacts, scan_facts};
pub use several::matching;
pub(crate) use spheres::axes as sphere_axes;
pub use surfels::{KeptLevels, Material, Normalisation, Surfels, VelocityUnit};
pub use volume::{
    Grid, KERNEL, MOST_EXTINCTION, Samples, TransferFunction, TransferFunctionError, TransferStop, VolumeFacts,
    VolumeOptions,
};
pub(crate) use volume::{NodeError, VolumeLevels, VolumeNode};
pub use write_ply::write_ply;
