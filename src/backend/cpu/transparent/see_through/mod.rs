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
use crate::backend::cpu::ewa::{self, APRON_STRIDE, Filter, with_apron};
use crate::backend::cpu::job::Job;
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
    fn ewa(&self) -> ewa::EwaGroup<'_> {
        ewa::EwaGroup { scope: self.scope }
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

    fn project(&self, chunk: &Chunk, binned: &mut Binned<EwaSplat>) {
        self.ewa().project(chunk, binned);
    }

    fn reads_splats(pass: LayerPass) -> bool {
        match pass {
            LayerPass::Visibility(_) | LayerPass::Attribute(_) => true,
            LayerPass::Resolve(_) | LayerPass::LeftOut => false,
        }
    }

    fn prepare(&self, pass: LayerPass, index: usize, buffers: &mut TileBuffers, _scratch: &mut Vec<u32>) {
        match pass {
            LayerPass::Visibility(0) => {
                buffers.ewa.clear_depths();
                buffers.ewa.floor.clear();
                buffers.ewa.floor.resize(buffers.ewa.threshold.len(), 0.0);
                buffers.peel.cover.start();
                buffers.peel.live = true;
            }
            LayerPass::Visibility(_) if buffers.peel.live => {
                std::mem::swap(&mut buffers.ewa.threshold, &mut buffers.ewa.floor);
                buffers.ewa.clear_depths();
            }
            LayerPass::Attribute(_) if buffers.peel.live => {
                let scope = &self.scope;
                if scope.group.samples.len() == 1 {
                    let (tile, size) = (scope.band.tile(index), scope.raster.size);
                    let of_all = self.ewa().tolerance_of_all();
                    ewa::find_open(&tile, scope.raster.apron(), size, of_all, &mut buffers.ewa);
                }
                buffers.ewa.clear_sums(scope.channels.count);
                buffers.clear_coverage(scope.group.samples.len());
            }
            _ => {}
        }
    }

    fn run(&self, pass: LayerPass, job: Job<'_, EwaSplat, Vec<TileFilm>>) {
        if !job.buffers.peel.live {
            return;
        }
        let scope = &self.scope;
        let start = Instant::now();
        let (rect, [left, top]) = with_apron(&job.tile, scope.raster.apron(), scope.raster.size);
        let first = top * APRON_STRIDE + left;
        let ceiling = self.ceiling(job.index);
        if let LayerPass::Resolve(_) = pass {
            scope.end_turns(job.buffers);
            let TileBuffers { ewa, group_coverage, peel, .. } = job.buffers;
            let mut film = TileFilm::default();
            let coverage = &group_coverage.coverage;
            let peeled = Peeled { start: first, buffers: ewa, group_coverage: coverage, scale: scope.scale(), ceiling };
            let any = resolve(&scope.resolve(), &job.tile, &peeled, &mut peel.cover, &mut film);
            peel.live = any.more;
            if any.shown {
                job.out.push(film);
            }
            return scope.clocks.resolve.add(start);
        }
        if let LayerPass::LeftOut = pass {
            let TileBuffers { ewa, peel, .. } = job.buffers;
            let left = peel.cover.left_out(&job.tile, &ewa.threshold[first..], ceiling);
            scope.clocks.left_out.fetch_add(left, Ordering::Relaxed);
            return;
        }
        let tolerances = scope.group.samples.len() == 1 && self.ewa().tolerance_of_all().is_none();
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            if list.is_empty() {
                continue;
            }
            let depths = scope.depths(chunk);
            if let LayerPass::Attribute(_) = pass {
                scope.turn(chunk, job.buffers);
                let TileBuffers { ewa: buffers, group_coverage, .. } = &mut *job.buffers;
                let attributes = scope.attributes(chunk, &binned.values);
                let filter = Filter { attributes, depths, sigma: scope.raster.sigma, start: first, ceiling };
                let coverage = &mut group_coverage.sample_coverage;
                ewa::attribute(&binned.splats, list, &filter, &job.tile, buffers, coverage);
            } else {
                ewa::visibility(&binned.splats, list, depths, &rect, tolerances, &mut job.buffers.ewa);
            }
        }
        match pass {
            LayerPass::Attribute(_) => scope.clocks.attribute.add(start),
            _ => scope.clocks.visibility.add(start),
        }
    }
}
