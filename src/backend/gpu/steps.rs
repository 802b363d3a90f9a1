//! The passes that each step of the plan records. Twins: `splat_group`, `static_group`, `swept/map_group` and
//! `swept/sweep_group` of `src/backend/cpu/`.

use wgpu::{CommandEncoder, ComputePass, ComputePassDescriptor};

use super::DeviceState;
use super::batches::Batch;
use super::bind::{BoundProgram, ListPrograms, StaticLayerPrograms, SweptPrograms};
use super::job::{Job, StepWork, dispatch, of_segments, view_offset};
use super::memory::{MAP_BYTES, THRESHOLD_BYTES};
use super::timestamps::{Marks, Stage};
use crate::plan::{MapPass, SplatPass, StaticPass, SweepPass};

/// Step `Splat`.
pub(in crate::backend) struct SplatStep<'a> {
    pub job: Job<'a>,
    /// The static layer that the group starts from, if there is one.
    pub layer: Option<&'a StaticLayerPrograms>,
}

impl SplatStep<'_> {
    /// Starts sums from the static layer. Its `cached` batches are recomputed where they are visible in part.
    pub(in crate::backend) fn restore(
        &self,
        layer: &StaticLayerPrograms,
        encoder: &mut CommandEncoder,
        cached: usize,
        marks: &mut Marks,
    ) {
        let tiles = self.job.area.tiles;
        let timestamp_writes = marks.mark(Stage::Attribute);
        let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        dispatch(&mut recorder, &layer.restore, tiles, 0);
        for (number, sum) in layer.recompute[..cached].iter().enumerate() {
            dispatch(&mut recorder, sum, tiles, view_offset(number));
        }
    }
}

impl StepWork for SplatStep<'_> {
    type Pass = SplatPass;

    fn job(&self) -> &Job<'_> {
        &self.job
    }

    fn lists(&self) -> &ListPrograms {
        &self.job.place.programs.lists
    }

    fn reads_splats(pass: SplatPass) -> bool {
        match pass {
            SplatPass::Visibility | SplatPass::Attribute => true,
            SplatPass::Resolve => false,
        }
    }

    fn stage(pass: SplatPass) -> Stage {
        match pass {
            SplatPass::Visibility => Stage::Visibility,
            SplatPass::Attribute => Stage::Attribute,
            SplatPass::Resolve => Stage::Resolve,
        }
    }

    fn prepare(
        &self,
        state: &DeviceState,
        encoder: &mut CommandEncoder,
        pass: SplatPass,
        cached: usize,
        marks: &mut Marks,
    ) {
        let Some(layer) = self.layer else { return };
        match pass {
            SplatPass::Visibility => {
                let (b, bytes) = (&state.buffers, THRESHOLD_BYTES * self.job.area.len());
                encoder.copy_buffer_to_buffer(&b.layer_thresholds, 0, &b.thresholds, 0, bytes);
            }
            SplatPass::Attribute => self.restore(layer, encoder, cached, marks),
            // The film continues from the groups before.
            SplatPass::Resolve => {}
        }
    }

    fn record(&self, recorder: &mut ComputePass<'_>, pass: SplatPass, batch: &Batch, view: u32) {
        let (programs, tiles) = (self.job.place.programs, self.job.area.tiles);
        match pass {
            SplatPass::Visibility => dispatch(recorder, &programs.visibility, tiles, view),
            SplatPass::Attribute => {
                of_segments(recorder, &programs.splat_values, batch, view);
                dispatch(recorder, &programs.sum_attributes, tiles, view);
            }
            SplatPass::Resolve => dispatch(recorder, &self.job.place.film.resolve, tiles, view),
        }
    }
}

/// Step `StaticLayer`: the results of the passes are cached.
pub(in crate::backend) struct StaticLayerStep<'a> {
    pub job: Job<'a>,
    pub programs: &'a StaticLayerPrograms,
}

impl StepWork for StaticLayerStep<'_> {
    type Pass = StaticPass;

    fn job(&self) -> &Job<'_> {
        &self.job
    }

    fn lists(&self) -> &ListPrograms {
        &self.job.place.programs.lists
    }

    fn reads_splats(pass: StaticPass) -> bool {
        reads_splats(pass)
    }

    fn stage(pass: StaticPass) -> Stage {
        stage(pass)
    }

    fn record(&self, recorder: &mut ComputePass<'_>, pass: StaticPass, batch: &Batch, view: u32) {
        let (programs, tiles) = (self.job.place.programs, self.job.area.tiles);
        match pass {
            StaticPass::Visibility => dispatch(recorder, &programs.visibility, tiles, view),
            StaticPass::Attribute => {
                of_segments(recorder, &programs.splat_values, batch, view);
                dispatch(recorder, &self.programs.sum, tiles, view);
            }
            // The pass wrote the sums to the layer, and the rest was copied.
            StaticPass::Store => {}
        }
    }

    /// Copies the splats, lists and values of a batch once its attributes are added; thresholds with the last one.
    fn cache(&self, state: &DeviceState, encoder: &mut CommandEncoder, pass: StaticPass, batch: &Batch, number: usize) {
        if pass != StaticPass::Attribute {
            return;
        }
        let (b, prepared) = (&state.buffers, self.job.place.prepared);
        let cached = &b.cached[number];
        let (slots, tiles) = (u64::from(batch.slots), self.job.area.len());
        for (from, to, bytes) in [
            (&b.splats, &cached.splats, slots * prepared.schedule.splat_bytes),
            (&b.lists[0], &cached.list, 4 * b.entries),
            (&b.wide, &cached.wide, 4 * slots),
            (&b.starts, &cached.starts, 4 * (tiles + 2)),
            (&b.values, &cached.values, 4 * u64::from(prepared.channels.values) * slots),
            (&b.thresholds, &b.layer_thresholds, THRESHOLD_BYTES * tiles),
        ] {
            encoder.copy_buffer_to_buffer(from, 0, to, 0, bytes);
        }
    }
}

