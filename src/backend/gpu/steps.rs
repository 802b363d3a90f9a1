//! Steps `Sweep` and `Published` of intervals: the passes that they record. Twins: `swept/sweep_group.rs`,
//! `published/map_group.rs` and `published/sweep_group.rs` of `src/backend/cpu/`.

use wgpu::ComputePass;

use super::bind::{FilmPart, ListPrograms, MapPrograms, PublishedPrograms, SweptPrograms};
use super::recorder::{StepWork, in_stretches, of_surfels, of_views};
use super::timestamps::Stage;
use super::upload::Placed;
use crate::plan::{MapPass, PublishedSweepPass, SweepPass};

/// Step `Sweep`.
pub(in crate::backend) struct SweepStep<'a> {
    pub film: &'a FilmPart,
    pub programs: &'a SweptPrograms,
}

impl StepWork for SweepStep<'_> {
    type Pass = SweepPass;

    fn lists(&self) -> &ListPrograms {
        &self.programs.lists
    }

    fn stage(pass: SweepPass) -> Stage {
        match pass {
            SweepPass::Visibility => Stage::Visibility,
            SweepPass::Attribute => Stage::Attribute,
            SweepPass::Resolve => Stage::Resolve,
        }
    }

    fn record(&self, recorder: &mut ComputePass<'_>, pass: SweepPass, batch: &Placed) {
        match pass {
            SweepPass::Visibility => in_stretches(recorder, &self.programs.visibility, batch),
            SweepPass::Attribute => {
                of_surfels(recorder, &self.programs.splat_values, batch);
                in_stretches(recorder, &self.programs.attribute, batch);
            }
            SweepPass::Resolve => of_views(recorder, &self.film.resolve, batch),
        }
    }
}

/// The map of step `Published`.
pub(in crate::backend) struct MapStep<'a> {
    pub programs: &'a MapPrograms,
}

impl StepWork for MapStep<'_> {
    type Pass = MapPass;

    fn lists(&self) -> &ListPrograms {
        &self.programs.lists
    }

    fn stage(_pass: MapPass) -> Stage {
        Stage::Visibility
    }

    fn record(&self, recorder: &mut ComputePass<'_>, pass: MapPass, batch: &Placed) {
        let program = match pass {
            MapPass::Visibility => &self.programs.visibility,
            MapPass::Store => &self.programs.store,
        };
        of_views(recorder, program, batch);
    }
}

/// An interval of step `Published`.
pub(in crate::backend) struct PublishedSweepStep<'a> {
    pub film: &'a FilmPart,
    pub programs: &'a PublishedPrograms,
}

impl StepWork for PublishedSweepStep<'_> {
    type Pass = PublishedSweepPass;

    fn lists(&self) -> &ListPrograms {
        &self.programs.lists
    }

    fn stage(pass: PublishedSweepPass) -> Stage {
        match pass {
            PublishedSweepPass::Attribute => Stage::Attribute,
            PublishedSweepPass::Resolve => Stage::Resolve,
        }
    }

    fn record(&self, recorder: &mut ComputePass<'_>, pass: PublishedSweepPass, batch: &Placed) {
        match pass {
            PublishedSweepPass::Attribute => {
                of_surfels(recorder, &self.programs.splat_values, batch);
                in_stretches(recorder, &self.programs.attribute, batch);
            }
            PublishedSweepPass::Resolve => of_views(recorder, &self.film.resolve, batch),
        }
    }
}
