//! Chunks: the runs of surfels that are projected together.

use std::ops::Range;

use crate::frame::{Frame, PosedGroup};
use crate::scene::SurfelModel;

/// Surfels of a chunk.
pub(in crate::backend) const CHUNK: usize = 4096;

/// Some surfels of one object at one sample of a group.
#[derive(Clone, Debug)]
pub(in crate::backend) struct Chunk<'a> {
    /// The first one for static objects.
    pub sample: usize,
    pub object: usize,
    pub model: &'a SurfelModel,
    pub surfels: Range<usize>,
}

/// The chunks of the surfels of a group, opaque or see-through, in the order of sums: static objects first, once for
/// all samples. Also how many are of static objects.
pub(in crate::backend) fn chunks<'a>(
    frame: &'a Frame,
    group: &PosedGroup,
    see_through: bool,
) -> (Vec<Chunk<'a>>, usize) {
    let mut chunks: Vec<Chunk<'_>> = of_sample(frame, group, 0, true, see_through).collect();
    let at_rest = chunks.len();
    chunks.extend((0..group.samples.len()).flat_map(|sample| of_sample(frame, group, sample, false, see_through)));
    (chunks, at_rest)
}

/// The chunks of the visible objects that are static, or are not, and see-through, or are not, at one sample.
fn of_sample<'a>(
    frame: &'a Frame,
    group: &PosedGroup,
    sample: usize,
    fixed: bool,
    see_through: bool,
) -> impl Iterator<Item = Chunk<'a>> {
    frame.visible_surfels(&group.samples[sample], fixed, see_through).flat_map(move |(object, model)| {
        let len = model.surfels().len();
        (0..len).step_by(CHUNK).map(move |first| {
            let surfels = first..(first + CHUNK).min(len);
            Chunk { sample, object, model, surfels }
        })
    })
}
