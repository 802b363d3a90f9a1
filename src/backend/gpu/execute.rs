//! Executes a frame's plan on the device: cuts the frame up, records the passes of each group, and submits them one after
//! the other. Nothing waits for the device here.

use std::sync::Arc;

use bytemuck::Zeroable;
use wgpu::{CommandEncoder, ComputePass, ComputePassDescriptor};

use super::bindings::{Bench, Step, Steps};
use super::buffers::grow;
use super::clock::Marks;
use super::layer::KEEPING;
use super::layout::{BLOCK, DIGIT_BITS, Segment, TILE, Travel, UNIFORM_STRIDE, View, lights, wanted};
use super::models::Block;
use super::schedule::{Area, Band, DeviceChannels, ENTRIES_PER_SLOT, Limits, MAP_BYTES, Schedule, THRESHOLD_BYTES};
use super::waves::{Part, Wave, Waves};
use super::{Gpu, Machine};
use crate::backend::BackendError;
use crate::backend::clusters::Clusters;
use crate::film::FilmPlanes;
use crate::frame::{Blocks, Frame, PosedGroup};
use crate::options::Normalise;
use crate::plan::Pass;

/// What stays the same while a frame is rendered.
pub(super) struct Execution<'a> {
    pub frame: &'a Frame<'a>,
    pub channels: DeviceChannels,
    pub planes: FilmPlanes,
    /// Of each object.
    pub blocks: Vec<Vec<Block>>,
    /// Likewise, where only some blocks of the image are wanted.
    pub clusters: Vec<Arc<Clusters>>,
    pub schedule: Schedule,
}

impl Gpu {
    /// Cuts the frame up and makes room for it.
    pub(super) fn prepare<'a>(&mut self, frame: &'a Frame<'a>) -> Result<Execution<'a>, BackendError> {
        let channels = DeviceChannels::of(frame);
        let planes = FilmPlanes::of(frame.aovs);
        let once = frame.swept.is_some_and(|swept| swept.normalise == Normalise::Once);
        let planes = if once { planes.pooled() } else { planes };
        let limits = Limits { bytes: self.most_bytes, slots: self.most_slots };
        let mut schedule = Schedule::new(frame, &channels, &planes, limits)?;
        schedule.most_entries = schedule.most_entries.min(self.most_entries);
        let Machine { device, models, buffers, .. } = &mut self.machine;
        let blocks =
            frame.objects.iter().map(|object| models.blocks(device, object.surfels)).collect::<Result<Vec<_>, _>>()?;
        buffers.fit(device, &schedule, &channels)?;
        let entries = (ENTRIES_PER_SLOT * schedule.slots).min(self.first_entries).max(self.wanted_entries);
        buffers.fit_entries(device, entries.min(schedule.most_entries))?;
        buffers.fit_kept(device, &schedule, &channels)?;
        let wanted = wanted(frame);
        grow(device, &mut buffers.wanted, "blocks", 4 * wanted.len() as u64)?;
        device.queue.write_buffer(&buffers.wanted, 0, bytemuck::cast_slice(&wanted));
        let in_part = frame.wanted.is_some() && frame.swept.is_none();
        let clusters = if in_part { self.clusters.of_frame(frame) } else { Vec::new() };
        Ok(Execution { frame, channels, planes, blocks, clusters, schedule })
    }

    /// Records and submits all groups.
    pub(super) fn submit(&mut self, execution: &Execution<'_>, marks: &mut Marks) -> Result<(), BackendError> {
        let steps = self.steps(execution, marks)?;
        let Execution { frame, schedule, .. } = execution;
        let mut encoder = self.machine.encoder();
        encoder.clear_buffer(&self.machine.buffers.film, 0, None);
        encoder.clear_buffer(&self.machine.buffers.status, 0, None);
        self.machine.device.queue.submit([encoder.finish()]);
        let (has_still_picture, one_view) = (frame.has_still_picture(), frame.has_one_view());
        let mut part = 0;
        for (raster, groups) in frame.groups.chunk_by(|a, b| a.raster.phase == b.raster.phase).enumerate() {
            for band in schedule.bands(raster) {
                if !execution.wants(band) {
                    part += 1;
                    continue;
                }
                for groups in groups.chunk_by(|a, b| a.raster == b.raster) {
                    let work = |group, part_of_group| Work {
                        execution,
                        group,
                        raster,
                        band,
                        part: part_of_group,
                        on_map: false,
                        steps: &steps,
                        resolve: &steps.resolve[part],
                    };
                    // Where nothing that lies still is wanted there is nothing to start from.
                    let keeps = schedule.kept_slots > 0
                        && groups.len() > 1
                        && !execution.waves(&groups[0], Part::Still).waves.is_empty();
                    if keeps {
                        self.machine.passes(&work(&groups[0], Part::Still), &KEEPING, marks);
                    }
                    let part = match (has_still_picture, keeps) {
                        (true, _) => Part::Beside,
                        (false, true) => Part::Moving,
                        (false, false) => Part::Whole,
                    };
                    for (number, group) in groups.iter().enumerate() {
                        // Light at surfels may change from interval to interval.
                        if has_still_picture && (number == 0 || !one_view) {
                            self.machine.picture_still(&work(group, Part::Still), marks);
                        }
                        self.machine.group(&work(group, part), marks);
                    }
                }
                if let Some(finish) = steps.finish.get(part) {
                    self.machine.finish(finish, schedule.rasters[raster].area(band));
                }
                part += 1;
            }
        }
        self.machine.device.check()
    }

