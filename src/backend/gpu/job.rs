//! Runs a step for one group: uploads the group, then records and submits the passes, batch by batch.

use bytemuck::Zeroable;
use wgpu::{CommandEncoder, ComputePass, ComputePassDescriptor};

use super::DeviceState;
use super::batches::{Batch, segments};
use super::bind::{BinPrograms, BoundProgram, BoundPrograms, FilmPart, ListPrograms, Round};
use super::layout::{DIGIT_BITS, Segment, Travel, UNIFORM_STRIDE, View, WORKGROUP_ITEMS, lights};
use super::memory::{Area, Band};
use super::prepared::Prepared;
use super::timestamps::{Marks, Stage};
use crate::frame::{PosedGroup, Position, Raster};
use crate::plan::{BatchPass, PosedInterval, TilePass};

/// One sample position in one band.
#[derive(Clone, Copy)]
pub(in crate::backend) struct JobPlace<'a> {
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
    /// Slope of the time weight, as in [`crate::plan::PosedInterval`]. It is 0 where samples are instants.
    pub slope: f32,
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
        Job { place: self, group, see_through: false, area, map, flags: 0, slope: 0.0 }
    }

    /// The same for kernels at instants. Its pixels are those of the band and of the apron around it; its tiles are the
    /// band's.
    pub(in crate::backend) fn paint_job(self, group: usize, see_through: bool) -> Job<'a> {
        let (job, raster) = (self.job(group), self.raster(see_through));
        let pixels = job.area.pixels.widened(raster.apron() as i32, raster.size);
        Job { area: Area { pixels, ..job.area }, see_through, ..job }
    }

    /// The job of a group's interval. Only published kernels have a map, `guard` pixels wider than the band.
    pub(in crate::backend) fn sweep_job(self, group: usize, interval: &PosedInterval) -> Job<'a> {
        let around = self.area().guarded(interval.guard);
        let has_map = self.prepared.frame.guard().is_some();
        let map = if has_map { around } else { Area { tiles: [0; 2], ..around } };
        Job { map, slope: interval.slope, ..self.job(group) }
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

/// What a step records, pass by pass.
pub(in crate::backend) trait StepWork {
    /// Its passes.
    type Pass: TilePass;

    /// The group.
    fn job(&self) -> &Job<'_>;

    /// The programs that make what its passes read.
    fn lists(&self) -> &ListPrograms;

    /// The stage that the time of `pass` counts for.
    fn stage(pass: Self::Pass) -> Stage;

