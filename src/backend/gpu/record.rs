//! Records and submits a frame: walks over its rasters, bands, sample positions and steps. Nothing waits for the device here.

use bytemuck::Zeroable;
use wgpu::{CommandEncoder, ComputePass, ComputePassDescriptor};

use super::batches::{Batch, Batches};
use super::bind::{BinPrograms, BoundProgram, BoundPrograms, FilmPart, ListPrograms};
use super::layout::{BLOCK, DIGIT_BITS, Segment, Travel, UNIFORM_STRIDE, View, lights};
use super::memory::{Area, Band};
use super::prepared::Prepared;
use super::steps::{MapStep, SplatStep, StaticLayerStep, StaticPictureStep, SweepStep};
use super::timestamps::{Marks, Stage};
use super::{DeviceState, Gpu};
use crate::backend::BackendError;
use crate::frame::{PosedGroup, Position};
use crate::plan::{MapPass, Objects, SplatPass, StaticPass, Step, SweepPass};

/// One sample position in one band.
#[derive(Clone, Copy)]
pub(in crate::backend) struct Place<'a> {
    pub prepared: &'a Prepared<'a>,
    pub programs: &'a BoundPrograms,
    pub position: &'a Position,
    /// Index of the raster.
    pub raster: usize,
    pub band: Band,
    /// The band's part of the film.
    pub film: &'a FilmPart,
}

/// One group of a place, for one step.
#[derive(Clone, Copy)]
pub(in crate::backend) struct Job<'a> {
    pub place: Place<'a>,
    pub group: &'a PosedGroup,
    pub objects: Objects,
    /// Whether the batches of the static layer come first.
    pub from_layer: bool,
    /// The pixels that are worked on.
    pub area: Area,
    /// The pixels of the visibility map.
    pub map: Area,
    /// As in [`crate::plan::PosedInterval`]; 0 where samples are instants.
    pub slope: f32,
}

impl<'a> Place<'a> {
    /// The band's pixels.
    pub(in crate::backend) fn area(&self) -> Area {
        self.prepared.schedule.rasters[self.raster].area(self.band)
    }

    /// A group on the band, without an interval.
    pub(in crate::backend) fn job(self, group: usize, objects: Objects) -> Job<'a> {
        let area = self.area();
        let group = &self.position.groups[group];
        Job { place: self, group, objects, from_layer: false, area, map: area.guarded(0), slope: 0.0 }
    }

    /// The surfels of a group in batches.
    fn batches(&self, job: &Job<'_>) -> Batches {
        let Self { prepared, position, .. } = self;
        prepared.schedule.batches(prepared, &position.raster, job.group, job.objects, job.from_layer)
    }
}

impl Gpu {
    /// Records and submits all steps of a frame.
    pub(in crate::backend) fn submit(
        &mut self,
        prepared: &Prepared<'_>,
        marks: &mut Marks,
    ) -> Result<(), BackendError> {
        let programs = self.bind(prepared, marks)?;
        let Prepared { frame, schedule, .. } = prepared;
        let mut encoder = self.state.encoder();
        encoder.clear_buffer(&self.state.buffers.film, 0, None);
        encoder.clear_buffer(&self.state.buffers.status, 0, None);
        self.state.device.queue.submit([encoder.finish()]);
        let mut films = programs.film.iter();
        for (raster, of_raster) in frame.rasters.iter().enumerate() {
            for (band, film) in schedule.bands(raster).zip(&mut films) {
                if !prepared.wants(band) {
                    continue;
                }
                for position in &of_raster.positions {
                    let place = Place { prepared, programs: &programs, position, raster, band, film };
                    self.state.execute(place, marks)?;
                }
            }
        }
        self.state.device.check()
    }
}

