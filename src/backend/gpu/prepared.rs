//! A frame that is cut up, with its models on the device and room for everything.

use std::ops::Range;
use std::sync::Arc;

use wgpu::{Buffer, BufferBinding, BufferSize};

use super::layout::{DeviceGaussian, TILE, wanted};
use super::memory::{Band, DeviceChannels, ENTRIES_PER_SLOT, Limits, Schedule, makes_rounds};
use super::models::ModelBuffer;
use super::shadow_sizes::{DRAWING, Extents, TURNS_OF_TEXEL};
use super::slots::Slot;
use super::{DeviceState, Gpu};
use crate::backend::BackendError;
use crate::backend::clusters::Clusters;
use crate::film::FilmPlanes;
use crate::frame::{Frame, FrameObject, PosedGroup, Raster};
use crate::options::SweptKernel;
use crate::plan::LAYERS;
use crate::scene::SurfelModel;

/// Most passes of a batch that record their times: of opaque surfels, and of see-through ones, whose lists are made
/// again for each layer that reads them.
const PASSES_OF_GROUP: u64 = 20;
const PASSES_OF_LAYERS: u64 = 4 * (4 * LAYERS as u64 + 3);

/// Bytes that are copied for nothing in place of another copy.
const GAP: u64 = 1 << 15;

/// Most stretches of the lists of a batch of kernels in motion. Most lists are much shorter than the batch.
const MOST_STRETCHES: u64 = 32;
/// Turns of a loop that an entry at rest takes at most in each group that shares it: two for each pixel of a tile.
const TURNS_AT_REST: u64 = 600;

/// What stays the same while a frame is rendered.
pub(in crate::backend) struct Prepared<'a> {
    pub frame: &'a Frame,
    pub channels: DeviceChannels,
    /// The channels of see-through surfels, where there are any.
    pub see_through: Option<DeviceChannels>,
    pub planes: FilmPlanes,
    /// The surfel buffers of each object.
    pub surfel_buffers: Vec<Vec<ModelBuffer>>,
    /// The buffers of each object's Gaussians.
    pub gaussian_buffers: Vec<Vec<ModelBuffer>>,
    /// The clusters of each object, where rasters show only a part of the image.
    pub clusters: Vec<Arc<Clusters>>,
    pub schedule: Schedule,
    /// Bytes of a buffer that a program can bind.
    pub most_bytes: u64,
    /// Entries of the longest list of surfels that programs walk over to its end.
    pub most_list: u64,
    /// Most entries that an invocation walks over of kernels in motion, and of Gaussians. Longer lists are walked over
    /// in stretches.
    pub stretch: u64,
    /// How far objects reach, where lights with shadows ask for it.
    pub extents: Extents,
}

