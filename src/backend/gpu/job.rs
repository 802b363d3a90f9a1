//! What a step does for one group: its surfels in batches, and its view.

use super::batches::Batch;
use super::layout::{IN_STRETCHES, View};
use super::memory::{Area, Band};
use super::prepared::Prepared;
use crate::frame::{PosedGroup, Position, Raster};
use crate::plan::{LAYERS, PosedInterval};

/// One sample position in one band.
#[derive(Clone, Copy)]
pub(in crate::backend) struct JobPlace<'a> {
    pub prepared: &'a Prepared<'a>,
    pub position: &'a Position,
    /// Index of the raster.
    pub raster: usize,
    pub band: Band,
    /// Index of the band's part of the film, and the first tile of what is bound of it.
    pub film: usize,
    pub film_tile: u32,
}

/// One group of a place, for one step.
#[derive(Clone, Copy)]
pub(in crate::backend) struct Job<'a> {
    pub place: JobPlace<'a>,
    pub group: &'a PosedGroup,
    /// Is it of see-through surfels?
    pub see_through: bool,
    /// The pixels that are worked on.
    pub area: Area,
    /// The pixels of the visibility map.
    pub map: Area,
    /// Bits of [`View::flags`].
    pub flags: u32,
    /// Passes that walk over its lists, where it has one batch.
    pub walks: u32,
    /// Most entries of a list that a dispatch walks over; [`u64::MAX`]: all.
    pub stretch: u64,
    /// The interval of kernels in motion.
    pub interval: Option<&'a PosedInterval>,
}

impl<'a> JobPlace<'a> {
    /// The band's pixels.
    pub(in crate::backend) fn area(&self) -> Area {
        self.prepared.schedule.rasters[self.raster].area(self.band)
    }

    /// The job of a group on the band, without an interval.
    pub(in crate::backend) fn job(self, group: usize) -> Job<'a> {
        let area = self.area();
        let group = &self.position.groups[group];
        let map = area.guarded(0);
        Job { place: self, group, see_through: false, area, map, flags: 0, walks: 1, stretch: u64::MAX, interval: None }
    }

    /// The same for kernels at instants. Its pixels are those of the band and of the apron around it; its tiles are the
    /// band's.
    pub(in crate::backend) fn paint_job(self, group: usize, see_through: bool) -> Job<'a> {
        let (job, raster) = (self.job(group), self.raster(see_through));
        let pixels = job.area.pixels.widened(raster.apron() as i32, raster.size);
        let walks = match (see_through, self.prepared.channels.is_layered()) {
            // Two walks of pass `attribute` for each layer.
            (true, _) => 2 * u32::from(LAYERS),
            (false, true) => 2,
            (false, false) => 1,
        };
        Job { area: Area { pixels, ..job.area }, see_through, walks, ..job }
    }

    /// The job of a group's interval. Only published kernels have a map, `guard` pixels wider than the band.
    pub(in crate::backend) fn sweep_job(self, group: usize, interval: &'a PosedInterval) -> Job<'a> {
        let around = self.area().guarded(interval.guard);
        let has_map = self.prepared.frame.guard().is_some();
        let map = if has_map { around } else { Area { tiles: [0; 2], ..around } };
        Job { map, interval: Some(interval), stretch: self.prepared.stretch, ..self.job(group) }
    }

    /// The job of the map of a group's interval.
    pub(in crate::backend) fn map_job(self, group: usize, guard: u32) -> Job<'a> {
        let map = self.area().guarded(guard);
        // Its passes walk over no lists.
        Job { area: map, map, walks: 0, ..self.job(group) }
    }

    /// The surfels of a group, cut into batches.
    pub(in crate::backend) fn batches(&self, job: &Job<'_>) -> Vec<Batch> {
        let (prepared, raster) = (self.prepared, self.raster(job.see_through));
        prepared.schedule.batches(prepared, &raster, job.group, job.see_through)
    }

    /// The raster, with the filter of opaque or of see-through surfels.
    pub(in crate::backend) fn raster(&self, see_through: bool) -> Raster {
        let raster = self.position.raster;
        if see_through { raster.for_see_through(self.prepared.frame.prefilter) } else { raster }
    }
}

impl Job<'_> {
    /// Do its surfels receive shadows? Nothing is shaded on the map of an interval.
    pub(in crate::backend) fn is_shadowed(&self) -> bool {
        let prepared = self.place.prepared;
        let is_map = prepared.frame.swept.is_some() && self.interval.is_none();
        prepared.schedule.shadows.lights > 0 && !is_map
    }

    /// What all of its views have, alone in their round. `entries`: those that there is room for.
    pub(in crate::backend) fn view(&self, entries: u64) -> View {
        let Job { place, group, area, map, .. } = *self;
        View {
            pixels: area.pixels.to_array(),
            corner: area.corner,
            tiles: area.tiles,
            round_tiles: area.tiles[0] * area.tiles[1],
            views: 1,
            same_film: 1,
            film_tile: place.film_tile,
            first_tile_row: area.first_tile_row,
            map_corner: map.corner,
            map_tiles: map.tiles,
            entry_capacity: entries.min(u64::from(u32::MAX)) as u32,
            slope: self.interval.map_or(0.0, |interval| interval.slope),
            flags: self.flags | if self.stretch == u64::MAX { 0 } else { IN_STRETCHES },
            walks: self.walks,
            opaque_scale: group_scale(group),
            epsilon: place.prepared.frame.least_tolerance(group, self.see_through),
            casters: place.prepared.schedule.shadows.casters as u32,
            ..View::of(place.prepared.frame, &place.raster(self.see_through), group, &place.prepared.channels.shared)
        }
    }
}

/// What turns sums over a group's samples into means.
pub(in crate::backend) fn group_scale(group: &PosedGroup) -> f32 {
    let total: f32 = group.samples.iter().map(|sample| sample.weight).sum();
    if group.samples.len() > 1 && total > 0.0 { 1.0 / total } else { 1.0 }
}
