//! Step `Paint`, and instants of step `Published`: their programs, and the passes that they record. Twin:
//! `src/backend/cpu/paint/group.rs`.

use wgpu::ComputePass;

use super::batches::Batch;
use super::bind::{Binder, ListPrograms, PaintPrograms};
use super::constants::{ewa_constants, sum_constants, value_constants};
use super::job::{Job, StepWork, dispatch, of_segments};
use super::memory::DeviceChannels;
use super::prepared::Prepared;
use super::programs::{Constants, Program};
use super::timestamps::Stage;
use crate::backend::BackendError;
use crate::layout::{EwaSplat, Splat};
use crate::plan::PaintPass;

/// Size of a filtered splat in splats.
pub(super) const PARTS: (&str, u32) = ("SPLATS", (size_of::<EwaSplat>() / size_of::<Splat>()) as u32);

impl Binder<'_> {
    /// Binds the programs of discs, with low-pass discs or without. New lists go to the sort's buffers other than
    /// `emitted`.
    pub(super) fn disc_programs(
        &mut self,
        prepared: &Prepared<'_>,
        emitted: usize,
    ) -> Result<PaintPrograms, BackendError> {
        let Prepared { frame, channels, surfel_buffers, .. } = prepared;
        let none = Constants::new();
        let values = value_constants(frame, channels);
        Ok(PaintPrograms {
            lists: ListPrograms {
                project: self.of_surfels(Program::Project, &none, surfel_buffers)?,
                emit: self.program(Program::BinEmit, &none, emitted, &[])?,
            },
            // The sorted lists are in the first buffers.
            visibility: self.program(Program::Visibility, &none, 1, &[])?,
            second: None,
            splat_values: self.of_surfels(Program::SplatValues, &values, surfel_buffers)?,
            attribute: self.program(Program::SumAttributes, &sum_constants(channels), 1, &[])?,
        })
    }

    /// Binds the programs of filtered kernels. New lists go to the sort's buffers other than `emitted`.
    pub(super) fn filtered_programs(
        &mut self,
        prepared: &Prepared<'_>,
        emitted: usize,
    ) -> Result<PaintPrograms, BackendError> {
        let Prepared { frame, channels, surfel_buffers, .. } = prepared;
        let none = Constants::new();
        // Flags are those of the disc, which comes first.
        let mut values = value_constants(frame, channels);
        values.push(PARTS);
        let second = channels.is_layered().then(|| self.program(Program::EwaSecond, &none, 1, &[])).transpose()?;
        Ok(PaintPrograms {
            lists: ListPrograms {
                project: self.of_surfels(Program::EwaProject, &none, surfel_buffers)?,
                emit: self.program(Program::BinEmit, &vec![PARTS, ("PART", 1)], emitted, &[])?,
            },
            visibility: self.program(Program::EwaVisibility, &none, 1, &[])?,
            second,
            splat_values: self.of_surfels(Program::SplatValues, &values, surfel_buffers)?,
            attribute: self.program(Program::EwaAttribute, &ewa_constants(channels), 1, &[])?,
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

    fn reads_splats(pass: PaintPass) -> bool {
        pass != PaintPass::Resolve
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
            PaintPass::Visibility => dispatch(recorder, &programs.visibility, tiles, view),
            PaintPass::Second => programs.second.iter().for_each(|program| dispatch(recorder, program, tiles, view)),
            PaintPass::Attribute => {
                of_segments(recorder, &programs.splat_values, batch, view);
                dispatch(recorder, &programs.attribute, tiles, view);
            }
            PaintPass::Resolve => dispatch(recorder, &self.job.place.film.resolve, tiles, view),
        }
    }
}