impl Gpu {
    /// Cuts the frame up and makes room for it.
    pub(in crate::backend) fn prepare<'a>(&mut self, frame: &'a Frame) -> Result<Prepared<'a>, BackendError> {
        let (channels, see_through) = (DeviceChannels::of(frame), DeviceChannels::see_through(frame));
        let planes = frame.film_planes();
        // An entry takes two turns of a loop. Full EWA walks over a list twice, for the band and for the other layers;
        // over wide splats also where the apron takes its invocations more than one turn.
        // A kernel in motion that a pixel meets takes one turn more for each slice that it touches, or for each
        // sample of its source, and one to find the end; its lists are walked over in stretches. So are those of
        // Gaussians, each of which takes two turns more where layers of surfels may lie before it.
        let layers = see_through.map_or(1, |own| own.layers).max(channels.layers);
        let samples_of_source = frame.swept.map_or(0, |swept| u64::from(swept.source_samples.0));
        let before = if see_through.is_some() { 2 } else { 0 };
        let stretch = (self.most_turns / (3 + before + u64::from(frame.slices()).max(samples_of_source))).max(1);
        let instants = frame.swept.is_none_or(SweptKernel::is_published);
        let filtered = layers > 1 || frame.has_filtered_kernels();
        let most_list = if instants { self.most_turns / if filtered { 4 } else { 2 } } else { u64::MAX };
        // An entry at rest has two turns for each pixel of a tile, in each group that shares it.
        let sharing = if filtered && frame.shares_rest() { self.most_turns / TURNS_AT_REST } else { u64::MAX };
        let most_slots = if frame.swept.is_some() { stretch.saturating_mul(MOST_STRETCHES) } else { u64::MAX };
        let limits = Limits {
            bytes: self.most_bytes,
            slots: self.most_slots.min(most_slots),
            surfel_slots: if instants { self.most_surfel_slots } else { u64::MAX },
            groups: self.most_groups.min(sharing.max(1)),
            // All invocations that draw a surfel may have to take all texels of a light.
            shadow_texels: (self.most_turns / TURNS_OF_TEXEL).saturating_mul(u64::from(DRAWING)).max(1),
        };
        let mut schedule = Schedule::new(frame, &channels, &planes, limits)?;
        schedule.most_entries = schedule.most_entries.min(self.most_entries);
        let DeviceState { device, models, buffers, .. } = &mut self.state;
        let bytes = schedule.gaussians * size_of::<DeviceGaussian>() as u64;
        if bytes > self.most_bytes {
            return Err(device.error(format!(
                "{} Gaussians of captures need a buffer of {bytes} bytes, but a program can bind {}: take `--backend \
                 cpu`, which draws them in slabs of depth",
                schedule.gaussians, self.most_bytes
            )));
        }
        models.begin();
        let filters_all = frame.normalises();
        let filters = |model: &SurfelModel| {
            let see_through =
                frame.objects.iter().filter(|object| object.see_through).filter_map(|object| object.shape.surfels());
            filters_all || see_through.map(SurfelModel::surfels).any(|other| Arc::ptr_eq(other, model.surfels()))
        };
        let upload = |object: &FrameObject| match object.shape.surfels() {
            Some(model) => models.surfel_buffers(device, model, filters(model)),
            None => Ok(Vec::new()),
        };
        let surfel_buffers = frame.objects.iter().map(upload).collect::<Result<Vec<_>, _>>()?;
        let upload = |object: &FrameObject| match object.shape.gaussians() {
            Some(model) => models.gaussian_buffers(device, model.gaussians()),
            None => Ok(Vec::new()),
        };
        let gaussian_buffers = frame.objects.iter().map(upload).collect::<Result<Vec<_>, _>>()?;
        buffers.fit(device, &schedule)?;
        let entries = (ENTRIES_PER_SLOT * schedule.round_slots).min(self.first_entries).max(self.wanted_entries);
        // The sort of Gaussians takes an entry for each.
        buffers.fit_entries(device, entries.min(schedule.most_entries).max(schedule.round_gaussians))?;
        let wanted = wanted(frame);
        buffers.grow(device, Slot::Wanted, 4 * wanted.len() as u64)?;
        device.write(&buffers[Slot::Wanted], 0, bytemuck::cast_slice(&wanted));
        let strips = frame.rasters.len() as u32 > frame.stride * frame.stride;
        let in_part = (frame.wanted.is_some() || strips) && frame.swept.is_none();
        let clusters = if in_part { self.clusters.of_frame(frame) } else { Vec::new() };
        Ok(Prepared {
            frame,
            channels,
            see_through,
            planes,
            surfel_buffers,
            gaussian_buffers,
            clusters,
            schedule,
            most_bytes: self.most_bytes,
            most_list,
            stretch,
            extents: Extents::of(frame),
        })
    }
}

#[cfg(test)]
impl Gpu {
    /// Makes as much room for a frame as its lists may ever need, and returns all bytes that it then takes.
    pub(in crate::backend) fn fill(&mut self, frame: &Frame) -> Result<u64, BackendError> {
        let Prepared { schedule, planes, .. } = self.prepare(frame)?;
        let DeviceState { device, buffers, .. } = &mut self.state;
        buffers.fit_entries(device, schedule.most_entries)?;
        // The host has a copy of the film, and the picture.
        let pixels = u64::from(frame.size[0]) * u64::from(frame.size[1]);
        let on_host = schedule.film_bytes + 4 * pixels * planes.count as u64;
        Ok(frame.model_bytes + frame.picture_bytes + buffers.bytes() + on_host)
    }

    /// Bytes of the largest buffer that grows with tiles and is bound whole, but for the map, of which a row of tiles
    /// may be larger than all others.
    pub(in crate::backend) fn most_bytes_of_tiles(&self) -> u64 {
        use Slot::{CoverageMask, Layers, Opaque, Peeled, Sums, Thresholds};
        let bytes =
            [Sums, Thresholds, CoverageMask, Opaque, Peeled, Layers].map(|slot| self.state.buffers[slot].size());
        bytes.into_iter().max().unwrap_or(0)
    }

    /// Most groups of a round of a frame.
    pub(in crate::backend) fn groups_of_a_round(&mut self, frame: &Frame) -> u64 {
        self.prepare(frame).map_or(0, |prepared| prepared.schedule.round_groups)
    }
}

