//! Step `VisibilityMap`: one group at the middle of its interval, over the band and a guard band.

use std::time::Instant;

use super::map::{self, MapTile};
use crate::backend::cpu::attribute::{self, Attributes, Tally};
use crate::backend::cpu::bin::Binned;
use crate::backend::cpu::chunk::Chunk;
use crate::backend::cpu::job::Job;
use crate::backend::cpu::scope::Scope;
use crate::backend::cpu::tile_buffers::TileBuffers;
use crate::backend::cpu::tile_runner::TileWork;
use crate::layout::{Channels, Splat};
use crate::plan::MapPass;

/// One group on the map; the band of its scope has the guard band around it.
pub(in crate::backend) struct MapGroup<'a> {
    pub scope: Scope<'a>,
}

impl MapGroup<'_> {
    /// What `density` needs for one chunk: weights alone are summed.
    pub(in crate::backend) fn weights<'b>(&'b self, chunk: &Chunk, channels: &'b Channels) -> Attributes<'b> {
        Attributes { channels, ..self.scope.attributes(chunk, &[]) }
    }

    /// Pass `density` of one tile.
    fn density(&self, job: &mut Job<'_, Splat, MapTile>) {
        let channels = Channels::weights();
        for (chunk, binned) in job.chunks.iter().zip(job.binned) {
            let list = binned.list(&job.tile, job.scratch);
            if list.is_empty() {
                continue;
            }
            let TileBuffers { threshold, sums, .. } = &mut *job.buffers;
            let mut tally = Tally { sums, sample_coverage: &mut [], nearest: &mut [] };
            let weights = self.weights(chunk, &channels);
            attribute::attribute(&binned.splats, list, &weights, &job.tile, threshold, &mut tally);
        }
    }
}

impl TileWork for MapGroup<'_> {
    type Pass = MapPass;
    type Splat = Splat;
    type Out = MapTile;

    fn scope(&self) -> &Scope<'_> {
        &self.scope
    }

    fn project(&self, chunk: &Chunk, binned: &mut Binned) {
        self.scope.timed(binned, |binned| self.scope.project(chunk, binned));
    }

    fn reads_splats(pass: MapPass) -> bool {
        match pass {
            MapPass::Visibility | MapPass::Density => true,
            MapPass::Store => false,
        }
    }

    fn prepare(&self, pass: MapPass, _index: usize, buffers: &mut TileBuffers, _scratch: &mut Vec<u32>) {
        match pass {
            MapPass::Visibility => buffers.clear_threshold(),
            MapPass::Density => buffers.clear_sums(1, 1),
            // The tile of the map is written whole.
            MapPass::Store => {}
        }
    }

    fn run(&self, pass: MapPass, mut job: Job<'_, Splat, MapTile>) {
        let start = Instant::now();
        match pass {
            // It takes the time itself.
            MapPass::Visibility => return self.scope.visibility(&mut job),
            MapPass::Density => self.density(&mut job),
            MapPass::Store => map::store(&job.tile, &job.buffers.threshold, &job.buffers.sums, job.out),
        }
        self.scope.clocks.visibility.add(start);
    }
}
