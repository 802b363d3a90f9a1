//! A bounding volume hierarchy over the elements of one model, surfels or triangles, in model space relative to the
//! model's origin.
//!
//! Parallel locally-ordered clustering (crate `obvhs`) builds a binary tree. The tree is then collapsed into nodes of
//! eight children and leaves of up to four elements. Both are structures of arrays, so that vector instructions test
//! one node (eight boxes in f32) or one leaf (four elements in f64) at once. Leaves hold copies of what the
//! intersection needs: 36 bytes for each element, plus its number. A triangle is a corner and the two edges from there,
//! as a surfel is its centre and its two axes.

use glam::{DVec3, Vec3, Vec3A};
use obvhs::Boundable;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use rayon::prelude::*;

use crate::model::Surfels;
use crate::model::mesh::MeshSurface;
use crate::model::paths::{Paths, elapsed};

/// Children of a node.
pub(super) const WIDTH: usize = 8;

/// Most surfels or triangles of a leaf. Four f64 fill a vector register.
pub(super) const LANES: usize = 4;

/// Most boxes that are clustered at once: a power of two, since such parts of `disc_tree::order` lie together.
const PART: usize = 512;

/// Bit of a child's number that marks a leaf.
pub(super) const LEAF: u32 = 1 << 31;

/// Boxes grow by this share of the model's radius, so that f32 traversal misses nothing that f64 intersection hits.
///
/// The terms, in units of 2^-24 times the radius R: a ray's origin is moved to the model's sphere, |o| <= R about its
/// centre, and rounded (1); its direction is rounded over a path of 2 R (2); (b - o) is rounded (2); the reciprocal of
/// the direction and the product round twice each over 2 R (8). The sum is 13. The distance of the centre from the
/// origin adds another 1 + 2: models are recentred, so it is at most R. A side that moves adds 1 for itself, 2 each for
/// its drift, the time and their product, and 1 for the sum. All are 24; 32 leaves room to spare.
const PADDING: f64 = 32.0 / (1_u32 << 24) as f64;

/// The sides of eight boxes: low ones, then high ones; x, y, z; one value for each box.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(super) struct Sides(pub [[[f32; WIDTH]; 3]; 2]);

/// A node: eight boxes and what they bound.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(super) struct Node {
    /// A missing child has low = +inf and high = -inf. Of elements that move by themselves: at the start of the span.
    pub sides: Sides,
    /// Number of the child's node, or of its leaf with [`LEAF`] set.
    pub children: [u32; WIDTH],
}

/// A leaf: up to four surfels or triangles.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(super) struct Leaf {
    /// Centres of surfels or first corners of triangles, x, y, z; NaN where there is none.
    pub centre: [[f32; LANES]; 3],
    /// First axes, or edges to the second corners.
    pub u: [[f32; LANES]; 3],
    /// Second axes, or edges to the third corners.
    pub v: [[f32; LANES]; 3],
    /// Numbers of surfels, or of triangles in the mesh.
    pub element: [u32; LANES],
}

/// The columns of the paths of a leaf's surfels: x, y, z of each.
#[derive(Clone, Debug, Default)]
#[repr(C, align(32))]
pub(super) struct Rates(pub [[[f32; LANES]; 3]; 3]);

impl Rates {
    fn of(leaf: &Leaf, paths: &Paths<'_>) -> Self {
        let mut rates = Self::default();
        for (slot, &surfel) in leaf.element.iter().enumerate() {
            for (column, out) in paths.columns.iter().zip(&mut rates.0) {
                let Some(rate) = column.get(surfel as usize) else { continue };
                (0..3).for_each(|axis| out[axis][slot] = rate[axis]);
            }
        }
        rates
    }
}

/// The hierarchy of one model.
#[derive(Clone, Debug)]
pub(super) struct Bvh<'a> {
    /// Nodes; the first one is the root.
    pub nodes: Vec<Node>,
    pub leaves: Vec<Leaf>,
    /// How the surfels of each leaf move by themselves; empty where none does.
    pub rates: Vec<Rates>,
    /// How far the sides of each node move over the span; empty where no surfel moves by itself.
    pub drifts: Vec<Sides>,
    /// Times between which boxes move with constant speed.
    pub span: [f64; 2],
    /// Centre of a sphere around all.
    pub centre: DVec3,
    pub radius: f64,
    /// The triangles that it holds; `None`: it holds surfels.
    pub surface: Option<MeshSurface<'a>>,
    /// Are its surfels spheres? The length of the first axis is their radius.
    pub spheres: bool,
}

