//! Records the passes of a step, batch by batch.

use wgpu::{CommandEncoder, ComputePass, ComputePassDescriptor};

use super::DeviceState;
use super::bind::{BinPrograms, BoundProgram, BoundPrograms, ListPrograms, Round};
use super::layout::{DIGIT_BITS, WORKGROUP_ITEMS};
use super::memory::LONG;
use super::timestamps::{Marks, Stage};
use super::upload::{Placed, SurfelDispatch};
use crate::plan::{BatchPass, TilePass};

/// What a step records, pass by pass.
pub(in crate::backend) trait StepWork {
    /// Its passes.
    type Pass: TilePass;

    /// The programs that make what its passes read.
    fn lists(&self) -> &ListPrograms;

    /// The stage that the time of `pass` counts for.
    fn stage(pass: Self::Pass) -> Stage;

    /// Records a pass of one batch.
    fn record(&self, recorder: &mut ComputePass<'_>, pass: Self::Pass, batch: &Placed);
}

/// Records a chunk of a frame.
pub(in crate::backend) struct Recorder<'a> {
    pub state: &'a DeviceState,
    pub programs: &'a BoundPrograms,
    pub marks: &'a mut Marks,
    pub encoder: CommandEncoder,
    /// Slots of the lists that were recorded since the last submission.
    recorded: u64,
}

impl<'a> Recorder<'a> {
    pub(in crate::backend) fn new(
        state: &'a DeviceState,
        programs: &'a BoundPrograms,
        marks: &'a mut Marks,
        encoder: CommandEncoder,
    ) -> Self {
        Self { state, programs, marks, encoder, recorded: 0 }
    }

    /// Submits what is recorded, if it is so much that a device would not answer for long, or if times of no more
    /// passes can be measured.
    pub(in crate::backend) fn flush_if_long(&mut self) {
        if self.recorded > LONG || self.marks.is_full() {
            self.flush();
        }
    }

    /// Begins a pass, whose time counts for `stage`.
    pub(in crate::backend) fn pass(&mut self, stage: Stage) -> ComputePass<'_> {
        let timestamp_writes = self.marks.mark(stage);
        self.encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes })
    }

    /// Ends the recording. What is recorded is not yet submitted.
    pub(in crate::backend) fn end(mut self) -> CommandEncoder {
        self.marks.collect(&mut self.encoder);
        self.encoder
    }

    /// Submits what is recorded.
    pub(in crate::backend) fn flush(&mut self) {
        self.marks.collect(&mut self.encoder);
        self.recorded = 0;
        let done = std::mem::replace(&mut self.encoder, self.state.encoder());
        self.state.device.submit([done]);
    }

    /// Records the passes of a step. Passes that read lists run batch by batch.
    pub(in crate::backend) fn run<W: StepWork>(&mut self, work: &W, batches: &[Placed], passes: &[W::Pass]) {
        let Some(first) = batches.first() else { return };
        let mut at_hand = None;
        for &pass in passes {
            if !pass.reads_splats() {
                self.record(work, pass, first);
                continue;
            }
            for (number, batch) in batches.iter().enumerate() {
                if at_hand != Some(number) {
                    self.make_lists(work, batch);
                    at_hand = Some(number);
                }
                self.record(work, pass, batch);
                self.flush_if_long();
            }
        }
    }

    /// Records one pass of one batch.
    pub(in crate::backend) fn record<W: StepWork>(&mut self, work: &W, pass: W::Pass, batch: &Placed) {
        work.record(&mut self.pass(W::stage(pass)), pass, batch);
    }

    /// Records the passes that make the splats of one batch, and their lists.
    fn make_lists<W: StepWork>(&mut self, work: &W, batch: &Placed) {
        for pass in BatchPass::ORDER {
            match pass {
                BatchPass::Project => self.project(work, batch),
                BatchPass::Bin => self.bin(&work.lists().emit, batch),
            }
        }
    }

    /// Records pass `project` of one batch, or `sweep`.
    pub(in crate::backend) fn project<W: StepWork>(&mut self, work: &W, batch: &Placed) {
        of_surfels(&mut self.pass(Stage::Project), &work.lists().project, batch);
    }

    /// Records pass `bin` of one batch. `emit`: the program that emits its entries.
    pub(in crate::backend) fn bin(&mut self, emit: &BoundProgram, batch: &Placed) {
        let (state, BinPrograms { reduce, scan, sort, starts }) = (self.state, &self.programs.bin);
        self.recorded += u64::from(batch.slots);
        let recorder = &mut self.pass(Stage::Bin);
        let groups = [batch.slots.div_ceil(WORKGROUP_ITEMS), 1];
        dispatch(recorder, reduce, groups, batch.view);
        dispatch(recorder, scan, [1, 1], batch.view);
        dispatch(recorder, emit, groups, batch.view);
        state.sort(recorder, sort, batch.view);
        dispatch(recorder, starts, [(batch.round_tiles + 2 + batch.views).div_ceil(256), 1], batch.view);
    }
}

impl DeviceState {
    pub(in crate::backend) fn encoder(&self) -> CommandEncoder {
        self.device.handle.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
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

/// Records `groups` workgroups of a program, in columns and rows.
pub(in crate::backend) fn dispatch(
    recorder: &mut ComputePass<'_>,
    program: &BoundProgram,
    groups: [u32; 2],
    view: u32,
) {
    program.dispatch(recorder, &[view], [groups[0], groups[1], 1]);
}

/// Records what makes the splats of a batch, or their values: a program for each surfel buffer of each object.
pub(in crate::backend) fn of_surfels(recorder: &mut ComputePass<'_>, programs: &[Vec<BoundProgram>], batch: &Placed) {
    of_buffers(recorder, programs, batch.view, &batch.surfels);
}

/// The same for any buffers of models.
pub(in crate::backend) fn of_buffers(
    recorder: &mut ComputePass<'_>,
    programs: &[Vec<BoundProgram>],
    view: u32,
    dispatches: &[SurfelDispatch],
) {
    for &SurfelDispatch { object, buffer, table, workgroups } in dispatches {
        programs[object][buffer].dispatch(recorder, &[view, table], [workgroups, 1, 1]);
    }
}

/// Records a workgroup for each tile of each view of a round.
pub(in crate::backend) fn of_views(recorder: &mut ComputePass<'_>, program: &BoundProgram, round: &Placed) {
    let [x, y] = round.tiles;
    program.dispatch(recorder, &[round.view], [x, y, round.views]);
}

/// The same for each stretch of the lists.
pub(in crate::backend) fn in_stretches(recorder: &mut ComputePass<'_>, program: &BoundProgram, round: &Placed) {
    let [x, y] = round.tiles;
    for &view in [round.view].iter().chain(&round.later) {
        program.dispatch(recorder, &[view], [x, y, round.views]);
    }
}
