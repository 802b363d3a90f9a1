//! What a picture misses by each node: the volume is drawn at each level beside a finer one.
//!
//! A node alone does not tell: what lies behind others would count. So all of the volume is drawn, and the squares of a
//! pixel's difference go to the nodes that it shows, by their shares.

use glam::Vec3;
use rayon::prelude::*;

use super::merge::covariance;
use super::side::{Mark, Side};
use super::{Gaussians, VolumeLevels};
use crate::math::srgb::{from_linear, to_linear};

/// Width of a cell in the pictures, pixels. Each level is drawn beside the one whose cells are half as wide. Pixels see
/// different parts of cells, as in a renderer's pictures.
const SCALE: f32 = 0.9;
/// Errors grow with this power of the width of cells that are wider than a pixel (docs/measurements/levels.md).
const GROWTH: f64 = 2.5;
/// Levels that have more than one kernel for this many of the finer level are not used.
const SAVED: usize = 2;
/// Kernels from which on a level is drawn from one side, not from three: each node has many pixels there.
const MANY: usize = 50_000;
/// Most pixels along a picture. Levels that need more are not used.
const MOST_PIXELS: f32 = 1024.0;
/// The square of what the finer level misses itself, and all finer ones, beside that of what is seen: errors are halved
/// from one level to the next, or more.
const FINER: f64 = 4.0 / 3.0;
/// Factor on squares for what views along axes do not show (docs/measurements/levels.md).
const ASLANT: f64 = 2.0;
/// Pixels of the level's mean that count with those of a node.
const SHARED: f64 = 4.0;

/// Sums over pixels that show a node.
#[derive(Clone, Copy, Default)]
struct Sum {
    /// Squares of differences, display values.
    squares: f64,
    pixels: f64,
}

impl Sum {
    fn add(&mut self, other: Self) {
        self.squares += other.squares;
        self.pixels += other.pixels;
    }
}

/// What a picture misses by a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NodeError {
    /// Error of a picture whose cells are a pixel wide, as a share of white as it is displayed (root mean square over
    /// what the node covers). Infinite for a node that is not used; 0 without children.
    error: f32,
    /// What it covers of a picture, model units^2. 0 without children.
    pub(crate) area: f32,
}

impl NodeError {
    const UNUSED: Self = Self { error: f32::INFINITY, area: 0.0 };

    /// The error of a picture whose cells are this many pixels wide.
    pub(crate) fn at(self, pixels: f64) -> f64 {
        f64::from(self.error) * if pixels < 1.0 { pixels } else { libm::pow(pixels, GROWTH) }
    }
}

/// Measures the nodes of a tree. Extinctions count times `density`.
pub(super) fn measure(levels: &VolumeLevels, volume: &Gaussians, density: f32) -> Vec<NodeError> {
    let mut errors = vec![NodeError { error: 0.0, area: 0.0 }; levels.nodes.len()];
    let [low, high] = levels.nodes[0].corners;
    let size = high - low;
    let inner = levels.nodes.iter().filter(|node| !node.is_leaf());
    let mut all_bits: Vec<u32> = inner.map(|node| node.bits).collect();
    all_bits.sort_unstable();
    all_bits.dedup();
    for bits in all_bits {
        let is_of_level = |i: &usize| levels.nodes[*i].bits == bits && !levels.nodes[*i].is_leaf();
        let nodes: Vec<usize> = (0..levels.nodes.len()).filter(is_of_level).collect();
        for &i in &nodes {
            errors[i] = NodeError::UNUSED;
        }
        let pixels = SCALE / levels.nodes[nodes[0]].spacing;
        let along = (size * pixels).to_array();
        let cuts = [bits, bits.saturating_sub(1)].map(|bits| levels.at(bits));
        let count = |cut: &Vec<u32>| cut.iter().map(|&i| levels.nodes[i as usize].own.len()).sum::<usize>();
        let [coarse, fine] = cuts.each_ref().map(count);
        let own: usize = nodes.iter().map(|&i| levels.nodes[i].own.len()).sum();
        // What else is in both cuts.
        let both = coarse - own;
        if SAVED * own > fine - both || along.iter().any(|&along| along > MOST_PIXELS) {
            continue;
        }
        let along = along.map(|along| (along.ceil() as usize).max(1));
        // The side that shows most is the first.
        let (first, sides) = (size.min_position(), if fine > MANY { 1 } else { 3 });
        let side = |i: usize| Side { axis: (first + i) % 3, low, pixels, size: along, density };
        let [coarse, fine] = cuts.map(|cut| levels.marks(volume, &cut));
        let sums = sums((0..sides).map(side).collect(), &fine, &coarse, levels.nodes.len());
        let mut whole = Sum::default();
        for &i in &nodes {
            whole.add(sums[i]);
        }
        // What is not seen is not known.
        if whole.pixels.is_nan() || whole.pixels <= 0.0 {
            continue;
        }
        let (mean, mean_pixels) = (whole.squares / whole.pixels, whole.pixels / nodes.len() as f64);
        for i in nodes {
            let Sum { squares, pixels: covered } = sums[i];
            let square = (squares + SHARED * mean) / (covered + SHARED);
            // What is hidden from here may show from elsewhere.
            let shown = if covered < SHARED { mean_pixels } else { covered };
            errors[i] = NodeError {
                error: (FINER * ASLANT * square).sqrt() as f32 / SCALE,
                area: (shown / sides as f64) as f32 / (pixels * pixels),
            };
        }
    }
    errors
}

