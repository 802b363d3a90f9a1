//! Step `Ewa`: its programs, and the passes that it records. Twin: `src/backend/cpu/ewa/group.rs`.

use wgpu::ComputePass;

use super::batches::Batch;
use super::bind::{Binder, EwaPrograms, ListPrograms};
use super::constants::{ewa_constants, value_constants};
use super::job::{Job, StepWork, dispatch, of_segments};
use super::prepared::Prepared;
use super::programs::{Constants, Program};
use super::timestamps::Stage;
use crate::backend::BackendError;
use crate::layout::{EwaSplat, Splat};
use crate::plan::EwaPass;

/// Size of a filtered splat in splats.
pub(super) const PARTS: (&str, u32) = ("SPLATS", (size_of::<EwaSplat>() / size_of::<Splat>()) as u32);

impl Binder<'_> {
    /// Binds the programs of full EWA. New lists go to the sort's buffers other than `emitted`.
    pub(super) fn ewa_programs(
        &mut self,
        prepared: &Prepared<'_>,
        emitted: usize,
    ) -> Result<EwaPrograms, BackendError> {
        let Prepared { frame, channels, surfel_buffers, .. } = prepared;
        let none = Constants::new();
        // Flags are those of the disc, which comes first.
        let mut values = value_constants(frame, channels);
        values.push(PARTS);
        // Without layers a pixel has the band alone.
        let second = if channels.layers > 1 { Some(self.program(Program::EwaSecond, &none, 1, &[])?) } else { None };
        Ok(EwaPrograms {
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

/// Step `Ewa`.
pub(in crate::backend) struct EwaStep<'a> {
    pub job: Job<'a>,
    pub programs: &'a EwaPrograms,
}

impl StepWork for EwaStep<'_> {
    type Pass = EwaPass;

    fn job(&self) -> &Job<'_> {
        &self.job
    }

    fn lists(&self) -> &ListPrograms {
        &self.programs.lists
    }

    fn reads_splats(pass: EwaPass) -> bool {
        match pass {
            EwaPass::Visibility | EwaPass::Second | EwaPass::Attribute => true,
            EwaPass::Resolve => false,
        }
    }

    fn stage(pass: EwaPass) -> Stage {
        match pass {
            EwaPass::Visibility | EwaPass::Second => Stage::Visibility,
            EwaPass::Attribute => Stage::Attribute,
            EwaPass::Resolve => Stage::Resolve,
        }
    }

    fn record(&self, recorder: &mut ComputePass<'_>, pass: EwaPass, batch: &Batch, view: u32) {
        let tiles = self.job.area.tiles;
        match pass {
            EwaPass::Visibility => dispatch(recorder, &self.programs.visibility, tiles, view),
            EwaPass::Second => {
                if let Some(program) = &self.programs.second {
                    dispatch(recorder, program, tiles, view);
                }
            }
            EwaPass::Attribute => {
                of_segments(recorder, &self.programs.splat_values, batch, view);
                dispatch(recorder, &self.programs.attribute, tiles, view);
            }
            EwaPass::Resolve => dispatch(recorder, &self.job.place.film.resolve, tiles, view),
        }
    }
}
