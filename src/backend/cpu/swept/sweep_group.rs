//! Step `Sweep`: one interval, its kernels swept and added to the film.

use std::time::Instant;

use super::attribute::{self, Footprint, Swept};
use super::filtered;
use super::map::Map;
use super::project;
use super::resolve::{self, Exposure};
use super::slices;
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::chunk::Chunk;
use crate::backend::cpu::job::Job;
use crate::backend::cpu::resolve::{TileFilm, resolve};
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::static_tile::StaticTile;
use crate::backend::cpu::tile_buffers::TileBuffers;
use crate::backend::cpu::tile_runner::TileWork;
use crate::layout::SweptSplat;
use crate::options::{KernelShape, Normalise, SweptKernel, TemporalAlpha};
use crate::plan::{PosedInterval, SweepPass};

/// One interval in one band, the map of its visibility, and the picture of static objects.
pub(in crate::backend) struct SweepGroup<'a> {
    pub scope: Scope<'a>,
    pub interval: &'a PosedInterval,
    pub kernel: SweptKernel,
    pub map: &'a Map,
    /// One a tile of the band; empty where static objects are swept with the others.
    pub picture: &'a [StaticTile],
}

impl SweepGroup<'_> {
    /// Do kernels sweep the ellipsoid instead of the tube?
    pub(in crate::backend) fn ellipsoid(&self) -> bool {
        self.kernel.shape == KernelShape::Ellipsoid
    }

    /// What `attribute` needs for one chunk, whose kernels have `values`.
    pub(in crate::backend) fn swept<'b>(&'b self, chunk: &Chunk, values: &'b [f32]) -> Swept<'b> {
        Swept {
            attributes: self.scope.attributes(chunk, values),
            footprint: Footprint::of(self.kernel),
            source_samples: self.kernel.source_samples.0,
            slope: self.interval.slope,
            sum: self.sums_weights(),
            map: self.map,
            raster: self.scope.raster,
        }
    }

    /// Starts thresholds from those of static objects.
    fn start_threshold(&self, index: usize, buffers: &mut TileBuffers) {
        buffers.clear_threshold();
        if let Some(tile) = self.picture.get(index) {
            tile.start_threshold(&mut buffers.threshold);
        }
    }

    /// Does full EWA filter kernels?
    pub(in crate::backend) fn filters(&self) -> bool {
        self.scope.raster.sigma > 0.0
    }

    fn sums_weights(&self) -> bool {
        self.kernel.alpha == TemporalAlpha::Sum
    }

    /// Pass `attribute` of one tile.
    fn add_kernels(&self, job: &mut Job<'_, SweptSplat, TileFilm>) {
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            if list.is_empty() {
                continue;
            }
            let swept = self.swept(chunk, &binned.values);
            let TileBuffers { threshold, sums, coverage_mask, slices, .. } = &mut *job.buffers;
            if self.filters() {
                let kernels = (&binned.splats[..], &binned.filters[..]);
                filtered::attribute(kernels, list, &swept, &job.tile, slices, sums, coverage_mask);
            } else {
                attribute::attribute(&binned.splats, list, &swept, &job.tile, threshold, slices, sums, coverage_mask);
            }
        }
    }

    /// Pass `visibility` of one tile.
    fn lower(&self, job: &mut Job<'_, SweptSplat, TileFilm>) {
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            let depths = self.scope.depths(chunk);
            slices::visibility(&binned.splats, list, depths, &job.tile, &mut job.buffers.slices);
        }
    }

    /// Pass `resolve` of one tile; `picture` is that of static objects there.
    pub(in crate::backend) fn resolve(&self, job: &mut Job<'_, SweptSplat, TileFilm>, picture: Option<&StaticTile>) {
        let Scope { channels, planes, .. } = self.scope;
        let TileBuffers { threshold, sums, group_coverage, coverage_mask, .. } = &mut *job.buffers;
        let (weight, coverage) = (self.scope.weight(), &mut group_coverage.coverage);
        let exposure = Exposure { interval: self.interval, weight, sum: self.sums_weights() };
        if self.filters() && !exposure.sum {
            resolve::filtered_coverage(&exposure, coverage_mask, coverage);
        } else {
            resolve::coverage(&exposure, coverage_mask, coverage);
        }
        match self.kernel.normalise {
            Normalise::Once => {
                resolve::pool(weight, channels, planes, &job.tile, sums, coverage, &mut job.out.values);
            }
            Normalise::Interval => {
                resolve(&self.scope.resolve(), &job.tile, threshold, sums, coverage, job.out);
            }
        }
        if let Some(picture) = picture {
            picture.show(weight, coverage, planes.weight, &job.tile, job.out);
        }
    }
}

impl TileWork for SweepGroup<'_> {
    type Pass = SweepPass;
    type Splat = SweptSplat;
    type Out = TileFilm;

    fn scope(&self) -> &Scope<'_> {
        &self.scope
    }

    fn project(&self, chunk: &Chunk, binned: &mut Binned<SweptSplat>) {
        self.scope.timed(binned, |binned| {
            let surfels = &self.scope.frame.objects[chunk.object].surfels;
            let view = self.scope.view(chunk);
            binned.splats.clear();
            let (range, Binned { splats, filters, .. }) = (chunk.surfels.clone(), &mut *binned);
            filters.clear();
            if self.filters() {
                project::project_filtered(&view, self.ellipsoid(), surfels, range, splats, filters);
            } else {
                project::project(&view, self.ellipsoid(), surfels, range, splats);
            }
            binned.bin();
            self.scope.add_values(chunk, binned);
        });
    }

    fn reads_splats(pass: SweepPass) -> bool {
        match pass {
            SweepPass::Visibility | SweepPass::Attribute => true,
            SweepPass::Resolve => false,
        }
    }

    fn prepare(&self, pass: SweepPass, index: usize, buffers: &mut TileBuffers, _scratch: &mut Vec<u32>) {
        match pass {
            SweepPass::Visibility => {
                self.start_threshold(index, buffers);
                buffers.start_slices(self.interval.slices as usize);
            }
            SweepPass::Attribute => {
                if !self.kernel.has_slices() {
                    self.start_threshold(index, buffers);
                }
                buffers.clear_sums(self.scope.channels.count, 1);
                buffers.clear_coverage_mask(self.filters());
            }
            // The film goes on from the intervals before.
            SweepPass::Resolve => {}
        }
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
                let picture = self.picture.get(job.index);
                self.resolve(&mut job, picture);
                self.scope.clocks.resolve.add(start);
            }
        }
    }

    /// A tile into which no kernel moves shows its static objects alone.
    fn skip(&self, index: usize, film: &mut TileFilm) -> bool {
        if let Some(picture) = self.picture.get(index) {
            let start = Instant::now();
            let tile = self.scope.band.tile(index);
            picture.show(self.scope.weight(), &[], self.scope.planes.weight, &tile, film);
            self.scope.clocks.resolve.add(start);
        }
        true
    }
}
