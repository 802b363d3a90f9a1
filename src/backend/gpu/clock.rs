//! Time of passes, measured by the device where it can.

use std::time::Duration;

use wgpu::{Buffer, BufferUsages, CommandEncoder, ComputePassTimestampWrites, QuerySet};

use super::device::Device;
use crate::backend::{BackendError, Stats};
use crate::plan::Pass;

/// Marks of one submission; the most that every device has.
const MARKS: u32 = 4096;

/// Begin and end of passes of a frame.
#[derive(Debug)]
pub(super) struct Clock {
    queries: QuerySet,
    /// Where a submission's marks are resolved to.
    resolved: Buffer,
    /// All marks of the frame, for the host.
    marks: Buffer,
    /// Passes since the last `collect`, then those before.
    pending: Vec<Pass>,
    passes: Vec<Pass>,
    /// Nanoseconds of a tick.
    period: f64,
}

impl Clock {
    /// `None` where the device measures nothing.
    pub(super) fn new(device: &Device) -> Result<Option<Self>, BackendError> {
        if !device.timestamps {
            return Ok(None);
        }
        let bytes = u64::from(MARKS) * 8;
        Ok(Some(Self {
            queries: device.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("marks"),
                ty: wgpu::QueryType::Timestamp,
                count: MARKS,
            }),
            resolved: device.buffer("marks", bytes, BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC)?,
            marks: device.buffer("marks", bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?,
            pending: Vec::new(),
            passes: Vec::new(),
            period: f64::from(device.queue.get_timestamp_period()),
        }))
    }

    /// Starts a frame of at most `passes` passes.
    pub(super) fn begin(&mut self, device: &Device, passes: usize) -> Result<(), BackendError> {
        self.pending.clear();
        self.passes.clear();
        let bytes = 16 * passes as u64;
        if self.marks.size() < bytes {
            self.marks = device.buffer("marks", bytes, self.marks.usage())?;
        }
        Ok(())
    }

    /// Marks for the next pass; none where there are too many since the last `collect`, which are not measured.
    pub(super) fn mark(&mut self, pass: Pass) -> Option<ComputePassTimestampWrites<'_>> {
        let next = 2 * self.pending.len() as u32;
        let room = next + 2 <= MARKS && self.marks.size() >= 16 * (self.passes.len() + self.pending.len() + 1) as u64;
        room.then(|| {
            self.pending.push(pass);
            ComputePassTimestampWrites {
                query_set: &self.queries,
                beginning_of_pass_write_index: Some(next),
                end_of_pass_write_index: Some(next + 1),
            }
        })
    }

    /// Collects the marks of a submission at its end.
    pub(super) fn collect(&mut self, encoder: &mut CommandEncoder) {
        let count = 2 * self.pending.len() as u32;
        if count > 0 {
            encoder.resolve_query_set(&self.queries, 0..count, &self.resolved, 0);
            let at = 16 * self.passes.len() as u64;
            encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.marks, at, u64::from(count) * 8);
            self.passes.append(&mut self.pending);
        }
    }

    /// What the host maps after a frame.
    pub(super) fn marks(&self) -> &Buffer {
        &self.marks
    }

    /// Adds the measured times to `stats`.
    pub(super) fn add(&self, marks: &[u64], stats: &mut Stats) {
        for (pass, marks) in self.passes.iter().zip(marks.as_chunks::<2>().0) {
            let ticks = marks[1].saturating_sub(marks[0]);
            let time = Duration::from_nanos((ticks as f64 * self.period) as u64);
            match pass {
                Pass::Project => stats.project += time,
                Pass::Bin => stats.bin += time,
                Pass::Visibility => stats.visibility += time,
                Pass::Attribute => stats.attribute += time,
                Pass::Resolve => stats.resolve += time,
            }
        }
    }
}
