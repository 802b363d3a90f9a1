//! What lies still, splatted once for all groups that share a sample position (docs/architecture.md, "What lies still").
//! Twin: src/backend/cpu/layer.rs.
//!
//! Its waves go through the passes alone, and what those make of it is kept. Then each group starts from its thresholds, recalls
//! the sums of what is still visible, and adds anew where only some of it is.

use wgpu::{CommandEncoder, ComputePassDescriptor};

use super::Machine;
use super::clock::Marks;
use super::execute::{Work, dispatch, view_offset};
use super::schedule::THRESHOLD_BYTES;
use super::waves::Wave;
use crate::plan::Pass;

/// Passes of what lies still, to be kept.
pub(super) const KEEPING: [Pass; 4] = [Pass::Project, Pass::Bin, Pass::Visibility, Pass::Attribute];

impl Machine {
    /// Keeps wave `number` of what lies still, after its attributes were added; thresholds with the last one.
    pub(super) fn keep(&self, encoder: &mut CommandEncoder, work: &Work<'_>, wave: &Wave, number: usize) {
        let b = &self.buffers;
        let kept = &b.kept[number];
        let slots = u64::from(wave.slots);
        let values = 4 * u64::from(work.execution.channels.values) * slots;
        let starts = 4 * (work.area().len() + 2);
        for (from, to, bytes) in [
            (&b.splats, &kept.splats, slots * work.execution.schedule.splat_bytes),
            (&b.lists[0], &kept.list, 4 * b.entries),
            (&b.wide, &kept.wide, 4 * slots),
            (&b.starts, &kept.starts, starts),
            (&b.values, &kept.values, values),
            (&b.thresholds, &b.layer_thresholds, THRESHOLD_BYTES * work.area().len()),
        ] {
            encoder.copy_buffer_to_buffer(from, 0, to, 0, bytes);
        }
    }

    /// Lets a pass start from what lies still, which `kept` waves hold.
    pub(super) fn recall(
        &self,
        encoder: &mut CommandEncoder,
        pass: Pass,
        work: &Work<'_>,
        kept: usize,
        marks: &mut Marks,
    ) {
        let (b, area) = (&self.buffers, work.area());
        match (pass, &work.steps.layer) {
            (Pass::Visibility, _) => {
                let bytes = THRESHOLD_BYTES * area.len();
                encoder.copy_buffer_to_buffer(&b.layer_thresholds, 0, &b.thresholds, 0, bytes);
            }
            (Pass::Attribute, Some(layer)) => {
                let timestamp_writes = marks.mark(pass);
                let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
                dispatch(&mut recorder, &layer.recall, area.tiles, 0);
                for (number, anew) in layer.anew[..kept].iter().enumerate() {
                    dispatch(&mut recorder, anew, area.tiles, view_offset(number));
                }
            }
            _ => {}
        }
    }
}
