//! Records the passes of a step, batch by batch.

use std::mem::offset_of;

use wgpu::{CommandEncoder, ComputePass, ComputePassDescriptor};

use super::DeviceState;
use super::bind::{Binder, BoundProgram, BoundPrograms, Own, Use, rounds_of_tiles};
use super::constants::Digit;
use super::layout::{DIGIT_BITS, Totals, WORKGROUP_ITEMS, WORKGROUP_SURFELS};
use super::memory::LONG;
use super::passes::{Per, Program};
use super::prepared::Prepared;
use super::shadow_sizes::DRAWING;
use super::shadows::shades_gaussians;
use super::slots::Slot;
use super::steps::{DevicePass, Kind, SHADOW_LAYER, SHADOWS};
use super::timestamps::{Marks, Stage};
use super::upload::{Placed, SurfelDispatch};
use crate::backend::BackendError;
use crate::plan::BatchPass;

/// Digits of a depth, 32 bits. Their sort ends in the first buffers.
const DIGITS_OF_DEPTH: u32 = u32::BITS.div_ceil(DIGIT_BITS);
const _: () = assert!(DIGITS_OF_DEPTH.is_multiple_of(2));

/// Most workgroups for the texels of a light.
const MOST_OF_TEXELS: u64 = 512;

/// Records a chunk of a frame.
pub(in crate::backend) struct Recorder<'a> {
    binder: Binder<'a>,
    marks: &'a mut Marks,
    encoder: CommandEncoder,
    /// Slots of the lists that were recorded since the last submission.
    recorded: u64,
}

/// A call of a program, bound, with the offsets of its uniforms.
struct Call {
    program: BoundProgram,
    offsets: Vec<u32>,
    workgroups: Workgroups,
}

/// Numbers of workgroups.
#[derive(Clone, Copy)]
enum Workgroups {
    These([u32; 3]),
    /// Those in [`Slot::Totals`], from this byte on.
    Totals(u64),
}

/// Bytes of the totals before the workgroups of programs with one invocation for each entry.
const PIECES_AT: u64 = offset_of!(Totals, columns) as u64;

impl<'a> Recorder<'a> {
    pub(in crate::backend) fn new(
        prepared: &'a Prepared<'a>,
        state: &'a mut DeviceState,
        bound: &'a mut BoundPrograms,
        marks: &'a mut Marks,
        encoder: CommandEncoder,
    ) -> Self {
        Self { binder: Binder { prepared, state, bound }, marks, encoder, recorded: 0 }
    }

    /// Submits what is recorded, if it is so much that a device would not answer for long, or if times of no more
    /// passes can be measured.
    pub(in crate::backend) fn flush_if_long(&mut self) {
        if self.recorded > LONG || self.marks.is_full() {
            self.flush();
        }
    }

    /// Fills a buffer with zeros.
    pub(in crate::backend) fn clear(&mut self, slot: Slot) {
        self.encoder.clear_buffer(&self.binder.state.buffers[slot], 0, None);
    }

    /// Copies the first bytes of a buffer, from byte `start`, to another.
    pub(in crate::backend) fn copy(&mut self, (from, start): (Slot, u64), to: Slot, bytes: u64) {
        let buffers = &self.binder.state.buffers;
        self.encoder.copy_buffer_to_buffer(&buffers[from], start, &buffers[to], 0, bytes);
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
        let done = std::mem::replace(&mut self.encoder, self.binder.state.encoder());
        self.binder.state.device.submit([done]);
    }

    /// Records the passes of a step on surfels. Passes that read lists run batch by batch. `of`: the step's kind, and
    /// the part of the film that it writes.
    pub(in crate::backend) fn run<P: DevicePass>(
        &mut self,
        of: (Kind, usize),
        batches: &[Placed],
        passes: &[P],
    ) -> Result<(), BackendError> {
        let Some(first) = batches.first() else { return Ok(()) };
        if of.0.draws_shadows() && self.binder.prepared.schedule.shadows.lights > 0 {
            self.shadows(first)?;
        }
        let mut at_hand = None;
        for &pass in passes {
            if !pass.reads_splats() {
                self.record(of, pass, first, batches.len())?;
                continue;
            }
            for (number, batch) in batches.iter().enumerate() {
                if at_hand != Some(number) {
                    for pass in BatchPass::ORDER {
                        self.record_batch(of.0, pass, batch)?;
                    }
                    at_hand = Some(number);
                }
                self.record(of, pass, batch, batches.len())?;
                self.flush_if_long();
            }
        }
        Ok(())
    }

