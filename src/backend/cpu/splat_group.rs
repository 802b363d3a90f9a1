//! Step `Splat`: one group, splatted and added to the film.

use std::time::Instant;

use super::bin::Binned;
use super::chunk::Chunk;
use super::job::Job;
use super::resolve::{self, TileFilm};
use super::scope::Scope;
use super::static_tile::{StaticLayer, StaticTile};
use super::tile_buffers::TileBuffers;
use super::tile_runner::TileWork;
use crate::layout::Splat;
use crate::plan::SplatPass;

/// One group in one band, and the static layer that it starts from.
pub(in crate::backend) struct SplatGroup<'a> {
    pub scope: Scope<'a>,
    /// Empty where there is none.
    pub layer: &'a StaticLayer,
}

impl SplatGroup<'_> {
    /// The static layer of tile `index`, where it shows anything.
    fn static_tile(&self, index: usize) -> Option<&StaticTile> {
        self.layer.tiles.get(index).filter(|tile| !tile.is_empty())
    }

    /// Starts the sums of tile `index` from the static layer. It restores pixels whose static splats are all visible,
    /// and recomputes those of which some are hidden.
    fn start_from(&self, tile: &StaticTile, index: usize, buffers: &mut TileBuffers, scratch: &mut Vec<u32>) {
        let Some(mut limits) = tile.restore(self.scope.channels.count, buffers) else { return };
        std::mem::swap(&mut buffers.threshold, &mut limits);
        let tile = self.scope.band.tile(index);
        let (chunks, binned) = (&self.layer.chunks, &self.layer.binned);
        self.scope.add_splats(&mut Job { chunks, binned, tile, index, buffers, scratch, out: &mut () }, &mut []);
        std::mem::swap(&mut buffers.threshold, &mut limits);
    }
}

impl TileWork for SplatGroup<'_> {
    type Pass = SplatPass;
    type Splat = Splat;
    type Out = TileFilm;

    fn scope(&self) -> &Scope<'_> {
        &self.scope
    }

    fn project(&self, chunk: &Chunk, binned: &mut Binned) {
        self.scope.project_with_values(chunk, binned);
    }

    fn reads_splats(pass: SplatPass) -> bool {
        match pass {
            SplatPass::Visibility | SplatPass::Attribute => true,
            SplatPass::Resolve => false,
        }
    }

    fn prepare(&self, pass: SplatPass, index: usize, buffers: &mut TileBuffers, scratch: &mut Vec<u32>) {
        match pass {
            SplatPass::Visibility => {
                buffers.clear_threshold();
                if let Some(tile) = self.static_tile(index) {
                    tile.start_threshold(&mut buffers.threshold);
                }
            }
            SplatPass::Attribute => {
                let start = Instant::now();
                buffers.clear_sums(self.scope.channels.count, self.scope.group.samples.len());
                if let Some(tile) = self.static_tile(index) {
                    self.start_from(tile, index, buffers, scratch);
                }
                self.scope.clocks.attribute.add(start);
            }
            // The film goes on from the groups before.
            SplatPass::Resolve => {}
        }
    }

    fn run(&self, pass: SplatPass, mut job: Job<'_, Splat, TileFilm>) {
        let scope = &self.scope;
        match pass {
            SplatPass::Visibility => scope.visibility(&mut job),
            SplatPass::Attribute => {
                let start = Instant::now();
                scope.add_splats(&mut job, &mut []);
                scope.clocks.attribute.add(start);
            }
            SplatPass::Resolve => {
                let start = Instant::now();
                scope.end_turns(job.buffers);
                let TileBuffers { threshold, sums, group_coverage, .. } = job.buffers;
                resolve::resolve(&scope.resolve(), &job.tile, threshold, sums, &group_coverage.coverage, job.out);
                if scope.frame.blending.is_some() {
                    job.out.threshold.clone_from(threshold);
                }
                scope.clocks.resolve.add(start);
            }
        }
    }

    /// A tile into which nothing moves shows its static objects alone, if they were resolved already.
    fn skip(&self, index: usize, film: &mut TileFilm) -> bool {
        let Some(tile) = self.static_tile(index) else { return true };
        let values = &tile.film.values;
        if values.is_empty() {
            return false;
        }
        let start = Instant::now();
        film.values.resize(values.len(), 0.0);
        let weight = self.scope.weight();
        film.values.iter_mut().zip(values).for_each(|(out, value)| *out += weight * value);
        if self.scope.frame.blending.is_some() {
            film.threshold.clone_from(&tile.threshold);
        }
        self.scope.clocks.resolve.add(start);
        true
    }
}