    /// Makes room for the largest group's uniforms and for all marks; binds the programs.
    pub(super) fn steps(&mut self, execution: &Execution<'_>, marks: &mut Marks) -> Result<Steps, BackendError> {
        let Execution { frame, schedule, .. } = execution;
        let mut most = [0_usize; 3];
        let mut passes = 0;
        for group in &frame.groups {
            // Cut in two there may be a view more.
            let waves = execution.waves(group, Part::Whole);
            let views = waves.waves.len() + 2;
            let segments = group.samples.len() + waves.segments().count() + views;
            let lights = group.samples.iter().map(|sample| sample.lights.len()).sum();
            most = [most[0].max(views), most[1].max(segments), most[2].max(lights)];
            passes += 14 * views + 4;
        }
        let bands: usize = (0..schedule.rasters.len()).map(|raster| schedule.bands(raster).count()).max().unwrap_or(0);
        let Machine { device, buffers, pipelines, .. } = &mut self.machine;
        buffers.fit_group(device, most[0], most[1], most[2])?;
        marks.begin(device, passes * bands)?;
        Bench { device, pipelines, buffers }.steps(execution)
    }
}

impl Execution<'_> {
    fn waves(&self, group: &PosedGroup, part: Part) -> Waves {
        self.schedule.waves(self.frame, group, &self.blocks, &self.clusters, part)
    }

    /// Is any block of the band wanted?
    fn wants(&self, band: Band) -> bool {
        let wanted = self.frame.wanted.as_ref().filter(|_| self.frame.swept.is_none());
        let rows = [band.first_row, band.first_row + band.rows - 1].map(|row| (row * TILE) as usize / Blocks::EDGE);
        wanted.is_none_or(|blocks| (rows[0]..=rows[1]).any(|y| (0..blocks.width).any(|x| blocks.at(x, y))))
    }

    /// First byte and length of what each band has of the film.
    pub(super) fn parts(&self) -> Vec<(u64, u64)> {
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

/// One group in one band.
#[derive(Clone, Copy)]
pub(super) struct Work<'a> {
    pub execution: &'a Execution<'a>,
    pub group: &'a PosedGroup,
    pub raster: usize,
    pub band: Band,
    pub part: Part,
    /// On the map around the band, not on the band itself.
    pub on_map: bool,
    pub steps: &'a Steps,
    pub resolve: &'a Step,
}

impl Work<'_> {
    fn map(&self) -> Area {
        let guard = self.group.interval.map_or(0, |interval| interval.guard);
        self.execution.schedule.rasters[self.raster].area(self.band).guarded(guard)
    }

    pub(super) fn area(&self) -> Area {
        if self.on_map { self.map() } else { self.execution.schedule.rasters[self.raster].area(self.band) }
    }
}

