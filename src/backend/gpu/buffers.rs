//! Buffers that passes exchange. They grow when a frame needs more, and stay between frames.

use std::sync::{Arc, Weak};

use wgpu::{Buffer, BufferUsages};

use super::device::Device;
use super::layout::{
    CaptureSegment, DIGIT_BITS, DeviceGaussian, Light, Segment, Status, VIEW_BYTES, VIEWS, WORKGROUP_ITEMS, WORKGROUPS,
};
use super::memory::{MAP_BYTES, Schedule};
use crate::backend::BackendError;
use crate::environment::{Cube, Surroundings};
use crate::layout::FilteredSplat;

/// The buffers that the passes of one round exchange, and the film.
#[derive(Debug)]
pub(in crate::backend) struct Buffers {
    pub views: Buffer,
    /// Tables of workgroups; the background, and the totals of sorts.
    pub uniforms: Buffer,
    pub segments: Buffer,
    pub capture_segments: Buffer,
    pub lights: Buffer,
    /// What surfaces mirror, and the map that it was made of.
    pub environment: Buffer,
    environment_of: Weak<Cube>,
    pub splats: Buffer,
    pub touched: Buffer,
    pub partials: Buffer,
    pub totals: Buffer,
    pub status: Buffer,
    pub wide: Buffer,
    pub values: Buffer,
    /// Tiles and slots of entries. The sort moves them to and fro; sorted entries are in the first buffer.
    pub keys: [Buffer; 2],
    pub lists: [Buffer; 2],
    pub histogram: Buffer,
    pub digit_totals: Buffer,
    pub starts: Buffer,
    pub thresholds: Buffer,
    pub sums: Buffer,
    /// The visibility map of published kernels in motion; or the thresholds of slices of all others, and behind them,
    /// where they are kept, the nearest depths.
    pub map: Buffer,
    pub coverage_mask: Buffer,
    pub moments: Buffer,
    pub film: Buffer,
    /// The Gaussians of all captures and volumes, at a time sample of each group of a round, and their slots in the
    /// order of depth.
    pub gaussians: Buffer,
    pub order: Buffer,
    /// The picture of a group's surfels, which what is transparent is laid over.
    pub opaque: Buffer,
    /// Depths and covers of see-through surfels, while layers are peeled off; the films of those layers.
    pub peeled: Buffer,
    pub layers: Buffer,
    /// The blocks of the image that are wanted.
    pub wanted: Buffer,
    /// Number of entries that there is room for.
    pub entries: u64,
}

/// Bytes of the table of workgroups that a program binds.
pub(in crate::backend) const TABLE_BYTES: u64 = 8 * WORKGROUPS as u64;
/// Bytes of the moments of an interval.
const MOMENT_BYTES: u64 = size_of::<[f32; 32]>() as u64;

const UNIFORM: BufferUsages = BufferUsages::UNIFORM.union(BufferUsages::COPY_DST);
const SHARED: BufferUsages = BufferUsages::STORAGE.union(BufferUsages::COPY_SRC).union(BufferUsages::COPY_DST);

impl Buffers {
    pub(in crate::backend) fn new(device: &Device) -> Result<Self, BackendError> {
        let digits = 1_u64 << DIGIT_BITS;
        let empty = || device.buffer("buffers", 0, SHARED);
        Ok(Self {
            views: device.buffer("views", VIEW_BYTES, UNIFORM)?,
            uniforms: device.buffer("tables", TABLE_BYTES, UNIFORM | BufferUsages::COPY_SRC)?,
            segments: device.buffer("segments", size_of::<Segment>() as u64, SHARED)?,
            capture_segments: device.buffer("segments of captures", size_of::<CaptureSegment>() as u64, SHARED)?,
            lights: device.buffer("lights", size_of::<Light>() as u64, SHARED)?,
            environment: empty()?,
            environment_of: Weak::new(),
            // A buffer must hold at least one element of the largest type that it is bound as.
            splats: device.buffer("splats", size_of::<FilteredSplat>() as u64, SHARED)?,
            touched: empty()?,
            partials: empty()?,
            totals: device.buffer("totals", 32, SHARED | BufferUsages::INDIRECT)?,
            status: device.buffer("status", size_of::<Status>() as u64, SHARED)?,
            wide: empty()?,
            values: empty()?,
            keys: [empty()?, empty()?],
            lists: [empty()?, empty()?],
            histogram: empty()?,
            digit_totals: device.buffer("totals", 4 * digits, SHARED)?,
            starts: empty()?,
            thresholds: empty()?,
            sums: empty()?,
            map: empty()?,
            coverage_mask: empty()?,
            moments: device.buffer("moments", MOMENT_BYTES, SHARED)?,
            film: empty()?,
            gaussians: device.buffer("splats of captures", size_of::<DeviceGaussian>() as u64, SHARED)?,
            order: empty()?,
            opaque: empty()?,
            peeled: empty()?,
            layers: empty()?,
            wanted: empty()?,
            entries: 0,
        })
    }

