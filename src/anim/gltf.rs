//! Animations of glTF files: the clips of a file, and the motion of one of its nodes.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3, DVec4};

use super::chain::{Chain, Joint};
use super::error::AnimError;
use super::track::{Between, Property, Track};
use crate::gltf::{Clip, GltfError, GltfFile, Nodes, Tree, ValueShape, named, wrong};

/// Numbers that the keys of every file may be, however small it is.
const FREE_NUMBERS: u64 = 1 << 22;

/// Most numbers of keys for each byte of a file. Several channels may share them.
const MOST_GROWTH: u64 = 16;

/// Most nodes with keys in one chain.
const MOST_MOVING: usize = 1000;

/// What a matrix may differ from translation, rotation and scale, relative to its size.
const ROUNDING: f64 = 1e-5;

/// A glTF file as an animation.
#[derive(Clone, Debug)]
pub struct GltfAnimation {
    /// The file.
    pub path: PathBuf,
    /// Its nodes and animations.
    pub nodes: Nodes,
    /// What a user should know.
    pub notes: Vec<String>,
    rests: Vec<Rest>,
    clips: Vec<Moves>,
}

/// A node at rest.
#[derive(Clone, Copy, Debug)]
struct Rest {
    place: DAffine3,
    /// Scale, rotation, translation; `None` for a matrix that is not made of them.
    parts: Option<(DVec3, DQuat, DVec3)>,
}

/// One animation.
#[derive(Clone, Debug)]
struct Moves {
    name: String,
    /// Time of the last key, seconds.
    end: f64,
    /// Tracks by node.
    tracks: HashMap<usize, Vec<Track>>,
}

impl GltfAnimation {
    /// Frames a second where a scene says nothing.
    pub const FPS: f64 = 24.0;