impl Machine {
    pub(super) fn encoder(&self) -> CommandEncoder {
        self.device.handle.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Records and submits one group.
    pub(super) fn group(&self, work: &Work<'_>, marks: &mut Marks) {
        let passes = work.execution.frame.passes;
        let Some(kept) = passes.iter().position(|&pass| pass == Pass::Keep) else {
            self.passes(work, passes, marks);
            return;
        };
        // Kernels in motion look up sources anywhere on the map, so it must be whole before they are added.
        let (still, moving) = passes.split_at(kept + 1);
        self.passes(&Work { on_map: true, ..*work }, still, marks);
        self.passes(work, moving, marks);
    }

    /// Records and submits the picture of what lies still, at the sample position of a group and in its light.
    pub(super) fn picture_still(&self, work: &Work<'_>, marks: &mut Marks) {
        let b = &self.buffers;
        let Some(resolve) = work.steps.swept.as_ref().and_then(|swept| swept.still.as_ref()) else { return };
        let mut encoder = self.encoder();
        encoder.clear_buffer(&b.still_film, 0, None);
        self.flush(&mut encoder, marks);
        self.passes(&Work { resolve, ..*work }, &Pass::UNSWEPT, marks);
        let mut encoder = self.encoder();
        let behind = MAP_BYTES * work.map().len();
        encoder.copy_buffer_to_buffer(&b.thresholds, 0, &b.map, behind, THRESHOLD_BYTES * work.area().len());
        self.flush(&mut encoder, marks);
    }

    /// Records and submits some passes of a group, those that need lists wave by wave.
    pub(super) fn passes(&self, work: &Work<'_>, passes: &[Pass], marks: &mut Marks) {
        let Waves { kept, waves } = self.upload(work);
        let Some(last) = waves.len().checked_sub(1) else { return };
        let mut encoder = self.encoder();
        let mut at_hand = None;
        for &pass in passes {
            if work.part == Part::Moving {
                self.recall(&mut encoder, pass, work, kept.len(), marks);
            }
            match pass {
                // Run where lists are needed that are not at hand.
                Pass::Project | Pass::Bin | Pass::Sweep => {}
                Pass::Visibility | Pass::Attribute | Pass::Density | Pass::SweptAttribute => {
                    for (number, wave) in waves.iter().enumerate() {
                        let view = kept.len() + number;
                        if at_hand != Some(number) {
                            let of_still: &[Pass] = &[Pass::Project, Pass::Bin];
                            let makes = if pass == Pass::SweptAttribute { &[Pass::Sweep] } else { of_still };
                            for &pass in makes {
                                self.record(&mut encoder, pass, work, wave, view, marks);
                            }
                            at_hand = Some(number);
                        }
                        self.record(&mut encoder, pass, work, wave, view, marks);
                        if work.part == Part::Still && pass == Pass::Attribute && work.steps.layer.is_some() {
                            self.keep(&mut encoder, work, wave, number);
                        }
                        if waves.len() > 1 {
                            self.flush(&mut encoder, marks);
                        }
                    }
                }
                Pass::Resolve | Pass::Keep | Pass::SweptResolve => {
                    self.record(&mut encoder, pass, work, &waves[last], kept.len() + last, marks);
                }
            }
        }
        self.flush(&mut encoder, marks);
    }

    /// Ends a band whose film is not finished when all groups are added.
    fn finish(&self, step: &Step, area: Area) {
        let mut encoder = self.encoder();
        let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor::default());
        step.set(&mut recorder, &[0]);
        recorder.dispatch_workgroups(area.tiles[0], area.tiles[1], 1);
        drop(recorder);
        self.device.queue.submit([encoder.finish()]);
    }

    /// Submits what is recorded.
    fn flush(&self, encoder: &mut CommandEncoder, marks: &mut Marks) {
        marks.collect(encoder);
        let done = std::mem::replace(encoder, self.encoder());
        self.device.queue.submit([done.finish()]);
    }

    /// Uploads a group's views, segments and lights; returns its waves.
    pub(super) fn upload(&self, work: &Work<'_>) -> Waves {
        let Work { execution, group, part, .. } = *work;
        let frame = execution.frame;
        let waves = execution.waves(group, part);
        let (area, map) = (work.area(), work.map());
        let shared = View {
            pixels: area.pixels,
            corner: area.corner,
            tiles: area.tiles,
            first_tile_row: area.first_tile_row,
            map_corner: map.corner,
            map_tiles: map.tiles,
            entry_capacity: self.buffers.entries.min(u64::from(u32::MAX)) as u32,
            ..View::of(frame, group, execution.channels.shared.uniform)
        };
        let mut views = Vec::new();
        let mut before = 0;
        let mut travels = vec![Travel::zeroed(); group.samples.len()];
        for (number, wave) in waves.kept.iter().chain(&waves.waves).enumerate() {
            let view = View {
                slots: wave.slots,
                resumes: u32::from(number > 0 || part == Part::Moving),
                // Each interval has its own share of what is made once.
                weight: if part == Part::Still { 1.0 } else { shared.weight },
                first_turn: before,
                last_turn: wave.last_turn,
                ..shared
            };
            before = wave.last_turn;
            views.extend_from_slice(bytemuck::bytes_of(&view));
            views.resize(view_offset(number + 1) as usize, 0);
            travels.extend_from_slice(&wave.travels);
        }
        let weights = group.samples.iter().map(|sample| Segment::weighing(sample.weight));
        let segments: Vec<_> = weights.chain(waves.segments().copied()).collect();
        let queue = &self.device.queue;
        if let Some(interval) = &group.interval {
            queue.write_buffer(&self.buffers.moments, 0, bytemuck::bytes_of(&interval.moments));
        }
        queue.write_buffer(&self.buffers.travels, 0, bytemuck::cast_slice(&travels));
        queue.write_buffer(&self.buffers.views, 0, &views);
        queue.write_buffer(&self.buffers.segments, 0, bytemuck::cast_slice(&segments));
        queue.write_buffer(&self.buffers.lights, 0, bytemuck::cast_slice(&lights(&group.samples)));
        waves
    }

