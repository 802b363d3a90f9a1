//! Step `Published`, an interval: its kernels swept and added to the film.

use std::time::Instant;

use super::attribute::{self, Swept};
use super::coverage::coverage;
use super::map::Map;
use super::project::project;
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::chunk::Chunk;
use crate::backend::cpu::job::Job;
use crate::backend::cpu::project::SurfelView;
use crate::backend::cpu::resolve::TileFilm;
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::swept::{IntervalExposure, add_to_film};
use crate::backend::cpu::tile_buffers::TileBuffers;
use crate::backend::cpu::tile_runner::TileWork;
use crate::layout::SweptSplat;
use crate::options::{KernelWeight, SweptKernel, TemporalAlpha};
use crate::plan::{PosedInterval, PublishedSweepPass};

/// One interval in one band, and the map of its visibility.
pub(in crate::backend) struct PublishedSweepGroup<'a> {
    pub scope: Scope<'a>,
    pub interval: &'a PosedInterval,
    pub kernel: SweptKernel,
    pub map: &'a Map,
}

impl PublishedSweepGroup<'_> {
    /// What `attribute` needs for one chunk, whose kernels have `values`.
    pub(in crate::backend) fn swept<'b>(&'b self, chunk: &Chunk<'_>, values: &'b [f32]) -> Swept<'b> {
        Swept {
            attributes: self.scope.attributes(chunk, values),
            near: self.scope.frame.near,
            low_pass: self.scope.low_pass(),
            line: self.kernel.weight == KernelWeight::Line,
            source_samples: self.kernel.source_samples.0,
            slope: self.interval.slope,
            sum: self.sums_weights(),
            map: self.map,
            raster: self.scope.raster,
        }
    }

    fn sums_weights(&self) -> bool {
        self.kernel.alpha == TemporalAlpha::Sum
    }

    /// Pass `attribute` of one tile.
    fn add_kernels(&self, job: &mut Job<'_, SweptSplat, TileFilm>) {
        if job.first {
            job.buffers.clear_sums(self.scope.channels.count);
            job.buffers.published_mask.clear();
        }
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            if list.is_empty() {
                continue;
            }
            let swept = self.swept(chunk, &binned.values);
            let TileBuffers { sums, published_mask, .. } = &mut *job.buffers;
            attribute::attribute(&binned.splats, list, &swept, &job.tile, sums, published_mask);
        }
    }

    /// Pass `resolve` of one tile.
    pub(in crate::backend) fn resolve(&self, job: &mut Job<'_, SweptSplat, TileFilm>) {
        let TileBuffers { sums, group_coverage, published_mask, .. } = &mut *job.buffers;
        let exposure =
            IntervalExposure { interval: self.interval, weight: self.scope.weight(), sum: self.sums_weights() };
        coverage(&exposure, published_mask, &mut group_coverage.coverage);
        add_to_film(&self.scope, self.kernel.normalise, &job.tile, sums, &group_coverage.coverage, job.out);
    }
}

impl TileWork for PublishedSweepGroup<'_> {
    type Pass = PublishedSweepPass;
    type Splat = SweptSplat;
    type Out = TileFilm;

    fn scope(&self) -> &Scope<'_> {
        &self.scope
    }

    fn project(&self, chunk: &Chunk<'_>, binned: &mut Binned<SweptSplat>) {
        self.scope.timed(binned, |binned| {
            let Binned { splats, filters, .. } = &mut *binned;
            splats.clear();
            filters.clear();
            let view = SurfelView { centre_disc: self.scope.low_pass(), ..self.scope.view(chunk) };
            project(&view, chunk.model.surfels(), chunk.surfels.clone(), splats);
            self.scope.add_values(chunk, binned);
        });
    }

    fn run(&self, pass: PublishedSweepPass, mut job: Job<'_, SweptSplat, TileFilm>) {
        let start = Instant::now();
        match pass {
            PublishedSweepPass::Attribute => {
                self.add_kernels(&mut job);
                self.scope.clocks.attribute.add(start);
            }
            PublishedSweepPass::Resolve => {
                self.resolve(&mut job);
                self.scope.clocks.resolve.add(start);
            }
        }
    }
}
