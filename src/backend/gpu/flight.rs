//! Submissions: what the host needs to develop the film of a frame once the device is done.

use wgpu::{Buffer, BufferUsages, SubmissionIndex};

use super::Gpu;
use super::buffers::grow;
use super::device::Device;
use super::film::DeviceFilm;
use super::layout::Status;
use super::memory::RasterFilm;
use super::prepared::Prepared;
use super::slots::Slot;
use super::timestamps::Marks;
use crate::backend::{BackendError, GpuCalls, Rendered, Stats};
use crate::film::develop;
use crate::frame::{Blocks, Frame};

/// Where a frame's film, status and marks go. A later frame uses it again.
#[derive(Debug)]
pub(in crate::backend) struct Landing {
    /// Film, then status.
    staging: Buffer,
    marks: Marks,
}

/// A frame that was submitted.
#[derive(Debug)]
pub(in crate::backend) struct Flight {
    landing: Landing,
    submission: SubmissionIndex,
    /// Calls so far, of this try and of those before.
    calls: GpuCalls,
    /// The frame that was submitted. It is submitted again if its lists outgrow their buffers.
    frame: Frame,
    rasters: Vec<RasterFilm>,
    planes: usize,
    film_bytes: u64,
    /// Entries that there was room for, most entries that there can be room for, and slots of a batch.
    entries: u64,
    most_entries: u64,
    slots: u64,
    surfel_slots: u64,
    /// Groups of a round.
    groups: u64,
    /// Entries of the longest list that programs walk over to its end.
    most_list: u64,
}

impl Landing {
    fn new(device: &Device) -> Result<Self, BackendError> {
        let staging = device.buffer("the film's copy", 0, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?;
        Ok(Self { staging, marks: Marks::new(device)? })
    }
}

impl Gpu {
    /// Submits everything that a frame takes.
    pub(in crate::backend) fn depart(&mut self, frame: Frame) -> Result<Flight, BackendError> {
        let before = self.state.device.calls.so_far();
        let prepared = self.prepare(&frame)?;
        let mut landing = match self.landings.pop() {
            Some(landing) => landing,
            None => Landing::new(&self.state.device)?,
        };
        landing.marks.begin(&self.state.device, prepared.most_passes())?;
        let mut encoder = self.record(&prepared, &mut landing.marks)?;
        let wanted = prepared.wanted_film();
        let Prepared { planes, schedule, most_list, .. } = prepared;
        let (device, buffers) = (&self.state.device, &self.state.buffers);
        let status_bytes = size_of::<Status>() as u64;
        grow(device, &mut landing.staging, "the film's copy", schedule.film_bytes + status_bytes)?;
        for run in &wanted {
            encoder.copy_buffer_to_buffer(
                &buffers[Slot::Film],
                run.start,
                &landing.staging,
                run.start,
                run.end - run.start,
            );
        }
        let copied = status_bytes + wanted.iter().map(|run| run.end - run.start).sum::<u64>();
        encoder.copy_buffer_to_buffer(&buffers[Slot::Status], 0, &landing.staging, schedule.film_bytes, status_bytes);
        let submission = device.submit([encoder]);
        device.map(&landing.staging, copied);
        landing.marks.ask(device);
        device.check()?;
        let calls = device.calls.since(&before);
        Ok(Flight {
            calls,
            landing,
            submission,
            rasters: schedule.rasters,
            planes: planes.count,
            film_bytes: schedule.film_bytes,
            entries: buffers.entries,
            most_entries: schedule.most_entries,
            slots: schedule.slots,
            surfel_slots: schedule.surfel_slots,
            groups: schedule.round_groups,
            most_list,
            frame,
        })
    }

    /// Waits for a frame. Lists that outgrew their buffers were left empty. Then the frame is submitted again, with
    /// more room or in smaller batches, until they fit.
    pub(in crate::backend) fn land(&mut self, mut flight: Flight) -> Result<Rendered, BackendError> {
        let mut others_follow = !self.flights.is_empty();
        loop {
            match self.try_land(flight, others_follow)? {
                Ok(rendered) => return Ok(rendered),
                Err((frame, calls)) => {
                    // The others were submitted before.
                    (flight, others_follow) = (self.depart(frame)?, false);
                    flight.calls += calls;
                }
            }
        }
    }

    /// Waits for a frame. Returns the frame itself, and the calls so far, if it must be submitted again.
    fn try_land(
        &mut self,
        flight: Flight,
        others_follow: bool,
    ) -> Result<Result<Rendered, (Frame, GpuCalls)>, BackendError> {
        let device = &self.state.device;
        let before = device.calls.so_far();
        device.wait_until(flight.submission.clone(), others_follow)?;
        let frame = flight.frame;
        let mut calls = flight.calls;
        calls += device.calls.since(&before);
        let staging = &flight.landing.staging;
        let view = staging.get_mapped_range(..).map_err(|e| device.error(format!("cannot read the film: {e}")))?;
        let (film, rest) = view.split_at(flight.film_bytes as usize);
        let status = bytemuck::pod_read_unaligned::<Status>(&rest[..size_of::<Status>()]);
        let wanted = u64::from(status.most_entries);
        let (has_room, has_turns) = (wanted <= flight.entries, u64::from(status.longest) <= flight.most_list);
        let fits = has_room && has_turns;
        calls += status.count();
        let mut stats = Stats { gpu: Some(calls), ..Stats::of(&frame) };
        let picture = fits.then(|| {
            let film = DeviceFilm {
                rasters: &flight.rasters,
                stride: frame.stride as usize,
                planes: flight.planes,
                samples: frame.samples(),
                values: bytemuck::cast_slice(film),
            };
            let (width, stride) = (frame.size[0] as usize, frame.stride as usize);
            let wanted = |y| Blocks::columns(frame.wanted.as_ref(), y, width, stride);
            develop(&film, frame.size, &frame.aovs, &frame.behind_film(), wanted, None)
        });
        drop(view);
        staging.unmap();
        stats.splats = u64::from(status.splats_high) << 32 | u64::from(status.splats_low);
        stats.left_out = u64::from(status.left_out_high) << 32 | u64::from(status.left_out_low);
        flight.landing.marks.add_to(&mut stats);
        self.landings.push(flight.landing);
        if has_turns && wanted <= flight.most_entries {
            self.wanted_entries = self.wanted_entries.max(if fits { 0 } else { wanted + wanted / 4 });
        } else if !has_turns && flight.surfel_slots > flight.most_list {
            // Lists grow about as batches do. No list has more entries than its batch has slots.
            let share = flight.most_list as f64 / f64::from(status.longest);
            let shorter = (0.8 * share * flight.surfel_slots as f64) as u64;
            self.most_surfel_slots = self.most_surfel_slots.min(shorter.max(flight.most_list)).max(1);
        } else if flight.groups > 1 {
            self.most_groups = self.most_groups.min(flight.groups / 2);
        } else if flight.slots > 1 {
            // This ends: a batch of one splat has few entries.
            self.most_slots = self.most_slots.min(flight.slots / 2);
        } else {
            let what = if has_turns {
                format!("lists of {wanted} entries do not fit into its buffers")
            } else {
                format!("a list of {} entries is longer than its loops", status.longest)
            };
            return Err(self.state.device.error(what));
        }
        Ok(picture.map(|picture| Rendered { picture, stats }).ok_or((frame, calls)))
    }
}
