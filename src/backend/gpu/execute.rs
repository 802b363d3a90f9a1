//! Executes a frame's plan on the device: cuts the frame up, records the passes of each group, submits them one after the
//! other, and takes the film back at the end.

use wgpu::{CommandEncoder, ComputePassDescriptor, MapMode};

use super::bindings::{Bench, Step, Steps};
use super::film::DeviceFilm;
use super::layout::{BLOCK, Status, TILE, UNIFORM_STRIDE, View, lights};
use super::models::Block;
use super::schedule::{Band, DeviceChannels, Schedule, Wave};
use super::{Gpu, Machine};
use crate::backend::{BackendError, Rendered, Stats};
use crate::film::{FilmPlanes, develop};
use crate::frame::{Frame, PosedGroup};
use crate::plan::Pass;

/// What stays the same while a frame is rendered.
pub(super) struct Execution<'a> {
    pub frame: &'a Frame<'a>,
    pub channels: DeviceChannels,
    pub planes: FilmPlanes,
    /// Of each object.
    pub blocks: Vec<Vec<Block>>,
    pub schedule: Schedule,
}

impl Gpu {
    pub(super) fn execute(&mut self, frame: &Frame<'_>) -> Result<Rendered, BackendError> {
        let mut execution = self.prepare(frame)?;
        let mut entries = execution.schedule.first_entries();
        loop {
            self.machine.buffers.fit_entries(&self.machine.device, entries)?;
            self.submit(&execution)?;
            let (rendered, status) = self.take(&execution)?;
            // Lists that outgrew their buffers were left empty, and the frame is repeated with more room, or in more waves.
            let wanted = u64::from(status.most_entries);
            if wanted <= self.machine.buffers.entries {
                return Ok(rendered);
            }
            if wanted <= execution.schedule.most_entries {
                entries = (wanted + wanted / 4).min(execution.schedule.most_entries);
            } else if !execution.schedule.halve() {
                return Err(self.machine.device.error(format!("lists of {wanted} entries do not fit into its buffers")));
            }
        }
    }

    /// Cuts the frame up and makes room for it.
    pub(super) fn prepare<'a>(&mut self, frame: &'a Frame<'a>) -> Result<Execution<'a>, BackendError> {
        let channels = DeviceChannels::of(frame);
        let planes = FilmPlanes::of(frame.aovs);
        let schedule = Schedule::new(frame, &channels, &planes, self.most_bytes())?;
        let Machine { device, models, buffers, .. } = &mut self.machine;
        let blocks = frame
            .objects
            .iter()
            .map(|object| models.blocks(device, object.surfels))
            .collect::<Result<Vec<_>, _>>()?;
        buffers.fit(device, &schedule, &channels, &planes)?;
        Ok(Execution { frame, channels, planes, blocks, schedule })
    }

    /// Records and submits all groups.
    pub(super) fn submit(&mut self, execution: &Execution<'_>) -> Result<(), BackendError> {
        let Execution { frame, schedule, .. } = execution;
        let mut most = [0_usize; 3];
        let mut passes = 0;
        for group in &frame.groups {
            let waves = schedule.waves(frame, group, &execution.blocks);
            let segments = waves.iter().map(|wave| wave.segments.len()).sum();
            let lights = group.samples.iter().map(|sample| sample.lights.len()).sum();
            most = [most[0].max(waves.len()), most[1].max(segments), most[2].max(lights)];
            passes += 6 * waves.len() + 1;
        }
        let bands: usize = (0..schedule.rasters.len()).map(|raster| schedule.bands(raster).count()).max().unwrap_or(0);
        let Machine { device, buffers, pipelines, clock, .. } = &mut self.machine;
        buffers.fit_group(device, most[0], most[1], most[2])?;
        if let Some(clock) = clock {
            clock.begin(device, passes * bands)?;
        }
        let steps = Bench { device, pipelines, buffers }.steps(
            frame,
            &execution.channels,
            &execution.planes,
            &execution.blocks,
            schedule.band_tiles,
            &execution.parts(),
        )?;
        let mut encoder = self.machine.encoder();
        encoder.clear_buffer(&self.machine.buffers.film, 0, None);
        encoder.clear_buffer(&self.machine.buffers.status, 0, None);
        self.machine.device.queue.submit([encoder.finish()]);
        let mut part = 0;
        for (raster, groups) in frame.groups.chunk_by(|a, b| a.raster.phase == b.raster.phase).enumerate() {
            for band in schedule.bands(raster) {
                for group in groups {
                    let work = Work { execution, group, raster, band, steps: &steps, resolve: &steps.resolve[part] };
                    self.machine.group(&work);
                }
                part += 1;
            }
        }
        self.machine.device.check()
    }