    /// Reads the bytes of a file; its buffers lie beside `path`, or below.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, AnimError> {
        let refuse = |why: GltfError| AnimError::Gltf { path: path.to_owned(), why: why.to_string() };
        let file = GltfFile::read(bytes, path).map_err(refuse)?;
        Self::of(&file, bytes.len(), path).map_err(refuse)
    }

    fn of(file: &GltfFile<'_>, size: usize, path: &Path) -> Result<Self, GltfError> {
        let nodes = Nodes::of(file)?;
        // Cycles and second parents are refused.
        Tree::new(&file.document)?;
        let rest = |(index, node): (usize, &crate::gltf::Node)| {
            let place = node.transform().map_err(|found| wrong(format!("node {index}, {found}"), "a transform"))?;
            let parts = if node.matrix.is_some() { parts_of(&place) } else { node.parts().ok() };
            Ok(Rest { place, parts })
        };
        let rests = file.document.nodes.iter().enumerate().map(rest).collect::<Result<_, GltfError>>()?;
        let mut reader = Reader {
            file,
            left: FREE_NUMBERS + MOST_GROWTH * (size + file.outside()) as u64,
            times: HashMap::new(),
            values: HashMap::new(),
            notes: Vec::new(),
        };
        let clips = &file.document.animations;
        let clips = clips.iter().map(|clip| reader.clip(clip)).collect::<Result<_, GltfError>>()?;
        Ok(Self { path: path.to_owned(), nodes, notes: reader.notes, rests, clips })
    }

    /// The motion of a node with all that it hangs below.
    ///
    /// `node` is the name of a node, else the name of the mesh of one, else `#index`; without it the first node that
    /// has keys. If several animations move the chain, the first is used. `fps` is how many frames a second the file
    /// has; its keys that miss a frame by rounding are on it.
    ///
    /// # Errors
    /// There is no such node, or several are. A node of the chain has keys and a matrix that is no translation,
    /// rotation and scale, or too many nodes have keys. Without `node`: none has keys.
    pub fn bind(&self, node: Option<&str>, fps: f64, looped: bool) -> Result<Chain, AnimError> {
        self.chain(node, fps, looped).map_err(|why| AnimError::Gltf { path: self.path.clone(), why: why.to_string() })
    }

    fn chain(&self, node: Option<&str>, fps: f64, looped: bool) -> Result<Chain, GltfError> {
        let index = match node {
            Some(name) => self.nodes.one(name)?,
            None => (0..self.nodes.nodes.len())
                .find(|index| self.clips.iter().any(|clip| clip.tracks.contains_key(index)))
                .ok_or_else(|| wrong("no node with keys", "an animation, or the name of a node"))?,
        };
        let mut line = vec![index];
        while let Some(parent) = line.last().and_then(|&last| self.nodes.nodes[last].parent) {
            line.push(parent);
        }
        let mut moving = self.clips.iter().filter(|clip| line.iter().any(|node| clip.tracks.contains_key(node)));
        let clip = moving.next();
        let unused = moving.take(8).map(|clip| clip.name.chars().take(60).collect()).collect();
        let mut joints: Vec<Joint> = Vec::new();
        let mut moving = 0;
        for &node in line.iter().rev() {
            let rest = self.rests[node];
            match clip.and_then(|clip| clip.tracks.get(&node)) {
                Some(tracks) => {
                    moving += 1;
                    let Some((scale, rotation, translation)) = rest.parts else {
                        let found = format!("node {node} with keys and a matrix that shears");
                        return Err(wrong(found, "a translation, a rotation and a scale"));
                    };
                    joints.push(Joint::Moving { scale, rotation, translation, tracks: tracks.clone() });
                }
                None => match joints.last_mut() {
                    Some(Joint::Fixed(place)) => *place *= rest.place,
                    _ => joints.push(Joint::Fixed(rest.place)),
                },
            }
        }
        if moving > MOST_MOVING {
            return Err(wrong(
                format!("{moving} nodes with keys, one below another"),
                format!("at most {MOST_MOVING}"),
            ));
        }
        let label = node.map_or_else(|| self.nodes.label(index), str::to_owned);
        let period = super::track::Clock { fps }.key(clip.map_or(0.0, |clip| clip.end));
        Ok(Chain { label, fps, looped, unused, period, joints })
    }

    /// Time of the last key of all animations, seconds.
    pub fn seconds(&self) -> f64 {
        self.clips.iter().map(|clip| clip.end).fold(0.0, f64::max)
    }
}

/// Reads tracks. Channels that name the same numbers share them.
struct Reader<'a> {
    file: &'a GltfFile<'a>,
    /// Numbers that may still be read.
    left: u64,
    times: HashMap<usize, Arc<[f64]>>,
    values: HashMap<(usize, Property, Between), Arc<[DVec4]>>,
    notes: Vec<String>,
}