/// The columns of what a hierarchy holds, as leaves have them, and the number of each.
struct Elements<'a> {
    centre: &'a [Vec3],
    u: &'a [Vec3],
    v: &'a [Vec3],
    /// `None`: they are counted.
    number: Option<&'a [u32]>,
    /// The rows of the columns that the boxes are of; `None`: all.
    members: Option<&'a [u32]>,
}

/// Low and high corner of a box.
pub(super) type Corners = (Vec3, Vec3);

#[derive(Clone, Copy)]
struct Element {
    low: Vec3A,
    high: Vec3A,
}

impl Boundable for Element {
    fn aabb(&self) -> Aabb {
        Aabb::new(self.low, self.high)
    }
}

impl<'a> Bvh<'a> {
    /// Builds the hierarchy of surfels that rest in their model. Surfels that are not finite are left out.
    pub(super) fn of_surfels(surfels: &Surfels) -> Self {
        let boxes = (0..surfels.len()).into_par_iter().map(|i| bounds(surfels, i)).collect();
        Self { spheres: surfels.spheres, ..Self::of(&Elements::of(surfels, None), boxes, None) }
    }

    /// Builds the hierarchy of those surfels of a model, `members`, that move along `paths`, for times in `span`.
    pub(super) fn of_moving(surfels: &Surfels, paths: &Paths<'_>, members: &[u32], span: [f64; 2]) -> Self {
        let (start, end): (Vec<Corners>, Vec<Corners>) =
            members.par_iter().map(|&i| swept(surfels, paths, i as usize, span).into()).unzip();
        let mut bvh = Self::of(&Elements::of(surfels, Some(members)), start, Some(end));
        (bvh.span, bvh.spheres) = (span, surfels.spheres);
        bvh.rates = bvh.leaves.iter().map(|leaf| Rates::of(leaf, paths)).collect();
        bvh
    }

    /// Builds the hierarchy of the triangles of a mesh, relative to `origin`.
    pub(super) fn of_triangles(surface: MeshSurface<'a>, origin: DVec3) -> Self {
        let corners = surface.corners(origin);
        let edge = |corner: usize| corners.iter().map(move |of| of[corner] - of[0]).collect::<Vec<_>>();
        let centre: Vec<Vec3> = corners.iter().map(|of| of[0]).collect();
        let (u, v) = (edge(1), edge(2));
        let around = |[a, b, c]: &[Vec3; 3]| (a.min(*b).min(*c), a.max(*b).max(*c));
        let boxes = corners.par_iter().map(around).collect();
        let bvh = Self::of(
            &Elements { centre: &centre, u: &u, v: &v, number: Some(surface.triangles()), members: None },
            boxes,
            None,
        );
        Self { surface: Some(surface), ..bvh }
    }

