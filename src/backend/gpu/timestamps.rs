//! Time of passes, measured by devices that can.

use std::time::Duration;

use wgpu::{Buffer, BufferUsages, CommandEncoder, ComputePassTimestampWrites, QuerySet};

use super::buffers::grow;
use super::device::Device;
use crate::backend::{BackendError, Stats};

/// The entry of [`Stats`] that the time of a pass counts for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::backend) enum Stage {
    Project,
    Sort,
    Bin,
    Visibility,
    Attribute,
    Composite,
    Resolve,
}

/// Marks of one submission. Every device has as many.
const MARKS: u32 = 4096;

/// Begin and end of the passes of one frame.
#[derive(Debug)]
pub(in crate::backend) struct Marks {
    clock: Option<Clock>,
    /// Passes since the last `collect`, and those before it.
    pending: Vec<Stage>,
    passes: Vec<Stage>,
}

#[derive(Debug)]
struct Clock {
    queries: QuerySet,
    /// Where a submission's marks are resolved to.
    resolved: Buffer,
    /// All marks of the frame, for the host.
    marks: Buffer,
    /// Nanoseconds of a tick.
    period: f64,
}

impl Marks {
    /// Marks for a frame. There are none if the device measures nothing.
    pub(in crate::backend) fn new(device: &Device) -> Result<Self, BackendError> {
        let bytes = u64::from(MARKS) * 8;
        let clock = if device.timestamps {
            Some(Clock {
                queries: device.handle.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("marks"),
                    ty: wgpu::QueryType::Timestamp,
                    count: MARKS,
                }),
                resolved: device.buffer("marks", bytes, BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC)?,
                marks: device.buffer("marks", bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?,
                period: device.tick(),
            })
        } else {
            None
        };
        Ok(Self { clock, pending: Vec::new(), passes: Vec::new() })
    }

    /// Starts a frame of at most `passes` passes.
    pub(in crate::backend) fn begin(&mut self, device: &Device, passes: usize) -> Result<(), BackendError> {
        self.pending.clear();
        self.passes.clear();
        match &mut self.clock {
            Some(clock) => grow(device, &mut clock.marks, "marks", 16 * passes as u64),
            None => Ok(()),
        }
    }

    /// Marks for the next pass. None if there are too many passes since the last `collect`; those are not measured.
    pub(in crate::backend) fn mark(&mut self, stage: Stage) -> Option<ComputePassTimestampWrites<'_>> {
        let clock = self.clock.as_ref()?;
        let next = 2 * self.pending.len() as u32;
        let room = clock.marks.size() >= 16 * (self.passes.len() + self.pending.len() + 1) as u64;
        (room && next + 2 <= MARKS).then(|| {
            self.pending.push(stage);
            ComputePassTimestampWrites {
                query_set: &clock.queries,
                beginning_of_pass_write_index: Some(next),
                end_of_pass_write_index: Some(next + 1),
            }
        })
    }

    /// Are there as many passes since the last `collect` as can be measured?
    pub(in crate::backend) fn is_full(&self) -> bool {
        2 * self.pending.len() + 2 > MARKS as usize
    }

    /// Collects the marks of a submission at its end.
    pub(in crate::backend) fn collect(&mut self, encoder: &mut CommandEncoder) {
        let count = 2 * self.pending.len() as u32;
        if let Some(clock) = self.clock.as_ref().filter(|_| count > 0) {
            encoder.resolve_query_set(&clock.queries, 0..count, &clock.resolved, 0);
            let at = 16 * self.passes.len() as u64;
            encoder.copy_buffer_to_buffer(&clock.resolved, 0, &clock.marks, at, u64::from(count) * 8);
            self.passes.append(&mut self.pending);
        }
    }

    /// Asks for the marks. Call it after the last submission of a frame.
    pub(in crate::backend) fn ask(&self, device: &Device) {
        if let Some(clock) = &self.clock {
            device.map(&clock.marks, clock.marks.size());
        }
    }

    /// Adds the measured times to `stats`. Call it when the device is done.
    pub(in crate::backend) fn add_to(&self, stats: &mut Stats) {
        let Some(clock) = &self.clock else { return };
        if let Ok(marks) = clock.marks.get_mapped_range(..) {
            let marks: &[u64] = bytemuck::cast_slice(&marks);
            for (stage, marks) in self.passes.iter().zip(marks.chunks_exact(2)) {
                let ticks = marks[1].saturating_sub(marks[0]);
                let time = Duration::from_nanos((ticks as f64 * clock.period) as u64);
                match stage {
                    Stage::Project => stats.project += time,
                    Stage::Sort => stats.sort += time,
                    Stage::Bin => stats.bin += time,
                    Stage::Visibility => stats.visibility += time,
                    Stage::Attribute => stats.attribute += time,
                    Stage::Composite => stats.composite += time,
                    Stage::Resolve => stats.resolve += time,
                }
            }
        }
        clock.marks.unmap();
    }
}
