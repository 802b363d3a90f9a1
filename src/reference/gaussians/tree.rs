//! The Gaussians of a capture or of a volume in a tree of boxes, in model space.
//!
//! They stand along a curve through space. Eight neighbours share a box, eight such boxes share one, and so on: the
//! tree needs no pointers.

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::beam::Beam;
use crate::model::Gaussians;
use crate::reference::error::ReferenceError;
use crate::scene::Drawing;

/// Least alpha that shows.
pub(in crate::reference) const LEAST_ALPHA: f64 = 1.0 / 255.0;

/// Greatest alpha of one Gaussian.
pub(in crate::reference) const MOST_ALPHA: f64 = 0.99;

/// Children of a node.
const WIDTH: usize = 8;

/// What a tree holds.
pub(in crate::reference) trait Placed: Copy + Send + Sync {
    /// Centre, model space.
    fn centre(&self) -> Vec3;

    /// Distance from the centre within which a ray may meet it, model units.
    fn radius(&self) -> f64;
}

/// A Gaussian that can be seen.
#[derive(Clone, Copy, Debug)]
pub(in crate::reference) struct GaussianKernel {
    pub centre: Vec3,
    /// Number in the drawing.
    pub index: u32,
    /// Covariance in model space: xx, xy, xz, yy, yz, zz.
    pub covariance: [f64; 6],
    /// Opacity at the centre, with the factor of the object.
    pub opacity: f64,
    /// q = D^T V'^-1 D up to which alpha is at least [`LEAST_ALPHA`], and a little more.
    pub reach: f64,
    /// Greatest standard deviation times the root of `reach`, model units.
    pub radius: f64,
}

/// A box around centres, and the greatest radius of their Gaussians.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: Vec3,
    high: Vec3,
    radius: f64,
}

/// The Gaussians that can be seen.
#[derive(Clone, Debug)]
pub(in crate::reference) struct Tree<K> {
    kernels: Vec<K>,
    /// Nodes by level, those above kernels first. The last level has at most [`WIDTH`] nodes.
    levels: Vec<Vec<Node>>,
    /// Greatest absolute value of a coordinate.
    pub extent: f64,
}

impl<K: Placed> Tree<K> {
    /// Builds the tree of all that `capture` lets be seen. `of` makes the kernel of a number, or tells that nobody sees
    /// it.
    ///
    /// # Errors
    /// The tree does not fit into memory.
    pub(in crate::reference) fn new(
        gaussians: &Gaussians,
        drawing: &Drawing,
        of: impl Fn(u32) -> Option<K> + Sync,
    ) -> Result<Self, ReferenceError> {
        let count = gaussians.len();
        let each = size_of::<K>() + size_of::<(u64, u32)>() + size_of::<Node>() / WIDTH * 2;
        // The memory is tried first: a vector that does not fit would end the program.
        let fits = count.checked_mul(each).is_some_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok());
        if !fits || u32::try_from(count).is_err() {
            return Err(ReferenceError::Gaussians { count });
        }
        let inside = |p: DVec3| drawing.crop.is_none_or(|[low, high]| p.cmpge(low).all() && p.cmple(high).all());
        let seen: Vec<u32> = (0..count as u32)
            .into_par_iter()
            .filter(|&index| inside(gaussians.position[index as usize].as_dvec3()) && of(index).is_some())
            .collect();
        let low = seen.iter().fold(Vec3::INFINITY, |low, &i| low.min(gaussians.position[i as usize]));
        let high = seen.iter().fold(Vec3::NEG_INFINITY, |high, &i| high.max(gaussians.position[i as usize]));
        let mut order: Vec<(u64, u32)> =
            seen.into_par_iter().map(|i| (along_curve(gaussians.position[i as usize], low, high), i)).collect();
        order.par_sort_unstable();
        let kernels: Vec<K> = order.into_par_iter().filter_map(|(_, index)| of(index)).collect();
        let mut levels: Vec<Vec<Node>> = vec![kernels.chunks(WIDTH).map(Node::of_kernels).collect()];
        while let Some(above) = levels.last().filter(|level| level.len() > WIDTH) {
            let next = above.chunks(WIDTH).map(Node::of_nodes).collect();
            levels.push(next);
        }
        let extent = low.abs().max(high.abs()).as_dvec3().max_element();
        Ok(Self { kernels, levels, extent: if extent.is_finite() { extent } else { 0.0 } })
    }

    /// The Gaussians, of which [`Self::visit`] tells the places.
    pub(in crate::reference) fn kernels(&self) -> &[K] {
        &self.kernels
    }

    /// Memory of the tree, bytes.
    pub(in crate::reference) fn bytes(&self) -> u64 {
        let nodes: usize = self.levels.iter().map(|level| size_of_val(level.as_slice())).sum();
        (nodes + size_of_val(self.kernels.as_slice())) as u64
    }

    /// Calls `found` with the place of each Gaussian that a ray of the beam may meet. `stack` is scratch.
    pub(in crate::reference) fn visit(&self, beam: &Beam, stack: &mut Vec<(u32, u32)>, mut found: impl FnMut(u32, &K)) {
        let top = self.levels.len() - 1;
        stack.clear();
        stack.extend((0..self.levels[top].len() as u32).map(|at| (top as u32, at)));
        while let Some((level, at)) = stack.pop() {
            let node = &self.levels[level as usize][at as usize];
            if !beam.meets([node.low.as_dvec3(), node.high.as_dvec3()], node.radius) {
                continue;
            }
            let first = at as usize * WIDTH;
            if level > 0 {
                let end = (first + WIDTH).min(self.levels[level as usize - 1].len());
                stack.extend((first..end).map(|child| (level - 1, child as u32)));
                continue;
            }
            let end = (first + WIDTH).min(self.kernels.len());
            (first..end).for_each(|place| found(place as u32, &self.kernels[place]));
        }
    }
}

