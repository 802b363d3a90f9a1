//! What a file has: its nodes and animations, and how a node is found by name.

use super::document::Document;
use super::error::{GltfError, named, quote, wrong};
use super::file::GltfFile;
use super::nodes::Tree;

/// Most nodes that one message lists.
const MOST_LISTED: usize = 20;

/// The nodes and animations of a glTF file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nodes {
    /// In file order.
    pub nodes: Vec<NodeEntry>,
    /// In file order.
    pub animations: Vec<AnimationEntry>,
}

/// One node.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeEntry {
    /// Its name; empty if it has none.
    pub name: String,
    /// Index of its mesh.
    pub mesh: Option<usize>,
    /// Name of its mesh; empty if it has none.
    pub mesh_name: String,
    /// Index of the node that it hangs below.
    pub parent: Option<usize>,
    /// Triangles of its mesh, without those of its children.
    pub triangles: u64,
    /// True if an animation moves it, or a node that it hangs below.
    pub animated: bool,
    /// True if the default scene shows it.
    pub in_scene: bool,
}

/// One animation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AnimationEntry {
    /// Its name; empty if it has none.
    pub name: String,
    /// Time of the last key, seconds.
    pub seconds: f64,
    /// Number of channels.
    pub channels: usize,
}

impl Nodes {
    /// Lists what a file has.
    pub(crate) fn of(file: &GltfFile<'_>) -> Result<Self, GltfError> {
        let Document { nodes, meshes, animations, .. } = &file.document;
        let tree = Tree::new(&file.document)?;
        let mut moved = vec![false; nodes.len()];
        let mut listed = Vec::new();
        for clip in animations {
            let mut seconds = 0.0_f64;
            for channel in &clip.channels {
                if let Some(node) = channel.target.node.filter(|_| channel.target.path != "weights") {
                    named(nodes, node, "node")?;
                    moved[node] = true;
                }
                let sampler = named(&clip.samplers, channel.sampler, "sampler")?;
                let times = file.column(sampler.input, super::ValueShape::Scalar, "times")?;
                if let Some(last) = times.count.checked_sub(1) {
                    let [last] = times.get(last);
                    seconds = seconds.max(last);
                }
            }
            let name = clip.name.as_deref().unwrap_or_default().to_owned();
            listed.push(AnimationEntry { name, seconds, channels: clip.channels.len() });
        }
        let mut shown = vec![false; nodes.len()];
        let placed = tree.placed(&file.document)?;
        for (node, _) in placed {
            shown[node] = true;
        }
        // Parents come before their children, so that what moves a parent is known.
        let mut carried = moved;
        for index in top_down(&file.document, &tree) {
            carried[index] |= tree.parent(index).is_some_and(|parent| carried[parent]);
        }
        let mut entries = Vec::with_capacity(nodes.len());
        for (index, node) in nodes.iter().enumerate() {
            let mesh = node.mesh.map(|mesh| named(meshes, mesh, "mesh")).transpose()?;
            let mut triangles = 0_u64;
            for primitive in mesh.map_or(&[][..], |mesh| &mesh.primitives) {
                let Some(corners) = primitive.indices.or_else(|| primitive.attributes.get("POSITION").copied()) else {
                    continue;
                };
                let count = named(&file.document.accessors, corners, "accessor")?.count as u64;
                triangles = triangles.saturating_add(match primitive.mode.unwrap_or(4) {
                    4 => count / 3,
                    5 | 6 => count.saturating_sub(2),
                    _ => 0,
                });
            }
            entries.push(NodeEntry {
                name: node.name.as_deref().unwrap_or_default().to_owned(),
                mesh: node.mesh,
                mesh_name: mesh.and_then(|mesh| mesh.name.as_deref()).unwrap_or_default().to_owned(),
                parent: tree.parent(index),
                triangles,
                animated: carried[index],
                in_scene: shown[index],
            });
        }
        Ok(Self { nodes: entries, animations: listed })
    }