    /// Takes film, status and times back.
    fn take(&mut self, execution: &Execution<'_>) -> Result<(Rendered, Status), BackendError> {
        let Machine { device, buffers, clock, .. } = &mut self.machine;
        let frame = execution.frame;
        let film_bytes = execution.schedule.film_bytes;
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let status_bytes = size_of::<Status>() as u64;
        if film_bytes > 0 {
            encoder.copy_buffer_to_buffer(&buffers.film, 0, &buffers.staging, 0, film_bytes);
        }
        encoder.copy_buffer_to_buffer(&buffers.status, 0, &buffers.staging, film_bytes, status_bytes);
        device.queue.submit([encoder.finish()]);
        let map = |buffer: &wgpu::Buffer| buffer.map_async(MapMode::Read, .., |_| ());
        map(&buffers.staging);
        if let Some(clock) = clock {
            map(clock.marks());
        }
        device.wait()?;
        let mut stats = Stats::of(frame);
        let status;
        let picture = {
            let view =
                buffers.staging.get_mapped_range(..).map_err(|e| device.error(format!("cannot read the film: {e}")))?;
            let (film, rest) = view.split_at(film_bytes as usize);
            status = bytemuck::pod_read_unaligned::<Status>(&rest[..size_of::<Status>()]);
            let film = DeviceFilm {
                rasters: &execution.schedule.rasters,
                stride: frame.stride as usize,
                planes: execution.planes.count,
                values: bytemuck::cast_slice(film),
            };
            develop(&film, frame.size, frame.aovs, frame.background)
        };
        buffers.staging.unmap();
        stats.splats = u64::from(status.splats_high) << 32 | u64::from(status.splats_low);
        if let Some(clock) = clock {
            if let Ok(marks) = clock.marks().get_mapped_range(..) {
                clock.add(bytemuck::cast_slice(&marks), &mut stats);
            }
            clock.marks().unmap();
        }
        Ok((Rendered { picture, stats }, status))
    }
}

impl Execution<'_> {
    /// First byte and length of what each band has of the film.
    fn parts(&self) -> Vec<(u64, u64)> {
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
    pub steps: &'a Steps,
    pub resolve: &'a Step,
}

