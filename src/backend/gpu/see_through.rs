//! See-through surfels: their programs, and the passes that peel their layers off. Twin:
//! `src/backend/cpu/transparent/see_through/mod.rs`.
//!
//! They are the passes of full EWA, with depths and films of their own. A tile of which nothing is left does nothing.

use wgpu::{CommandEncoder, ComputePass, ComputePassDescriptor};

use super::DeviceState;
use super::batches::Batch;
use super::bind::{Binder, BoundProgram, EwaPrograms, ListPrograms, SeeThroughPrograms};
use super::constants::{peel_constants, peel_resolve_constants, peel_value_constants};
use super::ewa::PARTS;
use super::job::{Job, Place, StepWork, dispatch, of_segments, view_offset};
use super::memory::DeviceChannels;
use super::prepared::Prepared;
use super::programs::{Constants, Program, Slot};
use super::timestamps::{Marks, Stage};
use crate::backend::BackendError;
use crate::plan::{LayerPass, Objects};

impl Binder<'_> {
    /// Binds the programs of see-through surfels, whose channels are `channels`. New lists go to the sort's buffers
    /// other than `emitted`.
    pub(super) fn see_through_programs(
        &mut self,
        prepared: &Prepared<'_>,
        channels: &DeviceChannels,
        emitted: usize,
    ) -> Result<SeeThroughPrograms, BackendError> {
        let Prepared { frame, planes, surfel_buffers, .. } = prepared;
        let buffers = self.buffers;
        let depths = [(Slot::Thresholds, buffers.peeled.as_entire_buffer_binding())];
        let film = [(Slot::Film, buffers.layers.as_entire_buffer_binding())];
        let peel = vec![("PEEL", 1)];
        let mut values = peel_value_constants(frame, channels);
        values.push(PARTS);
        let of_layers = peel_resolve_constants(frame, channels, planes);
        // Without groups of splats before the band nobody asks which pixels are solid.
        let second =
            if channels.layers > 1 { Some(self.program(Program::EwaSecond, &peel, 1, &depths)?) } else { None };
        Ok(SeeThroughPrograms {
            start: self.program(Program::PeelStart, &of_layers, 1, &film)?,
            ewa: EwaPrograms {
                lists: ListPrograms {
                    project: self.of_surfels(Program::EwaProject, &Constants::new(), surfel_buffers)?,
                    emit: self.program(Program::BinEmit, &vec![PARTS, ("PART", 1)], emitted, &[])?,
                },
                visibility: self.program(Program::EwaVisibility, &peel, 1, &depths)?,
                second,
                splat_values: self.of_surfels(Program::SplatValues, &values, surfel_buffers)?,
                attribute: self.program(Program::EwaAttribute, &peel_constants(channels), 1, &depths)?,
            },
            resolve: self.program(Program::PeelResolve, &of_layers, 1, &film)?,
            left_out: self.program(Program::PeelLeftOut, &of_layers, 1, &[])?,
        })
    }
}

impl DeviceState {
    /// Peels off the layers of see-through surfels of a group. False if it has none.
    pub(in crate::backend) fn see_through(
        &self,
        place: Place<'_>,
        group: usize,
        has_opaque: bool,
        marks: &mut Marks,
    ) -> bool {
        let Some(programs) = place.programs.see_through.as_ref() else { return false };
        let job = Job { has_opaque, ..place.ewa_job(group, Objects::SeeThrough) };
        let in_one_batch = place.batches(&job).run.len() == 1;
        let step = SeeThroughStep { job, programs, in_one_batch };
        self.run(&step, &LayerPass::ORDER, marks)
    }
}

/// The layers of one group.
struct SeeThroughStep<'a> {
    job: Job<'a>,
    programs: &'a SeeThroughPrograms,
    /// If so, the attributes of its splats stay from layer to layer.
    in_one_batch: bool,
}

impl SeeThroughStep<'_> {
    /// Records a program that reads no splats.
    fn record_alone(&self, encoder: &mut CommandEncoder, program: &BoundProgram, stage: Stage, marks: &mut Marks) {
        let timestamp_writes = marks.mark(stage);
        let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        dispatch(&mut recorder, program, self.job.area.tiles, view_offset(0));
    }
}

impl StepWork for SeeThroughStep<'_> {
    type Pass = LayerPass;

    fn job(&self) -> &Job<'_> {
        &self.job
    }

    fn lists(&self) -> &ListPrograms {
        &self.programs.ewa.lists
    }

    fn reads_splats(pass: LayerPass) -> bool {
        match pass {
            LayerPass::Visibility(_) | LayerPass::Attribute(_) => true,
            LayerPass::Resolve(_) | LayerPass::LeftOut => false,
        }
    }

    fn stage(pass: LayerPass) -> Stage {
        match pass {
            LayerPass::Visibility(_) | LayerPass::LeftOut => Stage::Visibility,
            LayerPass::Attribute(_) => Stage::Attribute,
            LayerPass::Resolve(_) => Stage::Resolve,
        }
    }

    fn prepare(
        &self,
        _state: &DeviceState,
        encoder: &mut CommandEncoder,
        pass: LayerPass,
        _cached: usize,
        marks: &mut Marks,
    ) {
        match pass {
            LayerPass::Visibility(0) => self.record_alone(encoder, &self.programs.start, Stage::Visibility, marks),
            LayerPass::Attribute(_) => {
                if let Some(second) = &self.programs.ewa.second {
                    self.record_alone(encoder, second, Stage::Visibility, marks);
                }
            }
            LayerPass::Visibility(_) | LayerPass::Resolve(_) | LayerPass::LeftOut => {}
        }
    }

    fn record(&self, recorder: &mut ComputePass<'_>, pass: LayerPass, batch: &Batch, view: u32) {
        let (SeeThroughPrograms { ewa, resolve, left_out, .. }, tiles) = (self.programs, self.job.area.tiles);
        match pass {
            LayerPass::Visibility(_) => dispatch(recorder, &ewa.visibility, tiles, view),
            LayerPass::Attribute(layer) => {
                if layer == 0 || !self.in_one_batch {
                    of_segments(recorder, &ewa.splat_values, batch, view);
                }
                dispatch(recorder, &ewa.attribute, tiles, view);
            }
            LayerPass::Resolve(_) => dispatch(recorder, resolve, tiles, view),
            LayerPass::LeftOut => dispatch(recorder, left_out, tiles, view),
        }
    }
}