    /// Builds the hierarchy of elements in boxes: at the start of a span and, if they move by themselves, at its end.
    fn of(elements: &Elements<'_>, start: Vec<Corners>, end: Option<Vec<Corners>>) -> Self {
        let both = |i: usize| [start[i], end.as_ref().map_or(start[i], |end| end[i])];
        let is_finite = |&i: &usize| both(i).iter().all(|(low, high)| low.is_finite() && high.is_finite());
        let index: Vec<usize> = (0..start.len()).filter(is_finite).collect();
        let around = |i: usize| {
            let [a, b] = both(i);
            (a.0.min(b.0), a.1.max(b.1))
        };
        let whole = index.par_iter().map(|&i| around(i)).reduce(|| NOTHING, |a, b| (a.0.min(b.0), a.1.max(b.1)));
        if !(whole.0.cmple(whole.1).all()) {
            return Self::empty();
        }
        let (low, high) = (whole.0.as_dvec3(), whole.1.as_dvec3());
        let centre = 0.5 * (low + high);
        let extent = 0.5 * (high - low).length() + centre.length();
        let padding = PADDING * extent;
        let farthest = index
            .par_iter()
            .map(|&i| around(i))
            .map(|(low, high)| (high.as_dvec3() - centre).max(centre - low.as_dvec3()).length_squared())
            .reduce(|| 0.0, f64::max);
        let radius = farthest.sqrt() + 2.0 * padding;
        let grow = Vec3::splat(padding as f32);
        let padded = |boxes: &[Corners]| -> Vec<Element> {
            let padded = |&i: &usize| Element { low: (boxes[i].0 - grow).into(), high: (boxes[i].1 + grow).into() };
            index.iter().map(padded).collect()
        };
        let ends = end.as_ref().map(|end| [padded(&start), padded(end)]);
        let tree = match &ends {
            None => binary_tree(&padded(&start)),
            // Neighbours are what is near in the middle of the span.
            Some([a, b]) => {
                let middle = |(a, b): (&Element, &Element)| Element {
                    low: 0.5 * a.low + 0.5 * b.low,
                    high: 0.5 * a.high + 0.5 * b.high,
                };
                binary_tree(&a.iter().zip(b).map(middle).collect::<Vec<_>>())
            }
        };
        let numbers: Vec<u32> =
            index.iter().map(|&i| elements.members.map_or(i as u32, |members| members[i])).collect();
        drop((start, end));
        let ends = ends.map(|ends| ends.map(|boxes| merged(&tree, &boxes)));
        let mut collapse = Collapse {
            tree: &tree,
            index: &numbers,
            elements,
            counts: counts(&tree),
            ends,
            out: (Vec::new(), Vec::new(), Vec::new()),
        };
        collapse.run();
        let (nodes, leaves, drifts) = collapse.out;
        Self { nodes, leaves, drifts, centre, radius, ..Self::empty() }
    }

    /// A hierarchy of nothing.
    fn empty() -> Self {
        let (nodes, leaves, rates, drifts) = Default::default();
        Self {
            nodes,
            leaves,
            rates,
            drifts,
            span: [0.0; 2],
            centre: DVec3::ZERO,
            radius: 0.0,
            surface: None,
            spheres: false,
        }
    }

    /// Memory of nodes and leaves, bytes.
    pub(super) fn bytes(&self) -> u64 {
        let moving = size_of_val(self.rates.as_slice()) + size_of_val(self.drifts.as_slice());
        (size_of_val(self.nodes.as_slice()) + size_of_val(self.leaves.as_slice()) + moving) as u64
    }
}

const NOTHING: Corners = (Vec3::INFINITY, Vec3::NEG_INFINITY);

/// Box of an elliptical disc, or of a sphere. The disc's extent along an axis e is sqrt((u.e)^2 + (v.e)^2). The padding
/// covers the rounding.
fn bounds(surfels: &Surfels, i: usize) -> (Vec3, Vec3) {
    let (c, u, v) = (surfels.position[i], surfels.axis_u[i], surfels.axis_v[i]);
    let half_size =
        if surfels.spheres { Vec3::splat(u.length() * (1.0 + f32::EPSILON)) } else { (u * u + v * v).map(f32::sqrt) };
    (c - half_size, c + half_size)
}

/// Boxes of a disc at the start of a span and at its end. Between them, the box whose sides move from one to the other
/// with constant speed holds the disc on its path.
///
/// A path differs from its chord by at most h^2 / 8 times its greatest second derivative, where h is the length of the
/// span. The second derivative of a cubic is greatest at an end. The padding covers the rounding.
fn swept(surfels: &Surfels, paths: &Paths<'_>, i: usize, span: [f64; 2]) -> [Corners; 2] {
    let (u, v) = (surfels.axis_u[i].as_dvec3(), surfels.axis_v[i].as_dvec3());
    let of_kernel = if surfels.spheres { DVec3::splat(u.length()) } else { (u * u + v * v).map(f64::sqrt) };
    let half_size = of_kernel + paths.bend(i, span);
    span.map(|time| {
        let place = paths.exact_place(surfels.position[i], i, elapsed(time));
        ((place - half_size).as_vec3(), (place + half_size).as_vec3())
    })
}