impl Reader<'_> {
    fn clip(&mut self, clip: &Clip) -> Result<Moves, GltfError> {
        let mut moves =
            Moves { name: clip.name.as_deref().unwrap_or_default().to_owned(), end: 0.0, tracks: HashMap::new() };
        let mut ignored = 0;
        for (index, channel) in clip.channels.iter().enumerate() {
            let property = match channel.target.path.as_str() {
                "translation" => Property::Translation,
                "rotation" => Property::Rotation,
                "scale" => Property::Scale,
                _ => {
                    ignored += 1;
                    continue;
                }
            };
            let Some(node) = channel.target.node else {
                ignored += 1;
                continue;
            };
            named(&self.file.document.nodes, node, "node")?;
            let sampler = named(&clip.samplers, channel.sampler, "sampler")?;
            let between = match sampler.interpolation.as_deref() {
                None | Some("LINEAR") => Between::Linear,
                Some("STEP") => Between::Step,
                Some("CUBICSPLINE") => Between::Cubic,
                Some(other) => {
                    let shown: String = other.chars().take(30).flat_map(char::escape_debug).collect();
                    return Err(wrong(format!("interpolation `{shown}`"), "STEP, LINEAR or CUBICSPLINE"));
                }
            };
            let what = format!("channel {index}");
            let times = self.times(sampler.input).map_err(|why| why.of(&what))?;
            let values = self.values(sampler.output, property, between).map_err(|why| why.of(&what))?;
            let factor = if between == Between::Cubic { 3 } else { 1 };
            if values.len() != factor * times.len() {
                let found = format!("{} values for {} keys", values.len(), times.len());
                return Err(wrong(found, format!("{} values", factor * times.len())).of(&what));
            }
            moves.end = moves.end.max(times.last().copied().unwrap_or(0.0));
            let tracks = moves.tracks.entry(node).or_default();
            if tracks.iter().any(|track| track.property == property) {
                return Err(wrong(format!("node {node} moved twice by {what}"), "one channel for each property"));
            }
            tracks.push(Track { property, between, times, values });
        }
        if ignored > 0 && self.notes.len() < 50 {
            self.notes.push(format!("ignored: {ignored} channels that move no node (weights of morph targets)"));
        }
        Ok(moves)
    }

    fn take(&mut self, numbers: usize) -> Result<(), GltfError> {
        self.left = (self.left.checked_sub(numbers as u64))
            .ok_or_else(|| wrong("more keys than the file can mean", "fewer accessors of the same data"))?;
        Ok(())
    }

    fn times(&mut self, accessor: usize) -> Result<Arc<[f64]>, GltfError> {
        if let Some(known) = self.times.get(&accessor) {
            return Ok(Arc::clone(known));
        }
        let column = self.file.column(accessor, ValueShape::Scalar, "times")?;
        self.take(column.count)?;
        let times: Arc<[f64]> = (0..column.count).map(|row| column.get::<1>(row)[0]).collect();
        if times.is_empty() {
            return Err(wrong(format!("accessor {accessor} without keys"), "one at least"));
        }
        let falls = |row: &usize| !(times[*row].is_finite() && (*row == 0 || times[*row] >= times[*row - 1]));
        if let Some(row) = (0..times.len()).find(falls) {
            let found = format!("time {} of key {row}", times[row]);
            return Err(wrong(found, "finite times that rise"));
        }
        self.times.insert(accessor, Arc::clone(&times));
        Ok(times)
    }

    fn values(&mut self, accessor: usize, property: Property, between: Between) -> Result<Arc<[DVec4]>, GltfError> {
        let key = (accessor, property, between);
        if let Some(known) = self.values.get(&key) {
            return Ok(Arc::clone(known));
        }
        let turns = property == Property::Rotation;
        let column =
            self.file.column(accessor, if turns { ValueShape::Vec4 } else { ValueShape::Vec3 }, "values of keys")?;
        self.take(column.count.saturating_mul(4))?;
        let mut values = Vec::with_capacity(column.count);
        for row in 0..column.count {
            let mut value =
                if turns { DVec4::from_array(column.get(row)) } else { DVec3::from_array(column.get(row)).extend(0.0) };
            let is_tangent = between == Between::Cubic && row % 3 != 1;
            if turns && !is_tangent {
                value = value.try_normalize().unwrap_or(DVec4::NAN);
            }
            if !value.is_finite() || value.abs().max_element() > 1e30 {
                let found = format!("value {row} of accessor {accessor}");
                return Err(wrong(found, if turns { "a rotation with a direction" } else { "numbers to 1e30" }));
            }
            values.push(value);
        }
        let values: Arc<[DVec4]> = values.into();
        self.values.insert(key, Arc::clone(&values));
        Ok(values)
    }
}

/// Scale, rotation and translation of a transform; `None` if it shears.
fn parts_of(place: &DAffine3) -> Option<(DVec3, DQuat, DVec3)> {
    if !(place.is_finite() && place.matrix3.determinant() != 0.0) {
        return None;
    }
    let parts = place.to_scale_rotation_translation();
    let again = DAffine3::from_scale_rotation_translation(parts.0, parts.1, parts.2);
    let size = place.matrix3.to_cols_array().iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    (again.is_finite() && again.matrix3.abs_diff_eq(place.matrix3, ROUNDING * size)).then_some(parts)
}
