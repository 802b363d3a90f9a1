//! Step `Paint`, and instants of step `Published`: their programs, and the passes that they record. Twin:
//! `src/backend/cpu/paint/group.rs`.

use wgpu::ComputePass;

use super::bind::{Binder, FilmPart, ListPrograms, PaintPrograms};
use super::constants::{depth_constants, sum_constants, value_constants};
use super::memory::DeviceChannels;
use super::prepared::Prepared;
use super::programs::{KernelKind, Program, Slot};
use super::recorder::{StepWork, of_surfels, of_views};
use super::timestamps::Stage;
use super::upload::Placed;
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
    pub programs: &'a PaintPrograms,
    pub film: &'a FilmPart,
}

impl StepWork for PaintStep<'_> {
    type Pass = PaintPass;

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

    fn record(&self, recorder: &mut ComputePass<'_>, pass: PaintPass, batch: &Placed) {
        let programs = self.programs;
        match pass {
            PaintPass::Visibility => of_views(recorder, &programs.visibility, batch),
            PaintPass::Second => programs.second.iter().for_each(|program| of_views(recorder, program, batch)),
            PaintPass::Attribute => {
                of_surfels(recorder, &programs.splat_values, batch);
                of_views(recorder, &programs.attribute, batch);
            }
            PaintPass::Resolve => of_views(recorder, &self.film.resolve, batch),
        }
    }
}