impl Prepared<'_> {
    /// True if any block of the band of this raster is wanted.
    pub(in crate::backend) fn wants(&self, raster: &Raster, band: Band) -> bool {
        let wanted = self.frame.wanted.as_ref().filter(|_| self.frame.swept.is_none());
        let rows = [band.first_row * TILE, (band.first_row + band.rows) * TILE - 1].map(|row| row as usize);
        let columns = [0, raster.size[0].max(1) as usize - 1];
        wanted.is_none_or(|blocks| blocks.touch(raster.first, [columns[0], columns[1], rows[0], rows[1]]))
    }

    /// Most passes of the frame, as far as times are measured.
    pub(in crate::backend) fn most_passes(&self) -> usize {
        let Self { frame, schedule, .. } = self;
        let surfels = frame.objects.iter().filter_map(|object| object.shape.surfels());
        let surfels: u64 = surfels.map(|model| model.surfels().len() as u64).sum();
        let of_group = |group: &PosedGroup| {
            let samples = group.samples.len() as u64;
            let batches = (samples * surfels).div_ceil(schedule.surfel_slots) + 1;
            let slabs = schedule.gaussians.div_ceil(schedule.slots).max(1);
            let layers = if self.see_through.is_some() { PASSES_OF_LAYERS } else { 0 };
            let composite = if frame.blending.is_some() { samples * (4 + 3 * slabs) } else { 0 };
            (PASSES_OF_GROUP + layers) * batches + composite
        };
        let of_bands: u64 = frame.positions().flat_map(|position| &position.groups).map(of_group).sum();
        let bands = (0..schedule.rasters.len()).map(|raster| schedule.bands(raster).count()).max().unwrap_or(0);
        of_bands as usize * bands
    }

    /// Bytes of a tile of the film.
    pub(in crate::backend) fn tile_bytes_of_film(&self) -> u64 {
        u64::from(TILE * TILE) * 4 * self.planes.count as u64
    }

    /// Do programs bind the whole film? Then the groups of a round may be of several rasters.
    pub(in crate::backend) fn binds_whole_film(&self) -> bool {
        makes_rounds(self.frame) && self.schedule.film_bytes <= self.most_bytes
    }

    /// Bytes of the film that the host develops, in runs. Small gaps are parts of them.
    pub(in crate::backend) fn wanted_film(&self) -> Vec<Range<u64>> {
        let mut runs: Vec<Range<u64>> = Vec::new();
        let tile_bytes = self.tile_bytes_of_film();
        for (raster, of_raster) in self.schedule.rasters.iter().zip(&self.frame.rasters) {
            let first = of_raster.positions.first().map_or([0; 2], |position| position.raster.first);
            let [columns, rows] = raster.tiles;
            for (number, [x, y]) in (0..).zip((0..rows).flat_map(|y| (0..columns).map(move |x| [x, y]))) {
                let [x, y] = [x, y].map(|tile| [tile * TILE, (tile + 1) * TILE - 1].map(|pixel| pixel as usize));
                if self.frame.wanted.as_ref().is_some_and(|blocks| !blocks.touch(first, [x[0], x[1], y[0], y[1]])) {
                    continue;
                }
                let start = 4 * raster.start + number * tile_bytes;
                match runs.last_mut() {
                    Some(run) if start <= run.end + GAP => run.end = start + tile_bytes,
                    _ => runs.push(start..start + tile_bytes),
                }
            }
        }
        runs
    }

    /// Part `index` of the film, as it is bound: the buffer may be larger than a binding.
    pub(in crate::backend) fn film_part<'b>(&self, index: usize, film: &'b Buffer) -> BufferBinding<'b> {
        let (offset, bytes) =
            if self.binds_whole_film() { (0, self.schedule.film_bytes) } else { self.film_parts()[index] };
        BufferBinding { buffer: film, offset, size: BufferSize::new(bytes) }
    }

    /// First byte and length of each band's part of the film.
    pub(in crate::backend) fn film_parts(&self) -> Vec<(u64, u64)> {
        let mut parts = Vec::new();
        for (index, raster) in self.schedule.rasters.iter().enumerate() {
            let row = u64::from(raster.tiles[0]) * self.tile_bytes_of_film();
            for band in self.schedule.bands(index) {
                parts.push((4 * raster.start + u64::from(band.first_row) * row, u64::from(band.rows) * row));
            }
        }
        parts
    }
}