    /// Records one pass of one wave, whose view is `number`.
    pub(super) fn record(
        &self,
        encoder: &mut CommandEncoder,
        pass: Pass,
        work: &Work<'_>,
        wave: &Wave,
        number: usize,
        marks: &mut Marks,
    ) {
        let timestamp_writes = marks.mark(pass);
        let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        let steps = work.steps;
        let view = view_offset(number);
        let tiles = work.area().tiles;
        let recorder = &mut recorder;
        match (pass, &steps.swept) {
            (Pass::Project, _) => of_segments(recorder, &steps.project, wave, view),
            (Pass::Bin, _) => self.bin(recorder, steps, &steps.bin_emit, wave, tiles, view),
            (Pass::Visibility, _) => dispatch(recorder, &steps.visibility, tiles, view),
            (Pass::Attribute, _) => {
                of_segments(recorder, &steps.splat_values, wave, view);
                let keeping = steps.layer.as_ref().filter(|_| work.part == Part::Still);
                dispatch(recorder, keeping.map_or(&steps.sum_attributes, |layer| &layer.sum), tiles, view);
            }
            (Pass::Resolve | Pass::SweptResolve, _) => dispatch(recorder, work.resolve, tiles, view),
            (Pass::Density, Some(swept)) => dispatch(recorder, &swept.density, tiles, view),
            (Pass::Keep, Some(swept)) => dispatch(recorder, &swept.keep, tiles, view),
            (Pass::Sweep, Some(swept)) => {
                of_segments(recorder, &swept.project, wave, view);
                self.bin(recorder, steps, &swept.bin_emit, wave, tiles, view);
            }
            (Pass::SweptAttribute, Some(swept)) => {
                of_segments(recorder, &swept.splat_values, wave, view);
                dispatch(recorder, &swept.attribute, tiles, view);
            }
            // Only where the plan is of kernels in motion.
            (Pass::Density | Pass::Keep | Pass::Sweep | Pass::SweptAttribute, None) => {}
        }
    }

    /// Pass `bin` of one wave.
    fn bin(&self, recorder: &mut ComputePass<'_>, steps: &Steps, emit: &Step, wave: &Wave, tiles: [u32; 2], view: u32) {
        let blocks = [wave.slots.div_ceil(BLOCK), 1];
        dispatch(recorder, &steps.bin_reduce, blocks, view);
        dispatch(recorder, &steps.bin_scan, [1, 1], view);
        dispatch(recorder, emit, blocks, view);
        let totals = &self.buffers.totals;
        for round in &steps.sort {
            round.count.set(recorder, &[view]);
            recorder.dispatch_workgroups_indirect(totals, 0);
            dispatch(recorder, &round.scan, [1 << DIGIT_BITS, 1], view);
            round.scatter.set(recorder, &[view]);
            recorder.dispatch_workgroups_indirect(totals, 0);
        }
        dispatch(recorder, &steps.bin_starts, [(tiles[0] * tiles[1] + 2).div_ceil(256), 1], view);
    }
}

/// Where view `number` begins.
pub(super) const fn view_offset(number: usize) -> u32 {
    number as u32 * UNIFORM_STRIDE as u32
}

pub(super) fn dispatch(recorder: &mut ComputePass<'_>, step: &Step, groups: [u32; 2], view: u32) {
    step.set(recorder, &[view]);
    recorder.dispatch_workgroups(groups[0], groups[1], 1);
}

/// One dispatch for each segment of the wave.
fn of_segments(recorder: &mut ComputePass<'_>, steps: &[Vec<Step>], wave: &Wave, view: u32) {
    for (segment, object, block) in &wave.segments {
        let offset = segment.index * UNIFORM_STRIDE as u32;
        steps[*object][*block].set(recorder, &[view, offset]);
        recorder.dispatch_workgroups(segment.surfels.div_ceil(256), 1, 1);
    }
}