impl DeviceState {
    /// Records and submits the steps of one sample position in one band.
    fn execute(&self, place: Place<'_>, marks: &mut Marks) -> Result<(), BackendError> {
        let mut has_layer = false;
        for step in &place.position.steps {
            match *step {
                Step::StaticLayer { group } => has_layer = self.static_layer(place, group, marks),
                Step::Splat { group } => self.splat(place, group, has_layer, marks)?,
                Step::StaticPicture { group } => self.static_picture(place, group, marks)?,
                Step::VisibilityMap { group, interval, objects, density } => {
                    let map = place.area().guarded(interval.guard);
                    let job = Job { area: map, map, ..place.job(group, objects) };
                    let programs = self.bound(place.programs.swept.as_ref())?;
                    self.run(&MapStep { job, programs }, MapPass::order(density), marks);
                }
                Step::Sweep { group, ref interval, kernel: _, objects } => {
                    self.device.queue.write_buffer(&self.buffers.moments, 0, bytemuck::bytes_of(&interval.moments));
                    let map = place.area().guarded(interval.guard);
                    let job = Job { map, slope: interval.slope, ..place.job(group, objects) };
                    let programs = self.bound(place.programs.swept.as_ref())?;
                    self.run(&SweepStep { job, programs }, &SweepPass::ORDER, marks);
                }
                Step::Finish => {
                    let mut encoder = self.encoder();
                    let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor::default());
                    let program = self.bound(place.film.finish.as_ref())?;
                    dispatch(&mut recorder, program, place.area().tiles, 0);
                    drop(recorder);
                    self.device.queue.submit([encoder.finish()]);
                }
            }
        }
        Ok(())
    }

    /// Programs that a step takes; they are bound for every frame that has the step.
    fn bound<'a, T>(&self, programs: Option<&'a T>) -> Result<&'a T, BackendError> {
        programs.ok_or_else(|| self.device.error("a step's programs were not bound"))
    }

    /// Makes the static layer of a position; false where there is no room for it, or nothing of it is wanted.
    pub(in crate::backend) fn static_layer(&self, place: Place<'_>, group: usize, marks: &mut Marks) -> bool {
        let job = place.job(group, Objects::Static);
        let Some(programs) = place.programs.static_layer.as_ref() else { return false };
        let any = !place.batches(&job).run.is_empty();
        if any {
            self.run(&StaticLayerStep { job, programs }, &StaticPass::ORDER, marks);
        }
        any
    }

    /// Splats a group, from the static layer on if there is one.
    pub(in crate::backend) fn splat(
        &self,
        place: Place<'_>,
        group: usize,
        has_layer: bool,
        marks: &mut Marks,
    ) -> Result<(), BackendError> {
        if has_layer {
            let job = Job { from_layer: true, ..place.job(group, Objects::Moving) };
            let layer = Some(self.bound(place.programs.static_layer.as_ref())?);
            self.run(&SplatStep { job, layer }, &SplatPass::ORDER, marks);
        } else {
            let job = place.job(group, Objects::All);
            self.run(&SplatStep { job, layer: None }, &SplatPass::ORDER, marks);
        }
        Ok(())
    }

    /// Makes the picture of static objects at a position, in the light of a group.
    pub(in crate::backend) fn static_picture(
        &self,
        place: Place<'_>,
        group: usize,
        marks: &mut Marks,
    ) -> Result<(), BackendError> {
        let programs = self.bound(place.programs.swept.as_ref())?;
        let resolve = self.bound(programs.static_picture.as_ref())?;
        let guard = place.prepared.frame.guard().unwrap_or(0);
        let job = Job { map: place.area().guarded(guard), ..place.job(group, Objects::Static) };
        let mut encoder = self.encoder();
        encoder.clear_buffer(&self.buffers.static_film, 0, None);
        self.flush(&mut encoder, marks);
        let step = StaticPictureStep { job, resolve };
        self.run(&step, &StaticPass::ORDER, marks);
        let mut encoder = self.encoder();
        step.keep_thresholds(self, &mut encoder);
        self.flush(&mut encoder, marks);
        Ok(())
    }
}

/// What a step records, pass by pass.
pub(in crate::backend) trait StepWork {
    /// Its passes.
    type Pass: Copy;

    /// The group.
    fn job(&self) -> &Job<'_>;

    /// The programs that make what its passes read.
    fn lists(&self) -> &ListPrograms;

