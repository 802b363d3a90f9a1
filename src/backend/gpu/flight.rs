//! A frame on its way: what the host needs to make a picture of its film once the device is done.

use wgpu::{Buffer, BufferUsages, MapMode, PollType, SubmissionIndex};

use super::Gpu;
use super::buffers::grow;
use super::clock::Marks;
use super::device::Device;
use super::execute::Execution;
use super::film::DeviceFilm;
use super::layout::Status;
use super::schedule::RasterFilm;
use crate::backend::{BackendError, Rendered, Stats};
use crate::film::{Aov, Background, develop};
use crate::frame::{Blocks, Frame};

/// Where a frame's film, status and marks go; used again by a later frame.
#[derive(Debug)]
pub(super) struct Landing {
    /// Film, then status.
    staging: Buffer,
    marks: Marks,
}

/// A frame that was submitted.
#[derive(Debug)]
pub(super) struct Flight {
    landing: Landing,
    submission: SubmissionIndex,
    size: [u32; 2],
    stride: usize,
    samples: u32,
    aovs: Vec<Aov>,
    background: Background,
    /// Blocks that were; `None`: all.
    wanted: Option<Blocks>,
    rasters: Vec<RasterFilm>,
    planes: usize,
    film_bytes: u64,
    stats: Stats,
    /// Entries that there was room for, most that may be made room for, and slots of a wave.
    entries: u64,
    most_entries: u64,
    slots: u64,
}

impl Landing {
    fn new(device: &Device) -> Result<Self, BackendError> {
        let staging = device.buffer("the film's copy", 0, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?;
        Ok(Self { staging, marks: Marks::new(device)? })
    }
}

impl Gpu {
    /// Submits everything that a frame takes.
    pub(super) fn depart(&mut self, frame: &Frame<'_>) -> Result<Flight, BackendError> {
        let execution = self.prepare(frame)?;
        let mut landing = match self.landings.pop() {
            Some(landing) => landing,
            None => Landing::new(&self.machine.device)?,
        };
        self.submit(&execution, &mut landing.marks)?;
        let Execution { planes, schedule, .. } = execution;
        let (device, buffers) = (&self.machine.device, &self.machine.buffers);
        let status_bytes = size_of::<Status>() as u64;
        grow(device, &mut landing.staging, "the film's copy", schedule.film_bytes + status_bytes)?;
        let mut encoder = self.machine.encoder();
        if schedule.film_bytes > 0 {
            encoder.copy_buffer_to_buffer(&buffers.film, 0, &landing.staging, 0, schedule.film_bytes);
        }
        encoder.copy_buffer_to_buffer(&buffers.status, 0, &landing.staging, schedule.film_bytes, status_bytes);
        let submission = device.queue.submit([encoder.finish()]);
        landing.staging.map_async(MapMode::Read, .., |_| ());
        landing.marks.ask();
        device.check()?;
        Ok(Flight {
            landing,
            submission,
            size: frame.size,
            stride: frame.stride as usize,
            samples: frame.samples(),
            aovs: frame.aovs.to_vec(),
            background: frame.background,
            wanted: frame.wanted.clone(),
            rasters: schedule.rasters,
            planes: planes.count,
            film_bytes: schedule.film_bytes,
            stats: Stats::of(frame),
            entries: buffers.entries,
            most_entries: schedule.most_entries,
            slots: schedule.slots,
        })
    }

    /// Waits for a frame. `None`: lists outgrew their buffers and were left empty; now there is more room, or waves are smaller,
    /// and the frame must be rendered again.
    pub(super) fn land(&mut self, flight: Flight) -> Result<Option<Rendered>, BackendError> {
        let device = &self.machine.device;
        let wait = PollType::Wait { submission_index: Some(flight.submission.clone()), timeout: None };
        device.handle.poll(wait).map_err(|e| device.error(e.to_string()))?;
        device.check()?;
        let mut stats = flight.stats;
        let staging = &flight.landing.staging;
        let view = staging.get_mapped_range(..).map_err(|e| device.error(format!("cannot read the film: {e}")))?;
        let (film, rest) = view.split_at(flight.film_bytes as usize);
        let status = bytemuck::pod_read_unaligned::<Status>(&rest[..size_of::<Status>()]);
        let wanted = u64::from(status.most_entries);
        let fits = wanted <= flight.entries;
        let picture = fits.then(|| {
            let film = DeviceFilm {
                rasters: &flight.rasters,
                stride: flight.stride,
                planes: flight.planes,
                samples: flight.samples,
                values: bytemuck::cast_slice(film),
            };
            let width = flight.size[0] as usize;
            let wanted = |y| Blocks::columns(flight.wanted.as_ref(), y, width, flight.stride);
            develop(&film, flight.size, &flight.aovs, flight.background, wanted, None)
        });
        drop(view);
        staging.unmap();
        stats.splats = u64::from(status.splats_high) << 32 | u64::from(status.splats_low);
        flight.landing.marks.add_to(&mut stats);
        self.landings.push(flight.landing);
        if wanted <= flight.most_entries {
            self.wanted_entries = self.wanted_entries.max(if fits { 0 } else { wanted + wanted / 4 });
        } else if flight.slots > 1 {
            // In the end each splat's entries fit.
            self.most_slots = self.most_slots.min(flight.slots / 2);
        } else {
            let what = format!("lists of {wanted} entries do not fit into its buffers");
            return Err(self.machine.device.error(what));
        }
        Ok(picture.map(|picture| Rendered { picture, stats }))
    }
}
