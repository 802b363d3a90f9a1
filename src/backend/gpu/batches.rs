//! How a group is cut up: its surfels into batches, and batches into segments.

use std::ops::Range;

use super::layout::{Segment, records};
use super::memory::Schedule;
use super::models::ModelBuffer;
use super::prepared::Prepared;
use crate::backend::clusters::{CLUSTER_SURFELS, Window};
use crate::frame::{PixelRect, PosedGroup, Raster};
use crate::scene::SurfelModel;

/// Gaps of unwanted surfels that are shorter than this are projected too, because a segment of its own costs more.
const GAP: usize = 1 << 12;

/// Surfels that go through the passes together.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Batch {
    pub slots: u32,
    /// Slots and segments that are at rest: they come first.
    pub at_rest: (u32, usize),
    /// Segments, with the object and the surfel buffer of each.
    pub segments: Vec<(Segment, usize, usize)>,
    /// The turn of the last segment.
    pub last_turn: u32,
}

impl Batch {
    /// Does the same rest in `other`, at the same place, in the same slots?
    pub(in crate::backend) fn rests_as(&self, other: &Self) -> bool {
        let (_, count) = self.at_rest;
        self.at_rest == other.at_rest && self.segments[..count] == other.segments[..count]
    }

    /// Two batches: of what is at rest, and of what moves. `first`: the index of the first segment of each.
    pub(in crate::backend) fn parted(&self, first: u32) -> [Self; 2] {
        let (slots, count) = self.at_rest;
        let (rest, moving) = self.segments.split_at(count);
        let move_up = |(at, &(segment, object, buffer)): (u32, &(Segment, usize, usize))| {
            let segment = Segment { first_slot: segment.first_slot - slots, index: first + at, ..segment };
            (segment, object, buffer)
        };
        [
            Self { slots, at_rest: self.at_rest, segments: rest.to_vec(), last_turn: 0 },
            Self {
                slots: self.slots - slots,
                segments: (0..).zip(moving).map(move_up).collect(),
                last_turn: self.last_turn,
                ..Self::default()
            },
        ]
    }
}

impl Schedule {
    /// The surfels of a group in batches, opaque or see-through: static objects first, once for all samples.
    pub(in crate::backend) fn batches(
        &self,
        prepared: &Prepared<'_>,
        raster: &Raster,
        group: &PosedGroup,
        see_through: bool,
    ) -> Vec<Batch> {
        let visible = |sample: usize, fixed: bool| {
            let some = prepared.frame.visible_surfels(&group.samples[sample], fixed, see_through);
            some.map(move |(object, model)| (sample, object, model))
        };
        let moving = (0..group.samples.len()).flat_map(|sample| visible(sample, false));
        // The first entries hold the weights of samples.
        let index = group.samples.len() as u32;
        let cutter = Cutter { prepared, raster, group, most: self.surfel_slots as usize, index };
        let mut batches = cutter.cut(visible(0, true).chain(moving));
        if let Some(last) = batches.last_mut() {
            last.last_turn = group.samples.len() as u32 + 1;
        }
        batches
    }
}

/// Cuts objects into segments and batches.
struct Cutter<'a> {
    prepared: &'a Prepared<'a>,
    raster: &'a Raster,
    group: &'a PosedGroup,
    /// Most slots of a batch.
    most: usize,
    /// Index of the next segment.
    index: u32,
}

impl Cutter<'_> {
    /// The runs of a surfel buffer that are wanted.
    fn parts(&self, sample: usize, object: usize, moves: bool, buffer: &ModelBuffer) -> Vec<Range<usize>> {
        let frame = self.prepared.frame;
        // The window knows no motion of points.
        let still = self.prepared.clusters.get(object).filter(|_| !moves);
        let Some(clusters) = still else { return vec![buffer.surfels.clone()] };
        let raster = self.raster;
        let one_sided = !frame.objects[object].two_sided;
        let object = &self.group.samples[sample].objects[object];
        let blocks = frame.wanted.as_ref();
        let eyes = object.eyes();
        let window =
            Window { object, eyes, raster, pixels: PixelRect::of_image(raster.size), near: frame.near, blocks };
        let mut parts: Vec<Range<usize>> = Vec::new();
        for cluster in buffer.surfels.start / CLUSTER_SURFELS..buffer.surfels.end.div_ceil(CLUSTER_SURFELS) {
            if !clusters.may_show(cluster, &window, one_sided) {
                continue;
            }
            let first = (cluster * CLUSTER_SURFELS).max(buffer.surfels.start);
            let end = ((cluster + 1) * CLUSTER_SURFELS).min(buffer.surfels.end);
            match parts.last_mut() {
                Some(part) if first - part.end <= GAP => part.end = end,
                _ => parts.push(first..end),
            }
        }
        parts
    }

    /// Cuts `objects`, each given by sample, object and surfels, into batches.
    fn cut<'s>(mut self, objects: impl Iterator<Item = (usize, usize, &'s SurfelModel)>) -> Vec<Batch> {
        let total: f32 = self.group.samples.iter().map(|sample| sample.weight).sum();
        let mut batches: Vec<Batch> = Vec::new();
        for (sample, object, model) in objects {
            let posed = &self.group.samples[sample];
            let (pose, of_frame) = (&posed.objects[object], &self.prepared.frame.objects[object]);
            let (turn, share) = if of_frame.is_static {
                (0, 1.0)
            } else {
                (sample as u32 + 1, if total > 0.0 { posed.weight / total } else { 1.0 })
            };
            let template = Segment::posed(pose, of_frame, model.surfels(), turn, share);
            for (number, buffer) in self.prepared.surfel_buffers[object].iter().enumerate() {
                for part in self.parts(sample, object, !model.paths().is_empty(), buffer) {
                    let mut first = part.start - buffer.surfels.start;
                    let end = part.end - buffer.surfels.start;
                    while first < end {
                        if batches.last().is_none_or(|batch| batch.slots as usize >= self.most) {
                            batches.push(Batch::default());
                        }
                        let Some(batch) = batches.last_mut() else { break };
                        let surfels = (end - first).min(self.most - batch.slots as usize);
                        let segment = Segment {
                            first_slot: batch.slots,
                            first_surfel: first as u32,
                            surfels: surfels as u32,
                            buffer_surfels: buffer.surfels.len() as u32,
                            buffer_start: buffer.surfels.start as u32,
                            index: self.index,
                            first_light: (sample * records(&posed.lights)) as u32,
                            ..template
                        };
                        batch.segments.push((segment, object, number));
                        batch.slots += surfels as u32;
                        if turn == 0 {
                            batch.at_rest = (batch.slots, batch.segments.len());
                        }
                        batch.last_turn = turn;
                        first += surfels;
                        self.index += 1;
                    }
                }
            }
        }
        batches
    }
}
