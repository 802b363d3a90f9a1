//! glTF 2.0: the container, its columns of numbers, and its tree of nodes, for whoever reads something of it.
//!
//! Data flow: `file` (bytes to a `document` and its buffers, `uri` finds those in other files) → `column` (numbers of
//! an accessor) and `nodes` (the tree and its names). Captures and meshes (`model`) and motion (`anim`) take what they
//! need from here. Indices, ranges and counts of a file are checked before they are used.
//!
//! The reader is our own: it keeps transforms in `f64`, says where a file is wrong, and checks every range before it
//! reads. Tests hold it against the crate `gltf`.

mod column;
mod document;
mod error;
mod file;
mod names;
mod nodes;
mod uri;

pub(crate) use column::{Column, ValueShape};
pub(crate) use document::{AlphaWord, Clip, Image, Material, Node, Primitive, TextureInfo};
pub(crate) use error::{GltfError, named, wrong};
pub(crate) use file::{GltfFile, is_text};
pub use names::{AnimationEntry, NodeEntry, Nodes};
pub(crate) use nodes::Tree;
pub(crate) use uri::{beside, find_beside, inline, read, read_beside};