impl VolumeLevels {
    /// The coarsest nodes with edges of at most 2 to `bits`, or without children.
    fn at(&self, bits: u32) -> Vec<u32> {
        let (mut cut, mut open) = (Vec::new(), vec![0]);
        while let Some(node) = open.pop() {
            let of = &self.nodes[node as usize];
            if of.is_leaf() || of.bits <= bits {
                cut.push(node);
            } else {
                open.extend(of.children.clone().rev());
            }
        }
        cut
    }

    /// The kernels of a cut as they are drawn.
    fn marks(&self, volume: &Gaussians, cut: &[u32]) -> Vec<Mark> {
        let mark = |node: u32, from: &Gaussians, i: usize| {
            let colour = from.colour(i).max(Vec3::ZERO);
            let linear = || Vec3::from_array(colour.to_array().map(to_linear));
            Mark {
                position: from.position[i],
                covariance: covariance(from.sigma[i], from.rotation[i]),
                extinction: from.opacity[i],
                colour: if volume.linear { colour } else { linear() },
                normal: from.normal.get(i).copied(),
                node,
            }
        };
        let marks = |&node: &u32| self.own(volume, node).map(move |(from, i)| (node, from, i));
        cut.iter().flat_map(marks).map(|(node, from, i)| mark(node, from, i)).collect()
    }
}

/// The sums of all nodes from some sides. Differences count on black and on white alike.
fn sums(sides: Vec<Side>, fine: &[Mark], coarse: &[Mark], nodes: usize) -> Vec<Sum> {
    let of_sides: Vec<Vec<Sum>> = sides.into_par_iter().map(|side| of_side(side, fine, coarse, nodes)).collect();
    let mut all = vec![Sum::default(); nodes];
    for of_side in of_sides {
        for (sum, own) in all.iter_mut().zip(of_side) {
            sum.add(own);
        }
    }
    all
}

fn of_side(side: Side, fine: &[Mark], coarse: &[Mark], nodes: usize) -> Vec<Sum> {
    let picture = |marks: &[Mark]| {
        let splats = side.splats(marks);
        let mut colour = vec![Vec3::ZERO; side.len()];
        let through = side.draw(&splats, |pixel, splat, share| colour[pixel] += splat.colour * share);
        (splats, colour, through)
    };
    let (_, own, through) = picture(fine);
    let (splats, other, other_through) = picture(coarse);
    let display = |colour: Vec3, through: f32| (colour + through).to_array().map(|x| from_linear(x.min(1.0)));
    let square = |pixel: usize| {
        let on = |white: f32| {
            let [a, b] =
                [display(own[pixel], white * through[pixel]), display(other[pixel], white * other_through[pixel])];
            a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f32>()
        };
        (on(0.0) + on(1.0)) / 6.0
    };
    let squares: Vec<f32> = (0..side.len()).map(square).collect();
    let mut sums = vec![Sum::default(); nodes];
    side.draw(&splats, |pixel, splat, share| {
        let squares = f64::from(squares[pixel] * share / (1.0 - other_through[pixel]).max(0.01));
        sums[splat.node as usize].add(Sum { squares, pixels: f64::from(share) });
    });
    sums
}
