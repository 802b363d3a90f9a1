//! See-through surfels: their programs, and the passes that peel their layers off. Twin:
//! `src/backend/cpu/transparent/see_through/mod.rs`.
//!
//! They are the passes of full EWA, with depths and films of their own. A tile of which nothing is left does nothing.

use wgpu::ComputePass;

use super::bind::{Binder, ListPrograms, SeeThroughPrograms};
use super::constants::peel_constants;
use super::memory::DeviceChannels;
use super::prepared::Prepared;
use super::programs::{KernelKind, Program, Slot};
use super::recorder::{StepWork, of_surfels, of_views};
use super::timestamps::Stage;
use super::upload::Placed;
use crate::backend::BackendError;
use crate::plan::LayerPass;

impl Binder<'_> {
    /// Binds the programs of see-through surfels, whose channels are `channels`. New lists go to the sort's buffers
    /// other than `emitted`.
    pub(super) fn see_through_programs(
        &mut self,
        prepared: &Prepared<'_>,
        channels: &DeviceChannels,
        emitted: usize,
    ) -> Result<SeeThroughPrograms, BackendError> {
        let film = [(Slot::Film, self.buffers.layers.as_entire_buffer_binding())];
        let of_layers = peel_constants(prepared.frame, channels, &prepared.planes);
        Ok(SeeThroughPrograms {
            start: self.program(Program::PeelStart, &of_layers, 1, &film)?,
            // Without groups of splats before the band nobody asks which pixels are solid.
            paint: self.paint_programs(prepared, (KernelKind::Filtered, channels), true, emitted)?,
            resolve: self.program(Program::PeelResolve, &of_layers, 1, &film)?,
            left_out: self.program(Program::PeelLeftOut, &of_layers, 1, &[])?,
        })
    }
}

/// The layers of one group.
pub(super) struct SeeThroughStep<'a> {
    pub programs: &'a SeeThroughPrograms,
    /// If so, the attributes of its splats stay from layer to layer.
    pub in_one_batch: bool,
}

impl StepWork for SeeThroughStep<'_> {
    type Pass = LayerPass;

    fn lists(&self) -> &ListPrograms {
        &self.programs.paint.lists
    }

    fn stage(pass: LayerPass) -> Stage {
        match pass {
            LayerPass::Start | LayerPass::Visibility(_) | LayerPass::Second(_) | LayerPass::LeftOut => {
                Stage::Visibility
            }
            LayerPass::Attribute(_) => Stage::Attribute,
            LayerPass::Resolve(_) => Stage::Resolve,
        }
    }

    fn record(&self, recorder: &mut ComputePass<'_>, pass: LayerPass, batch: &Placed) {
        let SeeThroughPrograms { start, paint, resolve, left_out } = self.programs;
        match pass {
            LayerPass::Start => of_views(recorder, start, batch),
            LayerPass::Visibility(_) => of_views(recorder, &paint.visibility, batch),
            LayerPass::Second(_) => paint.second.iter().for_each(|program| of_views(recorder, program, batch)),
            LayerPass::Attribute(layer) => {
                if layer == 0 || !self.in_one_batch {
                    of_surfels(recorder, &paint.splat_values, batch);
                }
                of_views(recorder, &paint.attribute, batch);
            }
            LayerPass::Resolve(_) => of_views(recorder, resolve, batch),
            LayerPass::LeftOut => of_views(recorder, left_out, batch),
        }
    }
}