/// Boxes around what is below each node of the binary tree, from the boxes of its elements.
fn merged(tree: &Bvh2, boxes: &[Element]) -> Vec<Element> {
    let mut all = vec![Element { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY }; tree.nodes.len()];
    let mut stack = vec![(0_usize, false)];
    while let Some((at, seen)) = stack.pop() {
        let node = &tree.nodes[at];
        let child = node.first_index as usize;
        let union = |a: &Element, b: &Element| Element { low: a.low.min(b.low), high: a.high.max(b.high) };
        if node.is_leaf() {
            let own = &tree.primitive_indices[child..child + node.prim_count as usize];
            all[at] = own.iter().fold(all[at], |sum, &i| union(&sum, &boxes[i as usize]));
        } else if seen {
            all[at] = union(&all[child], &all[child + 1]);
        } else {
            stack.extend([(at, true), (child, false), (child + 1, false)]);
        }
    }
    all
}

/// The binary tree of boxes, with one box in each leaf.
///
/// Clustering merges neighbours that are each other's nearest. Where many boxes are alike there is one such pair in a
/// round, so the time is the square of their number. Parts of [`PART`] boxes are therefore clustered by themselves, and
/// then the boxes of the parts.
fn binary_tree(boxes: &[Element]) -> Bvh2 {
    let cluster = |boxes: &[Aabb]| {
        let all = (0..boxes.len() as u32).collect();
        PlocBuilder::with_capacity(boxes.len()).build(PlocSearchDistance::Low, boxes, all, SortPrecision::U64, 2)
    };
    let order = if boxes.len() > PART {
        let centre: Vec<Vec3> = boxes.par_iter().map(|b| Vec3::from(0.5 * (b.low + b.high))).collect();
        let reach: Vec<f32> = boxes.par_iter().map(|b| 0.5 * (b.high - b.low).length()).collect();
        crate::model::disc_tree::order(&centre, &reach)
    } else {
        (0..boxes.len() as u32).collect()
    };
    let parts: Vec<Bvh2> = order
        .par_chunks(PART)
        .map(|part| cluster(&part.iter().map(|&i| boxes[i as usize].aabb()).collect::<Vec<_>>()))
        .collect();
    let mut tree = cluster(&parts.iter().map(|part| *part.nodes[0].aabb()).collect::<Vec<_>>());
    let top = tree.nodes.len();
    let mut first = vec![0_u32; parts.len()];
    for (part, first) in parts.iter().zip(&mut first) {
        // The root of a part takes the place of its leaf, so the part's nodes follow from the second one on.
        *first = tree.nodes.len() as u32 - 1;
        tree.nodes.extend_from_slice(&part.nodes[1..]);
    }
    let at = |node: &Bvh2Node, part: usize| {
        let from = if node.is_leaf() { (part * PART) as u32 } else { first[part] };
        Bvh2Node::new(*node.aabb(), node.prim_count, from + node.first_index)
    };
    for i in 0..top {
        if tree.nodes[i].is_leaf() {
            let part = tree.primitive_indices[tree.nodes[i].first_index as usize] as usize;
            tree.nodes[i] = at(&parts[part].nodes[0], part);
        }
    }
    for (part, of) in parts.iter().enumerate() {
        let nodes = &mut tree.nodes[first[part] as usize + 1..][..of.nodes.len() - 1];
        for node in nodes {
            *node = at(node, part);
        }
    }
    let own = parts.iter().enumerate();
    tree.primitive_indices = own
        .flat_map(|(part, of)| of.primitive_indices.iter().map(move |&i| (part, i)))
        .map(|(part, i)| order[part * PART + i as usize])
        .collect();
    tree
}

/// Number of elements below each node of the binary tree.
fn counts(tree: &Bvh2) -> Vec<u32> {
    let mut counts = vec![0; tree.nodes.len()];
    let mut stack = vec![(0_usize, false)];
    while let Some((at, seen)) = stack.pop() {
        let node = &tree.nodes[at];
        if node.is_leaf() {
            counts[at] = node.prim_count;
        } else if seen {
            let child = node.first_index as usize;
            counts[at] = counts[child] + counts[child + 1];
        } else {
            stack.push((at, true));
            stack.push((node.first_index as usize, false));
            stack.push((node.first_index as usize + 1, false));
        }
    }
    counts
}