impl Placed for GaussianKernel {
    fn centre(&self) -> Vec3 {
        self.centre
    }

    fn radius(&self) -> f64 {
        self.radius
    }
}

impl GaussianKernel {
    /// Gaussian `index` of a capture; `None` where it is too faint, or not finite.
    pub(in crate::reference) fn of(gaussians: &Gaussians, drawing: &Drawing, index: u32) -> Option<Self> {
        let i = index as usize;
        let sigma = gaussians.sigma[i].as_dvec3();
        let axes = DMat3::from_quat(gaussians.rotation[i].as_dquat().normalize()) * DMat3::from_diagonal(sigma);
        let s = axes * axes.transpose();
        let opacity = f64::from(gaussians.opacity[i]) * drawing.opacity;
        // A little more than the exact reach: alpha itself is compared where the Gaussian is seen.
        let reach = 2.0 * libm::log(opacity / LEAST_ALPHA) + 1e-9;
        let kernel = Self {
            centre: gaussians.position[i],
            index,
            covariance: [s.x_axis.x, s.x_axis.y, s.x_axis.z, s.y_axis.y, s.y_axis.z, s.z_axis.z],
            opacity,
            reach,
            radius: sigma.max_element() * reach.max(0.0).sqrt(),
        };
        kernel.is_visible().then_some(kernel)
    }

    fn is_visible(&self) -> bool {
        self.reach >= 0.0
            && self.reach.is_finite()
            && self.radius.is_finite()
            && self.centre.is_finite()
            && self.covariance.iter().all(|value| value.is_finite())
    }
}

impl Node {
    fn of_kernels<K: Placed>(kernels: &[K]) -> Self {
        kernels
            .iter()
            .map(|k| Self { low: k.centre(), high: k.centre(), radius: k.radius() })
            .fold(Self::NOTHING, Self::union)
    }

    fn of_nodes(nodes: &[Self]) -> Self {
        nodes.iter().copied().fold(Self::NOTHING, Self::union)
    }

    const NOTHING: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY, radius: 0.0 };

    fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high), radius: self.radius.max(other.radius) }
    }
}

/// Place along a Z-order curve in the box.
fn along_curve(p: Vec3, low: Vec3, high: Vec3) -> u64 {
    const CELLS: f64 = 2_097_151.0;
    let size = (high.as_dvec3() - low.as_dvec3()).max_element().max(f64::MIN_POSITIVE);
    let cell = (p.as_dvec3() - low.as_dvec3()) / size * CELLS;
    let spread = |x: f64| {
        let mut x = x as u64 & 0x1f_ffff;
        for (shift, mask) in [
            (32, 0x001f_0000_0000_ffff),
            (16, 0x001f_0000_ff00_00ff),
            (8, 0x100f_00f0_0f00_f00f),
            (4, 0x10c3_0c30_c30c_30c3),
            (2, 0x1249_2492_4924_9249),
        ] {
            x = (x | x << shift) & mask;
        }
        x
    };
    spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2
}