    /// Records one pass of one batch of several.
    pub(in crate::backend) fn record<P: DevicePass>(
        &mut self,
        (kind, film): (Kind, usize),
        pass: P,
        batch: &Placed,
        batches: usize,
    ) -> Result<(), BackendError> {
        let programs = pass.programs(self.binder.prepared.frame, batch, batches);
        self.programs((kind, film), &programs, batch)
    }

    /// Records what draws the shadow maps of groups, whose first batches these are.
    fn shadows(&mut self, first: &Placed) -> Result<(), BackendError> {
        let Binder { prepared, state, .. } = &self.binder;
        let shadows = prepared.schedule.shadows;
        let bytes = u64::from(first.views) * shadows.map_bytes();
        self.encoder.clear_buffer(&state.buffers[Slot::ShadowMaps], 0, Some(bytes));
        self.recorded += u64::from(first.views) * shadows.lights * shadows.casters;
        self.programs((Kind::Paint, 0), &SHADOWS, first)?;
        self.recorded += first.shadow_layers as u64 * u64::from(first.views) * shadows.lights * shadows.casters;
        self.programs((Kind::Peel, 0), &SHADOW_LAYER.repeat(first.shadow_layers), first)
    }

    /// May shadows fall on captures or volumes?
    pub(in crate::backend) fn shades_gaussians(&self) -> bool {
        shades_gaussians(self.binder.prepared)
    }

    /// Records a pass that makes the splats of a batch, or their lists.
    pub(in crate::backend) fn record_batch(
        &mut self,
        kind: Kind,
        pass: BatchPass,
        batch: &Placed,
    ) -> Result<(), BackendError> {
        match pass {
            BatchPass::Project => self.programs((kind, 0), &[kind.project()], batch),
            BatchPass::Bin => self.bin(kind, batch),
        }
    }

    /// Records pass `bin` of one batch.
    pub(in crate::backend) fn bin(&mut self, kind: Kind, batch: &Placed) -> Result<(), BackendError> {
        self.recorded += u64::from(batch.slots);
        let rounds = rounds_of_tiles(self.binder.prepared);
        let mut calls = Vec::new();
        for program in [Program::BinReduce, Program::BinScan, Program::BinEmit] {
            self.add((kind, 0, Own::Nothing), program, batch, &mut calls)?;
        }
        // The last round writes the first buffers.
        let rounds = (0..rounds).map(|round| (Digit::OfKey(round), (rounds - round).is_multiple_of(2)));
        self.add_sort(kind, rounds, batch, &mut calls)?;
        self.add((kind, 0, Own::Nothing), Program::BinStarts, batch, &mut calls)?;
        self.calls(Stage::Bin, &calls);
        Ok(())
    }

    /// Records a sort by depth of as many entries as the totals say; then by view, if wanted. It begins in the first
    /// buffers.
    pub(in crate::backend) fn sort(&mut self, by_view: bool, of: &Placed) -> Result<(), BackendError> {
        let digits = (0..DIGITS_OF_DEPTH).map(Digit::OfKey).chain(by_view.then_some(Digit::OfView));
        let mut calls = Vec::new();
        self.add_sort(Kind::Sorted, digits.zip([true, false].into_iter().cycle()), of, &mut calls)?;
        self.calls(Stage::Sort, &calls);
        Ok(())
    }

    /// Records programs of a pass, one after the other.
    pub(in crate::backend) fn programs(
        &mut self,
        (kind, film): (Kind, usize),
        programs: &[Program],
        batch: &Placed,
    ) -> Result<(), BackendError> {
        let mut calls = Vec::new();
        for &program in programs {
            self.add((kind, film, Own::Nothing), program, batch, &mut calls)?;
        }
        if let Some(program) = programs.first() {
            let stage = program.row().stage;
            debug_assert!(programs.iter().all(|other| other.row().stage == stage), "a pass has one stage");
            self.calls(stage, &calls);
        }
        Ok(())
    }

    /// Adds rounds of a sort: what each goes by, and whether it reads the first buffers.
    fn add_sort(
        &mut self,
        kind: Kind,
        rounds: impl Iterator<Item = (Digit, bool)>,
        batch: &Placed,
        calls: &mut Vec<Call>,
    ) -> Result<(), BackendError> {
        for (by, reads_first) in rounds {
            for program in [Program::SortCount, Program::SortScan, Program::SortScatter] {
                self.add((kind, 0, Own::Sort { by, reads_first }), program, batch, calls)?;
            }
        }
        Ok(())
    }