    /// Records a pass of one batch, whose view is at `view`.
    fn record(&self, recorder: &mut ComputePass<'_>, pass: Self::Pass, batch: &Batch, view: u32);
}

impl DeviceState {
    pub(in crate::backend) fn encoder(&self) -> CommandEncoder {
        self.device.handle.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Records and submits the passes of a step. Passes that read lists run batch by batch. False if there is no batch.
    pub(in crate::backend) fn run<W: StepWork>(&self, work: &W, passes: &[W::Pass], marks: &mut Marks) -> bool {
        let batches = work.job().place.batches(work.job());
        self.run_batches(work, &batches, passes, marks)
    }

    /// As [`Self::run`], of batches that are at hand.
    pub(in crate::backend) fn run_batches<W: StepWork>(
        &self,
        work: &W,
        batches: &[Batch],
        passes: &[W::Pass],
        marks: &mut Marks,
    ) -> bool {
        self.upload(work.job(), batches);
        let Some(first) = batches.first() else { return false };
        let mut encoder = self.encoder();
        let mut at_hand = None;
        for &pass in passes {
            if !pass.reads_splats() {
                Self::record(&mut encoder, work, pass, first, 0, marks);
                continue;
            }
            for (number, batch) in batches.iter().enumerate() {
                if at_hand != Some(number) {
                    self.make_lists(&mut encoder, work, batch, number, marks);
                    at_hand = Some(number);
                }
                Self::record(&mut encoder, work, pass, batch, number, marks);
                if batches.len() > 1 {
                    self.flush(&mut encoder, marks);
                }
            }
        }
        self.flush(&mut encoder, marks);
        true
    }

    /// Submits what is recorded.
    pub(in crate::backend) fn flush(&self, encoder: &mut CommandEncoder, marks: &mut Marks) {
        marks.collect(encoder);
        let done = std::mem::replace(encoder, self.encoder());
        self.device.submit([done]);
    }

    /// Uploads the views, segments and lights of a group, which is cut into `batches`.
    pub(in crate::backend) fn upload(&self, job: &Job<'_>, batches: &[Batch]) {
        let Job { place, group, area, map, .. } = *job;
        let (prepared, raster) = (place.prepared, place.raster(job.see_through));
        let shared = View {
            pixels: area.pixels.to_array(),
            corner: area.corner,
            tiles: area.tiles,
            first_tile_row: area.first_tile_row,
            map_corner: map.corner,
            map_tiles: map.tiles,
            entry_capacity: self.buffers.entries.min(u64::from(u32::MAX)) as u32,
            slope: job.slope,
            flags: job.flags,
            opaque_scale: group_scale(group),
            ..View::of(prepared.frame, &raster, group, &prepared.channels.shared)
        };
        let mut views = Vec::new();
        let mut before = 0;
        let mut travels = vec![Travel::zeroed(); group.samples.len()];
        for (number, batch) in batches.iter().enumerate() {
            let view = View {
                slots: batch.slots,
                slots_at_rest: batch.at_rest.slots,
                resumes: u32::from(number > 0),
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
        let all: Vec<_> = weights.chain(segments(batches).copied()).collect();
        let device = &self.device;
        device.write(&self.buffers.travels, 0, bytemuck::cast_slice(&travels));
        device.write(&self.buffers.views, 0, &views);
        device.write(&self.buffers.segments, 0, bytemuck::cast_slice(&all));
        device.write(&self.buffers.lights, 0, bytemuck::cast_slice(&lights(&group.samples)));
    }

    /// Records one pass of one batch, whose view is `number`.
    pub(in crate::backend) fn record<W: StepWork>(
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

    /// Records the passes that make the splats of one batch, and their lists. Its view is `number`.
    fn make_lists<W: StepWork>(
        &self,
        encoder: &mut CommandEncoder,
        work: &W,
        batch: &Batch,
        number: usize,
        marks: &mut Marks,
    ) {
        for pass in BatchPass::ORDER {
            match pass {
                BatchPass::Project => Self::project(encoder, work, batch, number, marks),
                BatchPass::Bin => self.bin(encoder, work, batch, number, marks),
            }
        }
    }

    /// Records pass `project` of one batch, or `sweep`.
    pub(in crate::backend) fn project<W: StepWork>(
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
        self.lists(recorder, place.programs, &work.lists().emit, batch.slots, area.tiles, view_offset(number));
    }

    /// Records pass `bin` of `slots` slots. `emit`: the program that emits their entries.
    pub(in crate::backend) fn lists(
        &self,
        recorder: &mut ComputePass<'_>,
        programs: &BoundPrograms,
        emit: &BoundProgram,
        slots: u32,
        [tiles_x, tiles_y]: [u32; 2],
        view: u32,
    ) {
        let BinPrograms { reduce, scan, sort, starts } = &programs.bin;
        let groups = [slots.div_ceil(WORKGROUP_ITEMS), 1];
        dispatch(recorder, reduce, groups, view);
        dispatch(recorder, scan, [1, 1], view);
        dispatch(recorder, emit, groups, view);
        self.sort(recorder, sort, view);
        dispatch(recorder, starts, [(tiles_x * tiles_y + 2).div_ceil(256), 1], view);
    }

    /// Records the rounds of a sort of as many entries as `totals` has.
    pub(in crate::backend) fn sort(&self, recorder: &mut ComputePass<'_>, rounds: &[Round], view: u32) {
        let totals = &self.buffers.totals;
        for round in rounds {
            round.count.dispatch_indirect(recorder, &[view], totals);
            dispatch(recorder, &round.scan, [1 << DIGIT_BITS, 1], view);
            round.scatter.dispatch_indirect(recorder, &[view], totals);
        }
    }
}

/// What turns sums over a group's samples into means.
pub(in crate::backend) fn group_scale(group: &PosedGroup) -> f32 {
    let total: f32 = group.samples.iter().map(|sample| sample.weight).sum();
    if group.samples.len() > 1 && total > 0.0 { 1.0 / total } else { 1.0 }
}

/// Where view `number` begins, bytes.
pub(in crate::backend) const fn view_offset(number: usize) -> u32 {
    number as u32 * UNIFORM_STRIDE as u32
}

/// Records `groups` workgroups of a program, in columns and rows.
pub(in crate::backend) fn dispatch(
    recorder: &mut ComputePass<'_>,
    program: &BoundProgram,
    groups: [u32; 2],
    view: u32,
) {
    program.dispatch(recorder, &[view], groups);
}

/// One dispatch for each segment of the batch whose splats are not at hand.
pub(in crate::backend) fn of_segments(
    recorder: &mut ComputePass<'_>,
    programs: &[Vec<BoundProgram>],
    batch: &Batch,
    view: u32,
) {
    for (segment, object, buffer) in batch.unmade() {
        let offset = segment.index * UNIFORM_STRIDE as u32;
        programs[*object][*buffer].dispatch(recorder, &[view, offset], [segment.surfels.div_ceil(256), 1]);
    }
}