/// Step `StaticPicture`: static objects get a film of their own.
pub(in crate::backend) struct StaticPictureStep<'a> {
    pub job: Job<'a>,
    pub resolve: &'a BoundProgram,
}

impl StaticPictureStep<'_> {
    /// Copies thresholds behind the map, where sweeps look for them.
    pub(in crate::backend) fn cache_thresholds(&self, state: &DeviceState, encoder: &mut CommandEncoder) {
        let (b, behind) = (&state.buffers, MAP_BYTES * self.job.map.len());
        encoder.copy_buffer_to_buffer(&b.thresholds, 0, &b.map, behind, THRESHOLD_BYTES * self.job.area.len());
    }
}

impl StepWork for StaticPictureStep<'_> {
    type Pass = StaticPass;

    fn job(&self) -> &Job<'_> {
        &self.job
    }

    fn lists(&self) -> &ListPrograms {
        &self.job.place.programs.lists
    }

    fn reads_splats(pass: StaticPass) -> bool {
        reads_splats(pass)
    }

    fn stage(pass: StaticPass) -> Stage {
        stage(pass)
    }

    fn record(&self, recorder: &mut ComputePass<'_>, pass: StaticPass, batch: &Batch, view: u32) {
        let (programs, tiles) = (self.job.place.programs, self.job.area.tiles);
        match pass {
            StaticPass::Visibility => dispatch(recorder, &programs.visibility, tiles, view),
            StaticPass::Attribute => {
                of_segments(recorder, &programs.splat_values, batch, view);
                dispatch(recorder, &programs.sum_attributes, tiles, view);
            }
            StaticPass::Store => dispatch(recorder, self.resolve, tiles, view),
        }
    }
}

fn reads_splats(pass: StaticPass) -> bool {
    match pass {
        StaticPass::Visibility | StaticPass::Attribute => true,
        StaticPass::Store => false,
    }
}

fn stage(pass: StaticPass) -> Stage {
    match pass {
        StaticPass::Visibility => Stage::Visibility,
        StaticPass::Attribute => Stage::Attribute,
        StaticPass::Store => Stage::Resolve,
    }
}

/// Step `VisibilityMap`.
pub(in crate::backend) struct MapStep<'a> {
    pub job: Job<'a>,
    pub programs: &'a SweptPrograms,
}

impl StepWork for MapStep<'_> {
    type Pass = MapPass;

    fn job(&self) -> &Job<'_> {
        &self.job
    }

    fn lists(&self) -> &ListPrograms {
        &self.job.place.programs.lists
    }

    fn reads_splats(pass: MapPass) -> bool {
        match pass {
            MapPass::Visibility | MapPass::Density => true,
            MapPass::Store => false,
        }
    }

    fn stage(pass: MapPass) -> Stage {
        match pass {
            MapPass::Visibility | MapPass::Density | MapPass::Store => Stage::Visibility,
        }
    }

    fn record(&self, recorder: &mut ComputePass<'_>, pass: MapPass, _batch: &Batch, view: u32) {
        let (programs, tiles) = (self.job.place.programs, self.job.area.tiles);
        match pass {
            MapPass::Visibility => dispatch(recorder, &programs.visibility, tiles, view),
            MapPass::Density => dispatch(recorder, &self.programs.density, tiles, view),
            MapPass::Store => dispatch(recorder, &self.programs.store_map, tiles, view),
        }
    }
}

/// Step `Sweep`.
pub(in crate::backend) struct SweepStep<'a> {
    pub job: Job<'a>,
    pub programs: &'a SweptPrograms,
}

impl StepWork for SweepStep<'_> {
    type Pass = SweepPass;

    fn job(&self) -> &Job<'_> {
        &self.job
    }

    fn lists(&self) -> &ListPrograms {
        &self.programs.lists
    }

    fn reads_splats(pass: SweepPass) -> bool {
        match pass {
            SweepPass::Visibility | SweepPass::Attribute => true,
            SweepPass::Resolve => false,
        }
    }

    fn stage(pass: SweepPass) -> Stage {
        match pass {
            SweepPass::Visibility => Stage::Visibility,
            SweepPass::Attribute => Stage::Attribute,
            SweepPass::Resolve => Stage::Resolve,
        }
    }

    fn record(&self, recorder: &mut ComputePass<'_>, pass: SweepPass, batch: &Batch, view: u32) {
        let tiles = self.job.area.tiles;
        match pass {
            SweepPass::Visibility => {
                if let Some(program) = &self.programs.visibility {
                    dispatch(recorder, program, tiles, view);
                }
            }
            SweepPass::Attribute => {
                of_segments(recorder, &self.programs.splat_values, batch, view);
                dispatch(recorder, &self.programs.attribute, tiles, view);
            }
            SweepPass::Resolve => dispatch(recorder, &self.job.place.film.resolve, tiles, view),
        }
    }
}
