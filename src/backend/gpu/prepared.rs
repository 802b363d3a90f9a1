//! A frame that is cut up, with its models on the device and room for everything.

use std::sync::Arc;

use super::bind::{Binder, BoundPrograms};
use super::buffers::grow;
use super::layout::{TILE, wanted};
use super::memory::{Band, DeviceChannels, ENTRIES_PER_SLOT, Limits, Schedule};
use super::models::SurfelBuffer;
use super::timestamps::Marks;
use super::{DeviceState, Gpu};
use crate::backend::BackendError;
use crate::backend::clusters::Clusters;
use crate::film::FilmPlanes;
use crate::frame::{Blocks, Frame, FrameObject};
use crate::plan::Objects;

/// What stays the same while a frame is rendered.
pub(in crate::backend) struct Prepared<'a> {
    pub frame: &'a Frame,
    pub channels: DeviceChannels,
    pub planes: FilmPlanes,
    /// Of each object.
    pub surfel_buffers: Vec<Vec<SurfelBuffer>>,
    /// Likewise, where only some blocks of the image are wanted.
    pub clusters: Vec<Arc<Clusters>>,
    pub schedule: Schedule,
}

impl Gpu {
    /// Cuts the frame up and makes room for it.
    pub(in crate::backend) fn prepare<'a>(&mut self, frame: &'a Frame) -> Result<Prepared<'a>, BackendError> {
        let channels = DeviceChannels::of(frame);
        let planes = frame.film_planes();
        let limits = Limits { bytes: self.most_bytes, slots: self.most_slots };
        let mut schedule = Schedule::new(frame, &channels, &planes, limits)?;
        schedule.most_entries = schedule.most_entries.min(self.most_entries);
        let DeviceState { device, models, buffers, .. } = &mut self.state;
        let upload = |object: &FrameObject| models.surfel_buffers(device, &object.surfels);
        let surfel_buffers = frame.objects.iter().map(upload).collect::<Result<Vec<_>, _>>()?;
        buffers.fit(device, &schedule, &channels)?;
        let entries = (ENTRIES_PER_SLOT * schedule.slots).min(self.first_entries).max(self.wanted_entries);
        buffers.fit_entries(device, entries.min(schedule.most_entries))?;
        buffers.fit_cached(device, &schedule, &channels)?;
        let wanted = wanted(frame);
        grow(device, &mut buffers.wanted, "blocks", 4 * wanted.len() as u64)?;
        device.queue.write_buffer(&buffers.wanted, 0, bytemuck::cast_slice(&wanted));
        let in_part = frame.wanted.is_some() && frame.swept.is_none();
        let clusters = if in_part { self.clusters.of_frame(frame) } else { Vec::new() };
        Ok(Prepared { frame, channels, planes, surfel_buffers, clusters, schedule })
    }

    /// Makes room for the uniforms of the largest group and for all marks; binds the programs.
    pub(in crate::backend) fn bind(
        &mut self,
        prepared: &Prepared<'_>,
        marks: &mut Marks,
    ) -> Result<BoundPrograms, BackendError> {
        let Prepared { frame, schedule, .. } = prepared;
        let mut most = [0_usize; 3];
        let mut passes = 0;
        for position in frame.positions() {
            for group in &position.groups {
                // Cut in two there may be a view more.
                let batches = schedule.batches(prepared, &position.raster, group, Objects::All, false);
                let views = batches.run.len() + 2;
                let segments = group.samples.len() + batches.segments().count() + views;
                let lights = group.samples.iter().map(|sample| sample.lights.len()).sum();
                most = [most[0].max(views), most[1].max(segments), most[2].max(lights)];
                passes += 14 * views + 4;
            }
        }
        let bands: usize = (0..schedule.rasters.len()).map(|raster| schedule.bands(raster).count()).max().unwrap_or(0);
        let DeviceState { device, buffers, pipelines, .. } = &mut self.state;
        buffers.fit_group(device, most[0], most[1], most[2])?;
        marks.begin(device, passes * bands)?;
        Binder { device, pipelines, buffers }.bind(prepared)
    }
}

impl Prepared<'_> {
    /// Is any block of the band wanted?
    pub(in crate::backend) fn wants(&self, band: Band) -> bool {
        let wanted = self.frame.wanted.as_ref().filter(|_| self.frame.swept.is_none());
        let rows = [band.first_row, band.first_row + band.rows - 1].map(|row| (row * TILE) as usize / Blocks::EDGE);
        wanted.is_none_or(|blocks| (rows[0]..=rows[1]).any(|y| (0..blocks.width).any(|x| blocks.at(x, y))))
    }

    /// First byte and length of what each band has of the film.
    pub(in crate::backend) fn film_parts(&self) -> Vec<(u64, u64)> {
        let mut parts = Vec::new();
        for (index, raster) in self.schedule.rasters.iter().enumerate() {
            let row = u64::from(raster.tiles[0]) * u64::from(TILE * TILE) * 4 * self.planes.count as u64;
            for band in self.schedule.bands(index) {
                parts.push((4 * raster.start + u64::from(band.first_row) * row, u64::from(band.rows) * row));
            }
        }
        parts
    }
}
