//! How a group is cut up: its surfels into waves, and those into segments.

use std::ops::Range;
use std::sync::Arc;

use super::layout::{Segment, Travel, UNIFORM_STRIDE};
use super::models::Block;
use super::schedule::Schedule;
use crate::backend::clusters::{CLUSTER, Clusters, Window};
use crate::frame::{Frame, PosedGroup};

/// Surfels that are not worth a segment of their own: what is not wanted is projected where it is shorter.
const GAP: usize = 1 << 12;

/// Surfels that go through the passes together.
#[derive(Clone, Debug, Default)]
pub(super) struct Wave {
    pub slots: u32,
    /// Segments, with the object and the block of each.
    pub segments: Vec<(Segment, usize, usize)>,
    /// One a segment.
    pub travels: Vec<Travel>,
    /// That of its last segment.
    pub last_turn: u32,
}

/// Which objects of a group its waves hold; what lies still comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Whole,
    /// What lies still alone, to be kept.
    Still,
    /// The rest; what lies still is kept already.
    Moving,
    /// The rest; what lies still has a picture of its own.
    Beside,
}

/// The waves of a group.
#[derive(Clone, Debug)]
pub(super) struct Waves {
    /// Of what is kept already.
    pub kept: Vec<Wave>,
    /// To go through the passes.
    pub waves: Vec<Wave>,
}

impl Waves {
    pub(super) fn segments(&self) -> impl Iterator<Item = &Segment> {
        self.kept.iter().chain(&self.waves).flat_map(|wave| &wave.segments).map(|(segment, _, _)| segment)
    }
}

impl Schedule {
    /// The surfels of `group` in waves; `blocks` are those of each object, and `clusters` where only some blocks of the image are wanted.
    pub(super) fn waves(
        &self,
        frame: &Frame<'_>,
        group: &PosedGroup,
        blocks: &[Vec<Block>],
        clusters: &[Arc<Clusters>],
        part: Part,
    ) -> Waves {
        let objects = |sample: usize, still: bool| {
            let posed = group.samples[sample].objects.iter().zip(&frame.objects).enumerate();
            let some = posed.filter(move |(_, (pose, object))| pose.visible && object.still == still);
            some.map(move |(index, _)| (sample, index))
        };
        let still = || objects(0, true);
        let moving = || (0..group.samples.len()).flat_map(|sample| objects(sample, false));
        // Before the segments come those that hold the weights of samples.
        let mut cutter =
            Cutter { frame, group, blocks, clusters, most: self.slots as usize, index: group.samples.len() as u32 };
        let (kept, mut waves) = match part {
            Part::Whole => (Vec::new(), cutter.cut(still().chain(moving()))),
            Part::Still => (Vec::new(), cutter.cut(still())),
            Part::Moving => (cutter.cut(still()), cutter.cut(moving())),
            Part::Beside => (Vec::new(), cutter.cut(moving())),
        };
        if (!kept.is_empty() || part == Part::Beside) && waves.is_empty() {
            // The samples' turns come nevertheless, and what lies still shows.
            waves.push(Wave::default());
        }
        if let Some(last) = waves.last_mut().filter(|_| part != Part::Still) {
            last.last_turn = group.samples.len() as u32 + 1;
        }
        Waves { kept, waves }
    }
}

/// Cuts objects into segments and waves.
struct Cutter<'a> {
    frame: &'a Frame<'a>,
    group: &'a PosedGroup,
    blocks: &'a [Vec<Block>],
    clusters: &'a [Arc<Clusters>],
    /// Slots of a wave.
    most: usize,
    /// Of the next segment.
    index: u32,
}

impl Cutter<'_> {
    /// The surfels of a block that are wanted.
    fn parts(&self, sample: usize, object: usize, block: &Block) -> Vec<Range<usize>> {
        let Some((clusters, blocks)) = self.clusters.get(object).zip(self.frame.wanted.as_ref()) else {
            return vec![block.surfels.clone()];
        };
        let raster = &self.group.raster;
        let [right, bottom] = raster.size.map(|pixels| pixels as i32 - 1);
        let one_sided = !self.frame.objects[object].two_sided;
        let object = &self.group.samples[sample].objects[object];
        let blocks = Some(blocks);
        let window = Window { object, raster, pixels: [0, right, 0, bottom], near: self.frame.near, blocks };
        let mut parts: Vec<Range<usize>> = Vec::new();
        for cluster in block.surfels.start / CLUSTER..block.surfels.end.div_ceil(CLUSTER) {
            if !clusters.may_show(cluster, &window, one_sided) {
                continue;
            }
            let first = (cluster * CLUSTER).max(block.surfels.start);
            let end = ((cluster + 1) * CLUSTER).min(block.surfels.end);
            match parts.last_mut() {
                Some(part) if first - part.end <= GAP => part.end = end,
                _ => parts.push(first..end),
            }
        }
        parts
    }

    /// `objects`: sample and object of each.
    fn cut(&mut self, objects: impl Iterator<Item = (usize, usize)>) -> Vec<Wave> {
        let total: f32 = self.group.samples.iter().map(|sample| sample.weight).sum();
        let mut waves: Vec<Wave> = Vec::new();
        for (sample, object) in objects {
            let posed = &self.group.samples[sample];
            let (pose, of_frame) = (&posed.objects[object], &self.frame.objects[object]);
            let (turn, share) = if of_frame.still {
                (0, 1.0)
            } else {
                (sample as u32 + 1, if total > 0.0 { posed.weight / total } else { 1.0 })
            };
            let template = Segment::posed(pose, of_frame, turn, share);
            for (number, block) in self.blocks[object].iter().enumerate() {
                for part in self.parts(sample, object, block) {
                    let mut first = part.start - block.surfels.start;
                    let end = part.end - block.surfels.start;
                    while first < end {
                        if waves.last().is_none_or(|wave| wave.slots as usize >= self.most) {
                            waves.push(Wave::default());
                        }
                        let Some(wave) = waves.last_mut() else { break };
                        let surfels = (end - first).min(self.most - wave.slots as usize);
                        let segment = Segment {
                            first_slot: wave.slots,
                            first_surfel: first as u32,
                            surfels: surfels as u32,
                            block: block.surfels.len() as u32,
                            block_start: block.surfels.start as u32,
                            index: self.index,
                            first_light: (sample * posed.lights.len()) as u32,
                            ..template
                        };
                        wave.segments.push((segment, object, number));
                        wave.travels.push(Travel::of(pose));
                        wave.slots += surfels as u32;
                        wave.last_turn = turn;
                        first += surfels;
                        self.index += 1;
                    }
                }
            }
        }
        waves
    }
}

const _: () = assert!(size_of::<Segment>() as u64 == UNIFORM_STRIDE);
