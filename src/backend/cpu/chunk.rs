//! Chunks: the runs of surfels that are projected together.

use std::ops::Range;

use crate::frame::{Frame, FrameObject, PosedGroup};

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

/// The chunks of the surfels of a group, opaque or see-through, in the order of sums: static objects first, once for
/// all samples. Also how many are of static objects.
pub(in crate::backend) fn chunks(frame: &Frame, group: &PosedGroup, see_through: bool) -> (Vec<Chunk>, usize) {
    let mut chunks: Vec<Chunk> = of_sample(frame, group, 0, true, see_through).collect();
    let at_rest = chunks.len();
    chunks.extend((0..group.samples.len()).flat_map(|sample| of_sample(frame, group, sample, false, see_through)));
    (chunks, at_rest)
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