    /// Adds the calls of a program for a batch.
    fn add(
        &mut self,
        (kind, film, own): (Kind, usize, Own),
        program: Program,
        batch: &Placed,
        calls: &mut Vec<Call>,
    ) -> Result<(), BackendError> {
        let ([x, y], view) = (batch.tiles, batch.view);
        let shadows = self.binder.prepared.schedule.shadows;
        let shadow_lights = shadows.lights as u32;
        // What does not write the film is bound once for all parts of it.
        let film = if program.row().writes.contains(&Slot::Film) { film } else { 0 };
        let mut add = |own: Own, offsets: Vec<u32>, workgroups: Workgroups| {
            let program = self.binder.program(program, Use { kind, film, own })?;
            calls.push(Call { program, offsets, workgroups });
            Ok(())
        };
        match program.row().per {
            Per::Surfels => {
                for &SurfelDispatch { object, buffer, table, workgroups } in &batch.surfels {
                    add(Own::Model(object, buffer), vec![view, table], Workgroups::These([workgroups, 1, 1]))?;
                }
                Ok(())
            }
            Per::Casters | Per::CasterAndLight | Per::WideCasterAndLight => {
                let of_block = match program.row().per {
                    Per::Casters => [1, 1],
                    Per::CasterAndLight => [WORKGROUP_SURFELS / DRAWING, shadow_lights],
                    _ => [WORKGROUP_SURFELS, shadow_lights],
                };
                let casters = if kind == Kind::Peel { &batch.veils } else { &batch.casters };
                for &SurfelDispatch { object, buffer, table, workgroups } in casters {
                    let groups = [workgroups, of_block[0], of_block[1]];
                    add(Own::Model(object, buffer), vec![view, table], Workgroups::These(groups))?;
                }
                Ok(())
            }
            Per::Receivers => {
                for &SurfelDispatch { object, buffer, table, workgroups } in &batch.receivers {
                    add(Own::Model(object, buffer), vec![view, table], Workgroups::These([workgroups, 1, 1]))?;
                }
                Ok(())
            }
            Per::ShadowLight => add(own, vec![view], Workgroups::These([shadow_lights, batch.views, 1])),
            Per::ShadowTexels => {
                let texels = shadows.room().div_ceil(256).min(MOST_OF_TEXELS);
                add(own, vec![view], Workgroups::These([texels as u32, shadow_lights, batch.views]))
            }
            Per::Stretch => [view]
                .iter()
                .chain(&batch.later)
                .try_for_each(|&view| add(own, vec![view], Workgroups::These([x, y, batch.views]))),
            Per::Slots => add(own, vec![view], Workgroups::These([batch.slots.div_ceil(WORKGROUP_ITEMS), 1, 1])),
            Per::All => add(own, vec![view], Workgroups::These([1; 3])),
            Per::Entries => add(own, vec![view], Workgroups::Totals(0)),
            Per::Entry => add(own, vec![view], Workgroups::Totals(PIECES_AT)),
            Per::Digit => add(own, vec![view], Workgroups::These([1 << DIGIT_BITS, 1, 1])),
            Per::Starts => {
                add(own, vec![view], Workgroups::These([(batch.round_tiles + 2 + batch.views).div_ceil(256), 1, 1]))
            }
            Per::Tile => add(own, vec![view], Workgroups::These([x, y, batch.views])),
            Per::TileAndBackground => add(own, vec![view, batch.backdrop], Workgroups::These([x, y, batch.views])),
        }
    }

    /// Records calls, whose time counts for `stage`.
    fn calls(&mut self, stage: Stage, calls: &[Call]) {
        let timestamp_writes = self.marks.mark(stage);
        let pass: &mut ComputePass<'_> =
            &mut self.encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        for Call { program, offsets, workgroups } in calls {
            match *workgroups {
                Workgroups::These(workgroups) => program.dispatch(pass, offsets, workgroups),
                Workgroups::Totals(at) => {
                    program.dispatch_indirect(pass, offsets, (&self.binder.state.buffers[Slot::Totals], at));
                }
            }
        }
    }
}

impl DeviceState {
    pub(in crate::backend) fn encoder(&self) -> CommandEncoder {
        self.device.handle.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }
}
