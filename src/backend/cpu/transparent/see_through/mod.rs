//! See-through surfels: the layers of an A-buffer, peeled off front to back (Zwicker et al. 2002, section 7.2;
//! docs/math.md, section 12).
//!
//! A layer is what full EWA shows of the discs behind all layers before it. So it needs no order of splats, and a tile
//! goes through the same passes again for each layer, until no disc is left.

pub(in crate::backend) mod cover;
mod resolve;

use std::sync::atomic::Ordering;
use std::time::Instant;

use self::resolve::{Peeled, resolve};
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::chunk::Chunk;
use crate::backend::cpu::job::Job;
use crate::backend::cpu::paint::{
    APRON_STRIDE, Filter, PaintGroup, RasterRays, attribute, find_open, visibility, with_apron,
};
use crate::backend::cpu::resolve::TileFilm;
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::tile_buffers::TileBuffers;
use crate::backend::cpu::tile_runner::TileWork;
use crate::layout::EwaSplat;
use crate::plan::LayerPass;

/// One group in one band.
pub(in crate::backend) struct SeeThroughGroup<'a> {
    /// With channels that have opacities.
    pub scope: Scope<'a>,
    /// The opaque picture of the group, tile by tile.
    pub opaque: &'a [TileFilm],
}

impl SeeThroughGroup<'_> {
    fn paint(&self) -> PaintGroup<'_, EwaSplat> {
        PaintGroup::new(self.scope)
    }

    /// T(x) of opaque surfels in tile `index`; empty where there are none.
    fn ceiling(&self, index: usize) -> &[f32] {
        self.opaque.get(index).map_or(&[], |film| &film.threshold)
    }
}

impl TileWork for SeeThroughGroup<'_> {
    type Pass = LayerPass;
    type Splat = EwaSplat;
    type Out = Vec<TileFilm>;

    fn scope(&self) -> &Scope<'_> {
        &self.scope
    }

    fn project(&self, chunk: &Chunk<'_>, binned: &mut Binned<EwaSplat>) {
        self.paint().project(chunk, binned);
    }

    fn run(&self, pass: LayerPass, mut job: Job<'_, EwaSplat, Vec<TileFilm>>) {
        if pass != LayerPass::Start && !job.buffers.peel.live {
            return;
        }
        let start = Instant::now();
        let clocks = self.scope.clocks;
        match pass {
            LayerPass::Start => {
                job.buffers.peel.cover.start();
                job.buffers.peel.live = true;
            }
            LayerPass::Visibility(layer) => {
                self.lower(layer, &mut job);
                clocks.visibility.add(start);
            }
            LayerPass::Second(_) => {
                let (apron, size) = (self.scope.raster.apron(), self.scope.raster.size);
                find_open(&job.tile, apron, size, self.paint().least_tolerance(true), &mut job.buffers.paint);
                clocks.visibility.add(start);
            }
            LayerPass::Attribute(_) => {
                self.add(&mut job);
                clocks.attribute.add(start);
            }
            LayerPass::Resolve(_) => {
                self.resolve(&mut job);
                clocks.resolve.add(start);
            }
            LayerPass::LeftOut => {
                let first = self.first(&job);
                let TileBuffers { paint, peel, .. } = job.buffers;
                let left = peel.cover.left_out(&job.tile, &paint.threshold[first..], self.ceiling(job.index));
                clocks.left_out.fetch_add(left, Ordering::Relaxed);
            }
        }
    }
}

impl SeeThroughGroup<'_> {
    /// Where the tile begins in planes with an apron.
    fn first<O>(&self, job: &Job<'_, EwaSplat, O>) -> usize {
        let (_, [left, top]) = with_apron(&job.tile, self.scope.raster.apron(), self.scope.raster.size);
        top * APRON_STRIDE + left
    }

    /// Pass `visibility` of one tile: the discs behind all layers before.
    fn lower(&self, layer: u8, job: &mut Job<'_, EwaSplat, Vec<TileFilm>>) {
        let (scope, buffers) = (&self.scope, &mut job.buffers.paint);
        if job.first && layer == 0 {
            buffers.clear_depths(true, false);
            buffers.floor.clear();
            buffers.floor.resize(buffers.threshold.len(), 0.0);
        } else if job.first {
            std::mem::swap(&mut buffers.threshold, &mut buffers.floor);
            buffers.clear_depths(true, false);
        }
        let (rect, _) = with_apron(&job.tile, scope.raster.apron(), scope.raster.size);
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            visibility(&binned.splats, list, scope.depths(chunk), &rect, buffers);
        }
    }

    /// Pass `attribute` of one tile.
    fn add(&self, job: &mut Job<'_, EwaSplat, Vec<TileFilm>>) {
        let scope = &self.scope;
        if job.first {
            job.buffers.paint.clear_sums(scope.channels.count, true);
            job.buffers.clear_coverage(scope.group.samples.len());
        }
        let (start, ceiling) = (self.first(job), self.ceiling(job.index));
        let sight = RasterRays::new(scope.frame.near, scope.raster);
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            if list.is_empty() {
                continue;
            }
            scope.turn(chunk, job.buffers);
            let TileBuffers { paint, group_coverage, .. } = &mut *job.buffers;
            let attributes = scope.attributes(chunk, &binned.values);
            let filter = Filter { attributes, depths: scope.depths(chunk), sight, start, ceiling };
            attribute(&binned.splats, list, &filter, &job.tile, paint, &mut group_coverage.sample_coverage);
        }
    }

    /// Pass `resolve` of one tile.
    fn resolve(&self, job: &mut Job<'_, EwaSplat, Vec<TileFilm>>) {
        let (scope, start, ceiling) = (&self.scope, self.first(job), self.ceiling(job.index));
        scope.end_turns(job.buffers);
        let TileBuffers { paint, group_coverage, peel, .. } = &mut *job.buffers;
        let mut film = TileFilm::default();
        let coverage = &group_coverage.coverage;
        let peeled = Peeled { start, buffers: paint, group_coverage: coverage, scale: scope.scale(), ceiling };
        let found = resolve(&scope.resolve(), &job.tile, &peeled, &mut peel.cover, &mut film);
        peel.live = found.more;
        if found.shown {
            job.out.push(film);
        }
    }
}