impl Machine {
    pub(super) fn encoder(&self) -> CommandEncoder {
        self.device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Records and submits one group: the plan's passes, those that need lists wave by wave.
    pub(super) fn group(&mut self, work: &Work<'_>) {
        let waves = self.upload(work);
        let Some(last) = waves.len().checked_sub(1) else { return };
        let mut encoder = self.encoder();
        let mut at_hand = None;
        for &pass in work.execution.frame.passes {
            match pass {
                // Run where lists are needed that are not at hand.
                Pass::Project | Pass::Bin => {}
                Pass::Visibility | Pass::Attribute => {
                    for (number, wave) in waves.iter().enumerate() {
                        if at_hand != Some(number) {
                            self.record(&mut encoder, Pass::Project, work, wave, number);
                            self.record(&mut encoder, Pass::Bin, work, wave, number);
                            at_hand = Some(number);
                        }
                        self.record(&mut encoder, pass, work, wave, number);
                        if waves.len() > 1 {
                            self.flush(&mut encoder);
                        }
                    }
                }
                Pass::Resolve => self.record(&mut encoder, pass, work, &waves[last], last),
            }
        }
        self.flush(&mut encoder);
    }

    fn flush(&mut self, encoder: &mut CommandEncoder) {
        if let Some(clock) = &mut self.clock {
            clock.collect(encoder);
        }
        let done = std::mem::replace(encoder, self.encoder());
        self.device.queue.submit([done.finish()]);
    }

    /// Uploads a group's views, segments and lights; returns its waves.
    pub(super) fn upload(&self, work: &Work<'_>) -> Vec<Wave> {
        let Work { execution, group, raster, band, .. } = *work;
        let frame = execution.frame;
        let waves = execution.schedule.waves(frame, group, &execution.blocks);
        let raster = &execution.schedule.rasters[raster];
        let last_pixel_row = ((band.first_row + band.rows) * TILE).min(raster.size[1]) as i32 - 1;
        let shared = View {
            pixels: [0, raster.size[0] as i32 - 1, (band.first_row * TILE) as i32, last_pixel_row],
            tiles: [raster.tiles[0], band.rows],
            first_tile_row: band.first_row,
            entry_capacity: self.buffers.entries.min(u64::from(u32::MAX)) as u32,
            ..View::of(frame, group, execution.channels.shared.uniform)
        };
        let mut views = Vec::new();
        let mut before = 0;
        for (number, wave) in waves.iter().enumerate() {
            let view = View {
                slots: wave.slots,
                resumes: u32::from(number > 0),
                first_sample: before as u32,
                first_weight: group.samples[before].weight,
                last_sample: wave.last_sample as u32,
                last_weight: group.samples[wave.last_sample].weight,
                ..shared
            };
            before = wave.last_sample;
            views.extend_from_slice(bytemuck::bytes_of(&view));
            views.resize((number + 1) * UNIFORM_STRIDE as usize, 0);
        }
        let segments: Vec<_> = waves.iter().flat_map(|wave| &wave.segments).map(|segment| segment.0).collect();
        let queue = &self.device.queue;
        queue.write_buffer(&self.buffers.views, 0, &views);
        queue.write_buffer(&self.buffers.segments, 0, bytemuck::cast_slice(&segments));
        queue.write_buffer(&self.buffers.lights, 0, bytemuck::cast_slice(&lights(&group.samples)));
        waves
    }

    /// Records one pass of one wave.
    pub(super) fn record(
        &mut self,
        encoder: &mut CommandEncoder,
        pass: Pass,
        work: &Work<'_>,
        wave: &Wave,
        number: usize,
    ) {
        let timestamp_writes = self.clock.as_mut().and_then(|clock| clock.mark(pass));
        let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        let steps = work.steps;
        let view = number as u32 * UNIFORM_STRIDE as u32;
        let tiles = [work.execution.schedule.rasters[work.raster].tiles[0], work.band.rows];
        let mut dispatch = |step: &Step, groups: [u32; 2]| {
            step.set(&mut recorder, &[view]);
            recorder.dispatch_workgroups(groups[0], groups[1], 1);
        };
        match pass {
            Pass::Project => of_segments(&mut recorder, &steps.project, wave, view),
            Pass::Bin => {
                let blocks = [wave.slots.div_ceil(BLOCK), 1];
                dispatch(&steps.bin_reduce, blocks);
                dispatch(&steps.bin_scan, [1, 1]);
                dispatch(&steps.bin_emit, blocks);
                let totals = &self.buffers.totals;
                for round in &steps.sort {
                    round.count.set(&mut recorder, &[view]);
                    recorder.dispatch_workgroups_indirect(totals, 0);
                    round.scan.set(&mut recorder, &[view]);
                    recorder.dispatch_workgroups(1 << super::layout::DIGIT_BITS, 1, 1);
                    round.scatter.set(&mut recorder, &[view]);
                    recorder.dispatch_workgroups_indirect(totals, 0);
                }
                steps.bin_starts.set(&mut recorder, &[view]);
                recorder.dispatch_workgroups((tiles[0] * tiles[1] + 2).div_ceil(256), 1, 1);
            }
            Pass::Visibility => dispatch(&steps.visibility, tiles),
            Pass::Attribute => {
                of_segments(&mut recorder, &steps.splat_values, wave, view);
                steps.sum_attributes.set(&mut recorder, &[view]);
                recorder.dispatch_workgroups(tiles[0], tiles[1], 1);
            }
            Pass::Resolve => dispatch(work.resolve, tiles),
        }
    }
}

/// One dispatch for each segment of the wave.
fn of_segments(recorder: &mut wgpu::ComputePass<'_>, steps: &[Vec<Step>], wave: &Wave, view: u32) {
    for (segment, object, block) in &wave.segments {
        let offset = segment.index * UNIFORM_STRIDE as u32;
        steps[*object][*block].set(recorder, &[view, offset]);
        recorder.dispatch_workgroups(segment.surfels.div_ceil(256), 1, 1);
    }
}