/// Turns the binary tree into an eight-wide tree.
struct Collapse<'a> {
    tree: &'a Bvh2,
    /// Element of each primitive of the tree.
    index: &'a [u32],
    elements: &'a Elements<'a>,
    counts: Vec<u32>,
    /// Boxes of the binary nodes at the start of the span and at its end, if they move.
    ends: Option<[Vec<Element>; 2]>,
    out: (Vec<Node>, Vec<Leaf>, Vec<Sides>),
}

impl Collapse<'_> {
    fn run(&mut self) {
        // (binary node, place of the wide node that it becomes)
        let mut work = vec![(0_usize, 0_usize)];
        self.out.0.push(Node::empty());
        while let Some((at, place)) = work.pop() {
            let mut children = [0_usize; WIDTH];
            let mut n = 1;
            children[0] = at;
            while n < WIDTH {
                // Open the child with the greatest cost, which is the one that most rays enter.
                let open = (0..n)
                    .filter(|&i| self.counts[children[i]] > LANES as u32)
                    .max_by(|&i, &j| self.area(children[i]).total_cmp(&self.area(children[j])));
                let Some(open) = open else { break };
                let first = self.tree.nodes[children[open]].first_index as usize;
                children[open] = first;
                children[n] = first + 1;
                n += 1;
            }
            for (slot, &child) in children[..n].iter().enumerate() {
                let number = if self.counts[child] <= LANES as u32 {
                    let leaf = self.leaf(child);
                    self.out.1.push(leaf);
                    LEAF | (self.out.1.len() - 1) as u32
                } else {
                    self.out.0.push(Node::empty());
                    work.push((child, self.out.0.len() - 1));
                    (self.out.0.len() - 1) as u32
                };
                let aabb = self.tree.nodes[child].aabb();
                let start = self.ends.as_ref().map_or([aabb.min, aabb.max], |[start, _]| start[child].corners());
                self.out.0[place].children[slot] = number;
                self.out.0[place].sides.set(slot, start);
                if let Some([_, end]) = &self.ends {
                    self.out.2.resize(self.out.0.len(), Sides::RESTING);
                    let [low, high] = end[child].corners();
                    self.out.2[place].set(slot, [low - start[0], high - start[1]]);
                }
            }
        }
    }

    fn area(&self, node: usize) -> f32 {
        self.tree.nodes[node].aabb().half_area()
    }

    fn leaf(&self, node: usize) -> Leaf {
        let mut leaf = Leaf {
            centre: [[f32::NAN; LANES]; 3],
            u: [[0.0; LANES]; 3],
            v: [[0.0; LANES]; 3],
            element: [u32::MAX; LANES],
        };
        let mut stack = vec![node];
        let mut slot = 0;
        while let Some(at) = stack.pop() {
            let node = &self.tree.nodes[at];
            if !node.is_leaf() {
                stack.push(node.first_index as usize + 1);
                stack.push(node.first_index as usize);
                continue;
            }
            for p in node.first_index..node.first_index + node.prim_count {
                let element = self.index[self.tree.primitive_indices[p as usize] as usize];
                let i = element as usize;
                let Elements { centre, u, v, number, .. } = self.elements;
                for axis in 0..3 {
                    leaf.centre[axis][slot] = centre[i][axis];
                    leaf.u[axis][slot] = u[i][axis];
                    leaf.v[axis][slot] = v[i][axis];
                }
                leaf.element[slot] = number.map_or(element, |number| number[i]);
                slot += 1;
            }
        }
        leaf
    }
}

impl Node {
    const fn empty() -> Self {
        let sides = Sides([[[f32::INFINITY; WIDTH]; 3], [[f32::NEG_INFINITY; WIDTH]; 3]]);
        Self { sides, children: [0; WIDTH] }
    }
}

impl Sides {
    /// The drift of boxes that rest.
    const RESTING: Self = Self([[[0.0; WIDTH]; 3]; 2]);

