//! Step `Paint`, and instants of step `Published`: their programs, and the passes that they record. Twin:
//! `src/backend/cpu/paint/group.rs`.

use wgpu::ComputePass;

use super::batches::Batch;
use super::bind::{Binder, ListPrograms, PaintPrograms};
use super::constants::{depth_constants, sum_constants, value_constants};
use super::job::{Job, StepWork, dispatch, of_segments};
use super::layout::SHARES_REST;
use super::memory::DeviceChannels;
use super::prepared::Prepared;
use super::programs::{Constants, KernelKind, Program, Slot};
use super::timestamps::Stage;
use crate::backend::BackendError;
use crate::layout::{EwaSplat, Splat};
use crate::plan::PaintPass;

impl Binder<'_> {
    /// Binds the programs of kernels whose channels are `channels`. `peels`: layers are peeled off them, and their
    /// depths are in a buffer of their own. New lists go to the sort's buffers other than `emitted`.
    pub(super) fn paint_programs(
        &mut self,
        prepared: &Prepared<'_>,
        (kernel, channels): (KernelKind, &DeviceChannels),
        peels: bool,
        emitted: usize,
    ) -> Result<PaintPrograms, BackendError> {
        let Prepared { frame, surfel_buffers, .. } = prepared;
        let depths = if peels { &self.buffers.peeled } else { &self.buffers.thresholds };
        let depths = [(Slot::Thresholds, depths.as_entire_buffer_binding())];
        let of_depths = depth_constants(frame, kernel, peels);
        // Flags are in the first part, and the bounds of lists in the last.
        let parts =
            ("SPLATS", if kernel.is_filtered() { size_of::<EwaSplat>() / size_of::<Splat>() } else { 1 } as u32);
        let mut values = value_constants(frame, channels);
        values.push(parts);
        let mut sums = sum_constants(channels);
        sums.extend(&of_depths);
        let second = channels
            .is_layered()
            .then(|| self.program(Program::Second(self.device.lanes), &of_depths, 1, &depths))
            .transpose()?;
        Ok(PaintPrograms {
            lists: ListPrograms {
                project: self.of_surfels(Program::Project(kernel), &of_depths, surfel_buffers)?,
                emit: self.program(Program::BinEmit, &vec![parts, ("PART", parts.1 - 1)], emitted, &[])?,
            },
            // The sorted lists are in the first buffers.
            find_rest: self.program(Program::FindRest, &Constants::new(), 1, &[])?,
            visibility: self.program(Program::Visibility(kernel, self.device.lanes), &of_depths, 1, &depths)?,
            second,
            splat_values: self.of_surfels(Program::SplatValues, &values, surfel_buffers)?,
            attribute: self.program(Program::Attribute(kernel, self.device.lanes), &sums, 1, &depths)?,
        })
    }
}

impl DeviceChannels {
    /// Has a pixel several layers?
    pub(super) fn is_layered(&self) -> bool {
        self.layers > 1
    }
}

/// Step `Paint`, and instants of step `Published`.
pub(in crate::backend) struct PaintStep<'a> {
    pub job: Job<'a>,
    pub programs: &'a PaintPrograms,
}

impl StepWork for PaintStep<'_> {
    type Pass = PaintPass;

    fn job(&self) -> &Job<'_> {
        &self.job
    }

    fn lists(&self) -> &ListPrograms {
        &self.programs.lists
    }

    fn stage(pass: PaintPass) -> Stage {
        match pass {
            PaintPass::Visibility | PaintPass::Second => Stage::Visibility,
            PaintPass::Attribute => Stage::Attribute,
            PaintPass::Resolve => Stage::Resolve,
        }
    }

    fn record(&self, recorder: &mut ComputePass<'_>, pass: PaintPass, batch: &Batch, view: u32) {
        let (programs, tiles) = (self.programs, self.job.area.tiles);
        match pass {
            PaintPass::Visibility => {
                if self.job.flags & SHARES_REST != 0 {
                    dispatch(recorder, &programs.find_rest, [(tiles[0] * tiles[1]).div_ceil(256), 1], view);
                }
                dispatch(recorder, &programs.visibility, tiles, view);
            }
            PaintPass::Second => programs.second.iter().for_each(|program| dispatch(recorder, program, tiles, view)),
            PaintPass::Attribute => {
                of_segments(recorder, &programs.splat_values, batch, view);
                dispatch(recorder, &programs.attribute, tiles, view);
            }
            PaintPass::Resolve => dispatch(recorder, &self.job.place.film.resolve, tiles, view),
        }
    }
}
