//! What passes that add up attributes need beside splats and depths, and how they add.

use glam::Mat3;

use super::patch;
use super::tiles::LANES;
use crate::layout::Channels;

/// What the pass needs beside splats and thresholds.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Attributes<'a> {
    pub channels: &'a Channels,
    /// The sample's share of its group's weight.
    pub share: f32,
    /// A number for each channel of each splat.
    pub values: &'a [f32],
    /// The axes of the object's camera in the world, as [`PosedObject::world_from_view`].
    pub world_from_view: Mat3,
}

impl Attributes<'_> {
    /// Numbers for the channels of splat `splat` of the chunk.
    #[inline(always)]
    pub(in crate::backend) fn of(&self, splat: u32) -> &[f32] {
        let count = self.channels.count;
        &self.values[splat as usize * count..][..count]
    }
}

/// plane += weights * value, for the patch that starts where `plane` does, of rows `stride` apart.
#[inline(always)]
pub(in crate::backend) fn add_patch<const W: usize>(
    plane: &mut [f32],
    stride: usize,
    weights: &[f32; LANES],
    value: f32,
) {
    let mut sum = patch::load::<W>(plane, stride);
    for l in 0..LANES {
        sum[l] += weights[l] * value;
    }
    patch::store::<W>(plane, stride, &sum);
}

/// plane += weights * value, for the first `LANES` pixels of `plane`.
#[inline(always)]
pub(in crate::backend) fn add(plane: &mut [f32], weights: &[f32; LANES], value: f32) {
    if let Some(plane) = plane.first_chunk_mut::<LANES>() {
        let old = *plane;
        for l in 0..LANES {
            plane[l] = old[l] + weights[l] * value;
        }
    }
}