    fn set(&mut self, slot: usize, corners: [Vec3A; 2]) {
        for (sides, corner) in self.0.iter_mut().zip(corners) {
            (0..3).for_each(|axis| sides[axis][slot] = corner[axis]);
        }
    }
}

impl Element {
    const fn corners(&self) -> [Vec3A; 2] {
        [self.low, self.high]
    }
}

impl<'a> Elements<'a> {
    fn of(surfels: &'a Surfels, members: Option<&'a [u32]>) -> Self {
        Self { centre: &surfels.position, u: &surfels.axis_u, v: &surfels.axis_v, number: None, members }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(n: u32) -> Surfels {
        let mut surfels = Surfels::default();
        for i in 0..n {
            let h = |k: u64| f64::from(crate::sampling::hash(u64::from(i), k)) as f32 / 4.3e9;
            surfels.position.push(Vec3::new(h(0), h(1), h(2)));
            surfels.axis_u.push(Vec3::new(h(3), h(4), h(5)) * 0.05);
            surfels.axis_v.push(Vec3::new(h(6), -h(7), h(8)) * 0.05);
            surfels.normal.push(Vec3::Z);
            surfels.colour.push(Vec3::ONE);
        }
        surfels
    }

    /// Every surfel is in one leaf, and every box holds what is below it.
    #[test]
    fn boxes_hold_their_surfels() {
        for n in [0, 1, 2, 8, 9, 1000, 5000] {
            let mut surfels = cloud(n);
            if n >= 1000 {
                // Many surfels lie in one place, and one is not finite.
                surfels.position[10..200].fill(Vec3::ONE);
                surfels.position[500].x = f32::NAN;
            }
            let bvh = Bvh::of_surfels(&surfels);
            let mut seen = vec![0; n as usize];
            let mut work = vec![(0_u32, [Vec3::NEG_INFINITY, Vec3::INFINITY])];
            if bvh.nodes.is_empty() {
                work.clear();
            }
            while let Some((number, [low, high])) = work.pop() {
                if number & LEAF != 0 {
                    for i in bvh.leaves[(number & !LEAF) as usize].element.into_iter().filter(|&i| i != u32::MAX) {
                        seen[i as usize] += 1;
                        let b = bounds(&surfels, i as usize);
                        assert!(low.cmple(b.0).all() && high.cmpge(b.1).all(), "surfel {i}");
                    }
                    continue;
                }
                let node = &bvh.nodes[number as usize];
                for slot in 0..WIDTH {
                    let side = |s: usize| Vec3::from_array([0, 1, 2].map(|axis| node.sides.0[s][axis][slot]));
                    if side(0).x < f32::INFINITY {
                        assert!(low.cmple(side(0)).all() && high.cmpge(side(1)).all());
                        work.push((node.children[slot], [side(0), side(1)]));
                    }
                }
            }
            for (i, &count) in seen.iter().enumerate() {
                assert_eq!(count, i32::from(surfels.position[i].is_finite()), "surfel {i} of {n}");
            }
        }
    }

    /// Boxes in one place, all alike or each a little larger, make no chain. Measured: 3000 deep where they are
    /// clustered all at once, which takes hours for a million.
    #[test]
    fn boxes_that_are_alike_make_no_chain() {
        for growth in [0.0, 1e-6] {
            let size = |i: u32| Vec3A::splat(0.1 * (1.0 + growth * i as f32));
            let boxes: Vec<Element> = (0..3000).map(|i| Element { low: -size(i), high: size(i) }).collect();
            let tree = binary_tree(&boxes);
            let (mut work, mut deepest, mut leaves) = (vec![(0_usize, 0_usize)], 0, 0);
            while let Some((at, depth)) = work.pop() {
                deepest = deepest.max(depth);
                let node = &tree.nodes[at];
                if node.is_leaf() {
                    leaves += 1;
                } else {
                    work.extend([0, 1].map(|i| (node.first_index as usize + i, depth + 1)));
                }
            }
            assert_eq!(leaves, boxes.len());
            assert!(deepest <= 600, "{deepest} deep");
        }
    }
}
