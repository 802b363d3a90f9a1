//! Chunks: the runs of surfels that are projected together.

use std::ops::Range;

use crate::frame::{Frame, FrameObject, PosedGroup};
use crate::plan::Objects;

/// Surfels of a chunk.
pub(in crate::backend) const CHUNK: usize = 4096;

/// Some surfels of one object at one sample of a group.
#[derive(Clone, Debug)]
pub(in crate::backend) struct Chunk {
    /// The first one for static objects.
    pub sample: usize,
    pub object: usize,
    pub surfels: Range<usize>,
}

/// The chunks of some objects of a group, in the order of sums: static objects first, once for all samples.
pub(in crate::backend) fn chunks(frame: &Frame, group: &PosedGroup, objects: Objects) -> Vec<Chunk> {
    let of_static = (objects != Objects::Moving).then_some((0, true));
    let of_moving = (0..group.samples.len()).filter(|_| objects != Objects::Static).map(|sample| (sample, false));
    let kinds = of_static.into_iter().chain(of_moving);
    let see_through = objects == Objects::SeeThrough;
    kinds.flat_map(|(sample, fixed)| of_sample(frame, group, sample, fixed, see_through)).collect()
}

/// The chunks of the visible objects that are static, or are not, and see-through, or are not, at one sample.
fn of_sample(
    frame: &Frame,
    group: &PosedGroup,
    sample: usize,
    fixed: bool,
    see_through: bool,
) -> impl Iterator<Item = Chunk> {
    let objects = group.samples[sample].objects.iter().zip(&frame.objects).enumerate();
    let wanted = move |object: &FrameObject| object.is_static == fixed && object.see_through == see_through;
    let visible = objects.filter(move |(_, (pose, object))| pose.visible && wanted(object));
    visible.flat_map(move |(index, (_, object))| {
        let len = object.surfels.len();
        (0..len).step_by(CHUNK).map(move |first| {
            let surfels = first..(first + CHUNK).min(len);
            Chunk { sample, object: index, surfels }
        })
    })
}