    /// Whether `pass` reads the lists of a batch, and not only what was made of them.
    fn reads_splats(pass: Self::Pass) -> bool;

    /// What the time of `pass` counts as.
    fn stage(pass: Self::Pass) -> Stage;

    /// Records what comes before `pass`; the static layer has `cached` batches.
    fn prepare(
        &self,
        _state: &DeviceState,
        _encoder: &mut CommandEncoder,
        _pass: Self::Pass,
        _cached: usize,
        _marks: &mut Marks,
    ) {
    }

    /// Records a pass of one batch, whose view is at `view`.
    fn record(&self, recorder: &mut ComputePass<'_>, pass: Self::Pass, batch: &Batch, view: u32);

    /// Records what is kept of batch `number` after `pass`.
    fn keep(
        &self,
        _state: &DeviceState,
        _encoder: &mut CommandEncoder,
        _pass: Self::Pass,
        _batch: &Batch,
        _number: usize,
    ) {
    }
}

impl DeviceState {
    pub(in crate::backend) fn encoder(&self) -> CommandEncoder {
        self.device.handle.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Records and submits the passes of a step; those that read lists, batch by batch.
    pub(in crate::backend) fn run<W: StepWork>(&self, work: &W, passes: &[W::Pass], marks: &mut Marks) {
        let Batches { cached, run: batches } = self.upload(work.job());
        let Some(last) = batches.len().checked_sub(1) else { return };
        let mut encoder = self.encoder();
        let mut at_hand = None;
        for &pass in passes {
            work.prepare(self, &mut encoder, pass, cached.len(), marks);
            if !W::reads_splats(pass) {
                self.record(&mut encoder, work, pass, &batches[last], cached.len() + last, marks);
                continue;
            }
            for (number, batch) in batches.iter().enumerate() {
                let view = cached.len() + number;
                if at_hand != Some(number) {
                    self.make_lists(&mut encoder, work, batch, view, marks);
                    at_hand = Some(number);
                }
                self.record(&mut encoder, work, pass, batch, view, marks);
                work.keep(self, &mut encoder, pass, batch, number);
                if batches.len() > 1 {
                    self.flush(&mut encoder, marks);
                }
            }
        }
        self.flush(&mut encoder, marks);
    }

    /// Submits what is recorded.
    fn flush(&self, encoder: &mut CommandEncoder, marks: &mut Marks) {
        marks.collect(encoder);
        let done = std::mem::replace(encoder, self.encoder());
        self.device.queue.submit([done.finish()]);
    }

    /// Uploads a group's views, segments and lights; returns its batches.
    pub(in crate::backend) fn upload(&self, job: &Job<'_>) -> Batches {
        let Job { place, group, area, map, .. } = *job;
        let (prepared, raster) = (place.prepared, &place.position.raster);
        let batches = place.batches(job);
        let shared = View {
            pixels: area.pixels.to_array(),
            corner: area.corner,
            tiles: area.tiles,
            first_tile_row: area.first_tile_row,
            map_corner: map.corner,
            map_tiles: map.tiles,
            entry_capacity: self.buffers.entries.min(u64::from(u32::MAX)) as u32,
            slope: job.slope,
            ..View::of(prepared.frame, raster, group, prepared.channels.shared.uniform)
        };
        let mut views = Vec::new();
        let mut before = 0;
        let mut travels = vec![Travel::zeroed(); group.samples.len()];
        for (number, batch) in batches.cached.iter().chain(&batches.run).enumerate() {
            let view = View {
                slots: batch.slots,
                resumes: u32::from(number > 0 || job.from_layer),
                // Each interval has its own share of what is made once.
                weight: if job.objects == Objects::Static { 1.0 } else { shared.weight },
                first_turn: before,
                last_turn: batch.last_turn,
                ..shared
            };
            before = batch.last_turn;
            views.extend_from_slice(bytemuck::bytes_of(&view));
            views.resize(view_offset(number + 1) as usize, 0);
            travels.extend_from_slice(&batch.travels);
        }
        let weights = group.samples.iter().map(|sample| Segment::weighing(sample.weight));
        let segments: Vec<_> = weights.chain(batches.segments().copied()).collect();
        let queue = &self.device.queue;
        queue.write_buffer(&self.buffers.travels, 0, bytemuck::cast_slice(&travels));
        queue.write_buffer(&self.buffers.views, 0, &views);
        queue.write_buffer(&self.buffers.segments, 0, bytemuck::cast_slice(&segments));
        queue.write_buffer(&self.buffers.lights, 0, bytemuck::cast_slice(&lights(&group.samples)));
        batches
    }

    /// Records one pass of one batch, whose view is `number`.
    pub(in crate::backend) fn record<W: StepWork>(
        &self,
        encoder: &mut CommandEncoder,
        work: &W,
        pass: W::Pass,
        batch: &Batch,
        number: usize,
        marks: &mut Marks,
    ) {
        let timestamp_writes = marks.mark(W::stage(pass));
        let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        work.record(&mut recorder, pass, batch, view_offset(number));
    }

    /// Records `project` and `bin` of one batch, whose view is `number`.
    fn make_lists<W: StepWork>(
        &self,
        encoder: &mut CommandEncoder,
        work: &W,
        batch: &Batch,
        number: usize,
        marks: &mut Marks,
    ) {
        self.project(encoder, work, batch, number, marks);
        self.bin(encoder, work, batch, number, marks);
    }

    /// Records pass `project` of one batch, or `sweep`.
    pub(in crate::backend) fn project<W: StepWork>(
        &self,
        encoder: &mut CommandEncoder,
        work: &W,
        batch: &Batch,
        number: usize,
        marks: &mut Marks,
    ) {
        let timestamp_writes = marks.mark(Stage::Project);
        let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        of_segments(&mut recorder, &work.lists().project, batch, view_offset(number));
    }

    /// Records pass `bin` of one batch.
    pub(in crate::backend) fn bin<W: StepWork>(
        &self,
        encoder: &mut CommandEncoder,
        work: &W,
        batch: &Batch,
        number: usize,
        marks: &mut Marks,
    ) {
        let timestamp_writes = marks.mark(Stage::Bin);
        let recorder = &mut encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        let Job { place, area, .. } = *work.job();
        let BinPrograms { reduce, scan, sort, starts } = &place.programs.bin;
        let (view, groups) = (view_offset(number), [batch.slots.div_ceil(BLOCK), 1]);
        dispatch(recorder, reduce, groups, view);
        dispatch(recorder, scan, [1, 1], view);
        dispatch(recorder, &work.lists().emit, groups, view);
        let totals = &self.buffers.totals;
        for round in sort {
            round.count.set(recorder, &[view]);
            recorder.dispatch_workgroups_indirect(totals, 0);
            dispatch(recorder, &round.scan, [1 << DIGIT_BITS, 1], view);
            round.scatter.set(recorder, &[view]);
            recorder.dispatch_workgroups_indirect(totals, 0);
        }
        let [tiles_x, tiles_y] = area.tiles;
        dispatch(recorder, starts, [(tiles_x * tiles_y + 2).div_ceil(256), 1], view);
    }
}

/// Where view `number` begins, bytes.
pub(in crate::backend) const fn view_offset(number: usize) -> u32 {
    number as u32 * UNIFORM_STRIDE as u32
}

pub(in crate::backend) fn dispatch(
    recorder: &mut ComputePass<'_>,
    program: &BoundProgram,
    groups: [u32; 2],
    view: u32,
) {
    program.set(recorder, &[view]);
    recorder.dispatch_workgroups(groups[0], groups[1], 1);
}

/// One dispatch for each segment of the batch.
pub(in crate::backend) fn of_segments(
    recorder: &mut ComputePass<'_>,
    programs: &[Vec<BoundProgram>],
    batch: &Batch,
    view: u32,
) {
    for (segment, object, buffer) in &batch.segments {
        let offset = segment.index * UNIFORM_STRIDE as u32;
        programs[*object][*buffer].set(recorder, &[view, offset]);
        recorder.dispatch_workgroups(segment.surfels.div_ceil(256), 1, 1);
    }
}