    /// Makes room for a frame.
    pub(in crate::backend) fn fit(&mut self, device: &Device, schedule: &Schedule) -> Result<(), BackendError> {
        let slots = schedule.round_slots;
        grow(device, &mut self.splats, "splats", slots * schedule.splat_bytes)?;
        grow(device, &mut self.touched, "tile counts", 4 * slots)?;
        grow(device, &mut self.partials, "tile counts", 8 * slots.div_ceil(u64::from(WORKGROUP_ITEMS)))?;
        grow(device, &mut self.wide, "lists", 4 * slots)?;
        grow(device, &mut self.values, "attributes", 4 * schedule.values * slots)?;
        let tile = 4 * 256;
        let (band, map) = (schedule.round_tiles, schedule.map_tiles);
        grow(device, &mut self.starts, "lists", 4 * (band.max(map) + 2 + u64::from(VIEWS)))?;
        grow(device, &mut self.thresholds, "thresholds", (schedule.depth_bytes * band).max(tile * map))?;
        grow(device, &mut self.sums, "sums", tile * schedule.sums * band)?;
        grow(device, &mut self.map, "the map", MAP_BYTES * map + schedule.slice_bytes * band)?;
        grow(device, &mut self.coverage_mask, "coverage masks", schedule.mask_bytes * band)?;
        let each = size_of::<DeviceGaussian>() as u64;
        grow(device, &mut self.gaussians, "splats of captures", schedule.round_gaussians * each)?;
        grow(device, &mut self.order, "splats of captures", 4 * schedule.round_gaussians)?;
        grow(device, &mut self.opaque, "the opaque picture", schedule.opaque_bytes * band)?;
        grow(device, &mut self.peeled, "see-through surfels", schedule.peeled_bytes * band)?;
        grow(device, &mut self.layers, "see-through surfels", schedule.layer_bytes * band)?;
        grow(device, &mut self.film, "the film's planes", schedule.film_bytes)
    }

    /// Uploads what surfaces mirror, unless it is there.
    pub(in crate::backend) fn fit_environment(
        &mut self,
        device: &Device,
        surroundings: Option<&Surroundings>,
    ) -> Result<(), BackendError> {
        let Some(Surroundings { cube, .. }) = surroundings else { return Ok(()) };
        // The weak pointer keeps the address from being used again.
        if self.environment_of.as_ptr() != Arc::as_ptr(cube) {
            let bytes: &[u8] = bytemuck::cast_slice(cube.texels());
            grow(device, &mut self.environment, "the environment", bytes.len() as u64)?;
            device.write(&self.environment, 0, bytes);
            self.environment_of = Arc::downgrade(cube);
        }
        Ok(())
    }

    /// Bytes of all buffers that grow with a frame's pixels, slots and entries.
    #[cfg(test)]
    pub(in crate::backend) fn bytes(&self) -> u64 {
        let splats = [&self.splats, &self.touched, &self.partials, &self.wide, &self.values, &self.starts];
        let tiles = [&self.thresholds, &self.sums, &self.map, &self.coverage_mask, &self.film, &self.histogram];
        let captures = [&self.gaussians, &self.order, &self.opaque, &self.peeled, &self.layers];
        let lists = self.keys.iter().chain(&self.lists);
        splats.into_iter().chain(tiles).chain(captures).chain(lists).map(Buffer::size).sum()
    }

    /// Makes room for `entries` entries.
    pub(in crate::backend) fn fit_entries(&mut self, device: &Device, entries: u64) -> Result<(), BackendError> {
        if entries <= self.entries {
            return Ok(());
        }
        for buffer in self.keys.iter_mut().chain(&mut self.lists) {
            grow(device, buffer, "lists", 4 * entries)?;
        }
        let groups = entries.div_ceil(u64::from(WORKGROUP_ITEMS));
        grow(device, &mut self.histogram, "lists", 4 * (groups << DIGIT_BITS))?;
        self.entries = entries;
        Ok(())
    }
}

/// Replaces `buffer` by a larger one, if it has less than `bytes` bytes. Its content is lost.
pub(in crate::backend) fn grow(
    device: &Device,
    buffer: &mut Buffer,
    label: &str,
    bytes: u64,
) -> Result<(), BackendError> {
    if buffer.size() < bytes {
        let usage = buffer.usage();
        // The old memory must be free before the new memory is taken.
        buffer.destroy();
        *buffer = device.buffer(label, bytes, usage)?;
    }
    Ok(())
}
