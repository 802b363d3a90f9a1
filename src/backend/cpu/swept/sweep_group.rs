//! Step `Sweep`: one interval, its kernels swept and added to the film.

use std::time::Instant;

use super::attribute::{self, Swept};
use super::project;
use super::resolve::{self, IntervalExposure, add_to_film};
use super::slices;
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::chunk::Chunk;
use crate::backend::cpu::job::Job;
use crate::backend::cpu::resolve::TileFilm;
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::tile_buffers::TileBuffers;
use crate::backend::cpu::tile_runner::TileWork;
use crate::layout::SweptSplat;
use crate::options::{KernelShape, SweptKernel, TemporalAlpha};
use crate::plan::{PosedInterval, SweepPass};

/// One interval in one band.
pub(in crate::backend) struct SweepGroup<'a> {
    pub scope: Scope<'a>,
    pub interval: &'a PosedInterval,
    pub kernel: SweptKernel,
}

impl SweepGroup<'_> {
    /// Do kernels sweep the ellipsoid instead of the tube?
    pub(in crate::backend) fn ellipsoid(&self) -> bool {
        self.kernel.shape == KernelShape::Ellipsoid
    }

    /// What `attribute` needs for one chunk, whose kernels have `values`.
    pub(in crate::backend) fn swept<'b>(&'b self, chunk: &Chunk<'_>, values: &'b [f32]) -> Swept<'b> {
        Swept {
            attributes: self.scope.attributes(chunk, values),
            depths: self.scope.depths(chunk),
            ellipsoid: self.ellipsoid(),
            slope: self.interval.slope,
            sum: self.sums_weights(),
        }
    }

    fn sums_weights(&self) -> bool {
        self.kernel.alpha == TemporalAlpha::Sum
    }

    /// Pass `visibility` of one tile.
    fn lower(&self, job: &mut Job<'_, SweptSplat, TileFilm>) {
        if job.first {
            job.buffers.start_slices(self.interval.slices as usize, self.scope.frame.keeps_nearest);
        }
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            let depths = self.scope.depths(chunk);
            slices::visibility(&binned.splats, list, depths, &job.tile, &mut job.buffers.slices);
        }
    }

    /// Pass `attribute` of one tile.
    fn add_kernels(&self, job: &mut Job<'_, SweptSplat, TileFilm>) {
        if job.first {
            job.buffers.clear_sums(self.scope.channels.count);
            job.buffers.coverage_mask.clear();
        }
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            if list.is_empty() {
                continue;
            }
            let swept = self.swept(chunk, &binned.values);
            let TileBuffers { sums, coverage_mask, slices, .. } = &mut *job.buffers;
            let kernels = (&binned.splats[..], &binned.filters[..]);
            attribute::attribute(kernels, list, &swept, &job.tile, slices, sums, coverage_mask);
        }
    }

    /// Pass `resolve` of one tile.
    pub(in crate::backend) fn resolve(&self, job: &mut Job<'_, SweptSplat, TileFilm>) {
        let TileBuffers { sums, group_coverage, coverage_mask, .. } = &mut *job.buffers;
        let (weight, coverage) = (self.scope.weight(), &mut group_coverage.coverage);
        let exposure = IntervalExposure { interval: self.interval, weight, sum: self.sums_weights() };
        resolve::coverage(&exposure, coverage_mask, coverage);
        add_to_film(&self.scope, self.kernel.normalise, &job.tile, sums, coverage, job.out);
    }
}

impl TileWork for SweepGroup<'_> {
    type Pass = SweepPass;
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
            let (view, surfels) = (self.scope.view(chunk), chunk.model.surfels());
            project::project(&view, self.ellipsoid(), surfels, chunk.surfels.clone(), splats, filters);
            self.scope.add_values(chunk, binned);
        });
    }

    fn run(&self, pass: SweepPass, mut job: Job<'_, SweptSplat, TileFilm>) {
        let start = Instant::now();
        match pass {
            SweepPass::Visibility => {
                self.lower(&mut job);
                self.scope.clocks.visibility.add(start);
            }
            SweepPass::Attribute => {
                self.add_kernels(&mut job);
                self.scope.clocks.attribute.add(start);
            }
            SweepPass::Resolve => {
                self.resolve(&mut job);
                self.scope.clocks.resolve.add(start);
            }
        }
    }
}