    /// All nodes that `name` means: those of this name, else those whose mesh has it, else the one of `#index`.
    pub fn matching(&self, name: &str) -> Vec<usize> {
        let all = |pick: &dyn Fn(&NodeEntry) -> &str| -> Vec<usize> {
            (0..self.nodes.len()).filter(|&index| pick(&self.nodes[index]) == name).collect()
        };
        if name.is_empty() {
            return Vec::new();
        }
        let named = all(&|node| &node.name);
        if !named.is_empty() {
            return named;
        }
        let shapes = all(&|node| &node.mesh_name);
        if !shapes.is_empty() {
            return shapes;
        }
        let index = name.strip_prefix('#').and_then(|index| index.parse::<usize>().ok());
        index.filter(|&index| index < self.nodes.len()).into_iter().collect()
    }

    /// The one node that `name` means.
    pub(crate) fn one(&self, name: &str) -> Result<usize, GltfError> {
        match self.matching(name)[..] {
            [index] => Ok(index),
            [] => Err(self.unknown(name)),
            ref several => Err(ambiguous(name, several)),
        }
    }

    /// The node whose mesh `name` means. Several nodes are the same where they share their mesh.
    pub(crate) fn one_mesh(&self, name: &str) -> Result<usize, GltfError> {
        let found = self.matching(name);
        let with_mesh: Vec<usize> = found.iter().copied().filter(|&index| self.nodes[index].mesh.is_some()).collect();
        match (found.first(), with_mesh.first()) {
            (None, _) => Err(self.unknown(name)),
            (Some(index), None) => Err(wrong(format!("node #{index} ({}) without a mesh", quote(name)), "a mesh")),
            (_, Some(&first)) => {
                let same = with_mesh.iter().all(|&index| self.nodes[index].mesh == self.nodes[first].mesh);
                if same { Ok(first) } else { Err(ambiguous(name, &with_mesh)) }
            }
        }
    }

    /// A text that finds node `index` alone, and that XML can hold: its name, if no other node has it, else `#index`.
    pub fn label(&self, index: usize) -> String {
        let name = self.nodes.get(index).map_or("", |node| node.name.as_str());
        let plain = name.trim() == name && !name.contains(|c: char| c.is_control() || is_outside_xml(c));
        let number = format!("#{index}");
        if plain && self.matching(name) == [index] { name.to_owned() } else { number }
    }

    fn unknown(&self, name: &str) -> GltfError {
        let known = (0..self.nodes.len()).map(|index| {
            let name = self.label(index);
            match self.nodes[index].mesh_name.as_str() {
                "" => name,
                mesh => format!("{name} (mesh {mesh})"),
            }
        });
        let list = listed(known);
        wrong(format!("no node {}", quote(name)), format!("a node of the file: {list}"))
    }
}

fn ambiguous(name: &str, several: &[usize]) -> GltfError {
    let list = listed(several.iter().map(|index| format!("#{index}")));
    wrong(format!("{} nodes {}", several.len(), quote(name)), format!("one of {list}"))
}

/// Characters that XML 1.0 has no place for, beside control characters.
fn is_outside_xml(c: char) -> bool {
    matches!(c, '\u{fffe}' | '\u{ffff}')
}

/// The first items as one text, and how many more there are.
fn listed(mut items: impl ExactSizeIterator<Item = String>) -> String {
    let more = items.len().saturating_sub(MOST_LISTED);
    let first: Vec<String> = items.by_ref().take(MOST_LISTED).collect();
    match (first.is_empty(), more) {
        (true, _) => "none".to_owned(),
        (_, 0) => first.join(", "),
        _ => format!("{} and {more} more", first.join(", ")),
    }
}

/// All nodes, parents before children.
fn top_down(document: &Document, tree: &Tree) -> Vec<usize> {
    let mut order: Vec<usize> = (0..document.nodes.len()).filter(|&index| tree.parent(index).is_none()).collect();
    let mut next = 0;
    while let Some(&index) = order.get(next) {
        next += 1;
        order.extend(&document.nodes[index].children);
    }
    order
}
